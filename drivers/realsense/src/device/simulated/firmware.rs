//! A RealSense's firmware: what it answers when the driver asks for itself, its tables and its unit.
//!
//! Commands and tables are bare numbers as the maker's library has them: a driver that had one of its
//! own wrong would not be answered.

use crate::controls::{Query, Selector};
use crate::encode;
use crate::monitor::{DeviceInfo, MONITOR_LEN, Opcode};
use hachi_hal::RgbdGeometry;

/// Distance between the imagers of a D455, metres: the maker's figure. No image depends on it.
const BASELINE_M: f64 = 0.095;

/// The firmware of a camera with this geometry.
#[derive(Debug)]
pub struct Firmware {
    info: DeviceInfo,
    geometry: RgbdGeometry,
    /// The command that was written last, and its first parameter.
    asked: [u32; 2],
}

impl Firmware {
    /// A camera that says this of itself.
    pub fn new(info: DeviceInfo, geometry: RgbdGeometry) -> Self {
        Self {
            info,
            geometry,
            asked: [0; 2],
        }
    }

    /// What a control is set to, a command to the firmware among them.
    pub fn set(&mut self, selector: Selector, bytes: &[u8]) {
        if selector == Selector::Monitor {
            let number = |at: usize| {
                let four = bytes.get(at..at + 4).and_then(|four| four.try_into().ok());
                four.map_or(0, u32::from_le_bytes)
            };
            self.asked = [number(4), number(8)];
        }
    }

    /// What a control is, or can be: anything. Of the firmware, the answer to the last command.
    pub fn get(&self, query: Query, bytes: &mut [u8]) {
        if bytes.len() < MONITOR_LEN {
            bytes.fill(if query == Query::Maximum { 0xFF } else { 0 });
        } else {
            bytes.copy_from_slice(&self.answer());
        }
    }

    fn answer(&self) -> [u8; MONITOR_LEN] {
        let geometry = &self.geometry;
        match self.asked {
            [0x10, _] => encode::answer(Opcode::DeviceInfo, &encode::device_info(&self.info)),
            [0x15, 25] => {
                let table = encode::depth_table(BASELINE_M, &[geometry.depth]);
                encode::answer(Opcode::ReadCalibration, &table)
            }
            [0x15, 32] => {
                let depth_from_color = geometry.color_from_depth.inverse();
                let table = encode::color_table(&geometry.color, &depth_from_color);
                encode::answer(Opcode::ReadCalibration, &table)
            }
            [0x2C, 9] => {
                let unit_um = (geometry.depth_unit_m * 1e6).round() as u32;
                encode::answer(Opcode::ReadAdvanced, &unit_um.to_le_bytes())
            }
            // What a driver should never ask: the answer is none, and is refused.
            _ => [0; MONITOR_LEN],
        }
    }
}
