//! How far a pose can be trusted, in words a person can act on.

use std::fmt;

/// Why a pose is not to be trusted in full.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Doubt {
    /// The scan has too few points to be placed.
    FewPoints {
        /// Points left after reduction.
        points: usize,
    },
    /// The best placement found leaves most of the scan unexplained: the pose is carried on.
    PoorFit {
        /// Share of the points that lie on known surfaces.
        fit_share: f64,
    },
    /// The scan does not fit the map but the scans just before it: the surroundings changed at
    /// once, and how the old place and the new lie to each other is a guess.
    NewPlace {
        /// Scans placed in the new surroundings so far.
        scans: usize,
    },
    /// The surroundings leave this many directions open (a bare corridor, a plain): there the
    /// pose follows its speed.
    Unobserved {
        /// Directions of translation.
        translations: usize,
        /// Axes of rotation.
        rotations: usize,
    },
}

/// How far a pose can be trusted.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub enum Condition {
    /// As usual.
    #[default]
    Ok,
    /// Carried or guessed in part.
    Degraded(Doubt),
    /// Carried for so long that it says nothing any more.
    Lost(Doubt),
}

impl Condition {
    /// The word for it: `OK`, `DEGRADED` or `LOST`.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Ok => "OK",
            Self::Degraded(_) => "DEGRADED",
            Self::Lost(_) => "LOST",
        }
    }

    /// Whether it is [`Condition::Ok`].
    pub fn is_ok(&self) -> bool {
        matches!(self, Self::Ok)
    }
}

impl fmt::Display for Doubt {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::FewPoints { points } => write!(f, "only {points} points to place the scan by"),
            Self::PoorFit { fit_share } => {
                write!(
                    f,
                    "only {:.0} % of the scan fits the map",
                    fit_share * 100.0
                )
            }
            Self::NewPlace { scans } => {
                write!(
                    f,
                    "the surroundings changed at once; {scans} scans placed since"
                )
            }
            Self::Unobserved {
                translations,
                rotations,
            } => write!(
                f,
                "the surroundings leave {translations} directions and {rotations} axes open"
            ),
        }
    }
}

impl fmt::Display for Condition {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Ok => f.write_str("OK"),
            Self::Degraded(doubt) | Self::Lost(doubt) => write!(f, "{}: {doubt}", self.name()),
        }
    }
}
