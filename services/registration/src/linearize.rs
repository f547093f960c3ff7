//! One linearisation of the GICP objective: normal equations from all correspondences.

use hachi_hal::Pose;
use nalgebra::{Matrix6, Vector6};
use rayon::prelude::*;

use crate::cloud::SurfacePoint;
use crate::pair::{InformationSum, Kernel, Pair, Transform};

/// Points handed to one task. Fixed, so that sums are grouped the same way for any number of
/// threads.
const CHUNK: usize = 256;

/// Answers which surface is nearest.
pub trait SurfaceTarget: Sync {
    /// The piece of surface nearest to `point` (target frame, metres), if any is within reach.
    fn closest(&self, point: [f32; 3], max_distance_sq: f32) -> Option<SurfacePoint>;
}

/// Normal equations `information * delta = -gradient`, and what went into them.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NormalEquations {
    /// Gauss-Newton approximation of the Hessian; rotation first, source frame.
    pub information: Matrix6<f64>,
    /// The part of the information about translation that every direction has alike.
    pub tangential: f64,
    /// Gradient at `delta = 0`.
    pub gradient: Vector6<f64>,
    /// The robust loss summed: half the squared Mahalanobis distances where no kernel is used.
    pub error: f64,
    /// Sum of squared distances across the target's surface, m².
    pub across_sq: f64,
    /// Pairs within reach.
    pub pairs: usize,
}

#[derive(Debug, Clone, Copy, Default)]
struct Partial {
    information: InformationSum,
    gradient: [f64; 6],
    error: f64,
    across_sq: f64,
    pairs: usize,
}

/// Linearises; keeps its buffers.
#[derive(Debug, Clone, Default)]
pub struct Linearizer {
    partials: Vec<Partial>,
    matches: Vec<Option<SurfacePoint>>,
}

impl Linearizer {
    /// Pairs every source point with the nearest surface within `reach_m` and sums up.
    pub fn linearize<T: SurfaceTarget>(
        &mut self,
        source: &[SurfacePoint],
        target: &T,
        target_from_source: &Pose,
        reach_m: f32,
        kernel: Kernel,
    ) -> NormalEquations {
        self.matches.resize(source.len(), None);
        self.partials.clear();
        self.partials
            .resize(source.len().div_ceil(CHUNK), Partial::default());
        let transform = Transform::new(target_from_source);
        source
            .par_chunks(CHUNK)
            .zip(self.matches.par_chunks_mut(CHUNK))
            .zip(self.partials.par_iter_mut())
            .for_each(|((points, matches), partial)| {
                for (point, matched) in points.iter().zip(matches) {
                    let moved = transform.apply(point.position);
                    *matched = target.closest(moved, reach_m * reach_m);
                    if let Some(surface) = matched {
                        partial.add(&Pair::new(point, surface, moved, &transform), point, kernel);
                    }
                }
            });
        let mut out = NormalEquations {
            information: Matrix6::zeros(),
            tangential: 0.0,
            gradient: Vector6::zeros(),
            error: 0.0,
            across_sq: 0.0,
            pairs: 0,
        };
        for partial in &self.partials {
            out.information += partial.information.matrix();
            out.tangential += partial.information.tangential();
            out.gradient += Vector6::from(partial.gradient);
            out.error += partial.error;
            out.across_sq += partial.across_sq;
            out.pairs += partial.pairs;
        }
        out
    }

    /// The robust loss at another pose, for the pairs of the last call.
    pub fn error_at(&self, source: &[SurfacePoint], pose: &Pose, kernel: Kernel) -> f64 {
        let transform = Transform::new(pose);
        source
            .iter()
            .zip(&self.matches)
            .filter_map(|(p, m)| m.as_ref().map(|m| (p, m)))
            .map(|(point, surface)| {
                let pair = Pair::new(point, surface, transform.apply(point.position), &transform);
                f64::from(kernel.loss(pair.mahalanobis_sq()))
            })
            .sum()
    }
}

impl Partial {
    #[inline]
    fn add(&mut self, pair: &Pair, source: &SurfacePoint, kernel: Kernel) {
        let terms = pair.linearize(source.position, kernel);
        self.information.add(&terms, 1.0);
        for (sum, term) in self.gradient.iter_mut().zip(terms.gradient) {
            *sum += f64::from(term);
        }
        self.across_sq += f64::from(terms.across * terms.across);
        self.error += f64::from(terms.loss);
        self.pairs += 1;
    }
}
