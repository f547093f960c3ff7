//! One line of a g2o file.

use crate::factor::{Factor, Key, is_definite};
use crate::group::{Dense, Group, Se2, Se3, Square};

/// What is wrong with a line.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum LineProblem {
    /// It is longer than any line of such a file.
    #[error("longer than {limit} bytes")]
    TooLong {
        /// The limit.
        limit: usize,
    },
    /// The wrong number of numbers.
    #[error("{tag} takes {expected} numbers, here are {got}")]
    Count {
        /// The line's first word.
        tag: &'static str,
        /// Numbers that belong there.
        expected: usize,
        /// Numbers that are there.
        got: usize,
    },
    /// A word that is no number.
    #[error("{text:?} is no number")]
    NotANumber {
        /// The word, cut short.
        text: String,
    },
    /// NaN or infinite.
    #[error("{text:?} is not finite")]
    NotFinite {
        /// The word, cut short.
        text: String,
    },
    /// A name of a pose that is no whole number from 0 on.
    #[error("{text:?} names no pose: whole numbers from 0 on do")]
    NotAKey {
        /// The word, cut short.
        text: String,
    },
    /// An edge from a pose to itself.
    #[error("an edge from {key} to itself")]
    SelfEdge {
        /// The pose.
        key: Key,
    },
    /// A quaternion of length zero.
    #[error("a quaternion of length zero")]
    NoRotation,
    /// An information matrix that is not positive semi-definite.
    #[error(
        "the information is not positive semi-definite: its eigenvalues are {smallest:e} to \
         {largest:e}"
    )]
    InformationNotPositive {
        /// Smallest eigenvalue.
        smallest: f64,
        /// Largest eigenvalue.
        largest: f64,
    },
    /// A line of the plane in a file of space, or the other way round.
    #[error("{tag} in a file that began with {began}")]
    OtherSpace {
        /// The line's first word.
        tag: &'static str,
        /// What the file began with.
        began: &'static str,
    },
}

/// A group that g2o files hold.
pub(super) trait Stored: Group {
    const VERTEX: &'static str;
    const EDGE: &'static str;
    /// Numbers of a pose.
    const NUMBERS: usize;
    /// From numbers; whether a quaternion had to be scaled visibly.
    fn from_numbers(numbers: &[f64]) -> Result<(Self, bool), LineProblem>;
    fn to_numbers(self) -> Vec<f64>;
}

impl Stored for Se2 {
    const VERTEX: &'static str = "VERTEX_SE2";
    const EDGE: &'static str = "EDGE_SE2";
    const NUMBERS: usize = 3;

    fn from_numbers(numbers: &[f64]) -> Result<(Self, bool), LineProblem> {
        Ok((Self::new(numbers[0], numbers[1], numbers[2]), false))
    }

    fn to_numbers(self) -> Vec<f64> {
        vec![self.translation.x, self.translation.y, self.theta()]
    }
}

/// A quaternion further than this from length one is no matter of printed digits.
const QUATERNION_TOLERANCE: f64 = 1e-3;

impl Stored for Se3 {
    const VERTEX: &'static str = "VERTEX_SE3:QUAT";
    const EDGE: &'static str = "EDGE_SE3:QUAT";
    const NUMBERS: usize = 7;

    fn from_numbers(numbers: &[f64]) -> Result<(Self, bool), LineProblem> {
        let [x, y, z, i, j, k, w] = numbers else {
            return Err(LineProblem::NoRotation);
        };
        // Scaled by the largest first, so that no square overflows or vanishes.
        let largest = [i, j, k, w].iter().fold(0.0, |m: f64, v| m.max(v.abs()));
        if largest == 0.0 {
            return Err(LineProblem::NoRotation);
        }
        let scaled = nalgebra::Quaternion::new(w / largest, i / largest, j / largest, k / largest);
        let length = scaled.norm() * largest;
        let rotation = nalgebra::UnitQuaternion::new_normalize(scaled);
        let pose = Self::new(nalgebra::Vector3::new(*x, *y, *z), rotation);
        Ok((pose, (length - 1.0).abs() > QUATERNION_TOLERANCE))
    }

    fn to_numbers(self) -> Vec<f64> {
        let (t, q) = (self.translation, self.rotation.coords);
        vec![t.x, t.y, t.z, q.x, q.y, q.z, q.w]
    }
}

/// What a line says.
#[derive(Debug)]
pub(super) enum Line<G: Group> {
    Vertex(Key, G, Scaled),
    Edge(Factor<G>, Scaled, Clipped),
}

/// A quaternion was scaled.
pub(super) type Scaled = bool;
/// A negative eigenvalue was set to zero.
pub(super) type Clipped = bool;

/// Words of a line, without its comment.
pub(super) fn words(line: &str) -> impl Iterator<Item = &str> {
    line.split('#').next().unwrap_or("").split_whitespace()
}

pub(super) fn key(word: &str) -> Result<Key, LineProblem> {
    word.parse().map_err(|_| LineProblem::NotAKey {
        text: cut_short(word),
    })
}

/// The words of a vertex after its tag.
pub(super) fn vertex<G: Stored>(words: &[&str]) -> Result<Line<G>, LineProblem> {
    count(G::VERTEX, 1 + G::NUMBERS, words)?;
    let key = key(words[0])?;
    let (pose, scaled) = G::from_numbers(&numbers(&words[1..])?)?;
    Ok(Line::Vertex(key, pose, scaled))
}

/// The words of an edge after its tag.
pub(super) fn edge<G: Stored>(words: &[&str]) -> Result<Line<G>, LineProblem> {
    let upper = G::DIM * (G::DIM + 1) / 2;
    count(G::EDGE, 2 + G::NUMBERS + upper, words)?;
    let (from, to) = (key(words[0])?, key(words[1])?);
    if from == to {
        return Err(LineProblem::SelfEdge { key: from });
    }
    let numbers = numbers(&words[2..])?;
    let (measured, scaled) = G::from_numbers(&numbers[..G::NUMBERS])?;
    let mut entries = numbers[G::NUMBERS..].iter();
    let mut information = G::Matrix::zeros();
    for r in 0..G::DIM {
        for (c, &entry) in (r..G::DIM).zip(&mut entries) {
            information.numbers_mut()[c * G::DIM + r] = entry;
            information.numbers_mut()[r * G::DIM + c] = entry;
        }
    }
    let clipped = clip::<G>(&mut information)?;
    let factor = if from.abs_diff(to) == 1 {
        Factor::between(from, to, measured, information)
    } else {
        Factor::loop_closure(from, to, measured, information)
    };
    Ok(Line::Edge(factor, scaled, clipped))
}

/// Files carry six digits: a negative eigenvalue up to this share of the largest is a zero that was
/// rounded.
const ROUNDED_SHARE: f64 = 1e-6;

fn clip<G: Group>(information: &mut G::Matrix) -> Result<Clipped, LineProblem> {
    if is_definite::<G>(information) {
        return Ok(false);
    }
    let (smallest, largest) = information.eigenvalue_range();
    if smallest >= 0.0 {
        return Ok(false);
    }
    let rounded = smallest >= -ROUNDED_SHARE * largest;
    if !rounded {
        return Err(LineProblem::InformationNotPositive { smallest, largest });
    }
    *information = information.without_negative_eigenvalues();
    Ok(true)
}

fn count(tag: &'static str, expected: usize, words: &[&str]) -> Result<(), LineProblem> {
    let got = words.len();
    if got == expected {
        return Ok(());
    }
    Err(LineProblem::Count { tag, expected, got })
}

fn numbers(words: &[&str]) -> Result<Vec<f64>, LineProblem> {
    words.iter().map(|word| number(word)).collect()
}

fn number(word: &str) -> Result<f64, LineProblem> {
    let number: f64 = word.parse().map_err(|_| LineProblem::NotANumber {
        text: cut_short(word),
    })?;
    if !number.is_finite() {
        return Err(LineProblem::NotFinite {
            text: cut_short(word),
        });
    }
    Ok(number)
}

pub(super) fn cut_short(word: &str) -> String {
    word.chars().take(32).collect()
}
