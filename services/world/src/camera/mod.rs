//! A RealSense-like camera on the robot: depth and colour of the scene and of the people in it, as
//! the bytes that the camera sends, with the truth beside them.
//!
//! In: a simulation's scene, people, path and clock; optics. Out: Z16 and YUYV pictures, and for each
//! who is seen where: masks, boxes, places, identities, clothes. The same configuration gives the same
//! bytes, for any number of threads.
//!
//! Depth is what a stereo camera measures: its error is one of disparity and grows with the square of
//! the distance; what only one imager sees has none. Glass is seen through, and nothing throws a
//! shadow ([`Light`]).

mod bytes;
mod light;
mod render;
mod truth;

use std::sync::Arc;

use hachi_hal::{Distortion, Intrinsics, Pose, RgbdGeometry, Stamp};
use nalgebra::{Matrix3, Rotation3, Translation3, UnitQuaternion};

pub use light::Light;
pub use truth::{PersonTruth, PixelBox};

use crate::person::{Body, Person};
use crate::scene::Scene;
use crate::simulation::SimulationConfig;
use crate::trajectory::Trajectory;
use render::Lens;

/// Everything about a camera but what it sees.
#[derive(Debug, Clone, PartialEq)]
pub struct CameraConfig {
    /// Optics of both pictures. Widths are even: two pixels share their colour.
    pub geometry: RgbdGeometry,
    /// Where the depth camera sits: its frame is x right, y down, z ahead.
    pub base_from_depth: Pose,
    /// From the depth camera's left imager to its right one, metres.
    pub baseline_m: f64,
    /// Standard deviation of a disparity, pixels; 0 is a perfect camera, which sees without the
    /// second imager too.
    pub disparity_sigma_px: f64,
    /// Nearest and furthest depth that is measured, metres.
    pub range_m: [f64; 2],
    /// Standard deviation of a colour's luma, counts.
    pub luma_sigma: f64,
    /// What the colour picture is taken in.
    pub light: Light,
    /// From one frame to the next, ns.
    pub period_ns: i64,
}

impl CameraConfig {
    /// A D455 at the given size (both pictures), thirty times a second, at the front of a quadruped
    /// and looking up by so many radians.
    ///
    /// Focal lengths and colour lens are those of a printed unit at 848 x 480, baseline and
    /// place of the colour camera the maker's.
    pub fn d455(width: u32, height: u32, up_rad: f64) -> Self {
        let share = f64::from(width) / 848.0;
        let centre = [f64::from(width - 1) / 2.0, f64::from(height - 1) / 2.0];
        let picture = |focal: [f64; 2], distortion| Intrinsics {
            width,
            height,
            focal: focal.map(|f| f * share),
            centre,
            distortion,
        };
        let lens = Distortion::BrownConrady([-0.056_98, 0.066_02, 0.000_21, 0.000_69, -0.020_85]);
        Self {
            geometry: RgbdGeometry {
                depth: picture([424.23, 424.23], Distortion::None),
                color: picture([421.65, 421.10], lens),
                color_from_depth: Pose::translation(-0.0591, -0.0001, 0.0002),
                depth_unit_m: 0.001,
            },
            base_from_depth: looking_ahead([0.30, 0.0, 0.12], up_rad),
            baseline_m: 0.095,
            disparity_sigma_px: 0.08,
            range_m: [0.4, 20.0],
            luma_sigma: 2.0,
            light: Light::default(),
            period_ns: 33_333_333,
        }
    }
}

/// The pose in the base of a camera at a place, looking ahead and up by so many radians.
pub fn looking_ahead(at: [f64; 3], up_rad: f64) -> Pose {
    // Right is -y, down is -z, ahead is x.
    let axes = Matrix3::new(0.0, 0.0, 1.0, -1.0, 0.0, 0.0, 0.0, -1.0, 0.0);
    let ahead = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(axes));
    // Turning about the axis to the right lifts what is ahead.
    let up = UnitQuaternion::from_euler_angles(up_rad, 0.0, 0.0);
    Pose::from_parts(Translation3::from(nalgebra::Vector3::from(at)), ahead * up)
}

/// One frame: pictures and truth. Its buffers are used again for the next one.
#[derive(Debug, Clone, Default)]
pub struct CameraFrame {
    /// Counts frames from 0.
    pub sequence: u32,
    /// The middle of both exposures.
    pub stamp: Stamp,
    /// Z16, row by row.
    pub depth: Vec<u8>,
    /// YUYV, row by row.
    pub color: Vec<u8>,
    /// For each pixel of the colour picture, whom it shows: 0 is nobody, 1 the first of
    /// [`CameraFrame::people`], and so on.
    pub masks: Vec<u8>,
    /// Everybody who is there, seen or not.
    pub people: Vec<PersonTruth>,
}

/// The camera.
#[derive(Debug)]
pub struct SimulatedCamera {
    config: CameraConfig,
    people: Arc<[Person]>,
    scene: Arc<Scene>,
    trajectory: Arc<Trajectory>,
    seed: u64,
    start: Stamp,
    end: Stamp,
    depth_lens: Lens,
    color_lens: Lens,
    next: u32,
    frame: CameraFrame,
    bodies: Vec<Body>,
}

/// Masks number those who are there in a byte; more at once are not drawn.
const MOST_PEOPLE: usize = 255;

impl SimulatedCamera {
    /// A camera on the robot of `simulation`, whose scene, people, path, clock and seed it shares.
    pub fn new(simulation: &SimulationConfig, config: CameraConfig) -> Self {
        let geometry = &config.geometry;
        let frame = CameraFrame {
            depth: vec![0; 2 * geometry.depth.pixels()],
            color: vec![0; 2 * geometry.color.pixels()],
            masks: vec![0; geometry.color.pixels()],
            ..CameraFrame::default()
        };
        Self {
            depth_lens: Lens::new(&geometry.depth),
            color_lens: Lens::new(&geometry.color),
            scene: Arc::clone(&simulation.scene),
            trajectory: Arc::clone(&simulation.trajectory),
            seed: simulation.seed,
            start: simulation.start,
            end: simulation.end(),
            next: 0,
            frame,
            bodies: Vec::new(),
            people: Arc::clone(&simulation.people),
            config,
        }
    }

    /// Everything but what it sees.
    pub fn config(&self) -> &CameraConfig {
        &self.config
    }

    /// Where the depth camera truly is.
    pub fn map_from_depth(&self, stamp: Stamp) -> Pose {
        let time_s = stamp.secs_since(self.start);
        self.trajectory.map_from_base(time_s) * self.config.base_from_depth
    }

    /// When the next frame is exposed; `None` after the end of the simulation.
    pub fn next_stamp(&self) -> Option<Stamp> {
        let stamp = self.start + i64::from(self.next) * self.config.period_ns;
        (stamp <= self.end).then_some(stamp)
    }

    /// Goes on with the first frame that is not exposed before `stamp`.
    pub fn skip_to(&mut self, stamp: Stamp) {
        let periods = stamp.nanos_since(self.start).max(0);
        let period = self.config.period_ns.max(1);
        let first = (periods + period - 1) / period;
        self.next = self.next.max(u32::try_from(first).unwrap_or(u32::MAX));
    }

    /// The next frame; `None` after the end of the simulation.
    pub fn next_frame(&mut self) -> Option<&CameraFrame> {
        self.next_of(true, None)
    }

    /// As [`next_color_frame`](Self::next_color_frame), of a robot whose way is not known beforehand:
    /// from where its base is at [`next_stamp`](Self::next_stamp).
    pub fn next_color_frame_from(&mut self, map_from_base: &Pose) -> Option<&CameraFrame> {
        self.next_of(false, Some(map_from_base))
    }

    /// The next frame without its depth, which takes most of the time: that picture stays as it was.
    pub fn next_color_frame(&mut self) -> Option<&CameraFrame> {
        self.next_of(false, None)
    }

    fn next_of(&mut self, with_depth: bool, map_from_base: Option<&Pose>) -> Option<&CameraFrame> {
        let stamp = self.next_stamp()?;
        let map_from_depth = match map_from_base {
            Some(map_from_base) => map_from_base * self.config.base_from_depth,
            None => self.map_from_depth(stamp),
        };
        self.expose(stamp, with_depth, &map_from_depth);
        self.frame.sequence = self.next;
        self.next = self.next.saturating_add(1);
        Some(&self.frame)
    }

    fn expose(&mut self, stamp: Stamp, with_depth: bool, map_from_depth: &Pose) {
        let time_s = stamp.secs_since(self.start);
        let floor = self.scene.floor();
        self.bodies.clear();
        self.frame.people.clear();
        let map_from_color = map_from_depth * self.config.geometry.color_from_depth.inverse();
        let there = self.people.iter().filter_map(|person| {
            let presence = person.presence(time_s, floor)?;
            Some((person, presence, person.body(&presence)?))
        });
        for (person, presence, body) in there.take(MOST_PEOPLE) {
            self.bodies.push(body);
            let truth = PersonTruth::new(person, &presence, &map_from_color);
            self.frame.people.push(truth);
        }
        let view = render::View {
            scene: &self.scene,
            bodies: &self.bodies,
            lighting: self.config.light.at(time_s),
            seed: self.seed,
            frame: u64::from(self.next),
        };
        let frame = &mut self.frame;
        frame.stamp = stamp;
        if with_depth {
            view.depth(
                &self.config,
                &self.depth_lens,
                map_from_depth,
                &mut frame.depth,
            );
        }
        let (color, masks) = (&mut frame.color, &mut frame.masks);
        view.color(
            &self.config,
            &self.color_lens,
            &map_from_color,
            color,
            masks,
        );
        let width = self.config.geometry.color.width;
        truth::find_visible(&frame.masks, width, &mut frame.people);
        for (truth, body) in frame.people.iter_mut().zip(&self.bodies) {
            let whole = view.whole(
                &self.config.geometry.color,
                &self.color_lens,
                &map_from_color,
                body,
            );
            truth.set_whole(whole);
        }
    }
}
