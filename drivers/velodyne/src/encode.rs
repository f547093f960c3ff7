//! The other direction: what the lasers saw, as the sensor's own bytes.
//!
//! In: firings of sixteen lasers, or whole blocks. Out: data and position packets that the decoder
//! reads back, byte for byte what a sensor would send. Simulators and tests share this, so that
//! there is one place that knows the layout in this direction.

use crate::packet::{
    AZIMUTH_COUNTS, BLOCKS, CHANNELS, DATA_LEN, DISTANCE_UNIT_M, HOUR_US, LASER_COUNT, Model,
    POSITION_LEN, PositionPacket, ReturnMode,
};

/// One return, in the sensor's counts.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Echo {
    /// Distance, 2 mm; 0 is no return.
    pub distance: u16,
    /// Reflectivity, 0 to 255.
    pub reflectivity: u8,
}

impl Echo {
    /// The nearest counts to a distance in metres; no return if it is not positive or does not fit
    /// (131 m and beyond).
    pub fn from_metres(range_m: f32, reflectivity: u8) -> Self {
        let counts = libm::roundf(range_m / DISTANCE_UNIT_M);
        if counts >= 1.0 && counts <= f32::from(u16::MAX) {
            Self {
                distance: counts as u16,
                reflectivity,
            }
        } else {
            Self::default()
        }
    }
}

/// One data block, in the sensor's counts.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Block {
    /// Azimuth of its first firing, 0.01°.
    pub azimuth: u16,
    /// Two firings of sixteen lasers in firing order.
    pub echoes: [Echo; CHANNELS],
}

/// A data packet from its blocks. Nothing is checked, so that damaged packets can be made too.
pub fn data_packet(
    blocks: &[Block; BLOCKS],
    hour_us: u32,
    mode: ReturnMode,
    model: Model,
) -> [u8; DATA_LEN] {
    let mut bytes = [0; DATA_LEN];
    for (block, chunk) in blocks.iter().zip(bytes.chunks_exact_mut(100)) {
        chunk[..2].copy_from_slice(&[0xFF, 0xEE]);
        chunk[2..4].copy_from_slice(&block.azimuth.to_le_bytes());
        for (echo, slot) in block.echoes.iter().zip(chunk[4..].chunks_exact_mut(3)) {
            slot[..2].copy_from_slice(&echo.distance.to_le_bytes());
            slot[2] = echo.reflectivity;
        }
    }
    bytes[1200..1204].copy_from_slice(&hour_us.to_le_bytes());
    bytes[1204] = mode.byte();
    bytes[1205] = model.byte();
    bytes
}

/// The blocks of a data packet as they stand; `None` if it has not the right length.
pub fn blocks_of(payload: &[u8]) -> Option<[Block; BLOCKS]> {
    let bytes: &[u8; DATA_LEN] = payload.try_into().ok()?;
    let mut blocks = [Block::default(); BLOCKS];
    for (block, chunk) in blocks.iter_mut().zip(bytes.chunks_exact(100)) {
        block.azimuth = u16::from_le_bytes([chunk[2], chunk[3]]);
        for (echo, slot) in block.echoes.iter_mut().zip(chunk[4..].chunks_exact(3)) {
            echo.distance = u16::from_le_bytes([slot[0], slot[1]]);
            echo.reflectivity = slot[2];
        }
    }
    Some(blocks)
}

/// What all lasers saw in one firing.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Firing {
    /// Azimuth of the first laser's shot, degrees, any turn.
    pub azimuth_deg: f64,
    /// Time of the first laser's shot on the sensor's clock, µs; the hour is taken off.
    pub time_us: u64,
    /// The return of each laser in firing order; in dual mode the last one.
    pub echoes: [Echo; LASER_COUNT],
    /// In dual mode the strongest return of each laser; otherwise not used.
    pub strongest: [Echo; LASER_COUNT],
}

/// Collects firings into data packets, 24 to a packet (12 in dual mode).
#[derive(Debug, Clone)]
pub struct PacketWriter {
    mode: ReturnMode,
    model: Model,
    blocks: [Block; BLOCKS],
    firings: usize,
    hour_us: u32,
}

impl PacketWriter {
    /// A writer for a sensor in one return mode.
    pub fn new(mode: ReturnMode, model: Model) -> Self {
        Self {
            mode,
            model,
            blocks: [Block::default(); BLOCKS],
            firings: 0,
            hour_us: 0,
        }
    }

    /// Adds the next firing; every 24th (12th) call returns a full packet.
    pub fn push(&mut self, firing: &Firing) -> Option<[u8; DATA_LEN]> {
        let dual = self.mode == ReturnMode::Dual;
        if self.firings == 0 {
            // The remainder is below an hour, which fits.
            self.hour_us = (firing.time_us % u64::from(HOUR_US)) as u32;
        }
        let blocks_per_pair = if dual { 2 } else { 1 };
        let block = self.firings / 2 * blocks_per_pair;
        let channel = self.firings % 2 * LASER_COUNT;
        if channel == 0 {
            let azimuth = azimuth_counts(firing.azimuth_deg);
            for target in &mut self.blocks[block..block + blocks_per_pair] {
                target.azimuth = azimuth;
            }
        }
        let channels = channel..channel + LASER_COUNT;
        self.blocks[block].echoes[channels.clone()].copy_from_slice(&firing.echoes);
        if dual {
            self.blocks[block + 1].echoes[channels].copy_from_slice(&firing.strongest);
        }
        self.firings += 1;
        if self.firings < 2 * BLOCKS / blocks_per_pair {
            return None;
        }
        self.firings = 0;
        Some(data_packet(
            &self.blocks,
            self.hour_us,
            self.mode,
            self.model,
        ))
    }
}

/// The nearest azimuth count within the turn.
fn azimuth_counts(degrees: f64) -> u16 {
    let turn = f64::from(AZIMUTH_COUNTS);
    let counts = libm::fmod(libm::round(degrees * 100.0), turn);
    let counts = if counts < 0.0 { counts + turn } else { counts };
    counts as u16
}

/// A position packet from what it says.
pub fn position_packet(position: &PositionPacket) -> [u8; POSITION_LEN] {
    let mut bytes = [0; POSITION_LEN];
    bytes[187] = position.top_temperature;
    bytes[188] = position.bottom_temperature;
    bytes[189] = position.calibration_temperature;
    bytes[190..192].copy_from_slice(&position.temperature_change.to_le_bytes());
    bytes[192..196].copy_from_slice(&position.calibration_age_s.to_le_bytes());
    bytes[196] = position.calibration_reason;
    bytes[197] = position.calibration_flags;
    bytes[198..202].copy_from_slice(&position.hour_us.to_le_bytes());
    bytes[202] = position.pps.byte();
    bytes[203] = position.thermal.byte();
    bytes[204] = position.shutdown_temperature;
    bytes[205] = position.power_up_temperature;
    bytes[206..206 + position.nmea().len()].copy_from_slice(position.nmea());
    bytes
}
