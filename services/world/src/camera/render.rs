//! Rays of pixels through the scene and the people in it.
//!
//! Rows are worked on in parallel, each with a random generator of its own, so that the picture does
//! not depend on how they are shared out.

use hachi_hal::{Intrinsics, Pose};
use parry3d::math::Vector;
use parry3d::query::Ray;
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;

use super::light::Lighting;
use super::truth::PixelBox;
use super::{CameraConfig, bytes};
use crate::noise::{Purpose, generator, normal_pair};
use crate::person::{Body, Rgb};
use crate::scene::{Hit, Scene, narrow};

/// Nothing further away is drawn, metres.
const FAR_M: f32 = 200.0;
/// Panes that a ray is followed through.
const PANES: usize = 6;
/// How far behind a surface a ray goes on, metres.
const STEP_M: f32 = 2e-3;
/// What a second imager must see of a surface for it to be the same one, metres and share.
const SAME_M: f32 = 0.02;
const SAME_SHARE: f32 = 0.01;
/// Disparities are found in these steps, pixels.
const DISPARITY_STEP_PX: f64 = 1.0 / 32.0;
/// What is seen where there is nothing.
const SKY: Rgb = [205, 220, 235];

/// Where pixels look: unit vectors in the camera's frame, row by row.
#[derive(Debug)]
pub(super) struct Lens {
    width: usize,
    looks: Vec<hachi_hal::Vector3>,
}

impl Lens {
    pub fn new(optics: &Intrinsics) -> Self {
        let pixels = (0..optics.height).flat_map(|row| (0..optics.width).map(move |c| (c, row)));
        Self {
            width: (optics.width as usize).max(1),
            looks: pixels
                .map(|(column, row)| {
                    let pixel = [f64::from(column), f64::from(row)];
                    optics.deproject(pixel, 1.0).normalize()
                })
                .collect(),
        }
    }

    fn row(&self, row: usize) -> &[hachi_hal::Vector3] {
        &self.looks[row * self.width..][..self.width]
    }
}

/// What a ray meets.
struct Surface {
    distance: f32,
    /// Towards the camera.
    normal: Vector,
    color: Rgb,
    /// The person's place among the bodies, from 1; 0 is the scene.
    mask: u8,
}

/// What there is to see at one moment.
pub(super) struct View<'a> {
    pub scene: &'a Scene,
    pub bodies: &'a [Body],
    pub lighting: Lighting,
    pub seed: u64,
    pub frame: u64,
}

impl View<'_> {
    /// The Z16 picture.
    pub fn depth(
        &self,
        config: &CameraConfig,
        lens: &Lens,
        map_from_camera: &Pose,
        z16: &mut [u8],
    ) {
        let eye = narrow(map_from_camera.translation.vector);
        let right = map_from_camera * nalgebra::Point3::new(config.baseline_m, 0.0, 0.0);
        let right = narrow(right.coords);
        let stereo = config.disparity_sigma_px > 0.0;
        let rows = z16.par_chunks_exact_mut(2 * lens.width);
        rows.enumerate().for_each(|(row, line)| {
            let mut random = self.random(row, 0);
            for (look, pixel) in lens.row(row).iter().zip(line.chunks_exact_mut(2)) {
                let dir = narrow(map_from_camera.rotation * look);
                // Drawn for every pixel, so that one does not shift the others.
                let luck = normal_pair(&mut random)[0];
                let surface = self.first(&Ray::new(eye, dir)).filter(|surface| {
                    let point = eye + dir * surface.distance;
                    !stereo || self.sees(right, point)
                });
                let depth = surface.map(|surface| f64::from(surface.distance) * look.z);
                let in_range = |z: &f64| (config.range_m[0]..=config.range_m[1]).contains(z);
                let depth = depth.map(|z| measured(config, z, luck)).filter(in_range);
                let count = bytes::count(depth, config.geometry.depth_unit_m);
                pixel.copy_from_slice(&count.to_le_bytes());
            }
        });
    }

    /// The YUYV picture, and who is seen in each of its pixels.
    pub fn color(
        &self,
        config: &CameraConfig,
        lens: &Lens,
        map_from_camera: &Pose,
        yuyv: &mut [u8],
        masks: &mut [u8],
    ) {
        let eye = narrow(map_from_camera.translation.vector);
        let rows = yuyv.par_chunks_exact_mut(2 * lens.width);
        let rows = rows.zip(masks.par_chunks_exact_mut(lens.width));
        rows.enumerate().for_each(|(row, (line, masks))| {
            let mut random = self.random(row, 1);
            let mut seen = |look: &hachi_hal::Vector3, mask: &mut u8| {
                let dir = narrow(map_from_camera.rotation * look);
                let surface = self.first(&Ray::new(eye, dir));
                *mask = surface.as_ref().map_or(0, |surface| surface.mask);
                let (color, light) = surface.map_or((SKY, self.lighting.sky()), |s| {
                    (s.color, self.lighting.on(s.normal))
                });
                let lit = bytes::lit(color, light);
                let [y, u, v] = bytes::yuv(lit);
                [y + config.luma_sigma * normal_pair(&mut random)[0], u, v]
            };
            let looks = lens.row(row).chunks_exact(2);
            for ((looks, masks), pair) in looks
                .zip(masks.chunks_exact_mut(2))
                .zip(line.chunks_exact_mut(4))
            {
                let first = seen(&looks[0], &mut masks[0]);
                let second = seen(&looks[1], &mut masks[1]);
                pair.copy_from_slice(&bytes::yuyv_pair(first, second));
            }
        });
    }

    /// The pixels that would show a body if nothing were in the way, and the box around them.
    pub fn whole(
        &self,
        optics: &Intrinsics,
        lens: &Lens,
        map_from_camera: &Pose,
        body: &Body,
    ) -> (u32, Option<PixelBox>) {
        let eye = narrow(map_from_camera.translation.vector);
        let (mut pixels, mut whole) = (0, None);
        let (centre, reach) = body.bounds();
        // Behind the camera, all of it.
        let ahead = narrow(map_from_camera.rotation * hachi_hal::Vector3::z());
        if (centre - eye).dot(ahead) < -reach {
            return (0, None);
        }
        for row in 0..optics.height {
            for (column, look) in lens.row(row as usize).iter().enumerate() {
                let dir = narrow(map_from_camera.rotation * look);
                if body.cast(&Ray::new(eye, dir), FAR_M).is_some() {
                    pixels += 1;
                    whole = Some(PixelBox::grown(whole, column as u32, row));
                }
            }
        }
        (pixels, whole)
    }

    fn random(&self, row: usize, picture: u64) -> ChaCha8Rng {
        // Pictures have at most a few thousand rows.
        let stream = self.frame << 16 | picture << 15 | row as u64;
        generator(self.seed, Purpose::Camera, stream)
    }

    /// The first thing a ray meets; glass is seen through.
    fn first(&self, ray: &Ray) -> Option<Surface> {
        let within = FAR_M;
        let scene = self.behind_glass(ray, within);
        let reach = scene.as_ref().map_or(within, |(_, hit)| hit.distance);
        let mut nearest: Option<(u8, crate::person::BodyHit)> = None;
        for (number, body) in self.bodies.iter().enumerate() {
            let best = nearest.as_ref().map_or(reach, |(_, hit)| hit.distance);
            if let Some(hit) = body.cast(ray, best) {
                // Masks have room for all that there can be.
                nearest = Some((number as u8 + 1, hit));
            }
        }
        let facing = |normal: Vector| {
            if normal.dot(ray.dir) > 0.0 {
                -normal
            } else {
                normal
            }
        };
        match nearest {
            Some((mask, hit)) => Some(Surface {
                distance: hit.distance,
                normal: facing(hit.normal),
                color: hit.color,
                mask,
            }),
            None => scene.map(|(color, hit)| Surface {
                distance: hit.distance,
                normal: facing(hit.normal),
                color,
                mask: 0,
            }),
        }
    }

    /// The scene's first surface that is not a pane, with its colour.
    fn behind_glass(&self, ray: &Ray, within: f32) -> Option<(Rgb, Hit)> {
        let mut passed = 0.0;
        for _ in 0..PANES {
            let from = Ray::new(ray.point_at(passed), ray.dir);
            let mut hit = self.scene.cast(&from, within - passed, None)?;
            hit.distance += passed;
            let material = &self.scene.object(hit.object).material;
            if !material.is_glass() {
                return Some((paint(material.reflectivity, hit.object), hit));
            }
            passed = hit.distance + STEP_M;
        }
        None
    }

    /// Whether a point is the first thing on the way to it.
    fn sees(&self, eye: Vector, point: Vector) -> bool {
        let way = point - eye;
        let distance = way.length();
        let first = self.first(&Ray::new(eye, way / distance));
        first.is_none_or(|surface| surface.distance > distance - SAME_M - SAME_SHARE * distance)
    }
}

/// What a stereo camera makes of a depth.
fn measured(config: &CameraConfig, depth_m: f64, luck: f64) -> f64 {
    if config.disparity_sigma_px <= 0.0 {
        return depth_m;
    }
    let focal_baseline = config.geometry.depth.focal[0] * config.baseline_m;
    let disparity = focal_baseline / depth_m + config.disparity_sigma_px * luck;
    let steps = (disparity / DISPARITY_STEP_PX).round().max(1.0);
    focal_baseline / (steps * DISPARITY_STEP_PX)
}

/// The colour of an object: as bright as its material, with a tint of its own.
fn paint(reflectivity: f32, object: u32) -> Rgb {
    // Knuth's multiplicative hash: neighbours in number are far apart in colour.
    let hash = object.wrapping_mul(2_654_435_761);
    let tint = |shift: u32| (f64::from(hash >> shift & 0xFF) / 255.0 - 0.5) * 0.3;
    let base = 60.0 + 190.0 * f64::from(reflectivity).clamp(0.0, 1.0);
    [24, 16, 8].map(|shift| (base * (1.0 + tint(shift))).clamp(0.0, 255.0) as u8)
}
