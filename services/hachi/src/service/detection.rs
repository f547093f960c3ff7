//! `detection`: who is in a picture, and what they look like. The networks; all that takes long.

use std::sync::atomic::Ordering;

use hachi_hal::Stamp;
use hachi_inference::ImageView;
use hachi_people::observe::Observer;
use hachi_runtime::{Progress, Work};
use tracing::warn;

use super::messages::{Belt, BeltEnd, Looked, Picture};
use super::signs::SharedSigns;

/// What the task leaves out, step by step.
pub const LADDER: &[&str] = &[
    "every second picture",
    "three of four pictures",
    "seven of eight pictures",
];

/// The task.
pub struct Detection {
    /// The networks.
    pub observer: Observer,
    /// From the camera.
    pub pictures: BeltEnd<Picture>,
    /// To tracking.
    pub out: Belt<Looked>,
    /// Where it is left that the networks fail.
    pub signs: SharedSigns,
    /// Pictures so far.
    pub count: u64,
    /// The step of the ladder.
    pub level: usize,
}

impl Work for Detection {
    fn run(&mut self, _: Stamp) -> Progress {
        let Some(mut picture) = self.pictures.full.receive() else {
            return Progress::Done;
        };
        self.count += 1;
        if self.count.is_multiple_of(1 << self.level)
            && let Some(mut looked) = self.out.empty.receive()
        {
            std::mem::swap(&mut looked.picture, &mut picture);
            match self.look(&mut looked) {
                Ok(()) => {
                    self.signs.network_fails.store(false, Ordering::Relaxed);
                    self.out.send(looked);
                }
                Err(error) => {
                    if !self.signs.network_fails.swap(true, Ordering::Relaxed) {
                        warn!(error, "a picture can't be looked at");
                    }
                    self.out.give_back(looked);
                }
            }
        }
        self.pictures.give_back(picture);
        Progress::Done
    }

    fn degrade(&mut self, level: usize) {
        self.level = level;
    }
}

impl Detection {
    fn look(&mut self, looked: &mut Looked) -> Result<(), String> {
        let Picture {
            width, height, rgb, ..
        } = &looked.picture;
        let image = ImageView::new(*width, *height, rgb).map_err(|error| error.to_string())?;
        let observed = self
            .observer
            .observe(&image)
            .map_err(|error| error.to_string())?;
        looked.keep(&observed);
        looked.found.clear();
        looked.found.extend_from_slice(self.observer.found());
        Ok(())
    }
}
