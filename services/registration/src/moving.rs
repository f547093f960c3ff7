//! Registration of a scan whose sensor moved while it measured.
//!
//! The motion is a [`Chain`] of poses, evenly spaced over the scan, between which the pose is
//! blended. All are found together: every point pulls on the two knots around its time, a bound
//! on acceleration ties neighbouring knots, and what the scan before left known of its last two
//! comes along as a prior. So a walking robot's bobbing, which turns around within one scan, is
//! followed instead of averaged, and what a scan does not see goes on at the speed it had.
//!
//! In: points in the sensor's frame at their own times, a target, the chain with a first guess.
//! Out: the chain, and a [`Fit`] that says how far to trust it.

use nalgebra::{Matrix6, Vector6};
use rayon::prelude::*;

use crate::chain::{Agility, Chain, ChainSystem, Increment, KNOTS, MAX_INTERVALS};
use crate::cloud::SurfacePoint;
use crate::degeneracy::Degeneracy;
use crate::linearize::SurfaceTarget;
use crate::pair::{InformationSum, Kernel, Pair, Transform};

/// Points handed to one task. Fixed, so that sums are grouped the same way for any number of
/// threads.
const CHUNK: usize = 128;

/// Room that buffers have from the start, points: a little more now and then must not allocate.
const ROOM: usize = 8192;

/// Share of its information that a scan hands on to the next: see [`Chain`].
const TRUST: f64 = 0.5;

/// A piece of surface and when it was measured.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct TimedSurface {
    /// In the sensor's frame at its own time.
    pub surface: SurfacePoint,
    /// Which interval of the chain its time falls into.
    pub interval: u32,
    /// How far into the interval, 0 to 1.
    pub share: f32,
}

/// Settings.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MovingConfig {
    /// Surfaces farther from a point than this are not paired with it.
    pub reach_m: f32,
    /// The same in the first iteration, when the guess is yet to be mended.
    pub first_reach_m: f32,
    /// How much bad pairs count.
    pub kernel: Kernel,
    /// A pair closer than this across its surface fits.
    pub fits_within_m: f32,
    /// Iterations before giving up.
    pub max_iterations: usize,
    /// Steps below this, in metres and radians, are converged.
    pub epsilon: f64,
    /// What the robot can do.
    pub agility: Agility,
    /// See [`Degeneracy::of`]; in an open direction the scan is not asked.
    pub degeneracy_threshold: f64,
}

/// How well a chain lays a scan on its target.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Fit {
    /// The last step was below the limit.
    pub converged: bool,
    /// Linearisations made.
    pub iterations: usize,
    /// Points with a surface within reach.
    pub pairs: usize,
    /// `pairs` over all points.
    pub inlier_share: f64,
    /// Points that fit (`fits_within_m`) over all points.
    pub fit_share: f64,
    /// Root mean square distance across the paired surface, metres.
    pub residual_m: f64,
    /// Information of the points about the pose, rotation first, sensor frame.
    pub information: Matrix6<f64>,
    /// What the scan left open; held to the prior.
    pub degeneracy: Degeneracy,
}

/// Sums of one chunk: the earlier knot with itself, with the later, the later with itself.
#[derive(Debug, Clone, Copy, Default)]
struct Partial {
    information: [InformationSum; 3],
    gradient: [[f64; 6]; 2],
    across_sq: f64,
    pairs: usize,
    fitting: usize,
}

/// A run of points of one interval.
#[derive(Debug, Clone, Copy)]
struct Chunk {
    interval: usize,
    start: usize,
    end: usize,
}

/// Aligns moving scans; keeps its buffers.
#[derive(Debug, Clone)]
pub struct MovingAligner {
    sorted: Vec<TimedSurface>,
    chunks: Vec<Chunk>,
    partials: Vec<Partial>,
    system: ChainSystem,
}

impl Default for MovingAligner {
    fn default() -> Self {
        Self {
            sorted: Vec::with_capacity(ROOM),
            chunks: Vec::with_capacity(ROOM / CHUNK + MAX_INTERVALS),
            partials: Vec::with_capacity(ROOM / CHUNK + MAX_INTERVALS),
            system: ChainSystem::new(),
        }
    }
}

impl MovingAligner {
    /// Finds the chain that lays `source` on `target`; `increments` are the measured motions over
    /// the chain's intervals, none or one for each.
    pub fn align<T: SurfaceTarget>(
        &mut self,
        source: &[TimedSurface],
        target: &T,
        chain: &mut Chain,
        increments: &[Increment],
        config: &MovingConfig,
    ) -> Fit {
        self.sort(source);
        let mut fit = Fit::default();
        while fit.iterations < config.max_iterations {
            let reach_m = if fit.iterations == 0 {
                config.first_reach_m
            } else {
                config.reach_m
            };
            self.linearize(target, chain, reach_m, config);
            self.system.reset(chain, &config.agility);
            self.add_points(config, &mut fit);
            for (i, increment) in increments.iter().enumerate() {
                self.system.add_increment(chain, i, increment);
            }
            fit.iterations += 1;
            let Some(step) = self.system.solve() else {
                break;
            };
            chain.apply(&step);
            if step.amax() < config.epsilon {
                fit.converged = true;
                break;
            }
        }
        chain.keep_marginal(&self.system, TRUST, &fit.degeneracy);
        fit
    }

    /// Orders the points by interval, so that a chunk pulls on one pair of knots only.
    fn sort(&mut self, source: &[TimedSurface]) {
        self.sorted.clear();
        self.chunks.clear();
        for interval in 0..MAX_INTERVALS {
            let mut start = self.sorted.len();
            self.sorted
                .extend(source.iter().filter(|p| p.interval as usize == interval));
            while start < self.sorted.len() {
                let end = (start + CHUNK).min(self.sorted.len());
                self.chunks.push(Chunk {
                    interval,
                    start,
                    end,
                });
                start = end;
            }
        }
    }

    fn linearize<T: SurfaceTarget>(
        &mut self,
        target: &T,
        chain: &Chain,
        reach_m: f32,
        config: &MovingConfig,
    ) {
        let mut knots = [Transform::new(&chain.poses()[0]); KNOTS - 1];
        for (knot, pose) in knots.iter_mut().zip(chain.poses()) {
            *knot = Transform::new(pose);
        }
        self.partials.resize(self.chunks.len(), Partial::default());
        let sorted = &self.sorted;
        self.partials
            .par_iter_mut()
            .zip(self.chunks.par_iter())
            .for_each(|(partial, chunk)| {
                *partial = Partial::default();
                let (early, late) = (&knots[chunk.interval], &knots[chunk.interval + 1]);
                for point in &sorted[chunk.start..chunk.end] {
                    let transform = early.blend(late, point.share);
                    let moved = transform.apply(point.surface.position);
                    if let Some(surface) = target.closest(moved, reach_m * reach_m) {
                        let pair = Pair::new(&point.surface, &surface, moved, &transform);
                        partial.add(&pair, point, config);
                    }
                }
            });
    }

    /// Adds the points' pull to the system, less what it says of directions it does not see.
    fn add_points(&mut self, config: &MovingConfig, fit: &mut Fit) {
        let count = self.sorted.len().max(1) as f64;
        let (mut across_sq, mut tangential, mut fitting) = (0.0, 0.0, 0);
        (fit.information, fit.pairs) = (Matrix6::zeros(), 0);
        for partial in &self.partials {
            let [early, both, late] = partial.information.map(|i| i.matrix());
            // A point's weights for its two knots add up to one, and so do these to its whole.
            fit.information += early + both + both + late;
            let [e, b, l] = partial.information.map(|i| i.tangential());
            tangential += e + 2.0 * b + l;
            fit.pairs += partial.pairs;
            fitting += partial.fitting;
            across_sq += partial.across_sq;
        }
        fit.inlier_share = fit.pairs as f64 / count;
        fit.fit_share = fitting as f64 / count;
        fit.residual_m = (across_sq / fit.pairs.max(1) as f64).sqrt();
        fit.degeneracy = Degeneracy::of(&fit.information, tangential, config.degeneracy_threshold);
        let seen = fit.degeneracy.projection_on_observed();
        for (partial, chunk) in self.partials.iter().zip(&self.chunks) {
            let knots = [chunk.interval + 1, chunk.interval + 2];
            let [early, both, late] = partial
                .information
                .map(|i| seen.transpose() * i.matrix() * seen);
            self.system.add_block(knots[0], knots[0], &early);
            self.system.add_block(knots[0], knots[1], &both);
            self.system.add_block(knots[1], knots[0], &both);
            self.system.add_block(knots[1], knots[1], &late);
            for (knot, gradient) in knots.into_iter().zip(partial.gradient) {
                self.system
                    .add_gradient(knot, &(seen.transpose() * Vector6::from(gradient)));
            }
        }
    }
}

impl Partial {
    #[inline]
    fn add(&mut self, pair: &Pair, point: &TimedSurface, config: &MovingConfig) {
        let terms = pair.linearize(point.surface.position, config.kernel);
        let late = f64::from(point.share);
        let early = 1.0 - late;
        self.information[0].add(&terms, early * early);
        self.information[1].add(&terms, early * late);
        self.information[2].add(&terms, late * late);
        for (k, term) in terms.gradient.into_iter().enumerate() {
            self.gradient[0][k] += early * f64::from(term);
            self.gradient[1][k] += late * f64::from(term);
        }
        self.across_sq += f64::from(terms.across * terms.across);
        self.pairs += 1;
        self.fitting += usize::from(terms.across.abs() < config.fits_within_m);
    }
}
