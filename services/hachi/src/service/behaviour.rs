//! `behaviour`: where the robot shall go; a wish for the gate.

use std::sync::atomic::Ordering;

use hachi_behaviour::{Obstacles, Patrol, PlaceEstimate};
use hachi_hal::{BaseCommand, Stamp};
use hachi_runtime::{Progress, Receiver, Sender, Work};
use tracing::warn;

use super::signs::SharedSigns;

/// The task.
pub struct Behaviour {
    /// The patrol.
    pub patrol: Patrol,
    /// Where the robot is.
    pub places: Receiver<PlaceEstimate>,
    /// The last of it.
    pub place: Option<PlaceEstimate>,
    /// What stands around.
    pub around: Receiver<Obstacles>,
    /// The last of it; nothing at first, when the gate lets nobody go.
    pub obstacles: Obstacles,
    /// What the task leaves for whoever asks.
    pub signs: SharedSigns,
    /// To the gate.
    pub wishes: Sender<BaseCommand>,
}

impl Work for Behaviour {
    fn run(&mut self, now: Stamp) -> Progress {
        self.place = self.places.newest().or(self.place);
        self.obstacles = self.around.newest().unwrap_or(self.obstacles);
        let was_blocked = self.patrol.blocked();
        let wish = self
            .place
            .and_then(|place| self.patrol.step(now, &place, &self.obstacles));
        if let Some(wish) = wish {
            let _ = self.wishes.send(wish);
        }
        if self.patrol.blocked() != was_blocked {
            self.say();
        }
        Progress::Done
    }
}

impl Behaviour {
    /// Says where the patrol could not go, counted as people count.
    fn say(&self) {
        let blocked = self.patrol.blocked();
        self.signs
            .way_blocked
            .store(blocked.is_some(), Ordering::Relaxed);
        if let Some(place) = blocked {
            warn!(
                "the way to place {} is blocked: going on to place {}",
                place + 1,
                self.patrol.next() + 1
            );
        }
    }
}
