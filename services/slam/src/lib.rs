//! LEO-SLAM: nodes, submaps, loops, a map that stays true.
#![forbid(unsafe_code)]
