//! Rooms of rectangles, seen by a turning LiDAR, with the truth about every point.
#![allow(dead_code, reason = "each test file uses its own part of this module")]

use hachi_cloud::Reason;
use hachi_hal::{Point, Pose, Rotation, Vector3};
use nalgebra::Translation3;

/// What a rectangle does to a beam.
#[derive(Clone, Copy)]
pub enum Finish {
    /// Answers with this intensity.
    Solid(f32),
    /// Clean or dusty glass: `dust` is the share of beams it answers aslant. Head-on (within 10
    /// degrees) it always answers. Other beams are mirrored, or pass if `clear`.
    Glass { dust: f32, clear: bool },
    /// Answers this share of beams weakly and mirrors the rest.
    Polished { answers: f32 },
}

#[derive(Clone, Copy)]
pub struct Rectangle {
    pub corner: Vector3,
    pub u: Vector3,
    pub v: Vector3,
    pub finish: Finish,
}

/// What a point is.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Truth {
    Real,
    Glass,
    Ghost,
}

#[derive(Default)]
pub struct Scene {
    pub rectangles: Vec<Rectangle>,
}

pub struct Scan {
    pub points: Vec<Point>,
    pub truth: Vec<Truth>,
    pub footprint_from_lidar: Pose,
}

/// A number in [0, 1) that depends on its arguments alone.
pub fn chance(a: usize, b: usize) -> f32 {
    let mut h = (a as u64).wrapping_mul(0x9E37_79B9_7F4A_7C15)
        ^ (b as u64).wrapping_mul(0xD1B5_4A32_D192_ED03);
    h ^= h >> 29;
    h = h.wrapping_mul(0xBF58_476D_1CE4_E5B9);
    h ^= h >> 32;
    (h >> 40) as f32 / (1 << 24) as f32
}

impl Scene {
    /// A vertical rectangle from `a` to `b` (x, y) and from `low` to `high`.
    pub fn wall(
        &mut self,
        a: [f64; 2],
        b: [f64; 2],
        low: f64,
        high: f64,
        finish: Finish,
    ) -> &mut Self {
        self.rectangles.push(Rectangle {
            corner: Vector3::new(a[0], a[1], low),
            u: Vector3::new(b[0] - a[0], b[1] - a[1], 0.0),
            v: Vector3::new(0.0, 0.0, high - low),
            finish,
        });
        self
    }

    /// A level rectangle.
    pub fn slab(&mut self, a: [f64; 2], b: [f64; 2], z: f64, finish: Finish) -> &mut Self {
        self.rectangles.push(Rectangle {
            corner: Vector3::new(a[0], a[1], z),
            u: Vector3::new(b[0] - a[0], 0.0, 0.0),
            v: Vector3::new(0.0, b[1] - a[1], 0.0),
            finish,
        });
        self
    }

    /// A box standing on `z`.
    pub fn cuboid(
        &mut self,
        a: [f64; 2],
        b: [f64; 2],
        z: f64,
        height: f64,
        finish: Finish,
    ) -> &mut Self {
        self.wall(a, [b[0], a[1]], z, z + height, finish)
            .wall([b[0], a[1]], b, z, z + height, finish)
            .wall(b, [a[0], b[1]], z, z + height, finish)
            .wall([a[0], b[1]], a, z, z + height, finish)
            .slab(a, b, z + height, finish)
    }

    fn cast(
        &self,
        origin: Vector3,
        direction: Vector3,
        skip: Option<usize>,
    ) -> Option<(f64, usize, Vector3)> {
        let mut nearest: Option<(f64, usize, Vector3)> = None;
        for (index, r) in self.rectangles.iter().enumerate() {
            let normal = r.u.cross(&r.v).normalize();
            let slope = normal.dot(&direction);
            if Some(index) == skip || slope.abs() < 1e-9 {
                continue;
            }
            let t = normal.dot(&(r.corner - origin)) / slope;
            let at = origin + direction * t - r.corner;
            let inside =
                |edge: Vector3| (0.0..=1.0).contains(&(at.dot(&edge) / edge.norm_squared()));
            if t > 1e-6
                && t < 100.0
                && inside(r.u)
                && inside(r.v)
                && nearest.is_none_or(|(n, ..)| t < n)
            {
                nearest = Some((t, index, normal));
            }
        }
        nearest
    }

    /// One turn: `rings` beams evenly over -15 to 15 degrees, `steps` azimuths.
    pub fn scan(&self, footprint_from_lidar: Pose, rings: usize, steps: usize) -> Scan {
        let mut scan = Scan {
            points: Vec::new(),
            truth: Vec::new(),
            footprint_from_lidar,
        };
        for step in 0..steps {
            for ring in 0..rings {
                let azimuth = step as f64 * std::f64::consts::TAU / steps as f64;
                let elevation = (-15.0 + 30.0 * ring as f64 / (rings - 1) as f64).to_radians();
                let beam = Vector3::new(
                    elevation.cos() * azimuth.cos(),
                    elevation.cos() * azimuth.sin(),
                    elevation.sin(),
                );
                let seed = step * rings + ring;
                if let Some((distance, intensity, truth)) =
                    self.echo(&footprint_from_lidar, beam, seed)
                {
                    let noise = f64::from(chance(seed, 1) + chance(seed, 2) - 1.0) * 0.03;
                    let p = beam * (distance + noise);
                    scan.points.push(Point {
                        intensity,
                        ring: ring as u16,
                        ..Point::at(p.x as f32, p.y as f32, p.z as f32)
                    });
                    scan.truth.push(truth);
                }
            }
        }
        scan
    }

    fn echo(
        &self,
        footprint_from_lidar: &Pose,
        beam: Vector3,
        seed: usize,
    ) -> Option<(f64, f32, Truth)> {
        let mut origin = footprint_from_lidar.translation.vector;
        let mut direction = footprint_from_lidar.rotation * beam;
        let (mut travelled, mut skip, mut truth) = (0.0, None, Truth::Real);
        for bounce in 0..4 {
            let (t, index, normal) = self.cast(origin, direction, skip)?;
            travelled += t;
            let answers = match self.rectangles[index].finish {
                Finish::Solid(intensity) => return Some((travelled, intensity, truth)),
                Finish::Glass { dust, .. } => {
                    if normal.dot(&direction).abs() > 0.985 {
                        1.0
                    } else {
                        dust
                    }
                }
                Finish::Polished { answers } => answers,
            };
            if chance(seed, 10 + bounce) < answers {
                let here = if truth == Truth::Real {
                    Truth::Glass
                } else {
                    truth
                };
                return Some((travelled, 6.0, here));
            }
            origin += direction * t;
            skip = Some(index);
            let passes = matches!(
                self.rectangles[index].finish,
                Finish::Glass { clear: true, .. }
            );
            if !passes {
                direction -= normal * (2.0 * normal.dot(&direction));
                truth = Truth::Ghost;
            }
        }
        None
    }
}

/// Sensor `height` above the floor at (0, 0), rolled and pitched.
pub fn standing(height: f64, roll_deg: f64, pitch_deg: f64) -> Pose {
    Pose::from_parts(
        Translation3::new(0.0, 0.0, height),
        Rotation::from_euler_angles(roll_deg.to_radians(), pitch_deg.to_radians(), 0.0),
    )
}

impl Scan {
    /// Shares of the points of one truth that carry one label.
    pub fn share(&self, labels: &[Reason], truth: Truth, label: Reason) -> f64 {
        let of: Vec<_> = labels
            .iter()
            .zip(&self.truth)
            .filter(|(_, t)| **t == truth)
            .collect();
        let with = of.iter().filter(|(l, _)| **l == label).count();
        with as f64 / of.len().max(1) as f64
    }

    pub fn count(&self, truth: Truth) -> usize {
        self.truth.iter().filter(|t| **t == truth).count()
    }
}
