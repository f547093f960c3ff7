//! What the sensors have in common: from a packet's number to its firings, beams and returns.
//!
//! In: the scene, the trajectory, the packet's number. Out: the packet's bytes and, for each
//! channel, the truth. A packet depends on nothing but these and the seed, so packets can be made
//! in any order and on any thread. Elsewhere: byte layouts (`vlp16`, `helios`), echoes
//! (`optics`), what is reported of them (`returns`).

use std::f64::consts::TAU;

use hachi_hal::{Pose, Stamp};
use rand::RngExt;

use crate::calendar::Utc;
use crate::noise::{Purpose, generator, normal_pair};
use crate::optics::{Echoes, Wanted, beam, trace};
use crate::returns::{Measurement, Report, ReturnTruth, Strays, dual_of, strongest_of};
use crate::scene::Scene;
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
const TURN_NS: i64 = 100_000_000;
/// Nor from farther: VLP-16 data sheet, 100 m, and the Helios' 16-bit distances reach 163 m.
pub(crate) const MAX_RANGE_M: f32 = 100.0;
/// Half the distance between the two halves of a beam at its divergence of 3 mrad (VLP-16
/// manual), radians: at edges they see two things.
const HALF_BEAM_RAD: f64 = 0.000_75;
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

    fn firing(self, group: usize, laser: usize) -> Firing {
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
}

impl DataPacket {
    pub fn empty() -> Self {
        Self {
            bytes: [0; helios::BYTES],
            len: 0,
            received: Stamp::default(),
            truth: [ReturnTruth::default(); 384],
        }
    }
}

/// Nanoseconds after the start at which the `index`-th data packet is received.
pub(crate) fn received_ns(sensor: SensorKind, index: u64) -> i64 {
    index as i64 * sensor.packet_ns() + sensor.last_firing_ns() + TRANSPORT_NS
}

/// Makes the `index`-th data packet.
pub(crate) fn make_packet(config: &SimulationConfig, index: u64, packet: &mut DataPacket) {
    let sensor = config.sensor;
    let begins_ns = index as i64 * sensor.packet_ns();
    let mut random = generator(config.seed, Purpose::Packets, index);
    let mut strays = Strays::new(config.seed, config.noise.stray_share, index);
    let mut reports = [Report::default(); 384];
    packet.truth = [ReturnTruth::default(); 384];
    let pose_at = |offset_ns: i64| {
        let time_s = (begins_ns + offset_ns) as f64 * 1e-9;
        config.trajectory.map_from_base(time_s) * config.base_from_lidar
    };
    let mut echoes = Echoes::new();
    let rises: [(f64, f64); 16] =
        std::array::from_fn(|laser| sensor.firing(0, laser).elevation_rad.sin_cos());
    for group in 0..sensor.groups() {
        let from_ns = sensor.firing(group, 0).offset_ns;
        let to_ns = sensor.firing(group, 15).offset_ns;
        // Between the first and the last laser of a group (35 µs) the pose is interpolated: a
        // body shaken at 60 rad/s² departs from that by 1e-8 rad.
        let motion = GroupMotion::new(pose_at(from_ns), pose_at(to_ns));
        for (laser, rise) in rises.into_iter().enumerate() {
            let firing = sensor.firing(group, laser);
            let share = (firing.offset_ns - from_ns) as f64 / (to_ns - from_ns) as f64;
            let turned = (begins_ns + firing.offset_ns).rem_euclid(TURN_NS);
            let head_rad = turned as f64 / TURN_NS as f64 * TAU;
            let shot = Shot {
                origin: lens(sensor, head_rad),
                azimuth_rad: head_rad + firing.azimuth_offset_rad,
                rise,
            };
            echoes.clear();
            shoot(&config.scene, sensor, &motion, share, shot, &mut echoes);
            let noise = normal_pair(&mut random);
            let fading = random.random::<f32>();
            let measured = Measurement::of(sensor.distance_unit_m(), &config.noise, noise, fading);
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

/// Where the beams leave the sensor, in its frame.
fn lens(sensor: SensorKind, head_rad: f64) -> [f64; 3] {
    match sensor {
        SensorKind::Vlp16 | SensorKind::Vlp16Dual => [0.0; 3],
        SensorKind::Helios16P => {
            let (sin, cos) = head_rad.sin_cos();
            [helios::LENS_M * cos, -helios::LENS_M * sin, 0.0]
        }
    }
}

struct GroupMotion {
    from: Pose,
    to: Pose,
}

impl GroupMotion {
    fn new(from: Pose, to: Pose) -> Self {
        Self { from, to }
    }

    /// A place and a direction of the sensor's frame, in the map, `share` of the way.
    fn in_map(&self, share: f64, at: [f64; 3], direction: [f64; 3]) -> ([f64; 3], [f64; 3]) {
        let (at, direction) = (
            nalgebra::Point3::from(at),
            hachi_hal::Vector3::from(direction),
        );
        let [a, b] = [&self.from, &self.to].map(|pose| (pose * at).coords);
        let [c, d] = [&self.from, &self.to].map(|pose| pose.rotation * direction);
        (
            a.lerp(&b, share).into(),
            c.lerp(&d, share).normalize().into(),
        )
    }
}

#[derive(Clone, Copy)]
struct Shot {
    origin: [f64; 3],
    azimuth_rad: f64,
    /// Sine and cosine of the elevation.
    rise: (f64, f64),
}

fn shoot(
    scene: &Scene,
    sensor: SensorKind,
    motion: &GroupMotion,
    share: f64,
    shot: Shot,
    echoes: &mut Echoes,
) {
    // A sensor that reports two echoes also sees both sides of an edge: half the beam each.
    let (sides, gain, wanted): (&[f64], f32, _) = match sensor {
        SensorKind::Vlp16Dual => (&[-HALF_BEAM_RAD, HALF_BEAM_RAD], 0.5, Wanted::Every),
        SensorKind::Vlp16 | SensorKind::Helios16P => (&[0.0], 1.0, Wanted::Strongest),
    };
    let (up, level) = shot.rise;
    for side in sides {
        // Azimuth runs clockwise seen from above, from x.
        let (sin, cos) = (shot.azimuth_rad + side).sin_cos();
        let direction = [level * cos, -level * sin, up];
        let (origin, direction) = motion.in_map(share, shot.origin, direction);
        let ray = beam(origin, direction);
        trace(scene, ray, gain, MAX_RANGE_M, wanted, echoes);
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
