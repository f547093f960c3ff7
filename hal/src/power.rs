//! The battery.

use crate::{DeviceError, Stamp};

/// What a battery reports at one moment.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct BatterySample {
    /// When it was measured.
    pub stamp: Stamp,
    /// Charge, 0 to 1.
    pub charge: f64,
    /// Voltage of all cells, V.
    pub voltage: f64,
    /// Current, A; negative while it is drained.
    pub current: f64,
    /// The hottest of its sensors, °C.
    pub temperature_c: f64,
    /// Lowest voltage of a cell, V.
    pub lowest_cell: f64,
    /// Charge cycles so far.
    pub cycles: u32,
}

impl BatterySample {
    /// Whether every value is finite and the charge is a share.
    pub fn is_plausible(&self) -> bool {
        let values = [
            self.voltage,
            self.current,
            self.temperature_c,
            self.lowest_cell,
        ];
        (0.0..=1.0).contains(&self.charge) && values.iter().all(|v| v.is_finite())
    }
}

/// A battery that tells its state.
///
/// - `read_battery` is back by `deadline`; nothing new is `Ok(None)`;
/// - stamps strictly increase; the charge is 0 to 1 and the other values are finite;
/// - an error leaves the device usable.
pub trait Battery {
    /// What can go wrong.
    type Error: DeviceError;
    /// The next report.
    fn read_battery(&mut self, deadline: Stamp) -> Result<Option<BatterySample>, Self::Error>;
}
