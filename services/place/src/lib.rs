//! Place recognition: Scan Context++ and Gaussian Scan Context.
#![forbid(unsafe_code)]
