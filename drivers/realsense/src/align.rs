//! A depth image as the colour camera would have measured it: for each pixel of the colour image
//! the depth of what is seen there.
//!
//! In: counts of the depth image and the geometry. Out: counts in the size of the colour image, of
//! the depth along the *colour* camera's axis; 0 where nothing was measured. Each depth pixel is a
//! small square: all colour pixels whose middle it covers get it, and the nearest surface wins.

use hachi_hal::{Distortion, Intrinsics, RgbdGeometry};

use crate::frame::FrameError;

/// Fills `aligned` (one count for each colour pixel) from `depth` (one for each depth pixel).
///
/// # Errors
/// An image has less room than the geometry says.
pub fn depth_to_color(
    geometry: &RgbdGeometry,
    depth: &[u16],
    aligned: &mut [u16],
) -> Result<(), FrameError> {
    let short = |got, needed| FrameError::Target { got, needed };
    let (got, needed) = (depth.len(), geometry.depth.pixels());
    let depth = depth.get(..needed).ok_or(short(got, needed))?;
    let (got, needed) = (aligned.len(), geometry.color.pixels());
    let aligned = aligned.get_mut(..needed).ok_or(short(got, needed))?;
    aligned.fill(0);
    let seen = Seen::new(geometry);
    for (row, counts) in depth
        .chunks_exact(geometry.depth.width.max(1) as usize)
        .enumerate()
    {
        for (lanes, counts) in counts.chunks(LANES).enumerate() {
            let mut padded = [0; LANES];
            padded[..counts.len()].copy_from_slice(counts);
            seen.place([(lanes * LANES) as f32, row as f32], &padded, aligned);
        }
    }
    Ok(())
}

/// Pixels that are worked out together: their loops have no branches, so that they become vectors.
const LANES: usize = 16;

/// Where lanes of corners are seen: columns, rows, and depth along the colour camera's axis.
type Corners = [[f32; LANES]; 3];

/// The geometry in single precision, in the form in which it is needed for every pixel. Errors stay
/// below a thousandth of a pixel and of a count.
struct Seen<'a> {
    depth: &'a Intrinsics,
    /// Rows of the rotation, and the translation in counts.
    rotation: [[f32; 3]; 3],
    translation: [f32; 3],
    /// Depth camera: reciprocal focal lengths and centre.
    per_focal: [f32; 2],
    depth_centre: [f32; 2],
    /// Colour camera.
    focal: [f32; 2],
    centre: [f32; 2],
    distortion: [f32; 5],
    size: [u32; 2],
}

impl<'a> Seen<'a> {
    fn new(geometry: &'a RgbdGeometry) -> Self {
        let (depth, color) = (&geometry.depth, &geometry.color);
        let rotation = geometry.color_from_depth.rotation.to_rotation_matrix();
        let translation = geometry.color_from_depth.translation.vector / geometry.depth_unit_m;
        let single = |v: [f64; 2]| v.map(|v| v as f32);
        Self {
            depth,
            rotation: core::array::from_fn(|i| {
                core::array::from_fn(|j| rotation.matrix()[(i, j)] as f32)
            }),
            translation: core::array::from_fn(|i| translation[i] as f32),
            per_focal: single(depth.focal.map(|f| 1.0 / f)),
            depth_centre: single(depth.centre),
            focal: single(color.focal),
            centre: single(color.centre),
            distortion: match color.distortion {
                Distortion::BrownConrady(k) => k.map(|k| k as f32),
                _ => [0.0; 5],
            },
            size: [color.width, color.height],
        }
    }

    /// Puts neighbouring depth pixels into the colour image, the first of them at `first`.
    fn place(&self, first: [f32; 2], counts: &[u16; LANES], aligned: &mut [u16]) {
        if *counts == [0; LANES] {
            return;
        }
        let depth = counts.map(f32::from);
        let from = self.corners(first.map(|v| v - 0.5), &depth);
        let to = self.corners(first.map(|v| v + 0.5), &depth);
        let [left, right, top, bottom, seen] = &self.squares(&from, &to, counts);
        for lane in 0..LANES {
            let count = seen[lane] as u16;
            for row in top[lane]..bottom[lane] {
                let at = row as usize * self.size[0] as usize;
                for column in left[lane]..right[lane] {
                    let cell = &mut aligned[at + column as usize];
                    // The nearer wins; nothing measured, less one, is further than anything.
                    *cell = cell.wrapping_sub(1).min(count - 1) + 1;
                }
            }
        }
    }

    /// The pixels that lanes cover, and their counts: first and end column, first and end row,
    /// count. Those that are not seen cover none.
    #[inline]
    fn squares(&self, from: &Corners, to: &Corners, counts: &[u16; LANES]) -> [[u32; LANES]; 5] {
        let [width, height] = self.size.map(|v| v as f32);
        let mut squares = [[0; LANES]; 5];
        for lane in 0..LANES {
            let (near, far) = (from[2][lane], to[2][lane]);
            let along = (near + far) * 0.5;
            // Nothing measured, behind the colour camera, or further than a count can say.
            let seen = (counts[lane] != 0)
                & (near > 0.0)
                & (far > 0.0)
                & (along >= 1.0)
                & (along <= f32::from(u16::MAX));
            let (left, top) = (
                ceiling(from[0][lane], width),
                ceiling(from[1][lane], height),
            );
            let (right, bottom) = (ceiling(to[0][lane], width), ceiling(to[1][lane], height));
            squares[0][lane] = left;
            squares[1][lane] = if seen { right.max(left) } else { left };
            squares[2][lane] = top;
            squares[3][lane] = if seen { bottom.max(top) } else { top };
            squares[4][lane] = nearest(along.max(1.0).min(f32::from(u16::MAX)));
        }
        squares
    }

    /// Where the colour camera sees what lies at these depths (counts) at neighbouring places of
    /// the depth image, the first of them at `first`.
    #[inline]
    fn corners(&self, first: [f32; 2], depth: &[f32; LANES]) -> Corners {
        let [xs, ys] = self.pin_hole(first);
        let (r, t) = (&self.rotation, &self.translation);
        let [k1, k2, p1, p2, k3] = self.distortion;
        let mut corners = [[0.0; LANES]; 3];
        for lane in 0..LANES {
            let along =
                |i: usize| depth[lane] * (r[i][0] * xs[lane] + r[i][1] * ys[lane] + r[i][2]) + t[i];
            let pz = along(2);
            let per_z = 1.0 / pz;
            let (x, y) = (along(0) * per_z, along(1) * per_z);
            let r2 = x * x + y * y;
            let radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3));
            let bent_x = x * radial + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x);
            let bent_y = y * radial + 2.0 * p2 * x * y + p1 * (r2 + 2.0 * y * y);
            corners[0][lane] = self.focal[0] * bent_x + self.centre[0];
            corners[1][lane] = self.focal[1] * bent_y + self.centre[1];
            corners[2][lane] = pz;
        }
        corners
    }

    /// Where neighbouring places of the depth image look. Depth images of these cameras are
    /// rectified; others' lenses cost time.
    #[inline]
    fn pin_hole(&self, first: [f32; 2]) -> [[f32; LANES]; 2] {
        let columns: [f32; LANES] = core::array::from_fn(|lane| first[0] + lane as f32);
        match self.depth.distortion {
            Distortion::None => {
                let y = (first[1] - self.depth_centre[1]) * self.per_focal[1];
                let x = columns.map(|column| (column - self.depth_centre[0]) * self.per_focal[0]);
                [x, [y; LANES]]
            }
            _ => {
                let looks = columns.map(|column| {
                    let pixel = [column, first[1]].map(f64::from);
                    self.depth.deproject(pixel, 1.0)
                });
                [looks.map(|p| p.x as f32), looks.map(|p| p.y as f32)]
            }
        }
    }
}

/// A float of this size has no room for fractions: adding it rounds, and leaves the whole number in
/// the lowest bits. A cast does the same with more checks, which keep loops from becoming vectors.
const WHOLE: f32 = 8_388_608.0;

/// The nearest whole number to one between 0 and 4,194,304.
#[inline]
fn nearest(value: f32) -> u32 {
    (value + WHOLE).to_bits() - WHOLE.to_bits()
}

/// The first pixel whose middle is not before `value`, within `0..=size`; 0 for not-a-number. Wrong
/// by a fifty-thousandth of a pixel, the same for both ends of a square.
#[inline]
fn ceiling(value: f32, size: f32) -> u32 {
    const ALMOST_HALF: f32 = 0.499_98;
    nearest(value.max(0.0).min(size) + ALMOST_HALF).min(size as u32)
}
