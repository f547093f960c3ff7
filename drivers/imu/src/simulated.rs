//! A chip without a chip: its registers, what they hold after a reset, and measurements that are ready
//! when its rate says so. It can be late, lose its power, fall silent, be another, and fail on its bus.
//!
//! In: bytes of registers, a motion. Out: bytes of registers. For tests of whatever reads the driver.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use hachi_hal::{Clock, Stamp, Vector3};

use crate::bus::Registers;
use crate::registers::{
    ACCEL_CONFIG, AccelRange, DATA_READY, DEVICE_CONFIG, GYRO_CONFIG, GyroRange, ICM_42688_P,
    INTERRUPT_STATUS, LOW_NOISE, MEASUREMENT_LEN, POWER, RESET, RESET_DONE, Rate, TEMPERATURE,
    WHO_AM_I,
};
use crate::system::BusFault;

/// What the ranges' and rates' registers hold after a reset: 1000 a second (sections 14.37, 14.38).
const AFTER_RESET: u8 = 0x06;

/// What the chip does at its next measurements.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Measures {
    /// Turning rate in rad/s and specific force in m/s², at 25 °C; what is beyond a range is its end.
    Motion(Vector3, Vector3),
    /// These bytes.
    Bytes([u8; MEASUREMENT_LEN]),
    /// Nothing, though it is switched on.
    Nothing,
}

#[derive(Debug)]
struct State {
    memory: [u8; 128],
    identity: u8,
    /// When the next measurement is ready; never while it is off.
    ready_at: Option<Stamp>,
    /// Transfers that fail.
    failing: u32,
    /// Does not come back from a reset.
    stuck: bool,
    measures: Measures,
}

/// A simulated chip. Clones are the same chip.
#[derive(Debug, Clone)]
pub struct SimulatedChip<C> {
    state: Arc<Mutex<State>>,
    clock: C,
}

impl<C: Clock> SimulatedChip<C> {
    /// A chip that lies still, as it is when its power comes on.
    pub fn new(clock: C) -> Self {
        let mut state = State {
            memory: [0; 128],
            identity: ICM_42688_P,
            ready_at: None,
            failing: 0,
            stuck: false,
            measures: Measures::Motion(Vector3::zeros(), Vector3::new(0.0, 0.0, 9.806_65)),
        };
        state.reset();
        Self {
            state: Arc::new(Mutex::new(state)),
            clock,
        }
    }

    /// What it measures from now on.
    pub fn set(&self, measures: Measures) {
        self.lock().measures = measures;
    }

    /// Its power is gone for a moment: it is as after a reset.
    pub fn lose_power(&self) {
        self.lock().reset();
    }

    /// So many of the transfers that come fail.
    pub fn fail(&self, transfers: u32) {
        self.lock().failing = transfers;
    }

    /// Whether it hangs in its next reset.
    pub fn hang(&self, stuck: bool) {
        self.lock().stuck = stuck;
    }

    /// It says that it is this chip.
    pub fn call_itself(&self, identity: u8) {
        let mut state = self.lock();
        state.identity = identity;
        state.memory[usize::from(WHO_AM_I)] = identity;
    }

    fn lock(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The chip, as long as its bus works.
    fn reached(&self) -> Result<MutexGuard<'_, State>, BusFault> {
        let mut state = self.lock();
        match state.failing {
            0 => Ok(state),
            failing => {
                state.failing = failing - 1;
                Err(BusFault("EREMOTEIO: Remote I/O error".into()))
            }
        }
    }
}

impl State {
    fn reset(&mut self) {
        self.memory = [0; 128];
        self.memory[usize::from(WHO_AM_I)] = self.identity;
        self.memory[usize::from(INTERRUPT_STATUS)] = RESET_DONE;
        self.memory[usize::from(GYRO_CONFIG)] = AFTER_RESET;
        self.memory[usize::from(ACCEL_CONFIG)] = AFTER_RESET;
        self.ready_at = None;
    }

    /// A register's bits for a range and for the rate.
    fn setting(&self, register: u8) -> (u8, u8) {
        let byte = self.memory[usize::from(register)];
        (byte >> 5, byte & 0x0F)
    }

    fn period_ns(&self) -> i64 {
        let bits = self.setting(GYRO_CONFIG).1;
        let all = [1000, 500, 200, 100].map(Rate::from_hz);
        let set = all.into_iter().flatten().find(|rate| rate.bits() == bits);
        set.unwrap_or_default().period_ns()
    }

    /// Measures what was due.
    fn advance(&mut self, now: Stamp) {
        let period_ns = self.period_ns();
        let Some(ready_at) = self.ready_at.as_mut().filter(|at| **at <= now) else {
            return;
        };
        let late = now.nanos_since(*ready_at) / period_ns + 1;
        *ready_at = *ready_at + late * period_ns;
        let bytes = match self.measures {
            Measures::Nothing => return,
            Measures::Bytes(bytes) => bytes,
            Measures::Motion(angular_velocity, specific_force) => {
                self.encode(angular_velocity, specific_force)
            }
        };
        self.memory[usize::from(TEMPERATURE)..][..MEASUREMENT_LEN].copy_from_slice(&bytes);
        self.memory[usize::from(INTERRUPT_STATUS)] |= DATA_READY;
    }

    fn encode(&self, angular_velocity: Vector3, specific_force: Vector3) -> [u8; MEASUREMENT_LEN] {
        let (gyro, accel) = (self.setting(GYRO_CONFIG).0, self.setting(ACCEL_CONFIG).0);
        let gyro_range = [2000, 1000, 500, 250].map(GyroRange::from_dps);
        let accel_range = [16, 8, 4, 2].map(AccelRange::from_g);
        let gyro = gyro_range.into_iter().flatten().find(|r| r.bits() == gyro);
        let accel = accel_range
            .into_iter()
            .flatten()
            .find(|r| r.bits() == accel);
        let accel_counts = specific_force / accel.unwrap_or_default().unit();
        let gyro_counts = angular_velocity / gyro.unwrap_or_default().unit();
        let mut bytes = [0; MEASUREMENT_LEN];
        let counts = accel_counts.iter().chain(&gyro_counts);
        for (place, count) in bytes[2..].chunks_exact_mut(2).zip(counts) {
            // The conversion ends at the range; the lowest count means that nothing was measured.
            let count = (count.round() as i16).max(-i16::MAX);
            place.copy_from_slice(&count.to_be_bytes());
        }
        bytes
    }
}

impl<C: Clock> Registers for SimulatedChip<C> {
    type Error = BusFault;

    fn read(&mut self, first: u8, bytes: &mut [u8]) -> Result<(), BusFault> {
        let now = self.clock.now();
        let mut state = self.reached()?;
        state.advance(now);
        for (byte, register) in bytes.iter_mut().zip(usize::from(first)..) {
            *byte = state.memory.get(register).copied().unwrap_or_default();
        }
        if first == INTERRUPT_STATUS {
            state.memory[usize::from(INTERRUPT_STATUS)] = 0;
        }
        Ok(())
    }

    fn write(&mut self, register: u8, value: u8) -> Result<(), BusFault> {
        let now = self.clock.now();
        let mut state = self.reached()?;
        if register == DEVICE_CONFIG && value & RESET != 0 {
            state.reset();
            if state.stuck {
                state.memory[usize::from(INTERRUPT_STATUS)] = 0;
            }
            return Ok(());
        }
        if let Some(byte) = state.memory.get_mut(usize::from(register)) {
            *byte = value;
        }
        if register == POWER {
            let period_ns = state.period_ns();
            state.ready_at = (value == LOW_NOISE).then(|| now + period_ns);
        }
        Ok(())
    }
}
