//! Where tracking hears what others want of it, and leaves what they want to know.
//!
//! In: orders from the desk, news of the keeper, what came of a picture. Out: whom the robot knows and
//! which of them is its person, a [`View`] for the page, somebody who is being enrolled to the keeper.
//! Never waits: orders that need a picture are put off until there is one.

use std::sync::atomic::Ordering;

use hachi_hal::Stamp;
use hachi_people::pointing::Meant;
use hachi_people::watch::Watch;
use tracing::info;

use super::acquaintances::Acquaintances;
use super::enrolment::{Enrolment, Stage};
use super::keeper::Settled;
use super::messages::{Belt, Looked};
use super::orders::{Answer, Inbox, NotBegun, Order};
use super::roster::Roster;
use super::signs::SharedSigns;
use super::view::{Shown, View};

/// An enrolment waits so long for somebody to be seen in front, seconds.
const PATIENCE_S: f64 = 1.0;

/// Tracking's side of it.
pub struct Reception {
    /// Who is known.
    pub roster: Roster,
    /// Orders.
    inbox: Inbox,
    /// Who in the store is whom in view; `None` without a store.
    pub acquaintances: Option<Acquaintances>,
    /// Who is being enrolled; nobody can be without a store.
    pub enrolment: Option<Enrolment>,
    /// What is known, for the page.
    views: Belt<View>,
    /// The last picture.
    shown: Option<Shown>,
    /// Since when an enrolment waits for somebody to be seen in front.
    nobody_since: Option<Stamp>,
    /// What was last said of the enrolment.
    said: Option<(u32, Stage)>,
    /// Where it is left that somebody is being enrolled.
    signs: SharedSigns,
}

impl Reception {
    /// One without a store.
    pub fn new(inbox: Inbox, views: Belt<View>, signs: SharedSigns) -> Self {
        Self {
            roster: Roster::default(),
            inbox,
            acquaintances: None,
            enrolment: None,
            views,
            shown: None,
            nobody_since: None,
            said: None,
            signs,
        }
    }

    /// Takes in news of the keeper and orders that need no picture.
    pub fn hear(&mut self, watch: &mut Watch, now: Stamp) {
        if let Some(acquaintances) = &mut self.acquaintances {
            acquaintances.hear(watch, &mut self.roster);
        }
        let settled = self.acquaintances.as_ref();
        if let Some(settled) = settled.and_then(|ends| ends.settled.receive()) {
            self.settle(watch, settled);
        }
        if let Some(enrolment) = &mut self.enrolment {
            enrolment.tick(now);
        }
        self.hold(watch);
        self.inbox.later();
        // One after the other: one that needs a picture holds up those behind it, for a second at most.
        while let Some(order) = self.inbox.take() {
            let answer = match order {
                Order::Cancel => {
                    Answer::Cancelled(self.enrolment.as_mut().is_some_and(Enrolment::cancel))
                }
                Order::Release => Answer::Released(self.release(watch)),
                Order::Pick(pointed) => {
                    watch.point(pointed, Meant::Anybody);
                    self.inbox.later();
                    continue;
                }
                Order::Enrol(_) => {
                    self.nobody_since = None;
                    self.inbox.later();
                    continue;
                }
            };
            self.inbox.answer(answer);
        }
    }

    /// Holds what the next picture may decide, so that it is not withdrawn in between.
    pub fn hold(&mut self, watch: &mut Watch) {
        if self.inbox.hold() {
            watch.stop_pointing();
        }
    }

    /// Carries out what waited for a picture, once the watch has seen it.
    pub fn see(&mut self, watch: &mut Watch, looked: &Looked, now: Stamp) {
        self.shown = Some(Shown::of(&looked.picture));
        if let Some(enrolment) = &mut self.enrolment {
            enrolment.see(watch.tracks(), looked);
        }
        let picked = watch.take_answer().map(|answer| match answer {
            Ok(picked) => {
                let (person, gone) = self.roster.pick(&picked);
                if let Some(gone) = gone {
                    watch.identifier().forget(gone);
                }
                Answer::Picked {
                    track: picked.track,
                    person,
                    known: picked.was.is_some(),
                }
            }
            Err(not) => Answer::NotPicked(not),
        });
        let answer = match self.inbox.held() {
            Some(Order::Pick(_)) => picked,
            Some(Order::Enrol(name)) => {
                let begun = match &mut self.enrolment {
                    Some(enrolment) => enrolment.begin(name, watch.tracks(), looked, now),
                    None => Err(NotBegun::NoStore),
                };
                // Detectors miss one in four: a single picture without anybody says little.
                let stamp = looked.picture.stamp;
                let since = *self.nobody_since.get_or_insert(stamp);
                let waits = begun == Err(NotBegun::Nobody) && stamp.secs_since(since) < PATIENCE_S;
                (!waits).then(|| begun.map_or_else(Answer::NotBegun, Answer::Begun))
            }
            _ => None,
        };
        match answer {
            Some(answer) => self.inbox.answer(answer),
            None => self.inbox.later(),
        }
        if let Some(acquaintances) = &mut self.acquaintances {
            acquaintances.tell(watch, &self.roster, looked.picture.stamp);
        }
    }

    /// Leaves what is known for the page, and says how an enrolment ended.
    pub fn tell(&mut self, watch: &Watch) {
        let progress = self.enrolment.as_ref().and_then(Enrolment::progress);
        let goes_on = self.enrolment.as_ref().is_some_and(Enrolment::goes_on);
        self.signs.enrolling.store(goes_on, Ordering::Relaxed);
        let ended = progress.filter(|p| p.stage.is_over());
        let ended = ended.map(|p| (p.number, p.stage));
        if ended.is_some() && ended != self.said {
            self.said = ended;
            if let Some((enrolment, stage)) = ended {
                info!(enrolment, ?stage, "an enrolment is over");
            }
        }
        // Where the page is slow, the box that it has not taken comes back.
        if let Some(mut view) = self.views.empty.receive() {
            view.fill(self.shown, watch, &self.roster, progress);
            self.views.send(view);
        }
    }

    fn release(&mut self, watch: &mut Watch) -> Option<u32> {
        let (number, gone) = self.roster.release()?;
        if let Some(gone) = gone {
            watch.identifier().forget(gone);
        }
        Some(number)
    }

    /// Somebody was enrolled, or was not.
    fn settle(&mut self, watch: &mut Watch, settled: Settled) {
        let Settled { number, kept } = settled;
        let progress = self.enrolment.as_ref().and_then(Enrolment::progress);
        let of_this = progress.filter(|p| p.number == number);
        let person = kept.map(|(stored, model)| {
            let track = of_this.map(|p| p.track);
            let track = track.filter(|track| watch.tracks().iter().any(|t| t.id == *track));
            let here = watch
                .statuses()
                .find(|s| track.is_some() && s.track == track);
            let here = here.map(|status| status.person);
            let person = watch.identifier().enrol(model, track);
            let Some(known) = here.and_then(|here| self.roster.of(here).copied()) else {
                return self.roster.add(person, Some(stored));
            };
            // Who was thought to be on that track: the user has just said who it is.
            let before = watch.model(known.person).cloned();
            watch.identifier().forget(known.person);
            match (known.stored, before) {
                (Some(_), Some(model)) => {
                    let elsewhere = watch.identifier().enrol(model, None);
                    self.roster.renumber(known.person, elsewhere);
                    self.roster.add(person, Some(stored))
                }
                _ => {
                    self.roster.renumber(known.person, person);
                    self.roster.store(person, stored);
                    known.number
                }
            }
        });
        if let Some(enrolment) = self.enrolment.as_mut().filter(|_| of_this.is_some()) {
            enrolment.settle(person);
        }
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use hachi_people::identify::{AppearanceModel, Condition, IdentifierConfig};
    use hachi_runtime::{TaskClock, TaskTable, VirtualClock, WhenFull, bounded};
    use hachi_store::people::{NetworkIdentity, NewPerson, PeopleFile, PeoplePaths, StoredId};

    use super::super::messages::belt;
    use super::super::orders::orders;
    use super::super::test_people::{observation, person_at};
    use super::*;

    const LOOKS: [f32; 2] = [1.0, 0.5];

    /// A robot before which one person stands who is being enrolled.
    struct Rig {
        reception: Reception,
        watch: Watch,
        looked: Looked,
        now: Stamp,
        store: PeopleFile,
        _folder: tempfile::TempDir,
    }

    impl Rig {
        fn new() -> Self {
            let now = Stamp::from_nanos(1);
            let clock = TaskClock::new(VirtualClock::starting_at(now));
            let table = TaskTable::new(clock);
            let nobody = table.bell();
            let (views, _) = belt::<View>(&table, "views", 1, &nobody);
            let (sittings, _) = bounded("sittings", 1, WhenFull::DropNewest, &nobody);
            let (_, inbox) = orders(&nobody, &nobody, Duration::from_secs(1));
            let folder = tempfile::tempdir().unwrap();
            let paths = PeoplePaths::beside(&folder.path().join("people.db"));
            let mut looked = Looked::default();
            (looked.picture.width, looked.picture.height) = (400, 200);
            looked.picture.rgb = vec![7; 3 * 400 * 200];
            Self {
                reception: Reception {
                    enrolment: Some(Enrolment::new(sittings)),
                    ..Reception::new(inbox, views, SharedSigns::default())
                },
                watch: Watch::new(0.5, IdentifierConfig::default()),
                looked,
                now,
                store: PeopleFile::open_or_create(&paths).unwrap(),
                _folder: folder,
            }
        }

        fn see(&mut self, pictures: usize) {
            for _ in 0..pictures {
                self.now = self.now + 100_000_000;
                let detections = [person_at(180.0, 40.0)];
                let observed = observation(&detections, &LOOKS);
                self.watch.step(&observed, 0.1);
                self.looked.keep(&observed);
                self.looked.picture.stamp = self.now;
                self.reception.see(&mut self.watch, &self.looked, self.now);
            }
        }

        /// Whoever stands there is in the store by this name from now on; their number.
        fn enrol(&mut self, name: &str) -> (StoredId, Option<u32>) {
            let tracks = self.watch.tracks();
            let enrolment = self.reception.enrolment.as_mut().unwrap();
            let number = enrolment
                .begin(name, tracks, &self.looked, self.now)
                .unwrap();
            self.see(80);
            let model = AppearanceModel::first(&LOOKS).unwrap();
            let entry = self.store.enrol(&NewPerson {
                name,
                enrolled_unix_s: 0,
                network: &NetworkIdentity::of_bytes("test", b"a network"),
                model: &model,
                images: &[],
            });
            let stored = entry.unwrap().id;
            let kept = Some((stored, model));
            self.reception
                .settle(&mut self.watch, Settled { number, kept });
            let enrolment = self.reception.enrolment.as_ref().unwrap();
            let progress = enrolment.progress().unwrap();
            assert_eq!(progress.stage, Stage::Done);
            (stored, progress.person)
        }

        fn condition(&self, number: u32) -> Condition {
            let known = self.reception.roster.people().iter();
            let known = known.copied().find(|known| known.number == number).unwrap();
            let mut statuses = self.watch.statuses();
            statuses
                .find(|s| s.person == known.person)
                .unwrap()
                .condition
        }
    }

    #[test]
    fn whoever_was_picked_and_is_enrolled_keeps_their_number_and_is_the_robots_person() {
        let mut rig = Rig::new();
        rig.see(5);
        let track = rig.watch.tracks()[0].id;
        rig.watch.point(
            hachi_people::pointing::Pointed::Track(track),
            Meant::Anybody,
        );
        rig.see(1);
        assert_eq!(rig.reception.roster.picked(), Some(1));
        let (stored, number) = rig.enrol("Anna");
        assert_eq!(number, Some(1));
        let [known] = *rig.reception.roster.people() else {
            panic!("more than one");
        };
        assert_eq!(known.stored, Some(stored));
        assert_eq!(rig.reception.roster.picked(), Some(1));
        rig.see(2);
        assert_eq!(rig.condition(1), Condition::Seen);
        // Released, somebody in the store stays known.
        assert_eq!(rig.reception.release(&mut rig.watch), Some(1));
        assert_eq!(rig.watch.statuses().count(), 1);
    }

    #[test]
    fn whoever_is_enrolled_on_a_known_person_s_track_is_who_the_user_says_they_are() {
        let mut rig = Rig::new();
        rig.see(5);
        let (_, anna) = rig.enrol("Anna");
        rig.see(2);
        let (_, hanna) = rig.enrol("Hanna");
        rig.see(2);
        assert_eq!((anna, hanna), (Some(1), Some(2)));
        assert_eq!(rig.condition(2), Condition::Seen);
        assert_eq!(rig.condition(1), Condition::Searching);
    }
}
