//! Why a graph, a solver or an update was refused. After every error the value it came from is as it
//! was before the call.

use crate::factor::{FactorDescription, FactorId};

/// Why something could not be done, with what was seen.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A pose was given for a key that has one.
    #[error("pose {key} is there already")]
    DuplicateKey {
        /// The key.
        key: u64,
    },
    /// A factor or question names a key that has no pose.
    #[error("there is no pose {key}")]
    UnknownKey {
        /// The key.
        key: u64,
    },
    /// A factor to remove is not there, or was removed before.
    #[error("there is no factor {id}")]
    UnknownFactor {
        /// Its identifier.
        id: FactorId,
    },
    /// A pose has a number that is not finite.
    #[error("pose {key} has a number that is not finite")]
    PoseNotFinite {
        /// The key.
        key: u64,
    },
    /// A factor's measurement or information has a number that is not finite.
    #[error("the {factor} has a number that is not finite")]
    FactorNotFinite {
        /// The factor.
        factor: FactorDescription,
    },
    /// A factor joins a pose with itself.
    #[error("the {factor} joins a pose with itself")]
    SelfEdge {
        /// The factor.
        factor: FactorDescription,
    },
    /// An information matrix is not symmetric.
    #[error("the information of the {factor} is not symmetric: off by {asymmetry:e}")]
    InformationNotSymmetric {
        /// The factor.
        factor: FactorDescription,
        /// The largest difference of two entries that should be equal.
        asymmetry: f64,
    },
    /// An information matrix has a negative eigenvalue. Zero is allowed: a direction left open.
    #[error(
        "the information of the {factor} is not positive semi-definite: its smallest eigenvalue is \
         {smallest:e}"
    )]
    InformationNotPositive {
        /// The factor.
        factor: FactorDescription,
        /// The smallest eigenvalue.
        smallest: f64,
    },
    /// A kernel's parameter is not a positive number.
    #[error("the kernel of the {factor} needs a positive number")]
    Kernel {
        /// The factor.
        factor: FactorDescription,
    },
    /// The factors leave a pose free to move.
    #[error("pose {key} is not held by its factors{}", last(.last_factor))]
    Unconstrained {
        /// The pose. Others may hang on it.
        key: u64,
        /// The factor that was added last to that pose, if any.
        last_factor: Option<FactorDescription>,
    },
    /// Numbers grew beyond what floating point holds.
    #[error("the error of the {factor} is not finite: poses or information are too large")]
    Overflow {
        /// The first factor whose error is not finite.
        factor: FactorDescription,
    },
    /// More poses or factors than indices.
    #[error("more than {limit} poses or factors")]
    TooLarge {
        /// The limit.
        limit: usize,
    },
}

fn last(factor: &Option<FactorDescription>) -> String {
    match factor {
        Some(factor) => format!("; the last was the {factor}"),
        None => "; it has none".to_owned(),
    }
}
