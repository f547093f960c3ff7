//! What the sensors have in common: from a packet's number to its firings and returns.
//!
//! In: the scene, the trajectory, the packet's number. Out: the packet's bytes and, for each
//! channel, the truth. A packet depends on nothing but these and the seed, so packets can be made
//! in any order and on any thread. Elsewhere: byte layouts (`vlp16`, `helios`), where the beams
//! go (`aim`), echoes (`optics`), what is reported of them (`returns`).

use std::f64::consts::TAU;

use hachi_hal::{Pose, Stamp};
use parry3d::query::Ray;
use rand::RngExt;

use crate::aim::{Head, LASERS};
use crate::calendar::Utc;
use crate::fan::Scratch;
use crate::moment::Moment;
use crate::noise::{Purpose, generator, uniform_pair};
use crate::optics::{Echoes, trace};
use crate::person::Body;
use crate::returns::{Measurement, Report, ReturnTruth, Strays, dual_of, strongest_of};
use crate::scene::Hit;
use crate::simulation::SimulationConfig;
use crate::{helios, vlp16};

/// Which sensor is simulated, at 600 turns a minute.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum SensorKind {
    /// Velodyne VLP-16, strongest return.
    #[default]
    Vlp16,
    /// Velodyne VLP-16, last and strongest return.
    Vlp16Dual,
    /// RoboSense RS-Helios-16P, strongest return.
    Helios16P,
}

/// When and where a laser fires.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Firing {
    pub offset_ns: i64,
    pub elevation_rad: f64,
    /// On top of the head's azimuth, in the sensor's sense.
    pub azimuth_offset_rad: f64,
}

/// The head turns 10 times a second.
pub(crate) const TURN_NS: i64 = 100_000_000;
/// Nor from farther: VLP-16 data sheet, 100 m, and the Helios' 16-bit distances reach 163 m.
pub(crate) const MAX_RANGE_M: f32 = 100.0;
/// After the last firing, the packet is on its way for this long, ns.
const TRANSPORT_NS: i64 = 50_000;

impl SensorKind {
    /// All of them.
    pub const ALL: [Self; 3] = [Self::Vlp16, Self::Vlp16Dual, Self::Helios16P];

    /// Its name on a command line.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Vlp16 => "vlp16",
            Self::Vlp16Dual => "vlp16-dual",
            Self::Helios16P => "helios16p",
        }
    }

    /// The sensor of a name.
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|sensor| sensor.name() == name)
    }

    /// From one data packet to the next, ns.
    pub const fn packet_ns(self) -> i64 {
        match self {
            Self::Vlp16 => 24 * vlp16::SEQUENCE_NS,
            Self::Vlp16Dual => 12 * vlp16::SEQUENCE_NS,
            Self::Helios16P => 12 * helios::BLOCK_NS,
        }
    }

    /// UDP port of data packets.
    pub const fn data_port(self) -> u16 {
        match self {
            Self::Vlp16 | Self::Vlp16Dual => vlp16::DATA_PORT,
            Self::Helios16P => helios::MSOP_PORT,
        }
    }

    /// UDP port of the packets in between: position packets, device information.
    pub const fn status_port(self) -> u16 {
        match self {
            Self::Vlp16 | Self::Vlp16Dual => vlp16::POSITION_PORT,
            Self::Helios16P => helios::DIFOP_PORT,
        }
    }

    /// The sensor's factory address.
    pub(crate) const fn address(self) -> [u8; 4] {
        match self {
            Self::Vlp16 | Self::Vlp16Dual => [192, 168, 1, 201],
            Self::Helios16P => [192, 168, 1, 200],
        }
    }

    /// Data packets to one status packet; the first comes with the first data packet.
    pub(crate) const fn data_per_status(self) -> u64 {
        match self {
            Self::Vlp16 | Self::Vlp16Dual => vlp16::DATA_PER_POSITION,
            Self::Helios16P => helios::MSOP_PER_DIFOP,
        }
    }

    const fn distance_unit_m(self) -> f64 {
        match self {
            Self::Vlp16 | Self::Vlp16Dual => vlp16::DISTANCE_UNIT_M,
            Self::Helios16P => helios::DISTANCE_UNIT_M,
        }
    }

    /// Groups of 16 lasers that fire one after the other within a packet.
    const fn groups(self) -> usize {
        match self {
            Self::Vlp16 | Self::Helios16P => 24,
            Self::Vlp16Dual => 12,
        }
    }

    pub(crate) fn firing(self, group: usize, laser: usize) -> Firing {
        match self {
            Self::Vlp16 | Self::Vlp16Dual => vlp16::firing(group, laser),
            Self::Helios16P => helios::firing(group / 2, 16 * (group % 2) + laser),
        }
    }

    /// When the packet's last laser fires, ns after its first.
    fn last_firing_ns(self) -> i64 {
        self.firing(self.groups() - 1, 15).offset_ns
    }

    /// Where the packet has the (last, strongest) report of a laser.
    const fn channels(self, group: usize, laser: usize) -> (usize, Option<usize>) {
        match self {
            Self::Vlp16 | Self::Helios16P => (16 * group + laser, None),
            Self::Vlp16Dual => {
                let last = 64 * (group / 2) + 16 * (group % 2) + laser;
                (last, Some(last + 32))
            }
        }
    }

    /// The head's azimuth as the 12 blocks have it, 0.01 degree.
    fn block_azimuths(self, packet_begins_ns: i64) -> [u16; 12] {
        std::array::from_fn(|block| {
            let begins = match self {
                Self::Vlp16 => 2 * vlp16::SEQUENCE_NS * block as i64,
                Self::Vlp16Dual => 2 * vlp16::SEQUENCE_NS * (block as i64 / 2),
                Self::Helios16P => helios::BLOCK_NS * block as i64,
            };
            let within = (packet_begins_ns + begins).rem_euclid(TURN_NS);
            // 36,000 counts a turn, rounded to the nearest.
            ((within * 36_000 + TURN_NS / 2) / TURN_NS % 36_000) as u16
        })
    }
}

/// One data packet, with room for the larger of the sensors.
#[derive(Debug, Clone)]
pub(crate) struct DataPacket {
    pub bytes: [u8; helios::BYTES],
    pub len: usize,
    pub received: Stamp,
    pub truth: [ReturnTruth; 384],
    casting: Casting,
}

/// Room for the casting of rays, used again.
#[derive(Debug, Clone, Default)]
struct Casting {
    rays: Vec<Ray>,
    hits: Vec<Option<Hit>>,
    scratch: Scratch,
    bodies: Vec<Body>,
}

impl DataPacket {
    pub fn empty() -> Self {
        Self {
            bytes: [0; helios::BYTES],
            len: 0,
            received: Stamp::default(),
            truth: [ReturnTruth::default(); 384],
            casting: Casting::default(),
        }
    }
}

/// Nanoseconds after the start at which the `index`-th data packet is received.
pub(crate) fn received_ns(sensor: SensorKind, index: u64) -> i64 {
    index as i64 * sensor.packet_ns() + sensor.last_firing_ns() + TRANSPORT_NS
}

/// Makes the `index`-th data packet of a robot that follows its trajectory.
pub(crate) fn make_packet(config: &SimulationConfig, index: u64, packet: &mut DataPacket) {
    let pose_at = |after_ns: i64| config.trajectory.map_from_base(after_ns as f64 * 1e-9);
    make_packet_at(config, index, &pose_at, packet);
}

/// Makes the `index`-th data packet with the base where `map_from_base` says for any time after the
/// start, ns.
pub(crate) fn make_packet_at(
    config: &SimulationConfig,
    index: u64,
    map_from_base: &(dyn Fn(i64) -> Pose + Sync),
    packet: &mut DataPacket,
) {
    let (sensor, scene) = (config.sensor, &*config.scene);
    let begins_ns = index as i64 * sensor.packet_ns();
    let mut random = generator(config.seed, Purpose::Packets, index);
    let mut strays = Strays::new(config.seed, config.noise.stray_share, index);
    let mut reports = [Report::default(); 384];
    packet.truth = [ReturnTruth::default(); 384];
    let pose_at = |offset_ns: i64| map_from_base(begins_ns + offset_ns) * config.base_from_lidar;
    let (head, casting) = (Head::new(sensor), &mut packet.casting);
    casting.rays.clear();
    for group in 0..sensor.groups() {
        let from_ns = sensor.firing(group, 0).offset_ns;
        let to_ns = sensor.firing(group, LASERS - 1).offset_ns;
        let turned = (begins_ns + from_ns).rem_euclid(TURN_NS) as f64 / TURN_NS as f64 * TAU;
        head.aim(
            &pose_at(from_ns),
            &pose_at(to_ns),
            turned,
            &mut casting.rays,
        );
    }
    let Casting {
        rays,
        hits,
        scratch,
        bodies,
    } = casting;
    scene.cast_fans(rays, head.rays(), MAX_RANGE_M, scratch, hits);
    // In the 1.3 ms of a packet nobody walks further than 3 mm.
    config.bodies_at(begins_ns as f64 * 1e-9, bodies);
    let moment = Moment { scene, bodies };
    if !bodies.is_empty() {
        for (ray, hit) in rays.iter().zip(hits.iter_mut()) {
            *hit = moment.nearer(ray, MAX_RANGE_M, *hit);
        }
    }
    let mut echoes = Echoes::new();
    for group in 0..sensor.groups() {
        for laser in 0..LASERS {
            echoes.clear();
            for ray in head.rays_of(laser) {
                let ray = head.rays() * group + ray;
                let (gain, wanted) = (head.gain, head.wanted);
                trace(
                    moment,
                    rays[ray],
                    hits[ray],
                    gain,
                    MAX_RANGE_M,
                    wanted,
                    &mut echoes,
                );
            }
            let luck = uniform_pair(&mut random);
            let fading = random.random::<f32>();
            let measured = Measurement::of(sensor.distance_unit_m(), &config.noise, luck, fading);
            let (last, strongest) = sensor.channels(group, laser);
            match strongest {
                None => {
                    let echo = strongest_of(echoes.as_slice(), measured.threshold, None);
                    (reports[last], packet.truth[last]) =
                        measured.report(strays.instead_of(echo).or(echo));
                }
                Some(strongest) => {
                    let (late, strong) = dual_of(echoes.as_slice(), measured.threshold);
                    // A stray return hides both: the pulse's other echo is weaker or too near.
                    let stray = strays.instead_of(strong);
                    let (late, strong) = (stray.or(late), stray.or(strong));
                    (reports[last], packet.truth[last]) = measured.report(late);
                    (reports[strongest], packet.truth[strongest]) = measured.report(strong);
                }
            }
        }
    }
    packet.received = config.start + received_ns(sensor, index);
    packet.len = encode(
        sensor,
        config.start + begins_ns,
        index,
        &reports,
        &mut packet.bytes,
    );
}

fn encode(
    sensor: SensorKind,
    begins: Stamp,
    index: u64,
    reports: &[Report; 384],
    bytes: &mut [u8; helios::BYTES],
) -> usize {
    let utc = Utc::from_nanos(begins.as_nanos());
    let azimuths = sensor.block_azimuths(index as i64 * sensor.packet_ns());
    match sensor {
        SensorKind::Vlp16 | SensorKind::Vlp16Dual => {
            let dual = sensor == SensorKind::Vlp16Dual;
            if let Some(data) = bytes.first_chunk_mut() {
                vlp16::encode_data(data, &azimuths, reports, utc.micros_past_hour(), dual);
            }
            vlp16::DATA_BYTES
        }
        SensorKind::Helios16P => {
            helios::encode_msop(bytes, &azimuths, reports, &utc, index as u32);
            helios::BYTES
        }
    }
}

/// Writes the status packet that goes out at `now`; how many bytes it has.
pub(crate) fn make_status(
    sensor: SensorKind,
    now: Stamp,
    bytes: &mut [u8; helios::BYTES],
) -> usize {
    let utc = Utc::from_nanos(now.as_nanos());
    match sensor {
        SensorKind::Vlp16 | SensorKind::Vlp16Dual => {
            if let Some(position) = bytes.first_chunk_mut() {
                vlp16::encode_position(position, &utc);
            }
            vlp16::POSITION_BYTES
        }
        SensorKind::Helios16P => {
            helios::encode_difop(bytes, &utc);
            helios::BYTES
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn azimuths_count_a_tenth_of_a_second_to_a_turn() {
        let azimuths = SensorKind::Vlp16.block_azimuths(0);
        // 110.592 us a block at 0.0036 degrees a microsecond: 39.813 counts.
        assert_eq!(azimuths[..4], [0, 40, 80, 119]);
        let helios = SensorKind::Helios16P.block_azimuths(99_999_000);
        assert_eq!(helios[..3], [0, 20, 40]);
        let dual = SensorKind::Vlp16Dual.block_azimuths(0);
        assert_eq!(dual[..4], [0, 0, 40, 40]);
    }
}
