//! `base command`: hears the robot, asks the gate, tells the robot. The only task that can.

use std::sync::atomic::Ordering;

use hachi_behaviour::{Cause, GuardedBase, Obstacles, PlaceEstimate, Sight, Verdict};
use hachi_hal::{BaseCommand, Stamp, StopSample, Watchdog};
use hachi_runtime::{Halt, Progress, Receiver, Sender, SoftWatchdog, Work};
use hachi_unitree::BodySample;
use hachi_unitree::device::RobotLink;
use tracing::{info, warn};

use super::body::UnitreeBody;
use super::herald::Herald;
use super::signs::SharedSigns;

/// States taken in at one run: a B1 sends two in 5 ms; after a pause they come in a bunch.
const MOST_AT_ONCE: usize = 32;

/// The task.
pub struct BaseCommandTask<L> {
    /// The robot behind the gate.
    pub base: GuardedBase<UnitreeBody<L>>,
    /// What the gate knows.
    pub sight: Sight,
    /// Wishes of behaviours.
    pub wishes: Receiver<BaseCommand>,
    /// The last of them.
    pub wish: Option<BaseCommand>,
    /// The emergency stop on a bus, where there is one.
    pub stop_node: Option<Receiver<StopSample>>,
    /// What was last heard of it.
    pub node_stop: Option<StopSample>,
    /// What was last heard of the remote control's.
    pub remote_stop: Option<StopSample>,
    /// Where the robot is.
    pub places: Receiver<PlaceEstimate>,
    /// What stands around.
    pub around: Receiver<Obstacles>,
    /// The last of it.
    pub obstacles: Option<Obstacles>,
    /// Legs and body, on to the legs' task.
    pub bodies: Sender<BodySample>,
    /// Whether a task broke a promise.
    pub halt: Halt,
    /// Fed with each run.
    pub watchdog: SoftWatchdog,
    /// What the task leaves for whoever asks.
    pub signs: SharedSigns,
    /// What was said of why the robot stands.
    pub herald: Herald,
    /// Whether the last step failed at the base.
    pub failing: bool,
    /// Whether the link to the robot failed when it was last listened to.
    pub deaf: bool,
}

impl<L: RobotLink + Send> Work for BaseCommandTask<L> {
    fn run(&mut self, now: Stamp) -> Progress {
        self.hear(now);
        self.look();
        let wish = self.wish.as_ref();
        let verdict = match self
            .base
            .step(now, wish, &self.sight, self.obstacles.as_ref())
        {
            Ok(moved) => {
                self.failing = false;
                moved.verdict
            }
            Err(unmoved) => {
                // Not at every run: a robot that lies refuses two hundred times a second.
                if !self.failing {
                    warn!(error = %unmoved.error, "the robot does not take the command");
                }
                self.failing = true;
                unmoved.verdict
            }
        };
        self.say(now, &verdict);
        // Feeding can't fail: its error has no value.
        let Ok(()) = self.watchdog.feed(now);
        Progress::Done
    }
}

impl<L: RobotLink> BaseCommandTask<L> {
    /// Takes in what the robot sent.
    fn hear(&mut self, now: Stamp) {
        for _ in 0..MOST_AT_ONCE {
            let heard = self.base.listen(now);
            let was_deaf = std::mem::replace(&mut self.deaf, heard.is_err());
            match heard {
                Ok(Some(report)) => {
                    self.sight.robot = Some(report.stamp);
                    self.signs.robot.set(report.stamp);
                    self.remote_stop = report.stop.or(self.remote_stop);
                    if let Some(battery) = report.battery {
                        let percent = (100.0 * battery.charge).round() as u32;
                        self.signs.battery_percent.store(percent, Ordering::Relaxed);
                    }
                    if let Some(body) = report.body {
                        let _ = self.bodies.send(body);
                    }
                }
                Ok(None) => return,
                Err(error) => {
                    if !was_deaf {
                        warn!(%error, "the link to the robot fails");
                    }
                    return;
                }
            }
        }
    }

    /// Takes in what other tasks know.
    fn look(&mut self) {
        if let Some(place) = self.places.newest() {
            self.sight.localisation = Some((place.stamp, place.trusted));
        }
        self.sight.emergency_stop = match &self.stop_node {
            None => self.remote_stop,
            Some(samples) => {
                self.node_stop = samples.newest().or(self.node_stop);
                either(self.remote_stop, self.node_stop)
            }
        };
        self.obstacles = self.around.newest().or(self.obstacles);
        self.wish = self.wishes.newest().or(self.wish);
        self.sight.camera = self.signs.camera.get();
        self.sight.event_loop = self.signs.event_loop.get();
        self.sight.task_overrun = self.halt.is_asked_for();
    }

    /// Says what changed. That nobody wishes anything is no news: it is how a robot rests.
    fn say(&mut self, now: Stamp, verdict: &Verdict) {
        self.signs.set_causes(verdict.causes);
        if verdict.limited {
            self.signs.limited.fetch_add(1, Ordering::Relaxed);
        }
        let news = self.herald.hear(now, verdict.causes);
        for cause in news.come.iter() {
            match cause {
                Cause::NoWish | Cause::Obstacle => info!("{}", cause.line()),
                _ => warn!("{}", cause.line()),
            }
        }
        if news.over {
            info!("going on");
        }
    }
}

/// Two stops as one: pressed if either is, as old as the older one, unheard while either is.
fn either(one: Option<StopSample>, other: Option<StopSample>) -> Option<StopSample> {
    match (one, other) {
        (Some(one), Some(other)) => Some(StopSample {
            stamp: one.stamp.min(other.stamp),
            pressed: one.pressed || other.pressed,
        }),
        (one, other) => one.or(other).filter(|heard| heard.pressed),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn either_stop_stops_and_both_must_be_heard() {
        let stop = |nanos, pressed| {
            Some(StopSample {
                stamp: Stamp::from_nanos(nanos),
                pressed,
            })
        };
        assert_eq!(either(stop(5, false), stop(3, false)), stop(3, false));
        assert_eq!(either(stop(5, true), stop(3, false)), stop(3, true));
        assert_eq!(either(stop(5, false), stop(9, true)), stop(5, true));
        assert_eq!(either(None, stop(9, true)), stop(9, true));
        assert_eq!(either(stop(9, false), None), None);
        assert_eq!(either(None, None), None);
    }
}
