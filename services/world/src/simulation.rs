//! The simulated sensor: packet after packet, with the truth beside each.
//!
//! In: [`SimulationConfig`]. Out: the payloads that the real sensor would send, in order, and what
//! each return truly is. Packets are made some at a time, in parallel in the caller's rayon pool;
//! each depends on the configuration and its number alone, so the bytes are the same for any
//! number of threads.

use std::sync::Arc;

use hachi_hal::{Pose, Stamp};
use nalgebra::Translation3;
use rayon::prelude::*;

use crate::helios;
use crate::imu::{ImuConfig, SimulatedImu};
use crate::odometry::{OdometryConfig, SimulatedOdometry};
use crate::person::{Body, Person};
use crate::preset::{Preset, World};
use crate::returns::ReturnTruth;
use crate::scene::Scene;
use crate::sensor::{DataPacket, SensorKind, make_packet, make_status, received_ns};
use crate::trajectory::Trajectory;

/// How the sensor errs.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NoiseConfig {
    /// Standard deviation of a distance, metres.
    pub range_sigma_m: f64,
    /// Standard deviation of an intensity, as a share of it.
    pub intensity_sigma: f64,
    /// Share of the pulses that report a stray return: anywhere on the beam to twice as far as
    /// what the pulse meets, or to the greatest range if it meets nothing, as bright as cloth.
    pub stray_share: f64,
}

impl NoiseConfig {
    /// A perfect sensor but for the rounding of its bytes.
    pub const NONE: Self = Self {
        range_sigma_m: 0.0,
        intensity_sigma: 0.0,
        stray_share: 0.0,
    };

    /// A worn sensor in light rain: 5 cm, and two returns in a hundred are stray.
    pub const MILD: Self = Self {
        range_sigma_m: 0.05,
        intensity_sigma: 0.10,
        stray_share: 0.02,
    };

    /// In dust, beside other sensors: 15 cm, and a tenth of the returns is stray.
    pub const STRONG: Self = Self {
        range_sigma_m: 0.15,
        intensity_sigma: 0.20,
        stray_share: 0.10,
    };

    /// Three levels by name, from none to strong: what place recognition is measured at.
    pub const LEVELS: [(&str, Self); 3] = [
        ("none", Self::NONE),
        ("mild", Self::MILD),
        ("strong", Self::STRONG),
    ];
}

/// 1.5 cm, half of the VLP-16 data sheet's typical 3 cm accuracy, and 5 % of intensity.
impl Default for NoiseConfig {
    fn default() -> Self {
        Self {
            range_sigma_m: 0.015,
            intensity_sigma: 0.05,
            stray_share: 0.0,
        }
    }
}

/// Everything that decides what a simulation sends.
#[derive(Debug, Clone)]
pub struct SimulationConfig {
    /// What stands where.
    pub scene: Arc<Scene>,
    /// Who walks there.
    pub people: Arc<[Person]>,
    /// Where the robot is.
    pub trajectory: Arc<Trajectory>,
    /// Which sensor it carries.
    pub sensor: SensorKind,
    /// Where the sensor sits.
    pub base_from_lidar: Pose,
    /// How the sensor errs.
    pub noise: NoiseConfig,
    /// How the inertial sensor errs.
    pub imu: ImuConfig,
    /// How the legs' odometry errs.
    pub odometry: OdometryConfig,
    /// Of all noise.
    pub seed: u64,
    /// When the simulation begins, on the capture's UNIX clock.
    pub start: Stamp,
    /// How long it lasts, seconds.
    pub duration_s: f64,
}

/// 2023-11-14, 22:13:20 UTC.
const DEFAULT_START: Stamp = Stamp::from_nanos(1_700_000_000_000_000_000);

impl SimulationConfig {
    /// A robot with a VLP-16 on its back, 0.2 m over its base and 0.15 m before it, in a world.
    pub fn new(world: World, seed: u64, duration_s: f64) -> Self {
        Self {
            scene: Arc::new(world.scene),
            people: Arc::new([]),
            trajectory: Arc::new(world.trajectory),
            sensor: SensorKind::Vlp16,
            base_from_lidar: Pose::from_parts(
                Translation3::new(0.15, 0.0, 0.2),
                nalgebra::UnitQuaternion::identity(),
            ),
            noise: NoiseConfig::default(),
            imu: ImuConfig::default(),
            odometry: OdometryConfig::default(),
            seed,
            start: DEFAULT_START,
            duration_s,
        }
    }

    /// One of the ready-made worlds. The seed decides its layout as well as the noise.
    pub fn preset(preset: Preset, seed: u64, duration_s: f64) -> Self {
        Self::new(preset.world(seed), seed, duration_s)
    }

    fn duration_ns(&self) -> i64 {
        // Saturates; NaN is no time at all.
        (self.duration_s.max(0.0) * 1e9) as i64
    }

    /// When the simulation ends.
    pub fn end(&self) -> Stamp {
        self.start + self.duration_ns()
    }

    /// Everybody who is there at a time, seconds after the start.
    pub(crate) fn bodies_at(&self, time_s: f64, bodies: &mut Vec<Body>) {
        bodies.clear();
        let floor = self.scene.floor();
        bodies.extend(self.people.iter().filter_map(|person| {
            let presence = person.presence(time_s, floor)?;
            person.body(&presence)
        }));
    }

    fn seconds(&self, stamp: Stamp) -> f64 {
        stamp.secs_since(self.start)
    }

    /// Where the sensor truly is.
    pub fn map_from_lidar(&self, stamp: Stamp) -> Pose {
        self.map_from_base(stamp) * self.base_from_lidar
    }

    /// Where the base truly is.
    pub fn map_from_base(&self, stamp: Stamp) -> Pose {
        self.trajectory.map_from_base(self.seconds(stamp))
    }

    /// Where the footprint truly is: on the floor or ramp under the base, x along the heading.
    pub fn map_from_footprint(&self, stamp: Stamp) -> Pose {
        self.trajectory.map_from_footprint(self.seconds(stamp))
    }

    /// Takes points of the sensor to the footprint, with the body's bobbing and tilting of that
    /// moment.
    pub fn footprint_from_lidar(&self, stamp: Stamp) -> Pose {
        self.map_from_footprint(stamp).inverse() * self.map_from_lidar(stamp)
    }

    /// The readings of an inertial sensor in the base, from the start to the end.
    pub fn imu(&self) -> SimulatedImu {
        SimulatedImu::new(self)
    }

    /// The odometry of the robot's legs, from the start to the end.
    pub fn odometry(&self) -> SimulatedOdometry {
        SimulatedOdometry::new(self)
    }

    /// The true `map_from_lidar` every `period_ns` nanoseconds, from the start to the end.
    pub fn truth(&self, period_ns: i64) -> impl Iterator<Item = (Stamp, Pose)> + '_ {
        let period_ns = period_ns.max(1);
        (0..=self.duration_ns() / period_ns).map(move |i| {
            let stamp = self.start + i * period_ns;
            (stamp, self.map_from_lidar(stamp))
        })
    }
}

/// A payload that the sensor sent.
#[derive(Debug, Clone, Copy)]
pub struct SimulatedPacket<'a> {
    /// When it was received: 50 µs after its last firing.
    pub stamp: Stamp,
    /// UDP port it was sent to.
    pub port: u16,
    /// The UDP payload.
    pub bytes: &'a [u8],
    /// The truth about each of its 384 channels, in the order of the bytes (32 to a block); empty
    /// for packets without returns.
    pub truth: &'a [ReturnTruth],
}

/// Packets made at a time: enough to keep a few threads busy, 3 MB/s of memory traffic at most.
const BATCH: usize = 32;

/// The simulated sensor. Memory does not grow with the duration.
#[derive(Debug)]
pub struct Simulation {
    config: SimulationConfig,
    batch: Vec<DataPacket>,
    /// The number of the batch's first data packet, and of the first that is not made yet.
    batch_begins: u64,
    made: u64,
    /// The number of the next data packet to give out.
    given: u64,
    total: u64,
    status: [u8; helios::BYTES],
    status_due: bool,
}

impl Simulation {
    /// Ready to send its first packet.
    pub fn new(config: SimulationConfig) -> Self {
        let duration_ns = config.duration_ns();
        let first = received_ns(config.sensor, 0);
        let total = if duration_ns < first {
            0
        } else {
            (duration_ns - first) as u64 / config.sensor.packet_ns() as u64 + 1
        };
        Self {
            config,
            batch: vec![DataPacket::empty(); BATCH],
            batch_begins: 0,
            made: 0,
            given: 0,
            total,
            status: [0; helios::BYTES],
            status_due: false,
        }
    }

    /// What decides what it sends, and the truth.
    pub fn config(&self) -> &SimulationConfig {
        &self.config
    }

    /// How many data packets it sends in all.
    pub fn data_packets(&self) -> u64 {
        self.total
    }

    /// Leaves out what is received before `stamp`: what follows is the same as without, and takes
    /// no longer the later it is. There is no way back.
    pub fn skip_to(&mut self, stamp: Stamp) {
        let sensor = self.config.sensor;
        let ns = (stamp.as_nanos()).saturating_sub(self.config.start.as_nanos());
        let behind_first = ns.saturating_sub(received_ns(sensor, 0)).max(0) as u64;
        let index = behind_first
            .div_ceil(sensor.packet_ns() as u64)
            .min(self.total);
        if index > self.given {
            (self.given, self.made, self.status_due) = (index, index, false);
        }
    }

    /// When the next packet is received, if there is one.
    pub fn next_stamp(&self) -> Option<Stamp> {
        let index = if self.status_due {
            self.given - 1
        } else {
            self.given
        };
        (index < self.total)
            .then(|| self.config.start + received_ns(self.config.sensor, index))
            .map(|stamp| stamp + i64::from(self.status_due) * STATUS_DELAY_NS)
    }

    /// Goes on, or back, to the first data packet that is received at `stamp` or later; what is sent
    /// from there on is what it would have been without the leap.
    pub fn seek(&mut self, stamp: Stamp) {
        let after_ns = stamp.nanos_since(self.config.start);
        let first = received_ns(self.config.sensor, 0);
        let packet_ns = self.config.sensor.packet_ns();
        let index = match after_ns <= first {
            true => 0,
            false => ((after_ns - first) as u64).div_ceil(packet_ns as u64),
        };
        let index = index.min(self.total);
        self.status_due = false;
        // Batches begin at multiples of their size.
        self.made = index - index % BATCH as u64;
        self.given = self.made;
        if index > self.given {
            self.make_batch();
            self.given = index;
        }
    }

    /// The next packet; `None` at the end. Status packets follow the data packet they come with.
    pub fn next_packet(&mut self) -> Option<SimulatedPacket<'_>> {
        let stamp = self.next_stamp()?;
        let sensor = self.config.sensor;
        if self.status_due {
            self.status_due = false;
            let len = make_status(sensor, stamp, &mut self.status);
            return Some(SimulatedPacket {
                stamp,
                port: sensor.status_port(),
                bytes: &self.status[..len],
                truth: &[],
            });
        }
        if self.given == self.made {
            self.make_batch();
        }
        let packet = &self.batch[(self.given - self.batch_begins) as usize];
        self.status_due = self.given.is_multiple_of(sensor.data_per_status());
        self.given += 1;
        Some(SimulatedPacket {
            stamp,
            port: sensor.data_port(),
            bytes: &packet.bytes[..packet.len],
            truth: &packet.truth,
        })
    }

    fn make_batch(&mut self) {
        let count = (self.total - self.made).min(BATCH as u64) as usize;
        let (config, first) = (&self.config, self.made);
        self.batch_begins = first;
        self.batch[..count]
            .par_iter_mut()
            .enumerate()
            .for_each(|(i, packet)| make_packet(config, first + i as u64, packet));
        self.made += count as u64;
    }
}

/// A status packet follows its data packet by this, ns.
const STATUS_DELAY_NS: i64 = 20_000;
