//! `keeper`: what people look like by now is kept, and whoever is enrolled or forgotten by another
//! program meanwhile becomes known here, or unknown.
//!
//! In: models as tracking learns them, somebody who sat for their pictures; the store. Out: news for
//! tracking, names for the page. The task waits for the disk, below everything else; [`Acquaintances`]
//! is tracking's end, which never waits.

use std::sync::atomic::Ordering;
use std::time::{Duration, SystemTime, UNIX_EPOCH};

use hachi_hal::Stamp;
use hachi_people::identify::{AppearanceModel, Calibration};
use hachi_runtime::{Bell, Progress, Receiver, Sender, WhenFull, Work, bounded};
use hachi_store::people::{
    NetworkIdentity, NewPerson, PeopleError, PeopleFile, PersonEntry, StoredId,
};
use tracing::{info, warn};

use super::acquaintances::Acquaintances;
use super::enrolment::Sitting;
use super::signs::SharedSigns;
use crate::images;

/// How long a change waits for another program's: it comes again in ten seconds.
const PATIENCE: Duration = Duration::from_millis(200);
/// Models and news under way.
const WAITING: usize = 32;
/// Another program's change is waited for so often, a second each.
const MOST_TRIES: u32 = 10;

/// The store, and which network's models are of use.
pub struct Kept {
    /// The store.
    pub store: PeopleFile,
    /// The network.
    pub network: NetworkIdentity,
}

/// What changed in the store.
#[derive(Debug)]
pub enum News {
    /// Somebody is to be known.
    Known(StoredId, AppearanceModel),
    /// Somebody was forgotten.
    Forgotten(StoredId),
}

/// What became of a sitting.
#[derive(Debug)]
pub struct Settled {
    /// The enrolment's number.
    pub number: u32,
    /// Who is in the store now; nobody where that failed, which the page is told with the reason.
    pub kept: Option<(StoredId, AppearanceModel)>,
}

/// The task.
pub struct Keeper {
    kept: Kept,
    /// Whom tracking was told of.
    people: Vec<PersonEntry>,
    /// Whom it was not: other networks' and damaged models, said once.
    left_out: Vec<StoredId>,
    looks: Receiver<(StoredId, AppearanceModel)>,
    news: Sender<News>,
    sittings: Receiver<Box<Sitting>>,
    /// The sitting that is being kept, and how often that was tried.
    sitting: Option<(Box<Sitting>, u32)>,
    settled: Sender<Settled>,
    names: Sender<Names>,
    failures: Sender<Failed>,
    /// Rung so that tracking looks at the time where no pictures come.
    to_tracking: Bell,
    signs: SharedSigns,
    /// Whether the store has to be looked through.
    stale: bool,
    /// Whether the last change failed.
    failing: bool,
}

/// What everybody in the store is called.
pub type Names = Vec<(StoredId, String)>;

/// Which enrolment failed, and why, with what to do.
pub type Failed = (u32, String);

/// The page's end: what has names in it, and goes nowhere else.
pub struct NamedEnd {
    /// Whenever they change.
    pub names: Receiver<Names>,
    /// Of enrolments.
    pub failures: Receiver<Failed>,
}

/// The three ends, and where sittings go in.
pub struct Ends {
    /// The task.
    pub keeper: Keeper,
    /// Tracking's.
    pub acquaintances: Acquaintances,
    /// The page's.
    pub named: NamedEnd,
    /// Somebody sat.
    pub sittings: Sender<Box<Sitting>>,
}

/// Puts them together; `to_tracking` wakes tracking, the other bell nobody.
pub fn keeper(kept: Kept, to_tracking: &Bell, nobody: &Bell, signs: SharedSigns) -> Ends {
    let (to_keeper, looks) = bounded("people's looks", WAITING, WhenFull::DropOldest, nobody);
    // What does not fit is told the next time.
    let (news, from_keeper) = bounded("people's news", WAITING, WhenFull::DropNewest, nobody);
    let (sittings, sat) = bounded("sittings", 1, WhenFull::DropNewest, nobody);
    let (settled, from_sittings) = bounded("settled", 1, WhenFull::DropOldest, to_tracking);
    let (names, named) = bounded("people's names", 1, WhenFull::DropOldest, nobody);
    let (failures, failed) = bounded("failed enrolments", 1, WhenFull::DropOldest, nobody);
    // Setting a time-out can't fail.
    let _ = kept.store.set_patience(PATIENCE);
    let keeper = Keeper {
        kept,
        people: Vec::new(),
        left_out: Vec::new(),
        looks,
        news,
        sittings: sat,
        sitting: None,
        settled,
        names,
        failures,
        to_tracking: to_tracking.clone(),
        signs,
        stale: true,
        failing: false,
    };
    Ends {
        keeper,
        acquaintances: Acquaintances {
            looks: to_keeper,
            news: from_keeper,
            settled: from_sittings,
            kept_at: None,
        },
        named: NamedEnd {
            names: named,
            failures: failed,
        },
        sittings,
    }
}

impl Work for Keeper {
    fn run(&mut self, _: Stamp) -> Progress {
        let saved = self.save();
        let settled = self.keep_the_sitter();
        let looked = self.look_through();
        // After the names, so that the page has theirs by then.
        if let Some(settled) = settled {
            let _ = self.settled.send(settled);
        }
        if self.signs.enrolling.load(Ordering::Relaxed) {
            self.to_tracking.ring();
        }
        match saved.and_then(|saved| looked.map(|()| saved)) {
            // Another program writes: it is tried again. Nothing to save proves nothing.
            Err(PeopleError::InUse { .. }) | Ok(false) => {}
            Ok(true) => {
                if std::mem::take(&mut self.failing) {
                    info!("what people look like is kept again");
                }
            }
            Err(error) => {
                if !std::mem::replace(&mut self.failing, true) {
                    warn!(%error, "what people look like can't be kept");
                }
            }
        }
        Progress::Done
    }
}

impl Keeper {
    /// Whether there was anything to save.
    fn save(&mut self) -> Result<bool, PeopleError> {
        let mut saved = false;
        while let Some((id, model)) = self.looks.receive() {
            let Some(person) = self.people.iter().find(|person| person.id == id) else {
                continue;
            };
            let Kept { store, network } = &mut self.kept;
            match store.save_model(person, network, &model) {
                // Forgotten meanwhile: the store says so below.
                Ok(()) => saved = true,
                Err(PeopleError::Unknown { .. }) => {}
                Err(error) => return Err(error),
            }
        }
        Ok(saved)
    }

    /// Makes a model of whoever sat for it and keeps it with their pictures: all of it, or nothing.
    fn keep_the_sitter(&mut self) -> Option<Settled> {
        if self.sitting.is_none() {
            self.sitting = self.sittings.receive().map(|sitting| (sitting, 0));
        }
        let (sitting, tries) = self.sitting.take()?;
        let number = sitting.number;
        let kept = match self.enrol(&sitting) {
            Ok((person, model)) => {
                let id = person.id;
                self.people.push(person);
                // Its own changes are no news to the store: names are told anew.
                self.stale = true;
                Some((id, model))
            }
            Err(NotKept::Store(PeopleError::InUse { .. })) if tries < MOST_TRIES => {
                self.sitting = Some((sitting, tries + 1));
                return None;
            }
            Err(why) => {
                // What is said of it may hold the name, which the log does not.
                warn!(
                    enrolment = number,
                    "somebody can't be enrolled: the page says why"
                );
                let _ = self.failures.send((number, why.to_string()));
                None
            }
        };
        Some(Settled { number, kept })
    }

    fn enrol(&mut self, sitting: &Sitting) -> Result<(PersonEntry, AppearanceModel), NotKept> {
        let mut calibration = Calibration::new(sitting.features.len());
        for feature in &sitting.features {
            calibration.push(feature);
        }
        let model = calibration.finish().map_err(NotKept::Looks)?;
        let pictures: Result<Vec<_>, _> = sitting.crops.iter().cloned().map(images::kept).collect();
        let now = SystemTime::now().duration_since(UNIX_EPOCH);
        let Kept { store, network } = &mut self.kept;
        let person = store.enrol(&NewPerson {
            name: &sitting.name,
            enrolled_unix_s: now.map_or(0, |since| since.as_secs() as i64),
            network,
            model: &model,
            images: &pictures.map_err(NotKept::Picture)?,
        });
        Ok((person.map_err(NotKept::Store)?, model))
    }

    /// Tells tracking what changed in the store.
    fn look_through(&mut self) -> Result<(), PeopleError> {
        self.stale |= self.kept.store.has_changed()?;
        if !self.stale {
            return Ok(());
        }
        let listing = self.kept.store.list()?;
        let named = |person: &PersonEntry| (person.id, person.name.clone());
        let _ = self.names.send(listing.people.iter().map(named).collect());
        let mut told = true;
        let news = &self.news;
        self.people.retain(|person| {
            let there = listing.people.iter().any(|other| other.id == person.id);
            let gone = !there && news.send(News::Forgotten(person.id)).is_none();
            told &= there || gone;
            !gone
        });
        for person in listing.people {
            let known = self.people.iter().any(|other| other.id == person.id);
            if known || self.left_out.contains(&person.id) {
                continue;
            }
            match self.kept.store.model_of(&person, &self.kept.network) {
                Ok(model) => match self.news.send(News::Known(person.id, model)) {
                    None => self.people.push(person),
                    Some(_) => told = false,
                },
                Err(PeopleError::Unknown { .. }) => {}
                Err(PeopleError::OtherNetwork { .. } | PeopleError::DamagedPerson { .. }) => {
                    // The error names the person; the log, where nothing is forgotten, does not.
                    warn!(
                        "somebody in the store can't be known: `hachi people list` says who and why"
                    );
                    self.left_out.push(person.id);
                }
                Err(error) => return Err(error),
            }
        }
        self.stale = !told;
        Ok(())
    }
}

/// Why somebody who sat is not kept.
#[derive(Debug, thiserror::Error)]
enum NotKept {
    #[error("{0}: enrol them again")]
    Looks(hachi_people::identify::CalibrationError),
    #[error("a picture can't be kept ({0}): enrol them again")]
    Picture(String),
    #[error(transparent)]
    Store(PeopleError),
}

#[cfg(test)]
mod tests {
    use hachi_people::identify::IdentifierConfig;
    use hachi_people::watch::Watch;
    use hachi_runtime::{TaskClock, TaskTable, VirtualClock};
    use hachi_store::people::{NewPerson, PeoplePaths};

    use super::super::roster::Roster;
    use super::super::test_people::{observation, person_at};
    use super::*;

    const LOOKS: [f32; 4] = [0.6, 0.8, 0.0, 0.0];

    fn network() -> NetworkIdentity {
        NetworkIdentity::of_bytes("test", b"a network")
    }

    fn enrol(store: &mut PeopleFile, name: &str, network: &NetworkIdentity) -> PersonEntry {
        let model = AppearanceModel::first(&LOOKS).unwrap();
        store
            .enrol(&NewPerson {
                name,
                enrolled_unix_s: 0,
                network,
                model: &model,
                images: &[],
            })
            .unwrap()
    }

    /// The two ends, another program's hands on the store, and eyes.
    struct Rig {
        keeper: Keeper,
        acquaintances: Acquaintances,
        named: NamedEnd,
        sittings: Sender<Box<Sitting>>,
        to_tracking: Bell,
        signs: SharedSigns,
        roster: Roster,
        watch: Watch,
        other: PeopleFile,
        now: Stamp,
        _folder: tempfile::TempDir,
    }

    impl Rig {
        fn new() -> Self {
            let folder = tempfile::tempdir().unwrap();
            let paths = PeoplePaths::beside(&folder.path().join("people.db"));
            let kept = Kept {
                store: PeopleFile::open_or_create(&paths).unwrap(),
                network: network(),
            };
            let now = Stamp::from_nanos(1);
            let table = TaskTable::new(TaskClock::new(VirtualClock::starting_at(now)));
            let (to_tracking, nobody) = (table.bell(), table.bell());
            let signs = SharedSigns::default();
            let ends = keeper(kept, &to_tracking, &nobody, signs.clone());
            Self {
                keeper: ends.keeper,
                acquaintances: ends.acquaintances,
                named: ends.named,
                sittings: ends.sittings,
                to_tracking,
                signs,
                roster: Roster::default(),
                watch: Watch::new(0.5, IdentifierConfig::default()),
                other: PeopleFile::open_or_create(&paths).unwrap(),
                now,
                _folder: folder,
            }
        }

        fn keep(&mut self) {
            self.keeper.run(self.now);
            self.acquaintances.hear(&mut self.watch, &mut self.roster);
        }

        /// Somebody who looks like this is in view for so many seconds.
        fn see(&mut self, looks: [f32; 4], seconds: u32) {
            let detections = [person_at(10.0, 10.0)];
            for _ in 0..5 * seconds {
                self.now = self.now + 200_000_000;
                self.watch.step(&observation(&detections, &looks), 0.2);
                self.acquaintances.tell(&self.watch, &self.roster, self.now);
            }
        }

        fn known(&self) -> usize {
            self.watch.statuses().count()
        }
    }

    #[test]
    fn what_is_learnt_of_a_person_is_in_the_store() {
        let mut rig = Rig::new();
        let anna = enrol(&mut rig.other, "Anna", &network());
        rig.keep();
        assert_eq!(rig.known(), 1);
        let changed = [0.65, 0.75, 0.05, 0.0];
        rig.see(changed, 25);
        rig.keep();
        let stored = rig.other.model_of(&anna, &network()).unwrap();
        let before = AppearanceModel::first(&LOOKS).unwrap();
        assert!(stored.updates() > 20, "{stored:?}");
        assert!(stored.distance(&changed) < before.distance(&changed));
        // Its own changes are no news.
        rig.keep();
        assert_eq!(rig.known(), 1);
    }

    #[test]
    fn whoever_another_program_forgets_is_known_no_more_and_not_saved_again() {
        let mut rig = Rig::new();
        let anna = enrol(&mut rig.other, "Anna", &network());
        rig.keep();
        rig.see(LOOKS, 11);
        // A model is under way while she is forgotten.
        rig.other.forget(&anna).unwrap();
        rig.keep();
        assert_eq!(rig.known(), 0);
        assert_eq!(rig.other.list().unwrap().people, []);
        assert!(!rig.keeper.failing);
        enrol(&mut rig.other, "Anna", &network());
        rig.keep();
        assert_eq!(rig.known(), 1, "and known again once she is enrolled again");
    }

    #[test]
    fn other_networks_people_are_left_out_and_a_crowd_is_told_of_bit_by_bit() {
        let mut rig = Rig::new();
        let other = NetworkIdentity::of_bytes("test", b"another network");
        enrol(&mut rig.other, "Berta", &other);
        for number in 0..WAITING + 5 {
            enrol(&mut rig.other, &format!("person {number}"), &network());
        }
        rig.keep();
        assert_eq!(rig.known(), WAITING);
        rig.keep();
        assert_eq!(rig.known(), WAITING + 5);
        assert!(!rig.keeper.failing);
    }

    /// Somebody sat who is to have this name.
    fn sat(rig: &Rig, number: u32, name: &str) {
        // Noise, which no PNG makes smaller.
        let pixel = |k: u32| (k.wrapping_mul(2_654_435_761) >> 24) as u8;
        let crop = |number: u32| images::Rgb {
            width: 20,
            height: 50,
            pixels: (0..3 * 20 * 50).map(|k| pixel(k + number)).collect(),
        };
        let sitting = Sitting {
            number,
            name: name.to_owned(),
            features: vec![LOOKS.to_vec(); 12],
            crops: (0..12).map(crop).collect(),
        };
        assert!(rig.sittings.send(Box::new(sitting)).is_none());
    }

    #[test]
    fn whoever_sat_is_in_the_store_with_their_pictures_and_told_of_once() {
        let mut rig = Rig::new();
        rig.keep();
        sat(&rig, 3, "Anna");
        rig.keep();
        let settled = rig.acquaintances.settled.receive().unwrap();
        let anna = rig.other.find("Anna").unwrap();
        assert_eq!(anna.images, 12);
        let (id, model) = settled.kept.unwrap();
        assert_eq!((settled.number, id), (3, anna.id));
        assert_eq!(rig.other.model_of(&anna, &network()).unwrap(), model);
        let pictures = rig.other.images(&anna).unwrap().images;
        let first = images::decode(&pictures[0]).unwrap();
        assert_eq!((first.width, first.height), (20, 50));
        let names = rig.named.names.newest().unwrap();
        assert_eq!(names, [(anna.id, "Anna".to_owned())]);
        // Tracking makes them known from what was settled, not as news.
        rig.keep();
        assert_eq!(rig.known(), 0);
        // And they are somebody whom another program may forget.
        rig.other.forget(&anna).unwrap();
        rig.keep();
        assert_eq!(rig.named.names.newest().unwrap(), []);
    }

    #[test]
    fn whoever_can_not_be_kept_is_not_kept_at_all_and_it_is_said_why() {
        let mut rig = Rig::new();
        rig.keep();
        rig.keeper.kept.store.set_quota(1).unwrap();
        sat(&rig, 1, "Anna");
        rig.keep();
        assert!(rig.acquaintances.settled.receive().unwrap().kept.is_none());
        let (number, why) = rig.named.failures.newest().unwrap();
        assert_eq!(number, 1);
        assert!(why.contains("free some space"), "{why}");
        assert_eq!(rig.other.list().unwrap(), Default::default());
        rig.keeper.kept.store.set_quota(1 << 30).unwrap();
        enrol(&mut rig.other, "Anna", &network());
        sat(&rig, 2, "Anna");
        rig.keep();
        assert!(rig.acquaintances.settled.receive().unwrap().kept.is_none());
        let (_, why) = rig.named.failures.newest().unwrap();
        assert!(why.contains("choose another name"), "{why}");
        sat(&rig, 3, "Berta");
        rig.keep();
        assert!(rig.acquaintances.settled.receive().unwrap().kept.is_some());
        assert_eq!(rig.other.list().unwrap().people.len(), 2);
    }

    #[test]
    fn tracking_is_woken_to_look_at_the_time_while_somebody_is_enrolled() {
        let mut rig = Rig::new();
        rig.keep();
        assert_eq!(rig.to_tracking.hear(), None);
        rig.signs.enrolling.store(true, Ordering::Relaxed);
        rig.keep();
        assert!(rig.to_tracking.hear().is_some());
    }
}
