//! One scan after another: scale, guess, deskew, reduce, align, judge, remember.

use hachi_cloud::VoxelGrid;
use hachi_hal::{ImuSample, OdometrySample, Point, Pose, ScanHeader, Stamp, Vector3};
use hachi_registration::{
    Chain, Fit, Increment, Kernel, LocalMap, LocalMapConfig, MovingAligner, MovingConfig, Preparer,
    SurfaceCloud, SurfacePoint, TimedSurface,
};

use crate::agility::LearntAgility;
use crate::condition::{Condition, Doubt};
use crate::config::OdometryConfig;
use crate::measured::{GyroBias, from_gyroscope, from_odometry};
use crate::motion::ScanMotion;
use crate::news::News;
use crate::scale::Scale;
use crate::search::Search;
use crate::timing::Timing;

/// Fewer reduced points than this fix no pose.
const LEAST_POINTS: usize = 30;

/// Of the points that have a surface near them, this share of the usual must lie on it. Points
/// that have none say nothing: they are in a room that was not seen before. A scan laid wrongly
/// into a known room has surfaces near most points, and few points on them.
const USUAL_SHARE: f64 = 0.7;

/// Fewer points than this with a surface near them place nothing.
const LEAST_OVERLAP: f64 = 0.25;

/// A scan that had to be searched for, or comes after scans that are missing, is believed only if it
/// fits nearly as well as usual. On simulated hand-held, shaken walks with four of five scans
/// missing, right placements mostly reach 0.93 of the usual and more, wrong ones 0.65 to 0.9.
const CERTAIN_SHARE: f64 = 0.92;
const CERTAIN_OVERLAP: f64 = 0.6;

/// Scans placed in new surroundings before these become the map.
const SETTLED: usize = 3;

/// Points of one scan that the map takes in, evenly picked: a 64-beam scan has more than its cells
/// can tell apart.
const REMEMBERED_POINTS: usize = 40_000;

/// The map's origin follows when the robot is this far from it: single precision keeps 0.03 mm.
const ORIGIN_RANGE_M: f64 = 500.0;

/// Far cells are dropped each time the robot has gone this far.
const TIDY_EVERY_M: f64 = 10.0;

/// One scan and what else was measured while it was taken.
#[derive(Debug, Clone, Copy)]
pub struct ScanInput<'a> {
    /// What is true of all points.
    pub header: &'a ScanHeader,
    /// The points that filters left, sensor frame.
    pub points: &'a [Point],
    /// Inertial samples from before the last scan's end to after this one's, in time order; empty
    /// without an IMU.
    pub imu: &'a [ImuSample],
    /// Likewise from legs or wheels.
    pub odometry: &'a [OdometrySample],
}

impl<'a> ScanInput<'a> {
    /// A scan with nothing else.
    pub fn new(header: &'a ScanHeader, points: &'a [Point]) -> Self {
        Self {
            header,
            points,
            imu: &[],
            odometry: &[],
        }
    }
}

/// What a scan was expected by, besides the scans before it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Guess {
    /// The speed of the scans before it.
    #[default]
    Speed,
    /// Turning rates that span it.
    Gyroscope,
    /// External odometry that spans it.
    Odometry,
}

/// Where the sensor was at a scan's last point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Estimate {
    /// The scan's end.
    pub stamp: Stamp,
    /// Takes points of the LiDAR's frame to the odometry frame, which is the first scan's.
    pub odom_from_lidar: Pose,
    /// How far to trust it.
    pub condition: Condition,
    /// The numbers behind the condition.
    pub fit: Fit,
    /// What it was expected by. What was given and does not span the scan is not used.
    pub guess: Guess,
    /// The scan did not fit where it was expected, and was looked for farther.
    pub searched: bool,
}

/// LiDAR odometry; one call a scan.
pub struct Odometry {
    config: OdometryConfig,
    scale: Scale,
    grid: VoxelGrid,
    preparer: Preparer,
    aligner: MovingAligner,
    search: Search,
    map: LocalMap,
    /// Surroundings that do not fit the map, while they are being confirmed, and for how many
    /// scans they were.
    elsewhere: Option<(LocalMap, usize)>,
    chain: Chain,
    agility: LearntAgility,
    bias: GyroBias,
    motion: ScanMotion,
    source: SurfaceCloud,
    timed: Vec<TimedSurface>,
    deskewed: Vec<[f32; 3]>,
    shares: Vec<f32>,
    increments: Vec<Increment>,
    guess: Guess,
    /// Where the map's origin lies in the odometry frame.
    origin: Vector3,
    last_end: Option<Stamp>,
    /// Share of the paired points that lie on their surface, averaged over good scans.
    usual_fit_share: f64,
    good_fits: usize,
    misfits: usize,
    news: News,
    tidied_at: Vector3,
}

impl Odometry {
    /// Starts at the origin of the odometry frame.
    pub fn new(config: OdometryConfig) -> Self {
        Self {
            scale: Scale::new(config.target_points),
            grid: VoxelGrid::default(),
            preparer: Preparer::default(),
            aligner: MovingAligner::default(),
            search: Search::default(),
            map: LocalMap::new(LocalMapConfig {
                cell_m: 1.0,
                range_m: config.map_range_m,
            }),
            elsewhere: None,
            chain: Chain::starting_at(Pose::identity()),
            agility: LearntAgility::default(),
            bias: GyroBias::default(),
            motion: ScanMotion::default(),
            source: SurfaceCloud::default(),
            timed: Vec::with_capacity(2 * config.target_points),
            deskewed: Vec::new(),
            shares: Vec::new(),
            increments: Vec::new(),
            guess: Guess::default(),
            origin: Vector3::zeros(),
            last_end: None,
            usual_fit_share: 0.8,
            good_fits: 1,
            misfits: 0,
            news: News::default(),
            tidied_at: Vector3::zeros(),
            config,
        }
    }

    /// Places one scan.
    pub fn step(&mut self, input: &ScanInput<'_>) -> Estimate {
        let first = self.map.is_empty();
        if first {
            self.choose_scale(input.points);
        }
        let timing = Timing::of(
            input.header,
            self.last_end.replace(input.header.end),
            self.config.knot_interval_s,
        );
        self.guess(input, &timing, first);
        self.reduce(input, &timing);
        if self.source.len() < LEAST_POINTS {
            let doubt = Doubt::FewPoints {
                points: self.source.len(),
            };
            return self.carried(input.header.end, doubt);
        }
        if first {
            self.remember(input, &timing);
            return self.estimate(input.header.end, Condition::Ok, Fit::default(), false);
        }
        let (fit, searched) = self.place_on_map();
        if self.is_poor(&fit) {
            return self.misfit(input, &timing, fit);
        }
        self.misfits = 0;
        self.elsewhere = None;
        if (searched || timing.lead_s > 0.0) && self.is_dubious(&fit) {
            // Not remembered: what is laid wrongly into the map would make itself fit.
            let doubt = Doubt::PoorFit {
                fit_share: fit.fit_share,
            };
            return self.estimate(input.header.end, Condition::Degraded(doubt), fit, searched);
        }
        self.good_fits += 1;
        let fitting = fit.fit_share / fit.inlier_share;
        let rate = (1.0 / self.good_fits as f64).max(0.05);
        self.usual_fit_share += rate * (fitting - self.usual_fit_share);
        self.learn_agility(&timing, searched);
        self.learn_bias(&timing);
        let (pose, end) = (self.chain.last(), input.header.end);
        if self.news.are_seen(self.map.scans(), pose, end) {
            self.remember(input, &timing);
        }
        self.scale.follow(self.source.len());
        let open = fit.degeneracy;
        let condition = if open.any() && self.guess != Guess::Odometry {
            Condition::Degraded(Doubt::Unobserved {
                translations: open.translations,
                rotations: open.rotations,
            })
        } else {
            Condition::Ok
        };
        self.estimate(input.header.end, condition, fit, searched)
    }

    /// Takes a point of the last scan, measured at `share` of it, to the frame of the scan's end.
    pub fn deskew(&self, point: [f32; 3], share: f32) -> [f32; 3] {
        self.motion.to_end(point, share)
    }

    /// The last scan as it was aligned, in the LiDAR's frame at the scan's end.
    pub fn reduced_scan(&self) -> &[SurfacePoint] {
        &self.source.points
    }

    fn choose_scale(&mut self, points: &[Point]) {
        self.scale
            .search(&mut self.grid, points.iter().map(Point::position));
        let cell_m = self.config.cell_m.unwrap_or(self.cell_for_scale());
        self.map = LocalMap::new(LocalMapConfig {
            cell_m,
            range_m: self.config.map_range_m,
        });
    }

    fn cell_for_scale(&self) -> f32 {
        (2.0 * self.scale.voxel_m()).clamp(0.5, 1.0)
    }

    /// Lays out the chain over the scan, where speed and measured motions say it went.
    fn guess(&mut self, input: &ScanInput<'_>, timing: &Timing, first: bool) {
        let knot = |i: usize| timing.knot(i);
        self.increments.clear();
        self.guess = Guess::Speed;
        if first {
            return;
        }
        if !input.odometry.is_empty() {
            let out = &mut self.increments;
            from_odometry(input.odometry, knot, timing.intervals, &self.config, out);
            if !out.is_empty() {
                self.guess = Guess::Odometry;
            }
        }
        if self.increments.is_empty() && !input.imu.is_empty() {
            let out = &mut self.increments;
            from_gyroscope(
                input.imu,
                knot,
                timing.intervals,
                &self.bias,
                &self.config,
                out,
            );
            if !out.is_empty() {
                self.guess = Guess::Gyroscope;
            }
        }
        self.chain
            .extend(timing.lead_s, timing.intervals, timing.span_s);
        self.chain.guess_increments(&self.increments);
        if timing.has_point_times {
            self.motion
                .follow(timing.own(self.chain.poses()), timing.from);
        }
    }

    /// Deskews by the guess, reduces, and keeps every reduced point with its own time.
    fn reduce(&mut self, input: &ScanInput<'_>, timing: &Timing) {
        let motion = &self.motion;
        self.shares.clear();
        self.deskewed.clear();
        if timing.has_point_times {
            let share = |p: &Point| p.time_offset_ns as f32 * timing.per_ns;
            self.shares.extend(input.points.iter().map(share));
            let points = input.points.iter().zip(&self.shares);
            self.deskewed
                .extend(points.map(|(p, s)| motion.to_end(p.position(), *s)));
        } else {
            self.shares.resize(input.points.len(), 1.0);
            self.deskewed
                .extend(input.points.iter().map(Point::position));
        }
        let timed = self
            .deskewed
            .iter()
            .copied()
            .zip(self.shares.iter().copied());
        self.preparer
            .prepare(timed, self.scale.voxel_m(), &mut self.source);
        let lead = timing.leads();
        let own = timing.intervals - lead;
        let from = timing.from as f32;
        self.timed.clear();
        self.timed.extend(
            self.source
                .points
                .iter()
                .zip(&self.source.times)
                .map(|(p, &share)| {
                    let along = (from + share * (1.0 - from)).clamp(0.0, 1.0) * own as f32;
                    let interval = (along as u32).min(own as u32 - 1);
                    TimedSurface {
                        surface: SurfacePoint {
                            position: motion.from_end(p.position, share),
                            normal: motion.direction_from_end(p.normal, share),
                        },
                        interval: interval + lead as u32,
                        share: along - interval as f32,
                    }
                }),
        );
    }

    /// Aligns with the map; if that fails, looks farther and aligns again.
    fn place_on_map(&mut self) -> (Fit, bool) {
        let before = self.chain.clone();
        let mut config = self.moving_config(self.map.cell_m(), 1.0);
        config.agility = self
            .agility
            .agility(&config.agility, before.poses().len() - 1);
        let fit = self.aligner.align(
            &self.timed,
            &self.map,
            &mut self.chain,
            &self.increments,
            &config,
        );
        if !self.is_poor(&fit) {
            return (fit, false);
        }
        let (last, expected) = (before.poses()[0], *before.last());
        self.search
            .around(&self.source.points, &self.map, &last, &expected);
        // What got the sensor here was no ordinary acceleration.
        let config = self.moving_config(self.map.cell_m(), 10.0);
        let mut best = fit;
        for place in 0..self.search.found().len() {
            let mut chain = before.clone();
            chain.guess_end(&self.search.found()[place].1);
            let again = self
                .aligner
                .align(&self.timed, &self.map, &mut chain, &[], &config);
            if again.fit_share > best.fit_share && !self.is_poor(&again) {
                self.chain = chain;
                best = again;
            }
        }
        (best, true)
    }

    fn moving_config(&self, cell_m: f32, agility: f64) -> MovingConfig {
        let mut config = MovingConfig {
            reach_m: cell_m,
            first_reach_m: 1.9 * cell_m,
            kernel: Kernel::GemanMcClure {
                scale_m: 0.2 * cell_m,
            },
            fits_within_m: 0.1 * cell_m,
            max_iterations: 12,
            epsilon: 1e-3,
            agility: self.config.agility,
            degeneracy_threshold: self.config.degeneracy_threshold,
        };
        config.agility.between_scans = agility;
        config
    }

    fn is_poor(&self, fit: &Fit) -> bool {
        fit.pairs < LEAST_POINTS
            || fit.inlier_share < LEAST_OVERLAP
            || fit.fit_share < USUAL_SHARE * self.usual_fit_share * fit.inlier_share
    }

    /// Too good for a misfit, and yet so much worse than usual that, where the scan could not be
    /// expected here, it may be a wrong place that resembles the right one.
    fn is_dubious(&self, fit: &Fit) -> bool {
        fit.fit_share < CERTAIN_SHARE * self.usual_fit_share * fit.inlier_share
            || fit.inlier_share < CERTAIN_OVERLAP
    }

    /// The scan fits nowhere in the map: perhaps it fits the misfits before it.
    fn misfit(&mut self, input: &ScanInput<'_>, timing: &Timing, poor: Fit) -> Estimate {
        self.misfits += 1;
        self.agility.forget();
        let end = input.header.end;
        if let Some((mut map, scans)) = self.elsewhere.take() {
            let config = self.moving_config(map.cell_m(), 10.0);
            let mut chain = self.chain.clone();
            chain.guess_end(&chain.poses()[0].clone());
            let mut fit =
                self.aligner
                    .align(&self.timed, &map, &mut chain, &self.increments, &config);
            if self.is_poor(&fit) {
                let here = chain.poses()[0];
                self.search.around(&self.source.points, &map, &here, &here);
                chain.guess_end(&self.search.found()[0].1);
                fit = self
                    .aligner
                    .align(&self.timed, &map, &mut chain, &[], &config);
            }
            if !self.is_poor(&fit) {
                self.chain = chain;
                std::mem::swap(&mut self.map, &mut map);
                self.remember(input, timing);
                if scans + 1 >= SETTLED {
                    self.misfits = 0;
                } else {
                    std::mem::swap(&mut self.map, &mut map);
                    self.elsewhere = Some((map, scans + 1));
                }
                let doubt = Doubt::NewPlace { scans: scans + 1 };
                return self.estimate(end, Condition::Degraded(doubt), fit, true);
            }
        }
        let doubt = Doubt::PoorFit {
            fit_share: poor.fit_share,
        };
        let estimate = Estimate {
            fit: poor,
            searched: true,
            ..self.carried(end, doubt)
        };
        let config = LocalMapConfig {
            cell_m: self.map.cell_m(),
            range_m: self.config.map_range_m,
        };
        let mut map = LocalMap::new(config);
        std::mem::swap(&mut self.map, &mut map);
        self.remember(input, timing);
        std::mem::swap(&mut self.map, &mut map);
        self.elsewhere = Some((map, 1));
        estimate
    }

    /// Goes on where the guess says, and forgets the speed: after a misfit it is worth nothing.
    fn carried(&mut self, stamp: Stamp, doubt: Doubt) -> Estimate {
        let pose = *self.chain.poses().first().unwrap_or(self.chain.last());
        self.chain = Chain::starting_at(pose);
        let condition = if self.misfits > self.config.lost_after {
            Condition::Lost(doubt)
        } else {
            Condition::Degraded(doubt)
        };
        self.estimate(stamp, condition, Fit::default(), true)
    }

    /// Adds the scan, deskewed by what was found, to the map.
    fn remember(&mut self, input: &ScanInput<'_>, timing: &Timing) {
        if timing.has_point_times && self.chain.poses().len() > 1 {
            self.motion
                .follow(timing.own(self.chain.poses()), timing.from);
        }
        let (motion, pose) = (&self.motion, self.chain.last().cast::<f32>());
        let (rotation, shift) = (pose.rotation.to_rotation_matrix(), pose.translation.vector);
        let timed = timing.has_point_times;
        let stride = input.points.len().div_ceil(REMEMBERED_POINTS).max(1);
        let picked = input.points.iter().zip(&self.shares).step_by(stride);
        self.map.insert(picked.map(|(p, &share)| {
            let p = if timed {
                motion.to_end(p.position(), share)
            } else {
                p.position()
            };
            (rotation * nalgebra::Vector3::from(p) + shift).into()
        }));
        self.news.remember(*self.chain.last(), input.header.end);
        self.tidy();
    }

    /// Keeps the map small, near its origin and at the scene's scale.
    fn tidy(&mut self) {
        let here = self.chain.last().translation.vector;
        if (here - self.tidied_at).norm() < TIDY_EVERY_M {
            return;
        }
        let stretches = (self.config.map_memory_m / TIDY_EVERY_M).ceil();
        self.map
            .keep_around(here.cast::<f32>().into(), stretches as u32);
        self.tidied_at = here;
        let wanted = self.cell_for_scale();
        let change = wanted / self.map.cell_m();
        if self.config.cell_m.is_none() && !(0.6..1.7).contains(&change) {
            self.map.rescale(wanted);
        }
        if here.norm() > ORIGIN_RANGE_M {
            let edge = f64::from(self.map.cell_m());
            let cells = here.map(|c| (c / edge).round());
            self.map
                .shift_origin([cells.x as i32, cells.y as i32, cells.z as i32]);
            let shift = cells * edge;
            self.chain.translate(&-shift);
            self.agility.translate(&-shift);
            self.news.translate(&-shift);
            self.origin += shift;
            self.tidied_at -= shift;
        }
    }

    fn learn_agility(&mut self, timing: &Timing, searched: bool) {
        if searched || timing.lead_s > 0.0 {
            self.agility.forget();
            return;
        }
        let poses = self.chain.poses();
        self.agility.learn(poses[poses.len() / 2], timing.span_s);
    }

    fn learn_bias(&mut self, timing: &Timing) {
        if self.guess != Guess::Gyroscope {
            return;
        }
        let integrated = self
            .increments
            .iter()
            .fold(hachi_hal::Rotation::identity(), |turn, i| {
                turn * i.motion.rotation
            });
        let registered = self.chain.poses()[0].inv_mul(self.chain.last()).rotation;
        self.bias.learn(&integrated, &registered, timing.span_s);
    }

    fn estimate(&self, stamp: Stamp, condition: Condition, fit: Fit, searched: bool) -> Estimate {
        let mut odom_from_lidar = *self.chain.last();
        odom_from_lidar.translation.vector += self.origin;
        Estimate {
            stamp,
            odom_from_lidar,
            condition,
            fit,
            guess: self.guess,
            searched,
        }
    }
}
