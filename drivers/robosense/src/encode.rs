//! The other direction: what the lasers saw, as the sensor's own bytes.
//!
//! In: firings of sixteen lasers, or whole blocks; calibration and state. Out: MSOP and DIFOP
//! packets that the decoder reads back. Simulators and tests share this, so that there is one place
//! that knows the layout in this direction.

use crate::packet::{
    AZIMUTH_COUNTS, BLOCKS, CHANNELS, Calibration, DIFOP_MAGIC, DIFOP_PORT, DISTANCE_UNIT_M,
    LASER_COUNT, MSOP_MAGIC, MSOP_PORT, PACKET_LEN, ReturnMode, SyncSource, SyncStatus,
};

/// One return, in the sensor's counts.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Echo {
    /// Distance, 2.5 mm; 0 is no return.
    pub distance: u16,
    /// Intensity, 0 to 255.
    pub intensity: u8,
}

impl Echo {
    /// The nearest counts to a distance in metres; no return if it is not positive or does not fit
    /// (163 m and beyond).
    pub fn from_metres(range_m: f32, intensity: u8) -> Self {
        let counts = libm::roundf(range_m / DISTANCE_UNIT_M);
        if counts >= 1.0 && counts <= f32::from(u16::MAX) {
            Self {
                distance: counts as u16,
                intensity,
            }
        } else {
            Self::default()
        }
    }
}

/// One data block, in the sensor's counts.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Block {
    /// Azimuth, 0.01°.
    pub azimuth: u16,
    /// Two firings of sixteen lasers, or two returns of one.
    pub echoes: [Echo; CHANNELS],
}

/// An MSOP packet from its blocks. Nothing is checked, so that damaged packets can be made too.
///
/// `time_us` is the time of the first firing on the sensor's clock.
pub fn msop_packet(blocks: &[Block; BLOCKS], counter: u32, time_us: u64) -> [u8; PACKET_LEN] {
    let mut bytes = [0; PACKET_LEN];
    bytes[..4].copy_from_slice(&MSOP_MAGIC);
    bytes[5] = 1;
    bytes[12..16].copy_from_slice(&counter.to_be_bytes());
    bytes[17] = 1;
    write_time(&mut bytes, 20, time_us);
    // Family and model as the recorded sensor sends them.
    bytes[30] = 0x06;
    for (block, chunk) in blocks.iter().zip(bytes[42..].chunks_exact_mut(100)) {
        chunk[..2].copy_from_slice(&[0xFF, 0xEE]);
        chunk[2..4].copy_from_slice(&block.azimuth.to_be_bytes());
        for (echo, slot) in block.echoes.iter().zip(chunk[4..].chunks_exact_mut(3)) {
            slot[..2].copy_from_slice(&echo.distance.to_be_bytes());
            slot[2] = echo.intensity;
        }
    }
    bytes[1246..].copy_from_slice(&[0x00, 0xFF]);
    bytes
}

/// The blocks of an MSOP packet as they stand; `None` if it has not the right length.
pub fn blocks_of(payload: &[u8]) -> Option<[Block; BLOCKS]> {
    let bytes: &[u8; PACKET_LEN] = payload.try_into().ok()?;
    let mut blocks = [Block::default(); BLOCKS];
    for (block, chunk) in blocks.iter_mut().zip(bytes[42..].chunks_exact(100)) {
        block.azimuth = u16::from_be_bytes([chunk[2], chunk[3]]);
        for (echo, slot) in block.echoes.iter_mut().zip(chunk[4..].chunks_exact(3)) {
            echo.distance = u16::from_be_bytes([slot[0], slot[1]]);
            echo.intensity = slot[2];
        }
    }
    Some(blocks)
}

fn write_time(bytes: &mut [u8; PACKET_LEN], at: usize, time_us: u64) {
    let (seconds, micros) = (time_us / 1_000_000, time_us % 1_000_000);
    bytes[at..at + 6].copy_from_slice(&seconds.to_be_bytes()[2..]);
    bytes[at + 6..at + 10].copy_from_slice(&(micros as u32).to_be_bytes());
}

/// What all lasers saw in one firing.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Firing {
    /// Azimuth of the rotor at the first shot, degrees, any turn.
    pub azimuth_deg: f64,
    /// Time of the first shot on the sensor's clock, µs.
    pub time_us: u64,
    /// The return of each laser; in dual mode the first of two.
    pub echoes: [Echo; LASER_COUNT],
    /// In dual mode the second return of each laser; otherwise not used.
    pub second: [Echo; LASER_COUNT],
}

/// Collects firings into MSOP packets, 24 to a packet (12 in dual mode), and counts them.
#[derive(Debug, Clone)]
pub struct PacketWriter {
    dual: bool,
    blocks: [Block; BLOCKS],
    firings: usize,
    time_us: u64,
    counter: u32,
}

impl PacketWriter {
    /// A writer for a sensor in one return mode.
    pub fn new(mode: ReturnMode) -> Self {
        Self {
            dual: mode == ReturnMode::Dual,
            blocks: [Block::default(); BLOCKS],
            firings: 0,
            time_us: 0,
            counter: 0,
        }
    }

    /// Adds the next firing; every 24th (12th) call returns a full packet.
    pub fn push(&mut self, firing: &Firing) -> Option<[u8; PACKET_LEN]> {
        if self.firings == 0 {
            self.time_us = firing.time_us;
        }
        let per_block = if self.dual { 1 } else { 2 };
        let block = &mut self.blocks[self.firings / per_block];
        let first = self.firings % per_block * LASER_COUNT;
        if first == 0 {
            block.azimuth = azimuth_counts(firing.azimuth_deg);
        }
        block.echoes[first..first + LASER_COUNT].copy_from_slice(&firing.echoes);
        if self.dual {
            block.echoes[LASER_COUNT..].copy_from_slice(&firing.second);
        }
        self.firings += 1;
        if self.firings < per_block * BLOCKS {
            return None;
        }
        self.firings = 0;
        self.counter = self.counter.wrapping_add(1);
        Some(msop_packet(&self.blocks, self.counter, self.time_us))
    }
}

/// The nearest azimuth count within the turn.
fn azimuth_counts(degrees: f64) -> u16 {
    let turn = f64::from(AZIMUTH_COUNTS);
    let counts = libm::fmod(libm::round(degrees * 100.0), turn);
    let counts = if counts < 0.0 { counts + turn } else { counts };
    counts as u16
}

/// What a DIFOP packet is to say.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DifopContents {
    /// Configured and actual speed.
    pub rpm: u16,
    /// Which echoes the sensor reports.
    pub return_mode: ReturnMode,
    /// Where it takes its time from.
    pub sync_source: SyncSource,
    /// Whether its time follows that.
    pub sync_status: SyncStatus,
    /// Its time, µs.
    pub time_us: u64,
    /// Where its lasers point; `None` writes the mark for not calibrated.
    pub calibration: Option<Calibration>,
}

/// A DIFOP packet.
pub fn difop_packet(contents: &DifopContents) -> [u8; PACKET_LEN] {
    let mut bytes = [0; PACKET_LEN];
    bytes[..8].copy_from_slice(&DIFOP_MAGIC);
    bytes[8..10].copy_from_slice(&contents.rpm.to_be_bytes());
    bytes[10..14].copy_from_slice(&[192, 168, 1, 200]);
    bytes[14..18].copy_from_slice(&[192, 168, 1, 102]);
    bytes[24..26].copy_from_slice(&MSOP_PORT.to_be_bytes());
    bytes[26..28].copy_from_slice(&MSOP_PORT.to_be_bytes());
    bytes[28..30].copy_from_slice(&DIFOP_PORT.to_be_bytes());
    bytes[30..32].copy_from_slice(&DIFOP_PORT.to_be_bytes());
    bytes[34..36].copy_from_slice(&AZIMUTH_COUNTS.to_be_bytes());
    bytes[300] = contents.return_mode.byte();
    bytes[301] = contents.sync_source.byte();
    bytes[302] = contents.sync_status.byte();
    write_time(&mut bytes, 303, contents.time_us);
    bytes[352..354].copy_from_slice(&contents.rpm.to_be_bytes());
    bytes[468..660].fill(0xFF);
    if let Some(calibration) = &contents.calibration {
        write_angles(&mut bytes[468..], calibration.vertical_deg());
        write_angles(&mut bytes[564..], calibration.horizontal_deg());
    }
    bytes[1246..].copy_from_slice(&[0x0F, 0xF0]);
    bytes
}

fn write_angles(table: &mut [u8], angles_deg: &[f32; LASER_COUNT]) {
    for (entry, degrees) in table.chunks_exact_mut(3).zip(angles_deg) {
        let counts = libm::roundf(degrees * 100.0);
        entry[0] = u8::from(counts < 0.0);
        entry[1..].copy_from_slice(&(libm::fabsf(counts) as u16).to_be_bytes());
    }
}
