//! `imu`: an inertial sensor on a bus, for odometry.
//!
//! In: a bus, opened anew after it failed or fell silent. Out: samples in the base's axes. While none
//! come odometry goes on without; health and the log say so.

use std::sync::atomic::Ordering;

use hachi_hal::{DeviceError, FaultKind, Imu, ImuSample, Rotation, Stamp, Vector3};
use hachi_imu::system::{AnyRegisters, BusFault, Sleep};
use hachi_imu::{Icm42688, ImuConfig, ImuCounters, ImuError};
use hachi_runtime::{Progress, Sender, TaskClock, TaskSpec, Trigger, Work};
use tracing::{info, warn};

use super::rows;
use super::signs::SharedSigns;

/// Opens the bus, again and again.
pub type OpenRegisters = Box<dyn FnMut() -> Result<AnyRegisters, BusFault> + Send>;

/// An inertial sensor and its bus.
pub struct ImuDevice {
    /// Opens the bus.
    pub open: OpenRegisters,
    /// How it measures.
    pub measuring: ImuConfig,
    /// How it is turned on the robot's base.
    pub base_from_imu: Rotation,
}

/// From one attempt to start a sensor that failed to the next, ns.
const AGAIN_NS: i64 = 500_000_000;
/// A sensor that measures nothing for this long is started anew, ns. The driver looks before that
/// whether the chip lost its power.
const SILENT_NS: i64 = 500_000_000;
/// Reads that may fail one after the other before the bus is opened anew: interference is short.
const FAILURES: u32 = 10;
/// What stands still feels 1 g upwards, and so does what walks, in the mean over this long, s.
const UP_S: f64 = 1.0;
/// Where up is farther from the base's z axis than 45 degrees, the robot has fallen or the mount is not
/// what the settings say: such turning rates would mislead odometry.
const LEAST_UP: f64 = std::f64::consts::FRAC_1_SQRT_2;
/// Looks in the time of one measurement: none is missed, and its stamp is late by half of that time
/// at most.
const LOOKS: i64 = 2;
/// The share of its period that a run is given. A measurement takes half a millisecond on I2C at
/// 400 kHz, a tenth of that on SPI.
const SHARE: f64 = 0.4;

/// Said of a sensor that is not upright.
const TILTED: &str = "the inertial sensor does not feel up where the base has it: the robot lies on its \
                      side, or imu.base_from_imu is wrong";

/// The row of a sensor that measures so often.
pub fn spec(measuring: &ImuConfig) -> TaskSpec {
    let period_ns = measuring.rate.period_ns() / LOOKS;
    TaskSpec {
        trigger: Trigger::Period { period_ns },
        budget_ns: (period_ns as f64 * SHARE) as i64,
        ..rows::IMU
    }
}

/// The task.
pub struct ImuTask {
    /// The sensor and its bus.
    pub device: ImuDevice,
    /// The robot's clock.
    pub clock: TaskClock,
    /// To odometry.
    pub out: Sender<ImuSample>,
    /// To the recorder, if there is one.
    pub record: Option<Sender<ImuSample>>,
    /// Where it is left that the sensor is well, and what was counted.
    pub signs: SharedSigns,
    /// The sensor, while it works.
    pub sensor: Option<Sensor>,
    /// When it is started next, after a failure.
    pub starts_at: Option<Stamp>,
    /// What was counted of sensors before this one.
    pub past: ImuCounters,
    /// What is wrong, as it was last said.
    pub said: Option<String>,
}

/// A sensor that was started.
pub struct Sensor {
    chip: Icm42688<AnyRegisters, Sleep, TaskClock>,
    /// When it last measured, or was started.
    last: Stamp,
    /// Reads that failed since.
    failures: u32,
    /// The mean of the specific force, in the base's axes.
    up: Option<Vector3>,
}

impl Sensor {
    /// Whether up is where it is on a robot that is on its feet.
    fn is_upright(&mut self, force: &Vector3, period_ns: i64) -> bool {
        let share = (period_ns as f64 * 1e-9 / UP_S).min(1.0);
        let up = self.up.get_or_insert(*force);
        *up += (force - *up) * share;
        up.z > LEAST_UP * up.norm()
    }
}

impl Work for ImuTask {
    fn run(&mut self, now: Stamp) -> Progress {
        self.start(now);
        let Some(sensor) = &mut self.sensor else {
            return Progress::Done;
        };
        // Not until later than now: one look, and back.
        match sensor.chip.read(now) {
            Ok(Some(sample)) => {
                (sensor.last, sensor.failures) = (now, 0);
                self.pass_on(&sample);
            }
            Ok(None) if now.nanos_since(sensor.last) > SILENT_NS => {
                self.stop(now, "the inertial sensor measures nothing");
            }
            Ok(None) => {}
            Err(error) => self.fault(now, &error),
        }
        self.count();
        Progress::Done
    }
}

impl ImuTask {
    /// Opens the bus and starts the chip, from time to time until it works. Takes 50 ms: meanwhile
    /// nothing is there to be read anyway.
    fn start(&mut self, now: Stamp) {
        if self.sensor.is_some() || self.starts_at.is_some_and(|at| now < at) {
            return;
        }
        let device = &mut self.device;
        let started = (device.open)()
            .map_err(ImuError::Bus)
            .and_then(|registers| {
                Icm42688::start(registers, Sleep, self.clock.clone(), device.measuring)
            });
        self.signs.imu.starts.fetch_add(1, Ordering::Relaxed);
        match started {
            Ok(chip) => {
                self.sensor = Some(Sensor {
                    chip,
                    last: now,
                    failures: 0,
                    up: None,
                });
            }
            Err(error) => {
                self.signs.imu.faults.fetch_add(1, Ordering::Relaxed);
                self.stop(now, &error.to_string());
            }
        }
    }

    fn pass_on(&mut self, sample: &ImuSample) {
        let base_from_imu = self.device.base_from_imu;
        let sample = ImuSample {
            stamp: sample.stamp,
            angular_velocity: base_from_imu * sample.angular_velocity,
            specific_force: base_from_imu * sample.specific_force,
        };
        let period_ns = self.device.measuring.rate.period_ns();
        let Some(sensor) = &mut self.sensor else {
            return;
        };
        if !sensor.is_upright(&sample.specific_force, period_ns) {
            self.signs.imu.tilted.fetch_add(1, Ordering::Relaxed);
            self.say(TILTED);
            return;
        }
        if self.said.take().is_some() {
            info!("the inertial sensor measures again");
        }
        self.signs.imu.last.set(sample.stamp);
        // Full queues let the oldest go: a scan asks for the newest.
        let _ = self.out.send(sample);
        if let Some(record) = &self.record {
            let _ = record.send(sample);
        }
    }

    /// Says what is wrong, where that is news.
    fn say(&mut self, why: &str) {
        if self.said.as_deref() != Some(why) {
            warn!("{why}");
            self.said = Some(why.to_owned());
        }
    }

    fn fault(&mut self, now: Stamp, error: &ImuError<BusFault>) {
        self.signs.imu.faults.fetch_add(1, Ordering::Relaxed);
        let Some(sensor) = &mut self.sensor else {
            return;
        };
        sensor.failures += 1;
        if error.kind() != FaultKind::ReadAgain || sensor.failures >= FAILURES {
            self.stop(now, &error.to_string());
        }
    }

    /// Closes the bus, and says why.
    fn stop(&mut self, now: Stamp, why: &str) {
        if let Some(sensor) = self.sensor.take() {
            self.past += sensor.chip.counters();
        }
        self.starts_at = Some(now + AGAIN_NS);
        self.say(why);
    }

    fn count(&self) {
        let mut counters = self.past;
        if let Some(sensor) = &self.sensor {
            counters += sensor.chip.counters();
        }
        self.signs.imu.set(&counters);
    }
}
