//! The data packet: twelve blocks of two firings of sixteen lasers.
//!
//! Block `k` at byte `100 k`: flag, azimuth of its first firing (0.01°), then 32 returns of
//! distance (2 mm) and reflectivity. Byte 1200: µs since the top of the hour of the first firing;
//! 1204: return mode; 1205: product. All little-endian.
//!
//! The azimuth of a laser is interpolated from its block's to the next one's by firing time; the
//! last block turns as fast as the one before it. In dual mode blocks come in pairs that hold two
//! echoes of the same shots, so the neighbour is two blocks on.

use hachi_hal::{Point, ReturnKind};

use super::lasers::LaserTable;
use super::sine::sin_cos;
use super::{
    AZIMUTH_COUNTS, BLOCK_FLAG, BLOCK_LEN, BLOCK_PERIOD_NS, BLOCKS, CHANNELS, DATA_LEN,
    DISTANCE_UNIT_M, FIRING_PERIOD_NS, HOUR_US, LASER_COUNT, LASER_PERIOD_NS, MAX_POINTS, Model,
    PacketError, ReturnMode, STAMP_OFFSET, u16_at, u32_at,
};

/// Most azimuth counts between blocks: 1200 rpm turns 79.6 in a block's time, and a quarter more is
/// left for a rotor that is being regulated.
const MAX_STEP: u16 = 100;

/// Time of each channel after its block's first firing, ns.
const CHANNEL_NS: [u32; CHANNELS] = {
    let mut table = [0; CHANNELS];
    let mut j = 0;
    while j < CHANNELS {
        table[j] = FIRING_PERIOD_NS * (j / LASER_COUNT) as u32
            + LASER_PERIOD_NS * (j % LASER_COUNT) as u32;
        j += 1;
    }
    table
};

/// How far each channel is through its block's time, 0 to 1.
const CHANNEL_FRACTION: [f32; CHANNELS] = {
    let mut table = [0.0; CHANNELS];
    let mut j = 0;
    while j < CHANNELS {
        table[j] = CHANNEL_NS[j] as f32 / BLOCK_PERIOD_NS as f32;
        j += 1;
    }
    table
};

/// How packets are decoded.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct DecoderConfig {
    /// Lift each beam by the manual's vertical correction (up to 11 mm). Off by default, as in the
    /// clouds that ROS users know.
    pub vertical_correction: bool,
    /// The sensor is set to a limited field of view, so that one azimuth jump per packet is the
    /// edge of that field and not damage.
    pub limited_view: bool,
}

/// What is true of a whole data packet.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DataInfo {
    /// Sensor that sent it.
    pub model: Model,
    /// Echoes it holds.
    pub mode: ReturnMode,
    /// Time of its first firing, µs since the top of the hour on the sensor's clock.
    pub hour_us: u32,
    /// From its first shot to its last, ns.
    pub last_shot_ns: u32,
    /// Azimuth of its first shot, degrees in `[0, 360)`.
    pub first_azimuth_deg: f32,
    /// Azimuth of its last shot, degrees in `[0, 360)`.
    pub last_azimuth_deg: f32,
    /// How fast it turned over its last block, degrees per second.
    pub rate_deg_per_s: f32,
}

/// The points of one packet, oldest first. About 12 kB; made once and used again.
#[derive(Debug, Clone)]
pub struct PointBatch {
    points: [Point; MAX_POINTS],
    len: usize,
}

impl PointBatch {
    /// An empty batch.
    pub const fn new() -> Self {
        const ZERO: Point = Point {
            x: 0.0,
            y: 0.0,
            z: 0.0,
            intensity: 0.0,
            time_offset_ns: 0,
            azimuth_deg: 0.0,
            range_m: 0.0,
            ring: 0,
            returned: ReturnKind::Unknown,
        };
        Self {
            points: [ZERO; MAX_POINTS],
            len: 0,
        }
    }

    /// The points.
    pub fn as_slice(&self) -> &[Point] {
        &self.points[..self.len]
    }
}

impl Default for PointBatch {
    fn default() -> Self {
        Self::new()
    }
}

/// Decodes data packets of the VLP-16 and the Hi-Res, by what each packet says it is.
#[derive(Debug, Clone, PartialEq)]
pub struct Decoder {
    config: DecoderConfig,
    vlp16: LaserTable,
    hi_res: LaserTable,
}

impl Decoder {
    /// A decoder, with its tables computed.
    pub fn new(config: DecoderConfig) -> Self {
        Self {
            config,
            vlp16: LaserTable::new(Model::Vlp16, config.vertical_correction),
            hi_res: LaserTable::new(Model::HiRes, config.vertical_correction),
        }
    }

    /// Checks a packet without decoding its points.
    pub fn inspect(&self, payload: &[u8]) -> Result<DataInfo, PacketError> {
        Ok(self.open(payload)?.info)
    }

    /// Decodes the UDP payload of a data packet into `batch`, which is emptied first.
    ///
    /// Each point's time offset is `base_offset_ns` plus the time since the packet's first shot.
    /// Shots without a return make no point. On an error the batch is empty.
    pub fn decode(
        &self,
        payload: &[u8],
        base_offset_ns: u32,
        batch: &mut PointBatch,
    ) -> Result<DataInfo, PacketError> {
        batch.len = 0;
        let packet = self.open(payload)?;
        let lasers = match packet.info.model {
            Model::Vlp16 => &self.vlp16,
            Model::HiRes => &self.hi_res,
        };
        match packet.info.mode {
            ReturnMode::Dual => packet.decode_dual(lasers, base_offset_ns, batch),
            mode => packet.decode_single(mode, lasers, base_offset_ns, batch),
        }
        Ok(packet.info)
    }

    fn open<'a>(&self, payload: &'a [u8]) -> Result<Packet<'a>, PacketError> {
        let got = payload.len();
        let bytes: &[u8; DATA_LEN] = payload
            .try_into()
            .map_err(|_| PacketError::Length { got })?;
        let product = bytes[DATA_LEN - 1];
        let model = Model::from_byte(product).ok_or(PacketError::Product { got: product })?;
        let mode = bytes[DATA_LEN - 2];
        let mode = ReturnMode::from_byte(mode).ok_or(PacketError::ReturnMode { got: mode })?;
        let hour_us = u32_at(bytes, STAMP_OFFSET);
        if hour_us >= HOUR_US {
            return Err(PacketError::Stamp { got_us: hour_us });
        }
        let azimuths = read_azimuths(bytes)?;
        let stride = match mode {
            ReturnMode::Dual => 2,
            _ => 1,
        };
        let steps = block_steps(&azimuths, stride, self.config.limited_view)?;
        Ok(Packet {
            bytes,
            azimuths,
            steps,
            info: packet_info(model, mode, hour_us, &azimuths, &steps, stride),
        })
    }
}

fn read_azimuths(bytes: &[u8; DATA_LEN]) -> Result<[u16; BLOCKS], PacketError> {
    let mut azimuths = [0; BLOCKS];
    for (block, azimuth) in azimuths.iter_mut().enumerate() {
        let flag = u16_at(bytes, block * BLOCK_LEN);
        if flag != BLOCK_FLAG {
            return Err(PacketError::BlockFlag { block, got: flag });
        }
        *azimuth = u16_at(bytes, block * BLOCK_LEN + 2);
        if *azimuth >= AZIMUTH_COUNTS {
            return Err(PacketError::Azimuth {
                block,
                got: *azimuth,
            });
        }
    }
    Ok(azimuths)
}

/// Azimuth counts that each block turns through. `stride` is how many blocks on the next firing
/// stands.
fn block_steps(
    azimuths: &[u16; BLOCKS],
    stride: usize,
    limited_view: bool,
) -> Result<[u16; BLOCKS], PacketError> {
    let mut steps = [0; BLOCKS];
    let mut edges = 0;
    let mut moved = false;
    for block in (0..BLOCKS).step_by(stride) {
        if stride == 2 && azimuths[block] != azimuths[block + 1] {
            return Err(PacketError::PairAzimuth {
                block,
                first: azimuths[block],
                second: azimuths[block + 1],
            });
        }
        let Some(&next) = azimuths.get(block + stride) else {
            steps[block] = block.checked_sub(stride).map_or(0, |before| steps[before]);
            continue;
        };
        let from = azimuths[block];
        let mut step = if next >= from {
            next - from
        } else {
            AZIMUTH_COUNTS - from + next
        };
        if step > MAX_STEP {
            edges += 1;
            if !limited_view || edges > 1 {
                return Err(PacketError::AzimuthStep {
                    block: block + stride,
                    from,
                    to: next,
                });
            }
            // The edge of the field of view: the rotor went on at its speed.
            step = block.checked_sub(stride).map_or(0, |before| steps[before]);
        }
        moved |= step > 0;
        steps[block] = step;
    }
    if moved {
        Ok(steps)
    } else {
        Err(PacketError::RotorStopped {
            azimuth: azimuths[0],
        })
    }
}

fn packet_info(
    model: Model,
    mode: ReturnMode,
    hour_us: u32,
    azimuths: &[u16; BLOCKS],
    steps: &[u16; BLOCKS],
    stride: usize,
) -> DataInfo {
    let last = BLOCKS - stride;
    let step_deg = f32::from(steps[last]) * 0.01;
    let last_deg = f32::from(azimuths[last]) * 0.01 + step_deg * CHANNEL_FRACTION[CHANNELS - 1];
    DataInfo {
        model,
        mode,
        hour_us,
        last_shot_ns: (last / stride) as u32 * BLOCK_PERIOD_NS + CHANNEL_NS[CHANNELS - 1],
        first_azimuth_deg: f32::from(azimuths[0]) * 0.01,
        last_azimuth_deg: within_turn(last_deg),
        rate_deg_per_s: step_deg * (1e9 / BLOCK_PERIOD_NS as f32),
    }
}

/// An angle just past a turn, brought back into it, degrees.
fn within_turn(degrees: f32) -> f32 {
    if degrees >= 360.0 {
        degrees - 360.0
    } else {
        degrees
    }
}

/// A packet whose every field was checked.
struct Packet<'a> {
    bytes: &'a [u8; DATA_LEN],
    azimuths: [u16; BLOCKS],
    steps: [u16; BLOCKS],
    info: DataInfo,
}

/// Where the 32 shots of a block point, and when they were fired. Written block after block into
/// one place: handing these arrays over by value costs as much as computing them.
struct Beams {
    /// Unit vectors in ROS axes, without the elevation's sine.
    x: [f32; CHANNELS],
    y: [f32; CHANNELS],
    azimuth_deg: [f32; CHANNELS],
    time_offset_ns: [u32; CHANNELS],
}

impl Beams {
    const fn new() -> Self {
        Self {
            x: [0.0; CHANNELS],
            y: [0.0; CHANNELS],
            azimuth_deg: [0.0; CHANNELS],
            time_offset_ns: [0; CHANNELS],
        }
    }

    /// From the azimuth at the block's start, the counts it turns through, and its time.
    ///
    /// Within a block the rotor turns by less than 1°, where three terms of the sine's series are
    /// exact to single precision. The loop has no branches and no calls, so that it runs several
    /// lanes wide.
    fn aim(&mut self, azimuth: u16, step: u16, start_offset_ns: u32, lasers: &LaserTable) {
        const RADIANS_PER_COUNT: f32 = core::f32::consts::PI / 18_000.0;
        let start = sin_cos(azimuth);
        let (azimuth, step) = (f32::from(azimuth), f32::from(step));
        for j in 0..CHANNELS {
            let turned = step * CHANNEL_FRACTION[j];
            let angle = turned * RADIANS_PER_COUNT;
            let square = angle * angle;
            let sin = angle * (1.0 - square * (1.0 / 6.0));
            let cos = 1.0 - square * (0.5 - square * (1.0 / 24.0));
            // Azimuth grows clockwise from forward, y points left.
            self.x[j] = lasers.cos[j] * (start.cos * cos - start.sin * sin);
            self.y[j] = -lasers.cos[j] * (start.sin * cos + start.cos * sin);
            self.azimuth_deg[j] = within_turn((azimuth + turned) * 0.01);
            self.time_offset_ns[j] = start_offset_ns.wrapping_add(CHANNEL_NS[j]);
        }
    }

    fn point(&self, j: usize, echo: Echo, lasers: &LaserTable, returned: ReturnKind) -> Point {
        let range_m = f32::from(echo.distance) * DISTANCE_UNIT_M;
        Point {
            x: range_m * self.x[j],
            y: range_m * self.y[j],
            z: range_m * lasers.sin[j] + lasers.lift_m[j],
            intensity: f32::from(echo.reflectivity),
            time_offset_ns: self.time_offset_ns[j],
            azimuth_deg: self.azimuth_deg[j],
            range_m,
            ring: lasers.ring[j],
            returned,
        }
    }
}

/// One return as it stands in the packet.
#[derive(Clone, Copy, PartialEq, Eq)]
struct Echo {
    distance: u16,
    reflectivity: u8,
}

impl Echo {
    fn read(triple: &[u8; 3]) -> Self {
        Self {
            distance: u16::from_le_bytes([triple[0], triple[1]]),
            reflectivity: triple[2],
        }
    }
}

impl Packet<'_> {
    /// The 32 returns of a block, three bytes each.
    fn triples(&self, block: usize) -> &[[u8; 3]; CHANNELS] {
        let start = block * BLOCK_LEN + 4;
        let triples = self.bytes[start..].as_chunks::<3>().0.first_chunk();
        triples.expect("every block has room for its returns")
    }

    fn returns(&self, block: usize) -> impl Iterator<Item = Echo> {
        self.triples(block).iter().map(Echo::read)
    }

    fn decode_single(
        &self,
        mode: ReturnMode,
        lasers: &LaserTable,
        base_offset_ns: u32,
        batch: &mut PointBatch,
    ) {
        let returned = match mode {
            ReturnMode::Last => ReturnKind::Last,
            _ => ReturnKind::Strongest,
        };
        let mut beams = Beams::new();
        let mut len = 0;
        for block in 0..BLOCKS {
            let offset_ns = base_offset_ns.wrapping_add(block as u32 * BLOCK_PERIOD_NS);
            beams.aim(self.azimuths[block], self.steps[block], offset_ns, lasers);
            let room = &mut batch.points[len..len + CHANNELS];
            let mut written = 0;
            for (j, echo) in self.returns(block).enumerate() {
                // Written in any case and kept only if there is a return: a branch here would be
                // mispredicted at every edge of the scene. `written` is at most `j`, which the
                // remainder tells the compiler.
                room[written % CHANNELS] = beams.point(j, echo, lasers, returned);
                written += usize::from(echo.distance != 0);
            }
            len += written;
        }
        batch.len = len;
    }

    fn decode_dual(&self, lasers: &LaserTable, base_offset_ns: u32, batch: &mut PointBatch) {
        let mut beams = Beams::new();
        let mut len = 0;
        for block in (0..BLOCKS).step_by(2) {
            let [lasts, strongests] = [block, block + 1].map(|block| self.triples(block));
            // Shots come back or not in an order that no branch could be predicted by: bits are
            // collected first, and only shots that came back are looked at.
            let mut hit = hit_channels(lasts, strongests);
            if hit == 0 {
                continue;
            }
            let offset_ns = base_offset_ns.wrapping_add(block as u32 / 2 * BLOCK_PERIOD_NS);
            beams.aim(self.azimuths[block], self.steps[block], offset_ns, lasers);
            while hit != 0 {
                let j = hit.trailing_zeros() as usize % CHANNELS;
                hit &= hit - 1;
                let (last, strongest) = (Echo::read(&lasts[j]), Echo::read(&strongests[j]));
                let mut push = |echo, returned| {
                    batch.points[len] = beams.point(j, echo, lasers, returned);
                    len += 1;
                };
                // Nearly always.
                if last == strongest {
                    push(last, ReturnKind::StrongestAndLast);
                    continue;
                }
                for (echo, kind) in [last, strongest]
                    .into_iter()
                    .zip(echo_kinds(last, strongest))
                {
                    if let Some(returned) = kind {
                        push(echo, returned);
                    }
                }
            }
        }
        batch.len = len;
    }
}

/// A bit for each channel with an echo in either block of a pair.
fn hit_channels(lasts: &[[u8; 3]; CHANNELS], strongests: &[[u8; 3]; CHANNELS]) -> u32 {
    let mut bits = 0;
    for (j, (last, strongest)) in lasts.iter().zip(strongests).enumerate() {
        let distance = last[0] | last[1] | strongest[0] | strongest[1];
        bits |= u32::from(distance != 0) << j;
    }
    bits
}

/// What the two slots of a dual shot hold; `None` for nothing, or nothing new.
///
/// The even block has the last echo, the odd block the strongest. Where those are one echo the
/// sensor puts the second strongest beside it; in recordings that pair shows as a last echo that
/// is also the brighter one. Brightness stands in for strength here, which the packet does not
/// have; a tie is taken by slot.
fn echo_kinds(last: Echo, strongest: Echo) -> [Option<ReturnKind>; 2] {
    use ReturnKind::{Last, SecondStrongest, Strongest, StrongestAndLast};
    match (last.distance, strongest.distance) {
        (0, 0) => [None, None],
        (_, 0) => [Some(Last), None],
        (0, _) => [None, Some(Strongest)],
        _ if last == strongest => [Some(StrongestAndLast), None],
        (far, near) if far < near => [Some(SecondStrongest), Some(StrongestAndLast)],
        _ if last.reflectivity > strongest.reflectivity => {
            [Some(StrongestAndLast), Some(SecondStrongest)]
        }
        _ => [Some(Last), Some(Strongest)],
    }
}
