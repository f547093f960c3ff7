//! A depth image as the colour camera would have measured it: for each pixel of the colour image
//! the depth of what is seen there.
//!
//! In: counts of the depth image and the geometry. Out: counts in the size of the colour image, of
//! the depth along the *colour* camera's axis; 0 where nothing was measured. Each depth pixel is a
//! small square: all colour pixels whose middle it covers get it, and the nearest surface wins.

use hachi_hal::{Intrinsics, RgbdGeometry, Vector3};

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
    for (row, counts) in depth
        .chunks_exact(geometry.depth.width as usize)
        .enumerate()
    {
        for (column, &count) in counts.iter().enumerate() {
            if count != 0 {
                place(geometry, [column as f64, row as f64], count, aligned);
            }
        }
    }
    Ok(())
}

/// Puts one depth pixel into the colour image.
fn place(geometry: &RgbdGeometry, pixel: [f64; 2], count: u16, aligned: &mut [u16]) {
    let depth_m = f64::from(count) * geometry.depth_unit_m;
    let corner = |by: f64| {
        let pixel = [pixel[0] + by, pixel[1] + by];
        let point = geometry.depth.deproject(pixel, depth_m);
        let point = geometry.color_from_depth.rotation * point
            + geometry.color_from_depth.translation.vector;
        Some((seen(&geometry.color, &point)?, point.z))
    };
    let (Some((from, near)), Some((to, far))) = (corner(-0.5), corner(0.5)) else {
        return;
    };
    let count = libm::round((near + far) / 2.0 / geometry.depth_unit_m);
    if !(1.0..=f64::from(u16::MAX)).contains(&count) {
        return;
    }
    let count = count as u16;
    let size = [geometry.color.width, geometry.color.height];
    let [(left, right), (top, bottom)] =
        core::array::from_fn(|axis| covered(from[axis], to[axis], size[axis]));
    for row in top..bottom {
        let from = row * geometry.color.width as usize;
        for cell in &mut aligned[from + left..from + right] {
            if *cell == 0 || count < *cell {
                *cell = count;
            }
        }
    }
}

/// Where a point appears.
fn seen(color: &Intrinsics, point: &Vector3) -> Option<[f64; 2]> {
    color
        .project(point)
        .filter(|p| p.iter().all(|v| v.is_finite()))
}

/// The pixels whose middle lies in `[from, to)`, as a range within `0..size`.
fn covered(from: f64, to: f64, size: u32) -> (usize, usize) {
    let size = f64::from(size);
    let first = libm::ceil(from).clamp(0.0, size);
    let end = libm::ceil(to).clamp(first, size);
    (first as usize, end as usize)
}
