//! The third level of alignment: a finished submap against the last few.
//!
//! In: a submap that odometry placed, the nodes before it. Out: how it hangs on the last of them,
//! and how surely: odometry and alignment weighed against each other. Where surfaces say nothing
//! (along a bare corridor), or where the alignment says something absurd, odometry stands alone.

use hachi_hal::Pose;
use nalgebra::Matrix6;

use crate::alignment::{Aligned, Alignment};
use crate::anchor::Link;
use crate::ground::laid_on;
use crate::growing::GrownSubmap;
use crate::map::Map;
use crate::node::NodeId;
use crate::surfaces::Surfaces;
use crate::tangent::{difference, stepped};
use crate::uncertainty::{bounded, invert, metric_scale, translation_first};

/// Surfaces farther than this from the node say no more about its place than near ones.
const REACH_M: f32 = 60.0;

/// Squared Mahalanobis distance between odometry and alignment beyond which one of them is wrong;
/// and odometry, which followed every scan, is seldom. Six degrees of freedom, one in a million.
const ABSURD: f64 = 38.0;

/// Information that is left of odometry's where it contradicts an alignment that fits: ten times the
/// standard deviation, so that loops may say where the fault lies.
const DOUBT: f64 = 0.01;

/// How much better one of two placements has to fit.
const CLEARLY: f64 = 1.15;

/// An alignment with less than this is of no use.
const LEAST_OVERLAP: f64 = 0.3;
const LEAST_INLIERS: f64 = 0.5;

/// What the alignment with a few submaps errs by at least, metres and radians. Odometry has compared
/// every scan with all that is within a hundred metres: where it is sure, a few submaps add nothing
/// but their own noise; where it is not, they decide.
const LEAST_SIGMA_M: f64 = 0.03;
const LEAST_SIGMA_RAD: f64 = 0.006;

/// Aligns a submap with those before it, in steps; keeps its buffers.
#[derive(Debug, Default)]
pub struct ChainAlignment {
    target: Surfaces,
    source: Surfaces,
    alignment: Alignment,
    expected: Pose,
    way_information: Matrix6<f64>,
}

impl ChainAlignment {
    /// Begins; `previous` are the nodes to align with, the one that odometry hangs on first, and `way`
    /// leads there from it by odometry. `false` if there is nothing to align with: then the way alone
    /// counts.
    pub fn begin(
        &mut self,
        map: &mut Map,
        grown: &GrownSubmap,
        way: &Link,
        previous: &[NodeId],
    ) -> bool {
        let last = previous.first().and_then(|id| map.node(*id)).copied();
        let Some(last) = last else {
            return false;
        };
        self.expected = way.pose;
        self.way_information = way.information();
        let way = way.pose;
        let map_from_last = last.map_from_node;
        let centre = way.translation.vector.cast::<f32>().into();
        self.target.clear();
        for id in previous {
            let Some(map_from_node) = map.node(*id).map(|n| n.map_from_node) else {
                continue;
            };
            if let Ok(submap) = map.submap(*id) {
                let last_from_node = map_from_last.inv_mul(&map_from_node);
                self.target.add(&submap, &last_from_node, centre, REACH_M);
            }
        }
        self.target.index();
        self.source.clear();
        self.source
            .add(&grown.submap, &Pose::identity(), [0.0; 3], REACH_M);
        let mended = grown
            .ground
            .and_then(|ground| laid_on(&last.ground, &ground, &way));
        match mended {
            // Odometry and the ground disagree: both are tried.
            Some(mended) => self.alignment.begin(&self.source, &[way, mended]),
            None => self.alignment.begin_close(&self.source, &way),
        }
        true
    }

    /// A step; the way from the first of the nodes when it is known.
    pub fn step(&mut self) -> Option<Link> {
        let aligned = self.alignment.step(&self.target)?;
        let (found, fitness) = (&aligned.found, &aligned.fitness);
        if !found.converged || fitness.overlap < LEAST_OVERLAP {
            return Some(link(&self.expected, &self.way_information));
        }
        if fitness.inlier_share() < LEAST_INLIERS {
            return Some(link(&self.expected, &(self.way_information * DOUBT)));
        }
        let seen = found.degeneracy.projection_on_observed();
        let hessian = seen.transpose() * found.information * seen;
        let metric = translation_first(&hessian) * metric_scale(fitness);
        let of_surfaces = bounded(&metric, LEAST_SIGMA_M, LEAST_SIGMA_RAD);
        let off = difference(&self.expected, &found.target_from_source);
        let apart = (off.transpose() * self.way_information * off)[0];
        if aligned.guess > 0 && self.is_better(&aligned) {
            // The ground was right.
            return Some(link(&found.target_from_source, &of_surfaces));
        }
        if apart > ABSURD {
            return Some(link(&self.expected, &(self.way_information * DOUBT)));
        }
        // The two say the same but for a small step: weighed by what each knows of it.
        let both = of_surfaces + self.way_information;
        let step = invert(&both) * of_surfaces * off;
        Some(link(&stepped(&self.expected, &step), &both))
    }

    /// Whether what the ground led to fits clearly better than what odometry led to.
    fn is_better(&self, aligned: &Aligned) -> bool {
        let fit = |guess| self.alignment.guess_fitness(guess).unwrap_or(0.0);
        fit(aligned.guess) > CLEARLY * fit(0)
    }
}

fn link(pose: &Pose, information: &Matrix6<f64>) -> Link {
    Link {
        pose: *pose,
        covariance: invert(information),
    }
}
