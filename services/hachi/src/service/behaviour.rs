//! `behaviour`: where the robot shall go; a wish for the gate.

use hachi_behaviour::{Patrol, PlaceEstimate};
use hachi_hal::{BaseCommand, Stamp};
use hachi_runtime::{Progress, Receiver, Sender, Work};

/// The task.
pub struct Behaviour {
    /// The patrol.
    pub patrol: Patrol,
    /// Where the robot is.
    pub places: Receiver<PlaceEstimate>,
    /// The last of it.
    pub place: Option<PlaceEstimate>,
    /// To the gate.
    pub wishes: Sender<BaseCommand>,
}

impl Work for Behaviour {
    fn run(&mut self, now: Stamp) -> Progress {
        self.place = self.places.newest().or(self.place);
        let wish = self.place.and_then(|place| self.patrol.step(now, &place));
        if let Some(wish) = wish {
            let _ = self.wishes.send(wish);
        }
        Progress::Done
    }
}
