//! The MSOP packet: twelve blocks of two firings of sixteen lasers (in dual return, of one firing
//! with two returns).
//!
//! Bytes 12 to 15 count packets, 20 to 29 are seconds and microseconds of the first firing. Block
//! `k` at byte `42 + 100 k`: flag, azimuth (0.01°), then 32 returns of distance (2.5 mm) and
//! intensity.
//!
//! The azimuth of a firing is interpolated from its block's to the next one's by time; each laser
//! then points its own calibrated angle beside it. The lens stands off the axis of rotation and
//! turns with it.

use hachi_hal::{Point, ReturnKind};

use super::batch::PointBatch;
use super::head::as_packet;
use super::{
    AZIMUTH_COUNTS, BLOCK_FLAG, BLOCK_LEN, BLOCK_PERIOD_NS, BLOCKS, Calibration, DISTANCE_UNIT_M,
    HEADER_LEN, LASER_COUNT, LENS_OFFSET_M, PACKET_LEN, PacketError, ReturnMode, u16_at,
};

/// Most azimuth counts between blocks; more is the edge of a limited field of view (maker's
/// driver).
const MAX_STEP: u16 = 100;

/// When the lasers of a block fire, counted from its start.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct LaserTiming {
    /// From one laser to the next, ns.
    pub pitch_ns: u32,
    /// Start of the second firing, ns; single return only.
    pub second_firing_ns: u32,
    /// From one block to the next, ns.
    pub block_ns: u32,
}

impl Default for LaserTiming {
    /// What fits a recorded sensor and another decoder's clouds of it best: two firings in a block
    /// of 55.56 µs, half of it apart. Its clouds put the sixteenth laser 21 to 22 µs after the
    /// first; the maker's driver says 26, the table of the family's larger model begins with steps
    /// of 1.57, which lies between.
    fn default() -> Self {
        Self::for_block(BLOCK_PERIOD_NS)
    }
}

impl LaserTiming {
    /// The timing of a sensor whose blocks last `block_ns`.
    pub const fn for_block(block_ns: u32) -> Self {
        Self {
            pitch_ns: 1_570,
            second_firing_ns: block_ns / 2,
            block_ns,
        }
    }
}

/// How packets are decoded.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct DecoderConfig {
    /// Which echoes the packets hold; the packets do not say.
    pub return_mode: ReturnMode,
    /// When the lasers fire.
    pub timing: LaserTiming,
    /// The sensor is set to a limited field of view, so that one azimuth jump per packet is the
    /// edge of that field and not damage.
    pub limited_view: bool,
}

/// What is true of a whole MSOP packet.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MsopInfo {
    /// From its first shot to its last, ns.
    pub last_shot_ns: u32,
    /// Azimuth of the rotor at its first shot, degrees in `[0, 360)`.
    pub first_azimuth_deg: f32,
    /// Azimuth of the rotor at its last firing, degrees in `[0, 360)`.
    pub last_azimuth_deg: f32,
    /// How fast it turned over its last block, degrees per second.
    pub rate_deg_per_s: f32,
}

/// One laser, ready for decoding.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Laser {
    elevation_sin: f32,
    elevation_cos: f32,
    horizontal_sin: f32,
    horizontal_cos: f32,
    horizontal_deg: f32,
    ring: u16,
}

/// Decodes MSOP packets of one sensor.
#[derive(Debug, Clone, PartialEq)]
pub struct Decoder {
    config: DecoderConfig,
    lasers: [Laser; LASER_COUNT],
}

impl Decoder {
    /// A decoder for a sensor with these angles.
    pub fn new(config: DecoderConfig, calibration: &Calibration) -> Self {
        let rings = calibration.rings();
        let lasers = core::array::from_fn(|laser| {
            let elevation = f64::from(calibration.vertical_deg()[laser]).to_radians();
            let horizontal_deg = calibration.horizontal_deg()[laser];
            let (elevation_sin, elevation_cos) = libm::sincos(elevation);
            let (horizontal_sin, horizontal_cos) =
                libm::sincos(f64::from(horizontal_deg).to_radians());
            Laser {
                elevation_sin: elevation_sin as f32,
                elevation_cos: elevation_cos as f32,
                horizontal_sin: horizontal_sin as f32,
                horizontal_cos: horizontal_cos as f32,
                horizontal_deg,
                ring: rings[laser],
            }
        });
        Self { config, lasers }
    }

    /// Decodes the UDP payload of an MSOP packet into `batch`, which is emptied first.
    ///
    /// Each point's time offset is `base_offset_ns` plus the time since the packet's first shot; its
    /// azimuth is the laser's own, calibration included. Shots without a return make no point. On
    /// an error the batch is empty.
    pub fn decode(
        &self,
        payload: &[u8],
        base_offset_ns: u32,
        batch: &mut PointBatch,
    ) -> Result<MsopInfo, PacketError> {
        batch.clear();
        let bytes = as_packet(payload)?;
        let azimuths = read_azimuths(bytes)?;
        let steps = block_steps(&azimuths, self.config.limited_view)?;
        let timing = self.config.timing;
        let dual = self.config.return_mode == ReturnMode::Dual;
        for block in 0..BLOCKS {
            let rotor = Rotor {
                azimuth: f32::from(azimuths[block]),
                counts_per_ns: f32::from(steps[block]) / timing.block_ns.max(1) as f32,
            };
            let offset_ns = base_offset_ns.wrapping_add(timing.block_ns.wrapping_mul(block as u32));
            if dual {
                self.decode_pairs(bytes, block, &rotor, offset_ns, batch);
            } else {
                self.decode_firings(bytes, block, &rotor, offset_ns, batch);
            }
        }
        Ok(self.info(&azimuths, &steps))
    }

    fn info(&self, azimuths: &[u16; BLOCKS], steps: &[u16; BLOCKS]) -> MsopInfo {
        let timing = self.config.timing;
        let second_ns = match self.config.return_mode {
            ReturnMode::Dual => 0,
            _ => timing.second_firing_ns,
        };
        let last = BLOCKS - 1;
        let block_ns = timing.block_ns.max(1) as f32;
        let step_deg = f32::from(steps[last]) * 0.01;
        let last_deg = f32::from(azimuths[last]) * 0.01 + step_deg * (second_ns as f32 / block_ns);
        MsopInfo {
            last_shot_ns: timing
                .block_ns
                .wrapping_mul(last as u32)
                .wrapping_add(second_ns)
                .wrapping_add(timing.pitch_ns.wrapping_mul(LASER_COUNT as u32 - 1)),
            first_azimuth_deg: f32::from(azimuths[0]) * 0.01,
            last_azimuth_deg: within_turn(last_deg),
            rate_deg_per_s: step_deg * (1e9 / block_ns),
        }
    }

    /// A block of single return: two firings one after the other.
    fn decode_firings(
        &self,
        bytes: &[u8; PACKET_LEN],
        block: usize,
        rotor: &Rotor,
        offset_ns: u32,
        batch: &mut PointBatch,
    ) {
        let timing = self.config.timing;
        let returned = match self.config.return_mode {
            ReturnMode::Last => ReturnKind::Last,
            ReturnMode::First => ReturnKind::First,
            ReturnMode::Strongest | ReturnMode::Dual => ReturnKind::Strongest,
        };
        for firing in 0..2 {
            let start_ns = timing.second_firing_ns * u32::from(firing == 1);
            batch.begin_firing(rotor.azimuth_deg(start_ns));
            let base = rotor.direction(start_ns);
            for (id, laser) in self.lasers.iter().enumerate() {
                let raw = Raw::at(bytes, block, firing * LASER_COUNT + id);
                let pitch_ns = timing.pitch_ns.wrapping_mul(id as u32);
                let shot = base.turned(rotor, pitch_ns);
                batch.points[batch.len] = Point {
                    time_offset_ns: offset_ns.wrapping_add(start_ns.wrapping_add(pitch_ns)),
                    azimuth_deg: rotor.beam_deg(start_ns.wrapping_add(pitch_ns), laser),
                    returned,
                    ..laser.point(&shot, raw)
                };
                // Written in any case, kept only if there is a return.
                batch.len += usize::from(raw.distance != 0);
            }
        }
    }

    /// A block of dual return: two returns of one firing.
    fn decode_pairs(
        &self,
        bytes: &[u8; PACKET_LEN],
        block: usize,
        rotor: &Rotor,
        offset_ns: u32,
        batch: &mut PointBatch,
    ) {
        batch.begin_firing(rotor.azimuth_deg(0));
        let base = rotor.direction(0);
        for (id, laser) in self.lasers.iter().enumerate() {
            let pitch_ns = self.config.timing.pitch_ns.wrapping_mul(id as u32);
            let shot = base.turned(rotor, pitch_ns);
            let echoes = [0, LASER_COUNT].map(|first| Raw::at(bytes, block, first + id));
            for (raw, kind) in echoes.into_iter().zip(echo_kinds(echoes[0], echoes[1])) {
                if let Some(returned) = kind {
                    batch.points[batch.len] = Point {
                        time_offset_ns: offset_ns.wrapping_add(pitch_ns),
                        azimuth_deg: rotor.beam_deg(pitch_ns, laser),
                        returned,
                        ..laser.point(&shot, raw)
                    };
                    batch.len += 1;
                }
            }
        }
    }
}

/// What the two slots of a dual shot hold; `None` for nothing, or nothing new.
///
/// The maker does not say which return stands first, so distance and intensity decide: the farther
/// one is the last, the brighter one the strongest.
fn echo_kinds(first: Raw, second: Raw) -> [Option<ReturnKind>; 2] {
    use ReturnKind::{Last, SecondStrongest, Strongest, StrongestAndLast};
    let kind_of = |this: Raw, other: Raw| {
        if this.distance == 0 {
            None
        } else if other.distance == 0 || this == other {
            Some(StrongestAndLast)
        } else if this.distance > other.distance {
            let strongest = this.intensity > other.intensity;
            Some(if strongest { StrongestAndLast } else { Last })
        } else {
            let strongest = this.intensity >= other.intensity;
            Some(if strongest {
                Strongest
            } else {
                SecondStrongest
            })
        }
    };
    let repeated = first == second;
    [
        kind_of(first, second),
        kind_of(second, first).filter(|_| !repeated),
    ]
}

fn read_azimuths(bytes: &[u8; PACKET_LEN]) -> Result<[u16; BLOCKS], PacketError> {
    let mut azimuths = [0; BLOCKS];
    for (block, azimuth) in azimuths.iter_mut().enumerate() {
        let at = HEADER_LEN + block * BLOCK_LEN;
        let flag = u16_at(bytes, at);
        if flag != BLOCK_FLAG {
            return Err(PacketError::BlockFlag { block, got: flag });
        }
        *azimuth = u16_at(bytes, at + 2);
        if *azimuth >= AZIMUTH_COUNTS {
            return Err(PacketError::Azimuth {
                block,
                got: *azimuth,
            });
        }
    }
    Ok(azimuths)
}

/// Azimuth counts that each block turns through; the last as many as the one before it.
fn block_steps(azimuths: &[u16; BLOCKS], limited_view: bool) -> Result<[u16; BLOCKS], PacketError> {
    let mut steps = [0; BLOCKS];
    let (mut edges, mut moved) = (0, false);
    for block in 1..BLOCKS {
        let (from, to) = (azimuths[block - 1], azimuths[block]);
        let mut step = if to >= from {
            to - from
        } else {
            AZIMUTH_COUNTS - from + to
        };
        if step > MAX_STEP {
            edges += 1;
            if !limited_view || edges > 1 {
                return Err(PacketError::AzimuthStep { block, from, to });
            }
            // The edge of the field of view: the rotor went on at its speed.
            step = block.checked_sub(2).map_or(0, |before| steps[before]);
        }
        moved |= step > 0;
        steps[block - 1] = step;
    }
    steps[BLOCKS - 1] = steps[BLOCKS - 2];
    if moved {
        Ok(steps)
    } else {
        Err(PacketError::RotorStopped {
            azimuth: azimuths[0],
        })
    }
}

/// An angle near a turn, brought into it, degrees.
fn within_turn(degrees: f32) -> f32 {
    let degrees = if degrees < 0.0 {
        degrees + 360.0
    } else {
        degrees
    };
    if degrees >= 360.0 {
        degrees - 360.0
    } else {
        degrees
    }
}

const RADIANS_PER_COUNT: f32 = core::f32::consts::PI / 18_000.0;

/// How the rotor turns through a block.
struct Rotor {
    /// At the block's start, 0.01°.
    azimuth: f32,
    counts_per_ns: f32,
}

impl Rotor {
    fn azimuth_deg(&self, after_ns: u32) -> f32 {
        within_turn((self.azimuth + self.counts_per_ns * after_ns as f32) * 0.01)
    }

    fn beam_deg(&self, after_ns: u32, laser: &Laser) -> f32 {
        let rotor_deg = (self.azimuth + self.counts_per_ns * after_ns as f32) * 0.01;
        within_turn(rotor_deg + laser.horizontal_deg)
    }

    fn direction(&self, after_ns: u32) -> Direction {
        let counts = self.azimuth + self.counts_per_ns * after_ns as f32;
        let (sin, cos) = libm::sincosf(counts * RADIANS_PER_COUNT);
        Direction { sin, cos }
    }
}

/// Sine and cosine of the rotor's azimuth.
struct Direction {
    sin: f32,
    cos: f32,
}

impl Direction {
    /// The same a few microseconds later. Within a firing the rotor turns by less than 0.5°, where
    /// three terms of the series are exact to single precision.
    fn turned(&self, rotor: &Rotor, after_ns: u32) -> Self {
        let angle = rotor.counts_per_ns * after_ns as f32 * RADIANS_PER_COUNT;
        let square = angle * angle;
        let sin = angle * (1.0 - square * (1.0 / 6.0));
        let cos = 1.0 - square * (0.5 - square * (1.0 / 24.0));
        Self {
            sin: self.sin * cos + self.cos * sin,
            cos: self.cos * cos - self.sin * sin,
        }
    }
}

/// One return as it stands in the packet.
#[derive(Clone, Copy, PartialEq, Eq)]
struct Raw {
    distance: u16,
    intensity: u8,
}

impl Raw {
    fn at(bytes: &[u8; PACKET_LEN], block: usize, channel: usize) -> Self {
        let at = HEADER_LEN + block * BLOCK_LEN + 4 + 3 * channel;
        Self {
            distance: u16_at(bytes, at),
            intensity: bytes[at + 2],
        }
    }
}

impl Laser {
    /// Position, range, intensity and ring of a return in a direction of the rotor.
    fn point(&self, rotor: &Direction, raw: Raw) -> Point {
        let range_m = f32::from(raw.distance) * DISTANCE_UNIT_M;
        let beam_sin = rotor.sin * self.horizontal_cos + rotor.cos * self.horizontal_sin;
        let beam_cos = rotor.cos * self.horizontal_cos - rotor.sin * self.horizontal_sin;
        let flat_m = range_m * self.elevation_cos;
        // Azimuth grows clockwise from forward, y points left.
        Point {
            x: flat_m * beam_cos + LENS_OFFSET_M * rotor.cos,
            y: -flat_m * beam_sin - LENS_OFFSET_M * rotor.sin,
            z: range_m * self.elevation_sin,
            intensity: f32::from(raw.intensity),
            range_m,
            ring: self.ring,
            ..Point::default()
        }
    }
}
