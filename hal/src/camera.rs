//! Colour and depth images, the optics behind them, and the trait that RGB-D cameras implement.
//!
//! In: nothing; plain data and a trait. Elsewhere: bytes of a particular camera (the drivers),
//! where it is mounted (the platform crates).
//!
//! Camera frames are optical frames of REP-103: x right, y down, z forward. Pixel `(0, 0)` is the
//! upper left one and its *middle* has the coordinates `(0.0, 0.0)`; images are row by row.
//! Distortion polynomials are those of Brown (1966) as OpenCV orders them: k1, k2, p1, p2, k3.

use crate::{DeviceError, Pose, Stamp, Vector3};

/// How a lens bends what a pin hole would see.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
pub enum Distortion {
    /// Not at all, or it was taken out.
    #[default]
    None,
    /// The polynomial takes the pin hole's picture to the lens's: OpenCV's model.
    BrownConrady([f64; 5]),
}

/// Steps of the fixed-point iteration against the polynomial. Each gains at least a digit for the
/// lenses that there are (|k| < 0.1 within the picture): ten are below a thousandth of a pixel.
const INVERSION_STEPS: usize = 10;

impl Distortion {
    /// From the pin hole's coordinates (x/z, y/z) to the lens's.
    pub fn distort(&self, pin_hole: [f64; 2]) -> [f64; 2] {
        match self {
            Self::None => pin_hole,
            Self::BrownConrady(k) => polynomial(k, pin_hole),
        }
    }

    /// From the lens's coordinates to the pin hole's.
    pub fn undistort(&self, lens: [f64; 2]) -> [f64; 2] {
        match self {
            Self::None => lens,
            Self::BrownConrady(k) => invert(k, lens),
        }
    }
}

fn bend(k: &[f64; 5], [x, y]: [f64; 2]) -> (f64, [f64; 2]) {
    let [k1, k2, p1, p2, k3] = *k;
    let r2 = x * x + y * y;
    let radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3));
    let tangential = [
        2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x),
        2.0 * p2 * x * y + p1 * (r2 + 2.0 * y * y),
    ];
    (radial, tangential)
}

fn polynomial(k: &[f64; 5], [x, y]: [f64; 2]) -> [f64; 2] {
    let (radial, tangential) = bend(k, [x, y]);
    [x * radial + tangential[0], y * radial + tangential[1]]
}

/// What the polynomial takes to `target`.
fn invert(k: &[f64; 5], target: [f64; 2]) -> [f64; 2] {
    let mut found = target;
    for _ in 0..INVERSION_STEPS {
        let (radial, tangential) = bend(k, found);
        found = [
            (target[0] - tangential[0]) / radial,
            (target[1] - tangential[1]) / radial,
        ];
    }
    found
}

/// Where a camera's pixels look.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Intrinsics {
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Focal lengths across and down, pixels.
    pub focal: [f64; 2],
    /// Where the optical axis meets the picture: column and row, pixels.
    pub centre: [f64; 2],
    /// What the lens does.
    pub distortion: Distortion,
}

impl Intrinsics {
    /// How many pixels there are.
    pub const fn pixels(&self) -> usize {
        self.width as usize * self.height as usize
    }

    /// Where a point of the camera frame appears: column and row. `None` behind the camera or
    /// in its plane. Pixels outside the picture are given as they are.
    pub fn project(&self, point: &Vector3) -> Option<[f64; 2]> {
        // Not-a-number is not in front either.
        let in_front = point.z > 0.0;
        if !in_front {
            return None;
        }
        let [x, y] = self
            .distortion
            .distort([point.x / point.z, point.y / point.z]);
        Some([
            self.focal[0] * x + self.centre[0],
            self.focal[1] * y + self.centre[1],
        ])
    }

    /// The point of the camera frame that appears at a pixel (column, row) at a depth along z,
    /// metres.
    pub fn deproject(&self, pixel: [f64; 2], depth_m: f64) -> Vector3 {
        let [x, y] = self.distortion.undistort([
            (pixel[0] - self.centre[0]) / self.focal[0],
            (pixel[1] - self.centre[1]) / self.focal[1],
        ]);
        Vector3::new(x, y, 1.0) * depth_m
    }

    /// Whether every number is finite and focal lengths are positive.
    pub fn is_sound(&self) -> bool {
        let finite = self.focal.iter().chain(&self.centre).all(|v| v.is_finite());
        let bends = match &self.distortion {
            Distortion::None => true,
            Distortion::BrownConrady(k) => k.iter().all(|v| v.is_finite()),
        };
        finite && bends && self.focal[0] > 0.0 && self.focal[1] > 0.0
    }
}

/// What stays the same from frame to frame while a camera streams.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RgbdGeometry {
    /// Where the depth image's pixels look.
    pub depth: Intrinsics,
    /// Where the colour image's pixels look.
    pub color: Intrinsics,
    /// From the depth camera's frame to the colour camera's.
    pub color_from_depth: Pose,
    /// What a count of the depth image is, metres.
    pub depth_unit_m: f64,
}

/// One depth image with the colour image that belongs to it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct RgbdHeader {
    /// Counts frames from 0 in the order in which the camera delivered them.
    pub sequence: u32,
    /// The middle of the depth image's exposure on the robot's clock: the frame's time.
    pub stamp: Stamp,
    /// The middle of the colour image's exposure on the robot's clock.
    pub color_stamp: Stamp,
    /// The depth image's time on the camera's clock, ns, where it has one.
    pub depth_sensor_ns: Option<u64>,
    /// The colour image's time on the camera's clock, ns, where it has one.
    pub color_sensor_ns: Option<u64>,
    /// The depth image's exposure, µs, where the camera says.
    pub depth_exposure_us: Option<u32>,
    /// The colour image's exposure, µs, where the camera says.
    pub color_exposure_us: Option<u32>,
}

/// Where a camera puts a frame.
#[derive(Debug)]
pub struct RgbdImages<'a> {
    /// One count a pixel; 0 is "nothing measured".
    pub depth: &'a mut [u16],
    /// Red, green, blue: three bytes a pixel.
    pub color: &'a mut [u8],
}

/// A camera that measures depth and sees colour.
///
/// - `read_frame` is back by `deadline`; nothing to report is `Ok(None)`, not an error;
/// - `geometry` is `Some` when a frame was delivered and belongs to that frame; it changes only
///   between frames, after an error;
/// - on `Some`, the first `geometry.depth.pixels()` counts and three times
///   `geometry.color.pixels()` bytes are the frame; images with less room are an error
///   ([`FaultKind::FixConfig`](crate::FaultKind::FixConfig)), never a cut frame;
/// - stamps strictly increase and sequence numbers count up by one;
/// - an error leaves the device usable: `read_frame` may be called again.
pub trait RgbdCamera {
    /// What can go wrong.
    type Error: DeviceError;
    /// Optics and units; `None` while they are not known.
    fn geometry(&self) -> Option<&RgbdGeometry>;
    /// The next frame.
    fn read_frame(
        &mut self,
        images: RgbdImages<'_>,
        deadline: Stamp,
    ) -> Result<Option<RgbdHeader>, Self::Error>;
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A D455's colour camera at 1280x720, from a unit's printed profile.
    const D455: Intrinsics = Intrinsics {
        width: 1280,
        height: 720,
        focal: [636.45, 635.62],
        centre: [648.58, 358.82],
        distortion: Distortion::BrownConrady([-0.05698, 0.06602, 0.00021, 0.00069, -0.02085]),
    };

    #[test]
    fn a_pixel_comes_back_to_itself_with_and_without_a_lens() {
        for distortion in [D455.distortion, Distortion::None] {
            let camera = Intrinsics { distortion, ..D455 };
            for pixel in [
                [0.0, 0.0],
                [1279.0, 719.0],
                [648.58, 358.82],
                [100.0, 700.0],
            ] {
                let point = camera.deproject(pixel, 2.5);
                let back = camera.project(&point).unwrap();
                assert_eq!(point.z, 2.5);
                assert!((back[0] - pixel[0]).abs() < 1e-3, "{pixel:?} {back:?}");
                assert!((back[1] - pixel[1]).abs() < 1e-3, "{pixel:?} {back:?}");
            }
        }
    }

    /// `projectPoints` of OpenCV 5.0 with the same numbers.
    #[test]
    fn the_forward_model_is_opencvs() {
        let [column, row] = D455.project(&Vector3::new(0.8, -0.4, 1.0)).unwrap();
        assert!((column - 1151.43639554).abs() < 1e-6, "{column}");
        assert!((row - 108.00190722).abs() < 1e-6, "{row}");
    }

    #[test]
    fn what_is_behind_the_camera_is_not_in_the_picture() {
        for z in [0.0, -1.0, f64::NAN] {
            assert_eq!(D455.project(&Vector3::new(0.1, 0.1, z)), None);
        }
    }
}
