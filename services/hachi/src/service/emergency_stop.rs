//! `emergency stop`: a stop's node on a CAN bus, for the gate.
//!
//! In: a bus, opened anew after it was down. Out: pressed or not at every run, to the base command
//! task; whatever is not a living node with closed contacts is *pressed*, and so is a bus that is down.
//! A task that says nothing is taken for pressed by the gate itself.

use hachi_canbus::stop_node::{StopNodeConfig, StopReason};
use hachi_canbus::{BusError, CanStop, device::CanBus};
use hachi_hal::{Stamp, StopSample};
use hachi_runtime::{Progress, Sender, TaskClock, Work};
use tracing::{info, warn};

use super::signs::SharedSigns;

/// A bus that may have been down.
pub type Bus = Box<dyn CanBus + Send>;

/// Opens the bus, again and again.
pub type OpenBus = Box<dyn FnMut() -> Result<Bus, BusError> + Send>;

/// A stop's node and its bus.
pub struct StopBus {
    /// How the stop is wired.
    pub node: StopNodeConfig,
    /// Opens the bus.
    pub open: OpenBus,
}

/// Frames taken in at one run: the node sends one every 100 ms and one for each change.
const MOST_AT_ONCE: usize = 8;

/// From one attempt to open a bus that is down to the next, ns.
const AGAIN_NS: i64 = 500_000_000;

/// The task.
pub struct EmergencyStopTask {
    /// The node and its bus.
    pub bus: StopBus,
    /// The robot's clock.
    pub clock: TaskClock,
    /// To the base command task.
    pub out: Sender<StopSample>,
    /// Where it is left that the node is well.
    pub signs: SharedSigns,
    /// The stop, while its bus is up.
    pub stop: Option<CanStop<Bus, TaskClock>>,
    /// When the bus is opened next; kept until it is read without a fault.
    pub opens_at: Option<Stamp>,
    /// Why the robot must stand when it was last said; the bus being down is a node unheard.
    pub said: Option<StopReason>,
}

impl Work for EmergencyStopTask {
    fn run(&mut self, now: Stamp) -> Progress {
        self.connect(now);
        self.hear(now);
        let reason = match &self.stop {
            Some(stop) => stop.reason(),
            None => Some(StopReason::Silent),
        };
        let sample = StopSample {
            stamp: now,
            pressed: reason.is_some(),
        };
        // A full queue lets the older one go: only the newest counts.
        let _ = self.out.send(sample);
        if matches!(reason, None | Some(StopReason::Pressed)) {
            self.signs.stop_node.set(now);
        }
        if reason != self.said {
            match reason {
                None => info!("the emergency stop lets the robot go"),
                Some(StopReason::Emergency { code }) => {
                    warn!(code, "{}", StopReason::Emergency { code }.name());
                }
                Some(reason) => warn!("{}", reason.name()),
            }
            self.said = reason;
        }
        Progress::Done
    }
}

impl EmergencyStopTask {
    /// Opens a bus that is down, from time to time.
    fn connect(&mut self, now: Stamp) {
        if self.stop.is_some() || self.opens_at.is_some_and(|at| now < at) {
            return;
        }
        match (self.bus.open)() {
            Ok(bus) => {
                // The settings were checked: such a node there can be.
                self.stop = CanStop::new(bus, self.clock.clone(), self.bus.node);
            }
            Err(error) => {
                if self.opens_at.is_none() {
                    warn!(%error, "the emergency stop's bus can't be opened");
                }
                self.opens_at = Some(now + AGAIN_NS);
            }
        }
    }

    /// Takes in what the node sent.
    fn hear(&mut self, now: Stamp) {
        let Some(stop) = &mut self.stop else {
            return;
        };
        for _ in 0..MOST_AT_ONCE {
            match stop.take_in() {
                // An interface that is down opens, and fails when it is read.
                Ok(more) => {
                    if self.opens_at.take().is_some() {
                        info!("the emergency stop's bus is there again");
                    }
                    if !more {
                        return;
                    }
                }
                Err(error) => {
                    if self.opens_at.is_none() {
                        warn!(%error, "the emergency stop's bus fails");
                    }
                    self.stop = None;
                    self.opens_at = Some(now + AGAIN_NS);
                    return;
                }
            }
        }
    }
}
