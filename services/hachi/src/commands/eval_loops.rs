//! `hachi eval loops`: how well places are recognised in a recording with known positions.
//!
//! In: keyframe scans and where they were taken. Out: precision and recall over all thresholds.
//! Each scan is levelled, described, looked for among the earlier ones and added to them, one
//! after the other as on a robot; only the levelled scans that choose the grid are held.

use std::fmt::Write as _;
use std::path::Path;
use std::time::{Duration, Instant};

use hachi_bridge::ScanFiles;
use hachi_hal::{Point, Pose, Stamp};
use hachi_place::precision_recall::{Curve, Detection, Outcome, distance_m, may_match, revisits};
use hachi_place::{
    Database, DatabaseConfig, Describer, DescriberConfig, Descriptor, Ground, Leveller, Match,
    Profile, leveller,
};
use hachi_trajectory::{Trajectory, read};
use serde::Serialize;

use crate::cli::loops::EvalLoopsArguments;
use crate::exit::Failure;
use crate::precision_recall_picture::Picture;
use crate::{output, progress};

/// Scans that choose the grid.
const CHOOSING: usize = 10;
/// How far a scan's time may be from its pose's: half a turn at 10 Hz.
const MAX_DIFFERENCE_S: f64 = 0.05;

#[derive(Debug, Serialize)]
struct Summary {
    descriptor: &'static str,
    auc: f64,
    recall_at_full_precision: f64,
    /// Least similarity of a detection there; none if the most alike match of all is wrong.
    threshold: Option<f64>,
    keyframes: usize,
    loops: usize,
    /// Describing and searching.
    ms_per_keyframe: f64,
    descriptor_ms: f64,
    search_ms: f64,
    levelling_ms: f64,
    max_range_m: f32,
    radius_m: f64,
    exclude: usize,
    unreadable_scans: usize,
}

/// Measures, draws, prints.
///
/// # Errors
/// Scans or poses that can't be read or do not belong together, a picture that can't be written.
pub fn run(arguments: &EvalLoopsArguments) -> Result<(), Failure> {
    let mut scans = ScanFiles::open(&arguments.input)
        .map_err(|error| Failure::new(error, "give a folder of scans"))?;
    let poses = read_poses(&arguments.poses)?;
    let placing = Placing::new(&scans, &poses, arguments)?;
    let mut run = Run::new(arguments);
    let bar = progress::bar(Some(scans.len() as u64), "scans");
    let mut points = Vec::new();
    for index in 0.. {
        match scans.next_scan(&mut points) {
            Ok(None) => break,
            Ok(Some((header, _))) => {
                if let Some(pose) = placing.pose(index, header.end) {
                    run.take(&points, pose)?;
                }
            }
            Err(error) => {
                run.unreadable += 1;
                tracing::warn!("{error}; it is left out");
            }
        }
        bar.inc(1);
    }
    run.choose_and_go_on()?;
    bar.finish_and_clear();
    if run.positions.is_empty() {
        return Err(Failure::new(
            format_args!("no scan of {} could be used", arguments.input.display()),
            "check that poses and scans belong together",
        ));
    }
    let (curve, summary) = run.finish();
    if let Some(path) = &arguments.plot {
        draw(path, arguments, &curve, &summary)?;
    }
    if arguments.json {
        output::json(&summary)
    } else {
        output::text(&summary.for_people())
    }
}

fn read_poses(path: &Path) -> Result<Trajectory, Failure> {
    let loaded = read::from_file(path).map_err(|error| {
        Failure::new(
            format_args!("{}: {error}", path.display()),
            "give poses in TUM, KITTI or EuRoC format",
        )
    })?;
    Ok(loaded.trajectory)
}

/// Which pose is a scan's.
enum Placing<'a> {
    ByIndex(&'a [Pose]),
    ByTime(&'a [Stamp], &'a [Pose]),
}

impl<'a> Placing<'a> {
    fn new(
        scans: &ScanFiles,
        trajectory: &'a Trajectory,
        arguments: &EvalLoopsArguments,
    ) -> Result<Self, Failure> {
        let poses = trajectory.poses();
        if poses.len() == scans.len() {
            return Ok(Self::ByIndex(poses));
        }
        trajectory
            .stamps()
            .map(|stamps| Self::ByTime(stamps, poses))
            .ok_or_else(|| {
                Failure::new(
                    format_args!(
                        "{} has {} poses without times, {} has {} scans",
                        arguments.poses.display(),
                        poses.len(),
                        arguments.input.display(),
                        scans.len()
                    ),
                    "give one pose for each scan, or poses with times",
                )
            })
    }

    fn pose(&self, index: usize, stamp: Stamp) -> Option<&'a Pose> {
        match self {
            Self::ByIndex(poses) => poses.get(index),
            Self::ByTime(stamps, poses) => {
                let after = stamps.partition_point(|s| *s < stamp);
                let nearest = [after.checked_sub(1), Some(after)]
                    .into_iter()
                    .flatten()
                    .filter(|i| *i < stamps.len())
                    .min_by_key(|i| stamps[*i].nanos_since(stamp).unsigned_abs())?;
                let apart_s = stamps[nearest].secs_since(stamp).abs();
                (apart_s <= MAX_DIFFERENCE_S).then(|| &poses[nearest])
            }
        }
    }
}

/// The recognition, scan after scan.
struct Run<'a> {
    arguments: &'a EvalLoopsArguments,
    leveller: Leveller,
    /// Of the last scan whose ground was seen.
    level_from_sensor: Option<Pose>,
    /// Levelled scans until the grid is chosen.
    held: Vec<Vec<[f32; 4]>>,
    describer: Option<Describer>,
    database: Database,
    views: Vec<Descriptor>,
    matches: Vec<Match>,
    positions: Vec<[f64; 3]>,
    best: Vec<Option<Match>>,
    levelling: Duration,
    describing: Duration,
    searching: Duration,
    unreadable: usize,
}

impl<'a> Run<'a> {
    fn new(arguments: &'a EvalLoopsArguments) -> Self {
        let mut config = DatabaseConfig::for_kind(arguments.descriptor.into());
        if let Some(comparison) = arguments.comparison {
            config.comparison = comparison.into();
        }
        // Every threshold is looked at afterwards.
        config.search.min_similarity = f32::MIN;
        Self {
            arguments,
            leveller: Leveller::default(),
            level_from_sensor: None,
            held: Vec::new(),
            describer: None,
            database: Database::new(config),
            views: Vec::new(),
            matches: Vec::new(),
            positions: Vec::new(),
            best: Vec::new(),
            levelling: Duration::ZERO,
            describing: Duration::ZERO,
            searching: Duration::ZERO,
            unreadable: 0,
        }
    }

    fn take(&mut self, points: &[Point], pose: &Pose) -> Result<(), Failure> {
        self.positions.push(pose.translation.vector.into());
        let mut levelled = Vec::new();
        self.level(points, &mut levelled);
        if self.describer.is_some() {
            return self.recognise(&levelled);
        }
        self.held.push(levelled);
        match self.held.len() < CHOOSING {
            true => Ok(()),
            false => self.choose_and_go_on(),
        }
    }

    fn level(&mut self, points: &[Point], levelled: &mut Vec<[f32; 4]>) {
        let start = Instant::now();
        let points: Vec<[f32; 4]> = points
            .iter()
            .map(|p| [p.x, p.y, p.z, p.intensity])
            .collect();
        let found = self.leveller.level(&points, None, levelled);
        if matches!(found.ground, Ground::Plane { .. }) {
            self.level_from_sensor = Some(found.level_from_sensor);
        } else if let Some(last) = &self.level_from_sensor {
            // The sensor's mount does not change from scan to scan.
            leveller::apply(last, &points, levelled);
        }
        self.levelling += start.elapsed();
    }

    /// Chooses the grid by the scans held, if that is still open, and recognises these.
    fn choose_and_go_on(&mut self) -> Result<(), Failure> {
        if self.describer.is_some() {
            return Ok(());
        }
        let held = std::mem::take(&mut self.held);
        let profile = self
            .arguments
            .profile
            .profile()
            .unwrap_or_else(|| Profile::for_clouds(held.iter().map(Vec::as_slice)));
        let config = DescriberConfig {
            formula: self.arguments.formula.into(),
            ..DescriberConfig::for_kind(self.arguments.descriptor.into())
        };
        self.describer = Some(Describer::new(profile, config));
        held.iter()
            .try_for_each(|levelled| self.recognise(levelled))
    }

    fn recognise(&mut self, levelled: &[[f32; 4]]) -> Result<(), Failure> {
        let Some(describer) = &mut self.describer else {
            return Ok(());
        };
        let id = self.best.len() as u64;
        let start = Instant::now();
        describer.describe_views(levelled, &mut self.views);
        let described = Instant::now();
        let accept = |earlier| may_match(id as usize, earlier as usize, self.arguments.exclude);
        self.database
            .query(&self.views, accept, 1, &mut self.matches)
            .and_then(|()| self.database.insert(id, &self.views[0]))
            .map_err(|error| Failure::new(error, "please report this"))?;
        self.describing += described - start;
        self.searching += described.elapsed();
        self.best.push(self.matches.first().copied());
        Ok(())
    }

    fn finish(self) -> (Curve, Summary) {
        let arguments = self.arguments;
        let known = revisits(&self.positions, arguments.exclude, arguments.radius_m);
        let detection = |n: usize, found: Match| Detection {
            similarity: found.similarity.into(),
            distance_m: distance_m(&self.positions[n], &self.positions[found.id as usize]),
        };
        let outcomes: Vec<Outcome> = known
            .into_iter()
            .zip(&self.best)
            .enumerate()
            .map(|(n, (is_revisit, found))| Outcome {
                detection: found.map(|found| detection(n, found)),
                is_revisit,
            })
            .collect();
        let curve = Curve::new(&outcomes, arguments.radius_m);
        let each_ms = |time: Duration| time.as_secs_f64() * 1e3 / self.positions.len() as f64;
        let full = curve.at_full_precision();
        let summary = Summary {
            descriptor: hachi_place::Kind::from(arguments.descriptor).name(),
            auc: curve.area(),
            recall_at_full_precision: full.map_or(0.0, |point| point.recall()),
            threshold: full.map(|point| point.threshold),
            keyframes: curve.keyframes(),
            loops: curve.revisits(),
            ms_per_keyframe: each_ms(self.describing + self.searching),
            descriptor_ms: each_ms(self.describing),
            search_ms: each_ms(self.searching),
            levelling_ms: each_ms(self.levelling),
            max_range_m: self.describer.map_or(0.0, |d| d.profile().max_range_m()),
            radius_m: arguments.radius_m,
            exclude: arguments.exclude,
            unreadable_scans: self.unreadable,
        };
        (curve, summary)
    }
}

impl Summary {
    fn for_people(&self) -> String {
        let mut text = String::new();
        let _ = writeln!(
            text,
            "{}: {} keyframes, {} of them revisits (within {} m, last {} left out), grid to {} m",
            self.descriptor,
            self.keyframes,
            self.loops,
            self.radius_m,
            self.exclude,
            self.max_range_m
        );
        let _ = writeln!(text, "area under the curve      {:.4}", self.auc);
        let _ = match self.threshold {
            Some(threshold) => writeln!(
                text,
                "recall at full precision  {:.1} % (threshold {threshold:.4})",
                self.recall_at_full_precision * 100.0
            ),
            None => writeln!(
                text,
                "recall at full precision  none: the most alike match of all is wrong"
            ),
        };
        let _ = writeln!(
            text,
            "time for each keyframe    {:.2} ms (descriptor {:.2}, search {:.2}; levelling {:.2} besides)",
            self.ms_per_keyframe, self.descriptor_ms, self.search_ms, self.levelling_ms
        );
        text
    }
}

fn draw(
    path: &Path,
    arguments: &EvalLoopsArguments,
    curve: &Curve,
    summary: &Summary,
) -> Result<(), Failure> {
    let name = arguments
        .input
        .file_name()
        .unwrap_or(arguments.input.as_os_str());
    let svg = Picture {
        title: &format!("{} on {}", summary.descriptor, name.to_string_lossy()),
        subtitle: &format!(
            "{} keyframes, {} revisits; area {:.3}, recall at full precision {:.1} %",
            summary.keyframes,
            summary.loops,
            summary.auc,
            summary.recall_at_full_precision * 100.0
        ),
        curve,
    }
    .to_svg()
    .map_err(|error| Failure::new(error, "leave out --plot"))?;
    hachi_bridge::write_file(path, svg.as_bytes()).map_err(|error| Failure::unwritten(&error))
}
