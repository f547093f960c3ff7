//! How far the place on the map can be trusted, in words a person can act on.

use std::fmt;

use hachi_odometry::{Condition, Doubt};

/// Why the place is not to be trusted in full.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub enum SlamDoubt {
    /// Odometry says so.
    Odometry(Doubt),
    /// The robot does not know where on the map it is.
    NotRecognised {
        /// Nodes that were looked for in the map since.
        nodes: usize,
    },
    /// One place fits, and a second opinion is awaited.
    Unconfirmed {
        /// Nodes that agree on it.
        agreeing: usize,
    },
    /// One place has won, and what is seen at this moment does not lie on the map there yet.
    NotSeen,
    /// No loop has been closed for so long that drift may be large.
    Drift {
        /// Standard deviation of the position on the map, metres.
        sigma_m: f64,
    },
}

/// How far the place on the map can be trusted.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub enum SlamCondition {
    /// As usual.
    #[default]
    Ok,
    /// Carried or guessed in part.
    Degraded(SlamDoubt),
    /// Not on the map.
    Lost(SlamDoubt),
    /// Found again, and not yet confirmed.
    Recovering(SlamDoubt),
}

impl SlamCondition {
    /// The word for it: `OK`, `DEGRADED`, `LOST` or `RECOVERING`.
    pub const fn name(&self) -> &'static str {
        match self {
            Self::Ok => "OK",
            Self::Degraded(_) => "DEGRADED",
            Self::Lost(_) => "LOST",
            Self::Recovering(_) => "RECOVERING",
        }
    }

    /// Whether it is [`SlamCondition::Ok`].
    pub const fn is_ok(&self) -> bool {
        matches!(self, Self::Ok)
    }
}

impl From<Condition> for SlamCondition {
    fn from(condition: Condition) -> Self {
        match condition {
            Condition::Ok => Self::Ok,
            Condition::Degraded(doubt) => Self::Degraded(SlamDoubt::Odometry(doubt)),
            Condition::Lost(doubt) => Self::Lost(SlamDoubt::Odometry(doubt)),
        }
    }
}

impl fmt::Display for SlamDoubt {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Odometry(doubt) => doubt.fmt(f),
            Self::NotRecognised { nodes } => {
                write!(
                    f,
                    "the place is not known; {nodes} submaps were looked for in the map"
                )
            }
            Self::Unconfirmed { agreeing } => {
                write!(f, "a known place fits, {agreeing} submaps agree so far")
            }
            Self::NotSeen => f.write_str(
                "a known place was recognised, but what is seen now does not lie on the map there yet",
            ),
            Self::Drift { sigma_m } => {
                write!(
                    f,
                    "no known place for long: the position may be {sigma_m:.1} m off"
                )
            }
        }
    }
}

impl fmt::Display for SlamCondition {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Ok => f.write_str("OK"),
            Self::Degraded(doubt) | Self::Lost(doubt) | Self::Recovering(doubt) => {
                write!(f, "{}: {doubt}", self.name())
            }
        }
    }
}
