//! Pose graphs: factors, batch solvers, iSAM2, marginals, g2o files.
#![forbid(unsafe_code)]
