//! Somebody who stands in front of the running robot is enrolled: FollowMe's calibration, live.
//!
//! In: a name, and from picture to picture who is where and what they look like. Out: a [`Sitting`], the
//! looks and pictures of one person, to the keeper, who makes a model of them and keeps it; how far it
//! is. Elsewhere: the model (`identify::calibration`: two thirds of the looks say what the person looks
//! like, one third how much that varies), the store ([`keeper`](super::keeper)).
//!
//! Whoever stood alone near the middle when it began is meant, by their track; where that ends, so does
//! the sitting. Pictures in which somebody else stands in front too are left out, so that one model is
//! never of two people.

use hachi_hal::Stamp;
use hachi_people::track::{Features, Track};
use hachi_runtime::Sender;
use serde::{Deserialize, Serialize};

use super::messages::Looked;
use super::orders::NotBegun;
use crate::images::Rgb;

/// Looks that are taken: twenty for the model, ten for the threshold.
pub const WANTED: usize = 30;
/// From one to the next, s: a person who turns once looks different by then.
const EVERY_S: f64 = 0.2;
/// It is over after so long, s.
const PATIENCE_S: f64 = 60.0;
/// In front is whoever's middle lies within this share of the picture's width around its middle,
const MIDDLE_SHARE: f64 = 0.5;
/// and who is at least this share of the picture high: at 7 m a person is.
const HIGH_SHARE: f64 = 0.2;

/// How far an enrolment is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Stage {
    /// Looks are taken.
    Taking,
    /// No look can be taken: nobody stands in front.
    WaitsForPerson,
    /// No look can be taken: somebody else stands in front too.
    WaitsForOthersToGo,
    /// Model and pictures are being kept.
    Keeping,
    /// The person is known.
    Done,
    /// It took too long.
    TimedOut,
    /// The person went away.
    WentAway,
    /// It was cancelled.
    Cancelled,
    /// They say nothing, or can't be kept.
    Failed,
}

impl Stage {
    /// Whether nothing more comes of it.
    pub fn is_over(self) -> bool {
        matches!(
            self,
            Self::Done | Self::TimedOut | Self::WentAway | Self::Cancelled | Self::Failed
        )
    }

    /// Whether looks are still to be taken.
    fn takes(self) -> bool {
        matches!(
            self,
            Self::Taking | Self::WaitsForPerson | Self::WaitsForOthersToGo
        )
    }
}

/// How far an enrolment is, in numbers.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Progress {
    /// Its number.
    pub number: u32,
    /// In one word.
    pub stage: Stage,
    /// Looks taken.
    pub taken: usize,
    /// When it ends by itself.
    pub ends: Stamp,
    /// The track.
    pub track: u64,
    /// The person, once they are known.
    pub person: Option<u32>,
}

/// What is to become somebody.
#[derive(Debug)]
pub struct Sitting {
    /// The enrolment's number.
    pub number: u32,
    /// What to call them.
    pub name: String,
    /// What they look like, one feature a picture.
    pub features: Vec<Vec<f32>>,
    /// Pictures cut to them.
    pub crops: Vec<Rgb>,
}

/// The enrolment that goes on, or the last one.
pub struct Enrolment {
    sittings: Sender<Box<Sitting>>,
    sitting: Option<Box<Sitting>>,
    progress: Option<Progress>,
    taken_at: Option<Stamp>,
    last: u32,
}

impl Enrolment {
    /// One that has not begun; sittings go to the keeper.
    pub fn new(sittings: Sender<Box<Sitting>>) -> Self {
        Self {
            sittings,
            sitting: None,
            progress: None,
            taken_at: None,
            last: 0,
        }
    }

    /// How far it is.
    pub fn progress(&self) -> Option<Progress> {
        self.progress
    }

    /// Whether one goes on.
    pub fn goes_on(&self) -> bool {
        self.progress.is_some_and(|p| !p.stage.is_over())
    }

    /// Begins with whoever stands in front.
    ///
    /// # Errors
    /// Nobody does, or more than one, or another enrolment goes on.
    pub fn begin(
        &mut self,
        name: &str,
        tracks: &[Track],
        looked: &Looked,
        now: Stamp,
    ) -> Result<u32, NotBegun> {
        if self.goes_on() {
            return Err(NotBegun::Busy);
        }
        let mut in_front = in_front(tracks, looked).filter(|track| track.is_confirmed());
        let person = in_front.next().ok_or(NotBegun::Nobody)?;
        match in_front.count() {
            0 => {}
            others => return Err(NotBegun::Several(others + 1)),
        }
        self.last += 1;
        self.sitting = Some(Box::new(Sitting {
            number: self.last,
            name: name.to_owned(),
            features: Vec::with_capacity(WANTED),
            crops: Vec::with_capacity(WANTED),
        }));
        self.taken_at = None;
        self.progress = Some(Progress {
            number: self.last,
            stage: Stage::Taking,
            taken: 0,
            ends: now + (PATIENCE_S * 1e9) as i64,
            track: person.id,
            person: None,
        });
        Ok(self.last)
    }

    /// Takes what a picture shows of them.
    pub fn see(&mut self, tracks: &[Track], looked: &Looked) {
        let (Some(progress), Some(sitting)) = (&mut self.progress, &mut self.sitting) else {
            return;
        };
        let Some(person) = tracks.iter().find(|track| track.id == progress.track) else {
            self.end(Stage::WentAway);
            return;
        };
        let is_in_front = in_front(tracks, looked).any(|track| track.id == person.id);
        let others = in_front(tracks, looked).any(|track| track.id != person.id);
        progress.stage = match (is_in_front, others) {
            (_, true) => Stage::WaitsForOthersToGo,
            (false, _) => Stage::WaitsForPerson,
            (true, false) => Stage::Taking,
        };
        let stamp = looked.picture.stamp;
        let due = |taken_at: Stamp| stamp.secs_since(taken_at) >= EVERY_S;
        if progress.stage != Stage::Taking || !self.taken_at.is_none_or(due) {
            return;
        }
        let Some((feature, crop)) = look(person, looked) else {
            return;
        };
        self.taken_at = Some(stamp);
        sitting.features.push(feature);
        sitting.crops.push(crop);
        progress.taken = sitting.features.len();
        if progress.taken >= WANTED {
            self.keep();
        }
    }

    fn keep(&mut self) {
        let refused = self
            .sitting
            .take()
            .and_then(|sitting| self.sittings.send(sitting));
        // One at a time: there is room for it.
        self.end(match refused {
            None => Stage::Keeping,
            Some(_) => Stage::Failed,
        });
    }

    /// Looks at the time.
    pub fn tick(&mut self, now: Stamp) {
        let late = |p: Progress| p.stage.takes() && now.nanos_since(p.ends) > 0;
        if self.progress.is_some_and(late) {
            self.end(Stage::TimedOut);
        }
    }

    /// Ends it; whether there was one that could be ended.
    pub fn cancel(&mut self) -> bool {
        let could = self.progress.is_some_and(|p| p.stage.takes());
        if could {
            self.end(Stage::Cancelled);
        }
        could
    }

    /// The person is known by this number, or nothing came of it.
    pub fn settle(&mut self, person: Option<u32>) {
        if let Some(progress) = &mut self.progress {
            progress.person = person;
        }
        self.end(match person {
            Some(_) => Stage::Done,
            None => Stage::Failed,
        });
    }

    fn end(&mut self, stage: Stage) {
        self.sitting = None;
        if let Some(progress) = &mut self.progress {
            progress.stage = stage;
        }
    }
}

/// Who stands near the middle of the picture and near the robot.
fn in_front<'a>(tracks: &'a [Track], looked: &Looked) -> impl Iterator<Item = &'a Track> {
    let picture = &looked.picture;
    let (width, height) = (picture.width as f64, picture.height as f64);
    tracks.iter().filter(move |track| {
        let b = track.bounding_box();
        let off = (b.middle()[0] - width / 2.0).abs();
        track.is_seen() && off <= MIDDLE_SHARE / 2.0 * width && b.height >= HIGH_SHARE * height
    })
}

/// What a track looks like in a picture, and the part of it that shows them.
fn look(track: &Track, looked: &Looked) -> Option<(Vec<f32>, Rgb)> {
    let features: Features<'_> = looked.observation().features?;
    let feature = features.get(track.detection?)?;
    let seen = looked.observation().detections.get(track.detection?)?;
    let picture = &looked.picture;
    let crop = Rgb::cut_from(
        (picture.width, picture.height),
        &picture.rgb,
        &seen.bounding_box,
    );
    Some((feature.to_vec(), crop?))
}

#[cfg(test)]
mod tests {
    use hachi_hal::Stamp;
    use hachi_people::identify::IdentifierConfig;
    use hachi_people::watch::Watch;
    use hachi_runtime::{Receiver, TaskClock, TaskTable, VirtualClock, WhenFull, bounded};

    use super::super::test_people::{observation, person_at};
    use super::*;

    const MS: i64 = 1_000_000;

    /// Pictures of 400 x 200 with people of 100 pixels, ten a second.
    struct Rig {
        watch: Watch,
        enrolment: Enrolment,
        sittings: Receiver<Box<Sitting>>,
        looked: Looked,
        now: Stamp,
    }

    impl Rig {
        fn new() -> Self {
            let clock = VirtualClock::starting_at(Stamp::default());
            let bell = TaskTable::new(TaskClock::new(clock)).bell();
            let (sender, sittings) = bounded("sittings", 1, WhenFull::DropNewest, &bell);
            let mut looked = Looked::default();
            looked.picture.width = 400;
            looked.picture.height = 200;
            looked.picture.rgb = vec![7; 3 * 400 * 200];
            Self {
                watch: Watch::new(0.5, IdentifierConfig::default()),
                enrolment: Enrolment::new(sender),
                sittings,
                looked,
                now: Stamp::from_nanos(1),
            }
        }

        /// So many pictures of people with their middles there.
        fn see(&mut self, pictures: usize, middles: &[f64]) {
            let detections: Vec<_> = middles.iter().map(|m| person_at(m - 20.0, 40.0)).collect();
            let values = [1.0, 0.5].repeat(middles.len());
            for _ in 0..pictures {
                self.now = self.now + 100 * MS;
                let observed = observation(&detections, &values);
                self.watch.step(&observed, 0.1);
                self.looked.keep(&observed);
                self.looked.picture.stamp = self.now;
                self.enrolment.see(self.watch.tracks(), &self.looked);
                self.enrolment.tick(self.now);
            }
        }

        fn begin(&mut self) -> Result<u32, NotBegun> {
            let tracks = self.watch.tracks();
            self.enrolment.begin("Anna", tracks, &self.looked, self.now)
        }

        fn stage(&self) -> Stage {
            self.enrolment.progress().unwrap().stage
        }
    }

    #[test]
    fn thirty_looks_are_taken_five_a_second_and_given_to_the_keeper() {
        let mut rig = Rig::new();
        rig.see(5, &[200.0]);
        assert_eq!(rig.begin(), Ok(1));
        rig.see(57, &[200.0]);
        assert_eq!(rig.enrolment.progress().unwrap().taken, 29);
        rig.see(2, &[200.0]);
        assert_eq!(rig.stage(), Stage::Keeping);
        let sitting = rig.sittings.receive().unwrap();
        assert_eq!((&*sitting.name, sitting.number), ("Anna", 1));
        assert_eq!(sitting.features, vec![vec![1.0, 0.5]; 30]);
        assert!(
            sitting
                .crops
                .iter()
                .all(|c| (c.width, c.height) == (40, 100))
        );
        // Too late to be ended, and nothing else begins before it is kept.
        assert!(!rig.enrolment.cancel());
        assert_eq!(rig.begin(), Err(NotBegun::Busy));
        rig.enrolment.settle(Some(4));
        assert_eq!(rig.stage(), Stage::Done);
        assert_eq!(rig.begin(), Ok(2));
    }

    #[test]
    fn it_begins_with_one_person_in_front_and_with_nobody_else() {
        let mut rig = Rig::new();
        rig.see(5, &[]);
        assert_eq!(rig.begin(), Err(NotBegun::Nobody));
        // At the side.
        rig.see(5, &[40.0]);
        assert_eq!(rig.begin(), Err(NotBegun::Nobody));
        rig.see(5, &[40.0, 150.0, 250.0]);
        assert_eq!(rig.begin(), Err(NotBegun::Several(2)));
        rig.see(25, &[40.0, 150.0]);
        assert_eq!(rig.begin(), Ok(1));
    }

    #[test]
    fn nothing_is_taken_while_somebody_else_stands_in_front() {
        let mut rig = Rig::new();
        rig.see(5, &[200.0]);
        rig.begin().unwrap();
        rig.see(10, &[200.0]);
        let taken = rig.enrolment.progress().unwrap().taken;
        rig.see(10, &[200.0, 290.0]);
        assert_eq!(rig.stage(), Stage::WaitsForOthersToGo);
        assert_eq!(rig.enrolment.progress().unwrap().taken, taken);
        rig.see(5, &[200.0]);
        assert_eq!(rig.stage(), Stage::Taking);
        rig.see(10, &[]);
        assert_eq!(rig.stage(), Stage::WaitsForPerson);
        // Two seconds later the track is over: whoever stands there then may be somebody else.
        rig.see(15, &[]);
        assert_eq!(rig.stage(), Stage::WentAway);
        rig.see(50, &[200.0]);
        assert_eq!(rig.stage(), Stage::WentAway);
        assert!(rig.sittings.is_empty());
    }

    #[test]
    fn it_ends_after_a_minute_with_pictures_or_without() {
        let mut rig = Rig::new();
        rig.see(5, &[200.0]);
        rig.begin().unwrap();
        rig.enrolment.tick(rig.now + 59_000 * MS);
        assert_eq!(rig.stage(), Stage::Taking);
        rig.enrolment.tick(rig.now + 61_000 * MS);
        assert_eq!(rig.stage(), Stage::TimedOut);
        rig.begin().unwrap();
        assert!(rig.enrolment.cancel() && !rig.enrolment.cancel());
        assert_eq!(rig.stage(), Stage::Cancelled);
    }
}
