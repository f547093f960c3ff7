//! Keyframes of a simulated robot: what it measured, and where.
//!
//! The small buildings are patrolled three times: as it comes; 0.4 m to the left, with the sensor
//! turned by 50 degrees; 0.3 m to the right and in reverse direction. The large ones bring the robot
//! back to known places in both directions by themselves. Each keyframe is a few turns of a VLP-16
//! gathered with the true motion between them, as odometry over a second would do it, and levelled
//! by the library itself.

use std::f64::consts::PI;
use std::sync::Arc;

use hachi_hal::{Pose, Rotation};
use hachi_place::{Leveller, leveller};
use hachi_world::{NoiseConfig, Preset, Simulation, SimulationConfig};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// How bad the sensor is.
#[derive(Debug, Clone, Copy)]
pub struct Level {
    /// Its name.
    pub name: &'static str,
    /// Standard deviation of a distance, metres.
    pub range_sigma_m: f64,
    /// Share of the returns whose distance is replaced by any other up to 30 m.
    pub outliers: f64,
}

/// The levels.
pub const LEVELS: [Level; 3] = [
    Level {
        name: "clean",
        range_sigma_m: 0.015,
        outliers: 0.0,
    },
    Level {
        name: "noisy",
        range_sigma_m: 0.05,
        outliers: 0.02,
    },
    Level {
        name: "bad",
        range_sigma_m: 0.10,
        outliers: 0.08,
    },
];

/// One keyframe.
#[derive(Debug, Clone, Default)]
pub struct Keyframe {
    /// True position of the sensor in the map, metres.
    pub position: [f64; 3],
    /// What it measured, levelled by the library.
    pub points: Vec<[f32; 4]>,
}

/// A turn in place makes a keyframe after this, radians.
const GAP_RAD: f64 = 0.5;
/// Turns in one keyframe, and the time between them, seconds.
const TURNS: usize = 5;
const BETWEEN_S: f64 = 0.3;
/// Gathered points are thinned to one for each cube of this edge, metres.
const VOXEL_M: f32 = 0.1;
/// Outliers lie up to this far, metres.
const OUTLIER_REACH_M: f32 = 30.0;

/// Keyframes of three rounds through the preset's building.
pub fn walk(preset: Preset, seed: u64, level: Level) -> Vec<Keyframe> {
    let world = preset.world(seed);
    let round_s = world.trajectory.period_s();
    let mut config = SimulationConfig::new(world, seed, round_s);
    config.noise = NoiseConfig {
        range_sigma_m: level.range_sigma_m,
        ..NoiseConfig::default()
    };
    let mounted = config.base_from_lidar;
    let rounds: &[(f64, f64)] = match preset {
        Preset::Building | Preset::Campus | Preset::CampusLong => &[(0.0, 0.0)],
        _ => &[(0.0, 0.0), (0.4, 50.0 * PI / 180.0), (-0.3, PI)],
    };
    let gap_m = match preset {
        Preset::Campus | Preset::CampusLong => 2.0,
        _ => 1.0,
    };
    let mut keyframes = Vec::new();
    for (round, &(lateral_m, yaw)) in rounds.iter().enumerate() {
        let aside = Pose::from_parts(
            hachi_hal::Vector3::new(0.0, lateral_m, 0.0).into(),
            Rotation::from_euler_angles(0.0, 0.0, yaw),
        );
        config.base_from_lidar = aside * mounted;
        config.seed = seed.wrapping_mul(1000) + round as u64;
        let mut of_round = round_of(&config, round_s, round as f64 * 0.37, gap_m, level);
        if yaw == PI {
            of_round.reverse();
        }
        keyframes.append(&mut of_round);
    }
    keyframes
}

fn round_of(
    config: &SimulationConfig,
    round_s: f64,
    begin_s: f64,
    gap_m: f64,
    level: Level,
) -> Vec<Keyframe> {
    let mut simulation = Simulation::new(SimulationConfig {
        scene: Arc::clone(&config.scene),
        trajectory: Arc::clone(&config.trajectory),
        duration_s: round_s + 10.0,
        ..config.clone()
    });
    let mut random = ChaCha8Rng::seed_from_u64(config.seed);
    let mut leveller = Leveller::default();
    let mut keyframes = Vec::new();
    let mut last: Option<Pose> = None;
    let mut time_s = begin_s;
    while time_s < round_s {
        let at = |t: f64| config.start + (t * 1e9) as i64;
        let now = config.map_from_lidar(at(time_s));
        let moved = last.is_none_or(|last| {
            let between = last.inverse() * now;
            between.translation.vector.norm() > gap_m || between.rotation.angle() > GAP_RAD
        });
        if moved {
            last = Some(now);
            let mut gathered = Vec::new();
            for turn in 0..TURNS {
                let begin = time_s + (turn as f64 - (TURNS / 2) as f64) * BETWEEN_S;
                if begin < 0.0 {
                    continue;
                }
                let mut scan = Vec::new();
                turn_of(&mut simulation, begin, &mut scan);
                spoil(&mut scan, level, &mut random);
                let now_from_then = now.inverse() * config.map_from_lidar(at(begin + 0.05));
                let mut moved = Vec::new();
                leveller::apply(&now_from_then, &scan, &mut moved);
                gathered.append(&mut moved);
            }
            thin(&mut gathered);
            let mut points = Vec::new();
            leveller.level(&gathered, None, &mut points);
            keyframes.push(Keyframe {
                position: now.translation.vector.into(),
                points,
            });
        }
        time_s += 0.1;
    }
    keyframes
}

/// One turn of the sensor from a time on.
fn turn_of(simulation: &mut Simulation, begin_s: f64, out: &mut Vec<[f32; 4]>) {
    const TURN_NS: i64 = 100_000_000;
    let begin = simulation.config().start + (begin_s * 1e9) as i64;
    simulation.seek(begin);
    while let Some(packet) = simulation.next_packet() {
        if packet.stamp > begin + TURN_NS + 2_000_000 {
            break;
        }
        if packet.bytes.len() == 1206 {
            decode(packet.bytes, out);
        }
    }
}

/// The returns of a VLP-16 data packet (single return), in the sensor's frame.
fn decode(bytes: &[u8], out: &mut Vec<[f32; 4]>) {
    const ELEVATION_DEG: [f32; 16] = [
        -15.0, 1.0, -13.0, 3.0, -11.0, 5.0, -9.0, 7.0, -7.0, 9.0, -5.0, 11.0, -3.0, 13.0, -1.0,
        15.0,
    ];
    for block in bytes[..1200].chunks_exact(100) {
        let azimuth = f32::from(u16::from_le_bytes([block[2], block[3]])) * 0.01;
        for (channel, record) in block[4..].chunks_exact(3).enumerate() {
            let distance = f32::from(u16::from_le_bytes([record[0], record[1]])) * 0.002;
            if distance == 0.0 {
                continue;
            }
            let (sequence, laser) = (channel / 16, channel % 16);
            let after_us = 55.296 * sequence as f32 + 2.304 * laser as f32;
            let azimuth = (azimuth + after_us * 0.0036).to_radians();
            let (up, level) = ELEVATION_DEG[laser].to_radians().sin_cos();
            out.push([
                distance * level * azimuth.cos(),
                -distance * level * azimuth.sin(),
                distance * up,
                f32::from(record[2]),
            ]);
        }
    }
}

/// Replaces a share of the distances by any other.
fn spoil(scan: &mut [[f32; 4]], level: Level, random: &mut ChaCha8Rng) {
    for point in scan {
        if random.random::<f64>() < level.outliers {
            let range = point[0].hypot(point[1]).hypot(point[2]);
            let factor = (0.5 + random.random::<f32>() * OUTLIER_REACH_M) / range;
            point[..3].iter_mut().for_each(|c| *c *= factor);
        }
    }
}

fn thin(points: &mut Vec<[f32; 4]>) {
    let cell = |p: &[f32; 4]| [p[0], p[1], p[2]].map(|c| (c / VOXEL_M).floor() as i32);
    points.sort_by_key(cell);
    points.dedup_by_key(|p| cell(p));
}
