//! What a pose is: a group with a tangent space, and the numbers a solver needs from it.
//!
//! In: nothing. Out: [`Group`], implemented by [`Se2`] and [`Se3`]. A group of your own (rotations,
//! similarity transforms) needs this one trait. Elsewhere: measurements between poses (`factor`).

mod se2;
mod se3;

use core::fmt::Debug;
use core::ops::{Mul, Neg};

use nalgebra::SMatrix;

pub use se2::Se2;
pub use se3::Se3;

/// A matrix or vector of fixed size, column by column: nalgebra's static matrices.
pub trait Dense: Copy + Debug + PartialEq + Send + Sync + 'static {
    /// All zeros.
    fn zeros() -> Self;
    /// The numbers, column by column.
    fn numbers(&self) -> &[f64];
    /// The numbers, column by column.
    fn numbers_mut(&mut self) -> &mut [f64];
}

impl<const R: usize, const C: usize> Dense for SMatrix<f64, R, C> {
    #[inline(always)]
    fn zeros() -> Self {
        Self::zeros()
    }
    #[inline(always)]
    fn numbers(&self) -> &[f64] {
        self.as_slice()
    }
    #[inline(always)]
    fn numbers_mut(&mut self) -> &mut [f64] {
        self.as_mut_slice()
    }
}

/// A square [`Dense`] matrix that maps tangent vectors `T` to tangent vectors.
pub trait Square<T>: Dense + Mul<Output = Self> + Mul<T, Output = T> + Neg<Output = Self> {
    /// Rows and columns swapped.
    fn transposed(&self) -> Self;
    /// Ones on the diagonal.
    fn identity() -> Self;
    /// The smallest and the largest eigenvalue of a symmetric matrix of finite numbers.
    fn eigenvalue_range(&self) -> (f64, f64);
    /// The symmetric matrix with its negative eigenvalues set to zero.
    fn without_negative_eigenvalues(&self) -> Self;
}

macro_rules! square {
    ($($n:literal),*) => {$(
        impl Square<SMatrix<f64, $n, 1>> for SMatrix<f64, $n, $n> {
            #[inline(always)]
            fn transposed(&self) -> Self {
                self.transpose()
            }
            #[inline(always)]
            fn identity() -> Self {
                Self::identity()
            }
            fn eigenvalue_range(&self) -> (f64, f64) {
                let values = self.symmetric_eigenvalues();
                (values.min(), values.max())
            }
            fn without_negative_eigenvalues(&self) -> Self {
                let mut eigen = self.symmetric_eigen();
                eigen.eigenvalues.apply(|v| *v = v.max(0.0));
                eigen.recompose()
            }
        }
    )*};
}
square!(1, 2, 3, 4, 5, 6, 7, 8, 9);

/// A pose, or anything else that can be composed, inverted and moved by a small step.
///
/// A step `delta` moves a pose on the right: `pose.retract(delta) = pose * Exp(delta)`, so it is in
/// the pose's own frame. `local` is its inverse: `a.local(b) = Log(a^-1 b)`.
pub trait Group: Copy + Debug + PartialEq + Send + Sync + 'static {
    /// Numbers in a tangent vector.
    const DIM: usize;
    /// A step or an error: `DIM` numbers.
    type Tangent: Dense;
    /// `DIM x DIM`: information, covariance, Jacobian.
    type Matrix: Square<Self::Tangent>;

    /// The pose that moves nothing.
    fn identity() -> Self;
    /// `self * other`.
    fn compose(&self, other: &Self) -> Self;
    /// The pose that undoes this one.
    fn inverse(&self) -> Self;
    /// `self * Exp(delta)`.
    fn retract(&self, delta: &Self::Tangent) -> Self;
    /// `Log(self^-1 * other)`.
    fn local(&self, other: &Self) -> Self::Tangent;
    /// `r = self.local(other)`, and its Jacobian with respect to a step of `other`.
    fn local_with_jacobian(&self, other: &Self) -> (Self::Tangent, Self::Matrix);
    /// The matrix with `self * Exp(delta) = Exp(adjoint * delta) * self`.
    fn adjoint(&self) -> Self::Matrix;
    /// Whether every number is finite.
    fn is_finite(&self) -> bool;

    /// `self^-1 * other`: `other` seen from `self`.
    #[inline(always)]
    fn between(&self, other: &Self) -> Self {
        self.inverse().compose(other)
    }
}
