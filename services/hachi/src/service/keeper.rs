//! `keeper`: what people look like by now is kept, and whoever is enrolled or forgotten by another
//! program meanwhile becomes known here, or unknown.
//!
//! In: models as tracking learns them; the store. Out: news for tracking. The task waits for the disk,
//! below everything else; [`Acquaintances`] is tracking's end, which never waits.

use std::time::Duration;

use hachi_hal::Stamp;
use hachi_people::identify::{AppearanceModel, PersonId};
use hachi_people::watch::Watch;
use hachi_runtime::{Bell, Progress, Receiver, Sender, WhenFull, Work, bounded};
use hachi_store::people::{NetworkIdentity, PeopleError, PeopleFile, PersonEntry, StoredId};
use tracing::{info, warn};

/// From one time that a person's looks are kept to the next, s. A power cut costs what was learnt since.
const KEPT_EVERY_S: f64 = 10.0;
/// How long a change waits for another program's: it comes again in ten seconds.
const PATIENCE: Duration = Duration::from_millis(200);
/// Models and news under way.
const WAITING: usize = 32;

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

/// The task.
pub struct Keeper {
    kept: Kept,
    /// Whom tracking was told of.
    people: Vec<PersonEntry>,
    /// Whom it was not: other networks' and damaged models, said once.
    left_out: Vec<StoredId>,
    looks: Receiver<(StoredId, AppearanceModel)>,
    news: Sender<News>,
    /// Whether the store has to be looked through.
    stale: bool,
    /// Whether the last change failed.
    failing: bool,
}

/// The two ends; the bell is rung by nobody who waits.
pub fn keeper(kept: Kept, bell: &Bell) -> (Keeper, Acquaintances) {
    let (to_keeper, looks) = bounded("people's looks", WAITING, WhenFull::DropOldest, bell);
    // What does not fit is told the next time.
    let (news, from_keeper) = bounded("people's news", WAITING, WhenFull::DropNewest, bell);
    // Setting a time-out can't fail.
    let _ = kept.store.set_patience(PATIENCE);
    let keeper = Keeper {
        kept,
        people: Vec::new(),
        left_out: Vec::new(),
        looks,
        news,
        stale: true,
        failing: false,
    };
    let acquaintances = Acquaintances {
        people: Vec::new(),
        looks: to_keeper,
        news: from_keeper,
        kept_at: None,
    };
    (keeper, acquaintances)
}

impl Work for Keeper {
    fn run(&mut self, _: Stamp) -> Progress {
        let saved = self.save();
        let looked = self.look_through();
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

    /// Tells tracking what changed in the store.
    fn look_through(&mut self) -> Result<(), PeopleError> {
        self.stale |= self.kept.store.has_changed()?;
        if !self.stale {
            return Ok(());
        }
        let listing = self.kept.store.list()?;
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

/// Tracking's end: who in the store is whom in view.
pub struct Acquaintances {
    people: Vec<(StoredId, PersonId)>,
    looks: Sender<(StoredId, AppearanceModel)>,
    news: Receiver<News>,
    kept_at: Option<Stamp>,
}

impl Acquaintances {
    /// Takes in what changed in the store.
    pub fn hear(&mut self, watch: &mut Watch) {
        while let Some(news) = self.news.receive() {
            match news {
                News::Known(id, model) => {
                    self.people
                        .push((id, watch.identifier().enrol(model, None)));
                }
                News::Forgotten(gone) => self.people.retain(|(id, person)| {
                    if *id == gone {
                        watch.identifier().forget(*person);
                    }
                    *id != gone
                }),
            }
        }
    }

    /// Has the looks of everybody in view kept, from time to time.
    pub fn tell(&mut self, watch: &Watch, now: Stamp) {
        let kept_at = *self.kept_at.get_or_insert(now);
        if now.secs_since(kept_at) < KEPT_EVERY_S {
            return;
        }
        self.kept_at = Some(now);
        let in_view = watch.statuses().filter(|status| status.unseen_s == 0.0);
        for status in in_view {
            let stored = self.people.iter().find(|(_, p)| *p == status.person);
            if let (Some((id, _)), Some(model)) = (stored, watch.model(status.person)) {
                // The oldest one goes where the keeper is behind: only the newest counts.
                let _ = self.looks.send((*id, model.clone()));
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use hachi_people::BoundingBox;
    use hachi_people::identify::IdentifierConfig;
    use hachi_people::observe::Observation;
    use hachi_people::track::{Detection, Features};
    use hachi_runtime::{TaskClock, TaskTable, VirtualClock};
    use hachi_store::people::{NewPerson, PeoplePaths};

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
            let (keeper, acquaintances) = keeper(kept, &table.bell());
            Self {
                keeper,
                acquaintances,
                watch: Watch::new(0.5, IdentifierConfig::default()),
                other: PeopleFile::open_or_create(&paths).unwrap(),
                now,
                _folder: folder,
            }
        }

        fn keep(&mut self) {
            self.keeper.run(self.now);
            self.acquaintances.hear(&mut self.watch);
        }

        /// Somebody who looks like this is in view for so many seconds.
        fn see(&mut self, looks: [f32; 4], seconds: u32) {
            let detections = [Detection {
                bounding_box: BoundingBox::new(10.0, 10.0, 40.0, 100.0),
                score: 0.95,
            }];
            for _ in 0..5 * seconds {
                self.now = self.now + 200_000_000;
                let seen = Observation {
                    detections: &detections,
                    features: Some(Features {
                        dimension: 4,
                        values: &looks,
                        same_person_distance: 0.4,
                    }),
                };
                self.watch.step(&seen, 0.2);
                self.acquaintances.tell(&self.watch, self.now);
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
}
