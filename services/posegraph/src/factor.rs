//! Measurements: of a pose (prior), and of one pose seen from another (between, loop).
//!
//! In: a measured pose and its information matrix. Out: [`Factor`], its error, and its share in the
//! normal equations. Elsewhere: who owns factors (`slab`, `graph`, `isam2`).

use core::fmt;

use crate::error::Error;
use crate::group::{Dense, Group, Square};
use crate::kernel::Kernel;

/// Names a pose. Any number; [`Isam2`](crate::Isam2) and the g2o solver take larger keys for later
/// poses.
pub type Key = u64;

/// Names a factor in a [`Graph`](crate::Graph) or an [`Isam2`](crate::Isam2). Never given twice.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct FactorId {
    pub(crate) slot: u32,
    pub(crate) generation: u32,
}

impl fmt::Display for FactorId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.generation {
            0 => write!(f, "{}", self.slot),
            again => write!(f, "{}.{again}", self.slot),
        }
    }
}

/// What a factor measures.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FactorKind {
    /// A pose itself.
    Prior,
    /// A pose seen from another: odometry.
    Between,
    /// The same, from recognising a place. Solvers treat it as `Between`; its owner may list and
    /// remove loops, and give them a kernel.
    Loop,
}

/// A factor in words: for errors, which outlive the factor.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct FactorDescription {
    /// What it measures.
    pub kind: FactorKind,
    /// From which pose.
    pub from: Key,
    /// To which pose; the same as `from` for a prior.
    pub to: Key,
}

impl fmt::Display for FactorDescription {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { kind, from, to } = self;
        match kind {
            FactorKind::Prior => write!(f, "prior on {from}"),
            FactorKind::Between => write!(f, "edge from {from} to {to}"),
            FactorKind::Loop => write!(f, "loop from {from} to {to}"),
        }
    }
}

/// One measurement.
///
/// Its error is `r = Log(measured^-1 * seen)`, where `seen` is the pose itself for a prior and
/// `from^-1 * to` otherwise; it costs `0.5 * kernel(r' * information * r)`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Factor<G: Group> {
    kind: FactorKind,
    from: Key,
    to: Key,
    measured: G,
    information: G::Matrix,
    kernel: Kernel,
}

impl<G: Group> Factor<G> {
    /// The pose `key` was measured to be `measured`.
    pub fn prior(key: Key, measured: G, information: G::Matrix) -> Self {
        Self {
            kind: FactorKind::Prior,
            from: key,
            to: key,
            measured,
            information,
            kernel: Kernel::Quadratic,
        }
    }

    /// The pose `to`, seen from `from`, was measured to be `measured`, a `from_from_to`.
    pub fn between(from: Key, to: Key, measured: G, information: G::Matrix) -> Self {
        Self {
            kind: FactorKind::Between,
            from,
            to,
            measured,
            information,
            kernel: Kernel::Quadratic,
        }
    }

    /// As [`between`](Self::between), from recognising a place.
    pub fn loop_closure(from: Key, to: Key, measured: G, information: G::Matrix) -> Self {
        Self {
            kind: FactorKind::Loop,
            ..Self::between(from, to, measured, information)
        }
    }

    /// With a robust kernel.
    #[must_use]
    pub fn with_kernel(self, kernel: Kernel) -> Self {
        Self { kernel, ..self }
    }

    /// What it measures.
    pub fn kind(&self) -> FactorKind {
        self.kind
    }

    /// From which pose.
    pub fn from(&self) -> Key {
        self.from
    }

    /// To which pose; the same as [`from`](Self::from) for a prior.
    pub fn to(&self) -> Key {
        self.to
    }

    /// The measurement.
    pub fn measured(&self) -> &G {
        &self.measured
    }

    /// Its information matrix, the inverse of its covariance.
    pub fn information(&self) -> &G::Matrix {
        &self.information
    }

    /// Its robust kernel.
    pub fn kernel(&self) -> Kernel {
        self.kernel
    }

    /// In words.
    pub fn description(&self) -> FactorDescription {
        FactorDescription {
            kind: self.kind,
            from: self.from,
            to: self.to,
        }
    }

    /// The error `r` for these poses; a prior looks only at `to`.
    #[inline(always)]
    pub fn residual(&self, from: &G, to: &G) -> G::Tangent {
        match self.kind {
            FactorKind::Prior => self.measured.local(to),
            FactorKind::Between | FactorKind::Loop => self.measured.local(&from.between(to)),
        }
    }

    /// `r' * information * r`: squared standard deviations away from the measurement.
    #[inline(always)]
    pub fn squared_mahalanobis(&self, from: &G, to: &G) -> f64 {
        let r = self.residual(from, to);
        dot(&(self.information * r), &r)
    }

    /// What it adds to the graph's error.
    #[inline(always)]
    pub fn cost(&self, from: &G, to: &G) -> f64 {
        0.5 * self.kernel.cost(self.squared_mahalanobis(from, to))
    }

    /// Checks everything that can be seen without poses. Whether the information leaves no direction
    /// open.
    pub(crate) fn validate(&self) -> Result<bool, Error> {
        let factor = self.description();
        let numbers = self.information.numbers();
        if !self.measured.is_finite() || !numbers.iter().all(|v| v.is_finite()) {
            return Err(Error::FactorNotFinite { factor });
        }
        if self.kind != FactorKind::Prior && self.from == self.to {
            return Err(Error::SelfEdge { factor });
        }
        if !self.kernel.is_valid() {
            return Err(Error::Kernel { factor });
        }
        let asymmetry = asymmetry::<G>(&self.information);
        let largest = numbers.iter().fold(0.0, |m: f64, v| m.max(v.abs()));
        if asymmetry > SYMMETRY_TOLERANCE * largest {
            return Err(Error::InformationNotSymmetric { factor, asymmetry });
        }
        if is_definite::<G>(&self.information) {
            return Ok(true);
        }
        let (smallest, largest) = self.information.eigenvalue_range();
        // `>=` is false for NaN, which a matrix of enormous numbers may give.
        let positive = smallest >= -EIGENVALUE_TOLERANCE * largest.abs();
        if positive {
            Ok(false)
        } else {
            Err(Error::InformationNotPositive { factor, smallest })
        }
    }

    /// Its share in the normal equations at these poses; a prior looks only at `to`.
    #[inline(always)]
    pub(crate) fn linearize(&self, from: &G, to: &G) -> Linearized<G> {
        let binary = self.kind != FactorKind::Prior;
        let seen = if binary { from.between(to) } else { *to };
        let (r, jacobian) = self.measured.local_with_jacobian(&seen);
        let weighted = self.information * r;
        let weight = self.kernel.weight(dot(&weighted, &r));
        let transposed = jacobian.transposed();
        let mut to_to = transposed * self.information * jacobian;
        let mut to_gradient = transposed * weighted;
        if weight != 1.0 {
            scale(&mut to_to, weight);
            scale(&mut to_gradient, weight);
        }
        if !binary {
            return Linearized {
                to_to,
                to_gradient,
                ..Linearized::zeros()
            };
        }
        // A step of `from` is the step -Ad(seen^-1) of `seen`.
        let carried = -seen.inverse().adjoint().transposed();
        let from_to = carried * to_to;
        Linearized {
            from_from: from_to * carried.transposed(),
            from_to,
            to_to,
            from_gradient: carried * to_gradient,
            to_gradient,
        }
    }
}

/// Blocks of `J' W J` and `J' W r` of one factor.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Linearized<G: Group> {
    pub from_from: G::Matrix,
    /// Rows of `from`, columns of `to`.
    pub from_to: G::Matrix,
    pub to_to: G::Matrix,
    pub from_gradient: G::Tangent,
    pub to_gradient: G::Tangent,
}

impl<G: Group> Linearized<G> {
    fn zeros() -> Self {
        Self {
            from_from: G::Matrix::zeros(),
            from_to: G::Matrix::zeros(),
            to_to: G::Matrix::zeros(),
            from_gradient: G::Tangent::zeros(),
            to_gradient: G::Tangent::zeros(),
        }
    }
}

/// Text files carry six digits or more.
const SYMMETRY_TOLERANCE: f64 = 1e-6;
/// Rounding of an eigenvalue that is zero, with room for matrices made of products.
const EIGENVALUE_TOLERANCE: f64 = 1e-9;
/// Below this share of its diagonal a pivot is rounding: the direction may as well be open.
const PIVOT_TOLERANCE: f64 = 1e-10;

fn asymmetry<G: Group>(matrix: &G::Matrix) -> f64 {
    let n = matrix.numbers();
    let pairs = (0..G::DIM).flat_map(|i| (0..i).map(move |j| (i, j)));
    pairs.fold(0.0, |m: f64, (i, j)| {
        m.max((n[i + j * G::DIM] - n[j + i * G::DIM]).abs())
    })
}

/// Whether Cholesky's pivots all stay clear of rounding.
pub(crate) fn is_definite<G: Group>(matrix: &G::Matrix) -> bool {
    let mut factor = *matrix;
    let n = factor.numbers_mut();
    for k in 0..G::DIM {
        let diagonal = n[k + k * G::DIM];
        let row = (0..k).map(|j| n[k + j * G::DIM]);
        let pivot = diagonal - row.map(|v| v * v).sum::<f64>();
        let clear = pivot > PIVOT_TOLERANCE * diagonal && pivot.is_finite();
        if !clear {
            return false;
        }
        let root = pivot.sqrt();
        n[k + k * G::DIM] = root;
        for i in k + 1..G::DIM {
            let products = (0..k).map(|j| n[i + j * G::DIM] * n[k + j * G::DIM]);
            n[i + k * G::DIM] = (n[i + k * G::DIM] - products.sum::<f64>()) / root;
        }
    }
    true
}

#[inline(always)]
pub(crate) fn dot<D: Dense>(a: &D, b: &D) -> f64 {
    a.numbers()
        .iter()
        .zip(b.numbers())
        .map(|(a, b)| a * b)
        .sum()
}

#[inline(always)]
fn scale<D: Dense>(a: &mut D, by: f64) {
    a.numbers_mut().iter_mut().for_each(|v| *v *= by);
}
