//! The filters of a scan in order; read [`Filters::step`] first.
//!
//! In: one scan in the sensor frame, where the sensor is on the robot, and where the ground is if
//! the platform knows. Out: a [`Reason`] for each point, the kept points, and what was found.
//! Elsewhere: the voxel grid, which its consumers call at their own sizes, and deskewing
//! (`hachi-registration`), which comes after: a mirror is a plane for the sensor that looks at it,
//! and a tenth of a second of walking bends neither.

use alloc::vec::Vec;

use hachi_hal::{Point, Pose};

use crate::adaptive::IntensityModel;
use crate::angular::AngularGrid;
use crate::ceiling::CeilingFilter;
use crate::config::{FilterConfig, FilterConfigError};
use crate::crop::{label_non_finite, label_range, label_self_hits};
use crate::float::dot;
use crate::ghost::GhostStage;
use crate::ground_tracker::{GroundSource, GroundTracker};
use crate::intensity::{
    Height, IntensityMode, has_signal, label_weak, label_weak_above_ground, label_weak_by_model,
};
use crate::label::{Reason, RemovalCounts, compact};
use crate::normals::Normals;
use crate::outlier::OutlierStage;

/// Where the sensor was during one scan.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ScanFrames {
    /// Takes points in the sensor frame to the frame of [`FilterConfig::body`].
    pub base_from_lidar: Pose,
    /// Takes points in the sensor frame to the footprint frame at this scan's time. `None` where
    /// no platform gives it: the ground is then found in the scan.
    pub footprint_from_lidar: Option<Pose>,
}

/// The base is the sensor, the ground unknown: a recording of a robot nobody knows.
impl Default for ScanFrames {
    fn default() -> Self {
        Self {
            base_from_lidar: Pose::identity(),
            footprint_from_lidar: None,
        }
    }
}

/// Where the ground of a scan was taken from.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum GroundUse {
    /// No filter that is switched on asked for it.
    NotNeeded,
    /// The caller's transform.
    Given,
    /// The scan, or the one before.
    Found(GroundSource),
}

/// What became of the intensity filter.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum IntensityUse {
    /// Switched off.
    Off,
    /// It ran.
    Ran,
    /// No kept point is brighter than the reject range: the source has no intensities, or on
    /// another scale. Nothing was removed.
    NoSignal,
    /// The ground is unknown, and without it dark floor would go. Nothing was removed.
    NoGround,
}

/// What the filters did with one scan.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Filtered {
    /// Points by reason.
    pub counts: RemovalCounts,
    /// Takes points to the footprint frame, as used for this scan.
    pub footprint_from_lidar: Option<Pose>,
    /// Where that comes from.
    pub ground: GroundUse,
    /// Whether the intensity filter ran, and why not.
    pub intensity: IntensityUse,
    /// Planes (floor and panes) in which ghosts were seen.
    pub mirrors: usize,
    /// Height of the ceiling that was removed over the footprint plane, metres.
    pub ceiling_m: Option<f32>,
}

/// The filters of one LiDAR. Keeps its buffers: once it has seen a scan of the largest size,
/// nothing allocates.
#[derive(Debug, Clone)]
pub struct Filters {
    config: FilterConfig,
    labels: Vec<Reason>,
    grid: AngularGrid,
    outliers: OutlierStage,
    ground: GroundTracker,
    intensities: IntensityModel,
    normals: Normals,
    ghosts: GhostStage,
    ceiling: CeilingFilter,
}

impl Filters {
    /// Filters with these settings, if they can work.
    pub fn new(config: FilterConfig) -> Result<Self, FilterConfigError> {
        config.check()?;
        Ok(Self {
            intensities: IntensityModel::new(config.reject),
            config,
            labels: Vec::new(),
            grid: AngularGrid::default(),
            outliers: OutlierStage::default(),
            ground: GroundTracker::default(),
            normals: Normals::default(),
            ghosts: GhostStage::default(),
            ceiling: CeilingFilter::default(),
        })
    }

    /// Labels one scan and puts the points that stay into `kept`, which is cleared first.
    pub fn step(
        &mut self,
        points: &[Point],
        frames: &ScanFrames,
        kept: &mut Vec<Point>,
    ) -> Filtered {
        self.labels.clear();
        self.labels.resize(points.len(), Reason::Kept);

        self.crop(points, &frames.base_from_lidar);
        if self.config.outliers || self.config.ghosts {
            self.grid.build(points, &self.labels);
        }
        let (footprint_from_lidar, ground) = self.find_ground(points, frames);
        if self.config.outliers {
            let sigmas = self.config.outlier_sigmas;
            self.outliers
                .label(&self.grid, points, sigmas, &mut self.labels);
        }
        let intensity = self.filter_intensity(points, footprint_from_lidar.as_ref());
        let mut mirrors = 0;
        let mut ceiling_m = None;
        if let Some(footprint_from_lidar) = &footprint_from_lidar {
            if self.config.ghosts {
                mirrors = self.ghosts.label(
                    &self.grid,
                    points,
                    footprint_from_lidar,
                    self.config.reject,
                    &mut self.labels,
                );
            }
            if self.config.ceiling {
                ceiling_m = self
                    .ceiling
                    .label(points, footprint_from_lidar, &mut self.labels);
            }
        }
        compact(points, &self.labels, kept);
        Filtered {
            counts: RemovalCounts::of(&self.labels),
            footprint_from_lidar,
            ground,
            intensity,
            mirrors,
            ceiling_m,
        }
    }

    /// Why each point of the last scan was kept or went, in the scan's order.
    pub fn labels(&self) -> &[Reason] {
        &self.labels
    }

    /// What these filters are set to.
    pub fn config(&self) -> &FilterConfig {
        &self.config
    }

    /// What the reject range has been learnt to be; the fixed one unless
    /// [`FilterConfig::adaptive_reject`] is on.
    pub fn intensity_model(&self) -> &IntensityModel {
        &self.intensities
    }

    fn crop(&mut self, points: &[Point], base_from_lidar: &Pose) {
        label_non_finite(points, &mut self.labels);
        for body in &self.config.body {
            label_self_hits(points, body, base_from_lidar, &mut self.labels);
        }
        let (near_m, far_m) = (self.config.near_m, self.config.far_m);
        label_range(points, near_m, far_m, &mut self.labels);
    }

    fn find_ground(&mut self, points: &[Point], frames: &ScanFrames) -> (Option<Pose>, GroundUse) {
        let by_ground = matches!(
            self.config.intensity,
            IntensityMode::Naive | IntensityMode::Normal
        );
        if !(by_ground || self.config.ghosts || self.config.ceiling) {
            return (frames.footprint_from_lidar, GroundUse::NotNeeded);
        }
        match &frames.footprint_from_lidar {
            Some(given) if Height::from_pose(given).is_some() => (Some(*given), GroundUse::Given),
            _ => {
                let estimate = self.ground.step(points, &self.labels);
                let ground = GroundUse::Found(estimate.source);
                (estimate.footprint_from_lidar, ground)
            }
        }
    }

    fn filter_intensity(
        &mut self,
        points: &[Point],
        footprint_from_lidar: Option<&Pose>,
    ) -> IntensityUse {
        let FilterConfig {
            intensity,
            reject,
            adaptive_reject,
            ground_margin_m,
            ..
        } = self.config;
        if intensity == IntensityMode::None {
            return IntensityUse::Off;
        }
        if !has_signal(points, reject, &self.labels) {
            return IntensityUse::NoSignal;
        }
        let height = footprint_from_lidar.and_then(Height::from_pose);
        if adaptive_reject {
            self.intensities
                .learn(points, height, ground_margin_m, &self.labels);
        }
        let labels = &mut self.labels;
        match (intensity, height) {
            (IntensityMode::None | IntensityMode::Intensity, _) if adaptive_reject => {
                label_weak_by_model(points, &self.intensities, None, ground_margin_m, labels);
            }
            (IntensityMode::None | IntensityMode::Intensity, _) => {
                label_weak(points, reject, labels);
            }
            (_, None) => return IntensityUse::NoGround,
            (IntensityMode::Naive, height @ Some(_)) if adaptive_reject => {
                label_weak_by_model(points, &self.intensities, height, ground_margin_m, labels);
            }
            (IntensityMode::Naive, Some(height)) => {
                label_weak_above_ground(points, reject, height, ground_margin_m, labels);
            }
            (IntensityMode::Normal, Some(height)) => self.filter_by_normal(points, height),
        }
        IntensityUse::Ran
    }

    /// Suspects whose normal is not the ground's go. Where a suspect has no normal, its neighbours
    /// too few or on one line, its height decides.
    fn filter_by_normal(&mut self, points: &[Point], height: Height) {
        let config = &self.config;
        self.normals.prepare(points, &self.labels);
        for (point, label) in points.iter().zip(&mut self.labels) {
            let position = point.position();
            let reject = if config.adaptive_reject {
                self.intensities.reject_at(position)
            } else {
                config.reject
            };
            if !label.is_kept() || !reject.contains(point.intensity) {
                continue;
            }
            let is_ground = match self.normals.at(position) {
                Some(normal) => dot(normal, height.up).abs() > 1.0 - config.normal_epsilon,
                None => height.of(position) < config.ground_margin_m,
            };
            if !is_ground {
                *label = Reason::Suspect;
            }
        }
    }
}
