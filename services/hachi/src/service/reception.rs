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

use super::enrolment::{Enrolment, Stage};
use super::keeper::{Acquaintances, Settled};
use super::messages::{Belt, Looked};
use super::orders::{Answer, Inbox, NotBegun, Order};
use super::roster::Roster;
use super::signs::SharedSigns;
use super::view::{Shown, View};

/// Tracking's side of it.
pub struct Reception {
    /// Who is known.
    pub roster: Roster,
    /// Orders.
    pub inbox: Inbox,
    /// Who in the store is whom in view; `None` without a store.
    pub acquaintances: Option<Acquaintances>,
    /// Who is being enrolled; nobody can be without a store.
    pub enrolment: Option<Enrolment>,
    /// What is known, for the page.
    pub views: Belt<View>,
    /// The last picture.
    pub shown: Option<Shown>,
    /// What was last said of the enrolment.
    pub said: Option<(u32, Stage)>,
    /// Where it is left that somebody is being enrolled.
    pub signs: SharedSigns,
}

impl Reception {
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
                Some(begun.map_or_else(Answer::NotBegun, Answer::Begun))
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
