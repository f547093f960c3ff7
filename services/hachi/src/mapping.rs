//! From scans to a trajectory and a map: the flow, stage by stage.
//!
//! In: scans with what else was measured. Out: a pose for each scan, a map, a report. Read
//! [`Mapping::step`] first; [`run`] feeds it from any recording, or from the simulated robot.

use std::path::Path;
use std::time::{Duration, Instant};

use hachi_cloud::{Filters, ScanFrames};
use hachi_hal::{ImuSample, OdometrySample, Point, Pose, ScanHeader, Stamp};
use hachi_odometry::{Estimate, Odometry, ScanInput};
use hachi_slam::{Slam, SlamEstimate};
use hachi_trajectory::Trajectory;
use indicatif::ProgressBar;

use crate::config::{MappingConfig, MotionInput};
use crate::exit::Failure;
use crate::interrupt::Cancelled;
use crate::map_builder::MapBuilder;
use crate::motion_samples::MotionSamples;
use crate::record::RunRecord;
use crate::recording::ScanSource;
use crate::report::{Report, RunState, StageRecorder};
use crate::slam_stage::SlamStage;

const STAGES: [&str; 5] = ["read", "filter", "odometry", "slam", "map"];
const READ: usize = 0;
const FILTER: usize = 1;
const ODOMETRY: usize = 2;
const SLAM: usize = 3;
const MAP: usize = 4;

/// A scan joins the map when the sensor has moved this far since the last that did.
const MAPPED_EVERY_M: f64 = 0.2;
/// Or turned this far: 5 degrees.
const MAPPED_EVERY_RAD: f64 = 0.087;

/// Points of one scan that join the map, evenly picked: a 64-beam scan has four times as many, and
/// the next scan fills in between.
const MAPPED_POINTS: usize = 30_000;

/// The pipeline.
pub struct Mapping {
    config: MappingConfig,
    frames: ScanFrames,
    filters: Filters,
    odometry: Odometry,
    kept: Vec<Point>,
    slam: Option<SlamStage>,
    map: MapBuilder,
    record: RunRecord,
    /// Where the last scan that the map took in was.
    mapped_at: Option<Pose>,
    times: StageRecorder,
}

impl Mapping {
    /// A pipeline with these settings. What the map holds beyond a few megabytes is kept on the disk
    /// of the folder `scratch`.
    ///
    /// # Errors
    /// A setting that no filter can work with.
    pub fn new(config: MappingConfig, scratch: &Path) -> Result<Self, Failure> {
        let filters = Filters::new(config.filter.clone())
            .map_err(|error| Failure::new(error, "correct the [filter] section"))?;
        Ok(Self {
            frames: ScanFrames {
                base_from_lidar: config.base_from_lidar.pose(),
                footprint_from_lidar: None,
            },
            filters,
            odometry: Odometry::new(config.odometry.clone()),
            kept: Vec::new(),
            slam: None,
            map: MapBuilder::new(config.map.voxel_m, scratch),
            record: RunRecord::new(true),
            mapped_at: None,
            times: StageRecorder::new(&STAGES),
            config,
        })
    }

    /// With SLAM: loops close, and the map is made of its submaps.
    #[must_use]
    pub fn with_slam(mut self, slam: Slam) -> Self {
        let base_from_lidar = self.frames.base_from_lidar;
        self.slam = Some(SlamStage::new(slam, base_from_lidar));
        self
    }

    /// Where the ground is for the scans that follow, as legs feel it; else filters look for it.
    pub fn stand_on(&mut self, footprint_from_base: Option<Pose>) {
        let base_from_lidar = self.frames.base_from_lidar;
        self.frames.footprint_from_lidar = footprint_from_base.map(|f| f * base_from_lidar);
    }

    /// One scan: filter, place, remember.
    ///
    /// # Errors
    /// Its stamp is not after the last scan's; the scan is left out.
    pub fn step(
        &mut self,
        header: &ScanHeader,
        points: &[Point],
        imu: &[ImuSample],
        odometry: &[OdometrySample],
    ) -> Estimate {
        let start = Instant::now();
        let filtered = self.filters.step(points, &self.frames, &mut self.kept);
        let filtered_at = Instant::now();
        let input = ScanInput {
            header,
            points: &self.kept,
            imu,
            odometry,
        };
        let estimate = self.odometry.step(&input);
        let placed_at = Instant::now();
        let stage = match &mut self.slam {
            Some(slam) => {
                slam.step(header, &self.kept, &self.odometry, &estimate);
                SLAM
            }
            None => {
                self.extend_map(header, &estimate);
                MAP
            }
        };
        self.times.stage(FILTER, filtered_at - start);
        self.times.stage(ODOMETRY, placed_at - filtered_at);
        self.times.stage(stage, placed_at.elapsed());
        let pose = self.map_from_base(&estimate.odom_from_lidar);
        self.record
            .account(points.len(), &filtered, &estimate, pose);
        estimate
    }

    /// `map_from_base` for a pose of the odometry: the map frame is the base's first pose.
    fn map_from_base(&self, odom_from_lidar: &Pose) -> Pose {
        let base_from_lidar = self.frames.base_from_lidar;
        base_from_lidar * odom_from_lidar * base_from_lidar.inverse()
    }

    fn extend_map(&mut self, header: &ScanHeader, estimate: &Estimate) {
        // A scan whose place is a guess would blur the map, one from the same place adds nothing.
        let fresh = self.mapped_at.is_none_or(|last| {
            let moved = last.inv_mul(&estimate.odom_from_lidar);
            moved.translation.vector.norm() > MAPPED_EVERY_M
                || moved.rotation.angle() > MAPPED_EVERY_RAD
        });
        if !fresh || !estimate.condition.is_ok() {
            return;
        }
        self.mapped_at = Some(estimate.odom_from_lidar);
        let map_from_lidar = self.frames.base_from_lidar * estimate.odom_from_lidar;
        let per_ns = 1.0 / (header.end - header.start).max(1) as f32;
        let stride = self.kept.len().div_ceil(MAPPED_POINTS).max(1);
        for point in self.kept.iter().step_by(stride) {
            let share = if header.has_point_times {
                point.time_offset_ns as f32 * per_ns
            } else {
                1.0
            };
            let deskewed = self.odometry.deskew(point.position(), share).map(f64::from);
            let placed = map_from_lidar * nalgebra::Point3::from(deskewed);
            self.map
                .add([placed.x, placed.y, placed.z], point.intensity);
        }
    }

    /// The end of a recording: with SLAM, the work under way is finished, and trajectory and map are
    /// made anew from all that was learnt.
    ///
    /// # Errors
    /// A submap can't be read back.
    pub fn finish(&mut self) -> Result<(), Failure> {
        let Some(slam) = &mut self.slam else {
            return Ok(());
        };
        slam.finish();
        self.record.trajectory = slam.trajectory();
        slam.build_map(&mut self.map)
    }

    /// The poses so far by odometry alone, in the frame of the first.
    pub fn odometry(&self) -> Trajectory {
        self.slam
            .as_ref()
            .map_or_else(|| self.record.trajectory.clone(), SlamStage::odometry)
    }

    /// Where the last scan was on the map, with SLAM.
    pub fn place(&self) -> Option<SlamEstimate> {
        self.slam.as_ref().and_then(SlamStage::place)
    }

    /// SLAM, if it is part of the flow.
    pub fn slam(&self) -> Option<&SlamStage> {
        self.slam.as_ref()
    }

    /// The poses so far, `map_from_base`.
    pub fn trajectory(&self) -> &Trajectory {
        &self.record.trajectory
    }

    /// The map so far.
    pub fn map(&self) -> &MapBuilder {
        &self.map
    }

    /// The map, of a run that is over.
    pub fn into_map(self) -> MapBuilder {
        self.map
    }

    /// The points of the last scan that the filters left.
    pub fn kept(&self) -> &[Point] {
        &self.kept
    }

    /// Why each point of the last scan was kept or went.
    pub fn filters(&self) -> &Filters {
        &self.filters
    }

    /// What was done so far.
    pub fn report(&self) -> Report {
        let mut report = self.record.report(&self.record.trajectory);
        if let Some(slam) = &self.slam {
            slam.fill(&mut report);
        }
        self.times.fill(&mut report);
        report
    }

    /// Which motion input the settings ask for.
    pub fn motion_input(&self) -> MotionInput {
        self.config.motion
    }
}

/// How a run over a recording ended.
#[derive(Debug)]
pub enum Ended {
    /// At the end of the recording.
    Finished,
    /// Because somebody asked for it.
    Interrupted,
    /// Because the recording can't be read further, or what was to be recorded could not be kept.
    Failed(Failure),
}

/// Feeds a whole recording through the pipeline. What was done until an end of any kind stays.
pub fn run(
    mapping: &mut Mapping,
    source: &mut dyn ScanSource,
    motion: &mut MotionSamples,
    cancelled: &Cancelled,
    progress: &ProgressBar,
    mut each: impl FnMut(&Mapping, &ScanHeader, &Estimate),
) -> Ended {
    let mut points = Vec::new();
    let mut last_end = Stamp::from_nanos(i64::MIN);
    loop {
        if cancelled.is_cancelled() {
            return Ended::Interrupted;
        }
        let start = Instant::now();
        let header = match source.next_scan(&mut points) {
            Ok(Some(header)) => header,
            Ok(None) => return Ended::Finished,
            Err(failure) => return Ended::Failed(failure),
        };
        let read: Duration = start.elapsed();
        if header.end <= last_end {
            mapping.record.count_repeated();
            continue;
        }
        motion.read_until(last_end, header.end);
        last_end = header.end;
        mapping.stand_on(motion.footprint_from_base(header.end));
        let started = Instant::now();
        let estimate = mapping.step(&header, &points, motion.imu(), motion.odometry());
        mapping.times.stage(READ, read);
        mapping.times.scan(started.elapsed());
        each(mapping, &header, &estimate);
        progress.set_message(estimate.condition.name());
        progress.inc(1);
    }
}

/// The state of a report after a run.
pub fn state_of(ended: &Ended) -> RunState {
    match ended {
        Ended::Finished => RunState::Finished,
        Ended::Interrupted => RunState::Interrupted,
        Ended::Failed(_) => RunState::InputFailed,
    }
}
