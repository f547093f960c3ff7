//! `tracking`: who is where from picture to picture, and which of them the robot knows.

use std::sync::Arc;
use std::sync::atomic::Ordering;

use hachi_hal::{Clock, Stamp};
use hachi_people::identify::Condition;
use hachi_people::watch::Watch;
use hachi_runtime::{Histogram, Progress, TaskClock, Work};
use tracing::info;

use super::keeper::Acquaintances;
use super::messages::{BeltEnd, Looked};
use super::signs::SharedSigns;

/// Somebody who sees what the robot sees, and may point at a person.
pub trait Audience: Send {
    /// What was made of a picture. Where the user points in it, pixels, if they do.
    fn see(&mut self, looked: &Looked, watch: &Watch) -> Option<[f64; 2]>;
}

/// The task.
pub struct Tracking {
    /// Who is where.
    pub watch: Watch,
    /// From detection.
    pub looked: BeltEnd<Looked>,
    /// Time of the last picture.
    pub last: Option<Stamp>,
    /// Who in the store is whom in view; `None` without a store.
    pub acquaintances: Option<Acquaintances>,
    /// Who sees it.
    pub audience: Option<Box<dyn Audience>>,
    /// From the middle of the exposure to where the robot's people are.
    pub latency: Arc<Histogram>,
    /// The clock that it is measured on.
    pub clock: TaskClock,
    /// What the task leaves for whoever asks.
    pub signs: SharedSigns,
    /// What was last said of the first person whom the robot knows.
    pub said: Option<Condition>,
}

impl Work for Tracking {
    fn run(&mut self, _: Stamp) -> Progress {
        let Some(looked) = self.looked.full.receive() else {
            return Progress::Done;
        };
        let stamp = looked.picture.stamp;
        let dt_s = self.last.map_or(0.0, |last| stamp.secs_since(last));
        self.last = Some(stamp);
        if let Some(acquaintances) = &mut self.acquaintances {
            acquaintances.hear(&mut self.watch);
        }
        self.watch.step(&looked.observation(), dt_s);
        if let Some(acquaintances) = &mut self.acquaintances {
            acquaintances.tell(&self.watch, stamp);
        }
        let now = self.clock.now();
        self.latency.record_signed_ns(now.nanos_since(stamp));
        self.tell();
        if let Some(audience) = &mut self.audience
            && let Some(at) = audience.see(&looked, &self.watch)
        {
            self.watch.pick(at);
        }
        self.looked.give_back(looked);
        Progress::Done
    }
}

impl Tracking {
    /// Leaves what is known, and says what changed.
    fn tell(&mut self) {
        let tracks = self.watch.tracks().iter();
        let in_view = tracks.filter(|track| track.is_confirmed() && track.is_seen());
        let in_view = u32::try_from(in_view.count()).unwrap_or(u32::MAX);
        self.signs.people_in_view.store(in_view, Ordering::Relaxed);
        let condition = self.watch.statuses().next().map(|status| status.condition);
        if condition == self.said {
            return;
        }
        self.said = condition;
        self.signs
            .person
            .set(condition.map_or("", |condition| condition.name()));
        if let Some(condition) = condition {
            // By number: names are kept where they can be forgotten, which a log can't.
            info!(condition = condition.name(), "person 1");
        }
    }
}
