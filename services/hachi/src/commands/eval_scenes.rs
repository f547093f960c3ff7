//! `hachi eval scenes`: how well one person is followed through ten scripted scenes.
//!
//! Each scene is rendered, goes through the camera's byte format, a detector and a network that tells
//! people apart, and the tracker. Three ways of knowing the person then work on the same tracks and
//! features: the track that the user picked and nothing else, FollowMe's calibration, CARPE-ID.

use std::time::{Duration, Instant};

use hachi_inference::ImageView;
use hachi_people::BoundingBox;
use hachi_people::followed::{Followed, Score, ScoreKeeper, Sight};
use hachi_people::identify::{AppearanceModel, Calibration, IdentifierConfig};
use hachi_people::observe::{Observation, Observer};
use hachi_people::track::Track;
use hachi_people::watch::Watch;
use hachi_realsense::frame::{Layout, YuyvImage};
use hachi_world::SimulatedCamera;
use hachi_world::scenes::{Script, ScriptedScene};
use rayon::prelude::*;
use serde::Serialize;
use tracing::debug;

use crate::cli::people::EvalScenesArguments;
use crate::exit::Failure;
use crate::interrupt::Cancelled;
use crate::people_pictures::{ContactSheet, Labels, annotate};
use crate::{networks, output, people_truth, progress};

/// Pictures on a scene's contact sheet.
const PICTURES: u32 = 12;

/// Features that FollowMe calibrates on: six seconds of a person in front of the robot.
const CALIBRATED_ON: usize = 60;

/// Seconds an hour that somebody else may be followed.
const MOST_WRONG_S_PER_HOUR: f64 = 1.0;
/// Mean time to know the person again, seconds: what CARPE-ID was published with.
const MOST_DELAY_S: f64 = 1.1;

#[derive(Debug, Serialize)]
struct Report {
    seed: u64,
    scenes: Vec<SceneReport>,
    all: Figures,
    limits: Limits,
    frames: u64,
    /// Detector, re-identification, tracking and identification.
    ms_per_frame: f64,
}

#[derive(Debug, Serialize)]
struct Limits {
    wrong_s_per_hour: f64,
    mean_delay_s: f64,
    kept: bool,
}

#[derive(Debug, Serialize)]
struct SceneReport {
    scene: &'static str,
    duration_s: f64,
    #[serde(flatten)]
    figures: Figures,
}

/// The three ways.
#[derive(Debug, Default, Serialize)]
struct Figures {
    track_alone: Figure,
    follow_me: Figure,
    carpe_id: Figure,
}

#[derive(Debug, Default, Serialize)]
struct Figure {
    tracked_share: f64,
    tracked_s: f64,
    visible_s: f64,
    re_identified: u32,
    re_identifications_needed: u32,
    wrong_s: f64,
    wrong_s_per_hour: f64,
    mean_delay_s: Option<f64>,
    delays_s: Vec<f64>,
}

impl From<&Score> for Figure {
    fn from(score: &Score) -> Self {
        Self {
            tracked_share: score.tracked_share(),
            tracked_s: score.tracked_s,
            visible_s: score.visible_s,
            re_identified: score.right,
            re_identifications_needed: score.needed,
            wrong_s: score.wrong_s,
            wrong_s_per_hour: score.wrong_s_per_hour(),
            mean_delay_s: score.mean_delay_s(),
            delays_s: score.delays_s.clone(),
        }
    }
}

impl Figure {
    /// Whether the person was known again soon enough; who is never known again is not.
    fn is_prompt(&self) -> bool {
        let needed = self.re_identifications_needed;
        self.mean_delay_s
            .map_or(needed == 0, |delay_s| delay_s < MOST_DELAY_S)
    }
}

/// Scores of the three ways, in their order.
type Scores = [Score; 3];

fn figures(scores: &Scores) -> Figures {
    let [track_alone, follow_me, carpe_id] = scores.each_ref().map(Figure::from);
    Figures {
        track_alone,
        follow_me,
        carpe_id,
    }
}

/// Runs the command.
///
/// # Errors
/// There is no network, one failed, or a picture can't be written.
pub fn run(arguments: &EvalScenesArguments) -> Result<(), Failure> {
    let scripts = match arguments.scenes.is_empty() {
        true => Script::ALL.to_vec(),
        false => arguments.scenes.clone(),
    };
    let cancelled = Cancelled::on_interrupt()?;
    let scene = |script: &Script| {
        let mut scene = script.scene(arguments.seed);
        let lasts_s = &mut scene.simulation.duration_s;
        *lasts_s = arguments.seconds.map_or(*lasts_s, |most| lasts_s.min(most));
        scene
    };
    let lasting = scripts
        .iter()
        .map(|script| scene(script).simulation.duration_s);
    let total_s: f64 = lasting.sum();
    let bar = progress::bar(Some((total_s * 10.0) as u64), "frames");
    let watched: Vec<(Script, Watched)> = scripts
        .par_iter()
        .map(|script| {
            let observer = networks::observer(&arguments.networks.or_own())?;
            let mut run = SceneRun::new(scene(script), observer);
            if arguments.pictures.is_some() {
                run.draw();
            }
            while !cancelled.is_cancelled() && run.step()? {
                bar.inc(1);
            }
            Ok((*script, run.finish()))
        })
        .collect::<Result<_, Failure>>()?;
    bar.finish_and_clear();
    if cancelled.is_cancelled() {
        return Err(Failure::Interrupted("nothing was measured".to_owned()));
    }
    if let Some(folder) = &arguments.pictures {
        std::fs::create_dir_all(folder)
            .map_err(|error| Failure::new(error, "choose another folder"))?;
        for (script, watched) in &watched {
            if let Some(sheet) = &watched.sheet {
                sheet.write(&folder.join(format!("{}.png", script.name())))?;
            }
        }
    }
    let report = report(arguments.seed, &watched);
    match arguments.json {
        true => output::json(&report),
        false => output::text(&text(&report)),
    }
}

fn report(seed: u64, watched: &[(Script, Watched)]) -> Report {
    let mut all = Scores::default();
    let (mut frames, mut time) = (0, Duration::ZERO);
    for (_, watched) in watched {
        for (sum, score) in all.iter_mut().zip(&watched.scores) {
            sum.add(score);
        }
        frames += watched.frames;
        time += watched.time;
    }
    let all = figures(&all);
    let kept = all.carpe_id.wrong_s_per_hour < MOST_WRONG_S_PER_HOUR && all.carpe_id.is_prompt();
    Report {
        seed,
        scenes: watched
            .iter()
            .map(|(script, watched)| SceneReport {
                scene: script.name(),
                duration_s: watched.scores[0].watched_s,
                figures: figures(&watched.scores),
            })
            .collect(),
        all,
        limits: Limits {
            wrong_s_per_hour: MOST_WRONG_S_PER_HOUR,
            mean_delay_s: MOST_DELAY_S,
            kept,
        },
        frames,
        ms_per_frame: time.as_secs_f64() * 1e3 / frames.max(1) as f64,
    }
}

/// What came of a scene.
struct Watched {
    scores: Scores,
    frames: u64,
    time: Duration,
    sheet: Option<ContactSheet>,
}

/// FollowMe: a calibration, then a model.
enum FollowMe {
    Calibrates(Calibration),
    Knows(AppearanceModel),
}

/// A scene that is being watched.
struct SceneRun {
    camera: SimulatedCamera,
    scene: ScriptedScene,
    observer: Observer,
    watch: Watch,
    rgb: Vec<u8>,
    frames: u64,
    time: Duration,
    /// The track that the user picked, once there is one.
    picked: Option<u64>,
    follow_me: FollowMe,
    keepers: [ScoreKeeper; 3],
    sheet: Option<ContactSheet>,
}

impl SceneRun {
    fn new(scene: ScriptedScene, observer: Observer) -> Self {
        Self {
            camera: SimulatedCamera::new(&scene.simulation, scene.camera.clone()),
            watch: Watch::new(observer.even_score(), IdentifierConfig::default()),
            scene,
            observer,
            rgb: Vec::new(),
            frames: 0,
            time: Duration::ZERO,
            picked: None,
            follow_me: FollowMe::Calibrates(Calibration::new(CALIBRATED_ON)),
            keepers: Default::default(),
            sheet: None,
        }
    }

    fn draw(&mut self) {
        self.sheet = Some(ContactSheet::new(3));
    }

    /// The next frame; whether there was one.
    fn step(&mut self) -> Result<bool, Failure> {
        let Some(frame) = self.camera.next_color_frame() else {
            return Ok(false);
        };
        let begun = Instant::now();
        let color = self.scene.camera.geometry.color;
        let layout = Layout::packed(color.width, color.height);
        self.rgb.resize(3 * color.pixels(), 0);
        YuyvImage::new(&frame.color, layout)
            .and_then(|image| image.to_rgb(&mut self.rgb))
            .map_err(|error| Failure::new(error, "please report this"))?;
        let image = ImageView::new(color.width as usize, color.height as usize, &self.rgb)
            .map_err(|error| Failure::new(error, "please report this"))?;
        let dt_s = self.scene.camera.period_ns as f64 * 1e-9;
        let at_s = frame.stamp.secs_since(self.scene.simulation.start);
        let user_points = self.picked.is_none() && at_s >= self.scene.picked_at_s;
        if let Some(at) = user_points
            .then(|| people_truth::pointed_at(&frame.people, self.scene.target))
            .flatten()
        {
            self.watch.pick(at);
        }
        let observed = self
            .observer
            .observe(&image)
            .map_err(|error| Failure::new(error, "give other networks"))?;
        self.watch.step(&observed, dt_s);
        self.time += begun.elapsed();
        self.frames += 1;

        let status = self.watch.statuses().next().copied();
        let tracks = self.watch.tracks();
        if self.picked.is_none() {
            self.picked = status.and_then(|status| status.track);
        }
        if self.picked.is_some() {
            let boxes = [
                seen(tracks, self.picked).map(Track::bounding_box),
                self.follow_me.step(tracks, &observed, self.picked),
                status
                    .and_then(|status| self.watch.followed(status.person))
                    .map(Track::bounding_box),
            ];
            let target = self.scene.target;
            let person = frame.people.iter().find(|person| person.id == target);
            let sight = people_truth::sight(person, color.width);
            let right = boxes.map(|b| people_truth::followed(b, &frame.people, target));
            for (keeper, followed) in self.keepers.iter_mut().zip(right) {
                keeper.step(dt_s, sight, followed);
            }
            if right[2] == Followed::Wrong || (sight, right[2]) == (Sight::Clear, Followed::Nobody)
            {
                let person = person.map(|person| (person.visible, person.visible_share()));
                debug!(at_s, ?right, ?person, ?status, detections = ?observed.detections);
                for track in tracks {
                    let looks = track.detection.and_then(|d| observed.features?.get(d));
                    let model = status.and_then(|status| self.watch.model(status.person));
                    let distance = looks.zip(model).map(|(looks, model)| model.distance(looks));
                    let threshold = model.map(AppearanceModel::threshold);
                    let b = track.bounding_box();
                    debug!(id = track.id, ?track.state, ?b, ?distance, ?threshold);
                }
            }
        }
        if let Some(sheet) = &mut self.sheet {
            let frames = (self.scene.simulation.duration_s / dt_s) as u32;
            if frame.sequence % (frames / PICTURES).max(1) == frames / PICTURES / 2 {
                let statuses: Vec<_> = self.watch.statuses().copied().collect();
                let labels = Labels {
                    tracks,
                    statuses: &statuses,
                    found: self.observer.found(),
                    caption: &format!("{at_s:.1} s"),
                };
                sheet.push(&annotate(&image, &labels));
            }
        }
        Ok(true)
    }

    fn finish(self) -> Watched {
        Watched {
            scores: self.keepers.map(ScoreKeeper::finish),
            frames: self.frames,
            time: self.time,
            sheet: self.sheet,
        }
    }
}

impl FollowMe {
    /// Who is followed: the picked track while it is calibrated on, then whoever looks most alike.
    fn step(
        &mut self,
        tracks: &[Track],
        observed: &Observation<'_>,
        picked: Option<u64>,
    ) -> Option<BoundingBox> {
        let features = observed.features?;
        match self {
            Self::Calibrates(calibration) => {
                let track = seen(tracks, picked)?;
                // An unsure detection has no feature: it is followed all the same.
                if let Some(feature) = features.get(track.detection?) {
                    calibration.push(feature);
                }
                if calibration.is_complete()
                    && let Ok(model) = calibration.finish()
                {
                    *self = Self::Knows(model);
                }
                Some(track.bounding_box())
            }
            Self::Knows(model) => {
                let near = |index: usize| {
                    let distance = model.distance(features.get(index)?);
                    (distance < model.threshold()).then_some((index, distance))
                };
                let alike = (0..observed.detections.len()).filter_map(near);
                let nearest = alike.min_by(|a, b| a.1.total_cmp(&b.1));
                nearest.map(|(index, _)| observed.detections[index].bounding_box)
            }
        }
    }
}

/// A track in this frame.
fn seen(tracks: &[Track], id: Option<u64>) -> Option<&Track> {
    let track = tracks.iter().find(|track| Some(track.id) == id);
    track.filter(|track| track.is_seen())
}

fn text(report: &Report) -> String {
    let mut text = format!(
        "{:<10} {:<12} {:>16} {:>8} {:>10} {:>10}\n",
        "SCENE", "", "TRACKED/VISIBLE", "FOUND", "WRONG s/h", "DELAY s"
    );
    let all = std::iter::once(("all", &report.all));
    let scenes = report
        .scenes
        .iter()
        .map(|scene| (scene.scene, &scene.figures));
    for (name, figures) in scenes.chain(all) {
        let ways = [
            ("track alone", &figures.track_alone),
            ("FollowMe", &figures.follow_me),
            ("CARPE-ID", &figures.carpe_id),
        ];
        for (k, (way, figure)) in ways.into_iter().enumerate() {
            text += &format!(
                "{:<10} {way:<12} {:>6.1}/{:<5.1} {:>3.0} % {:>3}/{:<3} {:>10.1} {:>10}\n",
                if k == 0 { name } else { "" },
                figure.tracked_s,
                figure.visible_s,
                100.0 * figure.tracked_share,
                figure.re_identified,
                figure.re_identifications_needed,
                figure.wrong_s_per_hour,
                figure
                    .mean_delay_s
                    .map_or_else(|| "-".to_owned(), |delay| format!("{delay:.2}")),
            );
        }
    }
    let kept = if report.limits.kept {
        "kept"
    } else {
        "not kept"
    };
    text + &format!(
        "limits of CARPE-ID over all scenes, {} s wrong an hour and {} s delay: {kept}\n\
         {} frames, {:.1} ms each without rendering",
        report.limits.wrong_s_per_hour,
        report.limits.mean_delay_s,
        report.frames,
        report.ms_per_frame
    )
}
