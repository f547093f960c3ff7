//! The camera's bytes: Z16 counts and YUYV pairs, written from the format's definitions
//! (`V4L2_PIX_FMT_Z16`, `V4L2_PIX_FMT_YUYV` with ITU-R BT.601 in studio range).

use crate::person::Rgb;

/// Counts of a depth, 0 where it is none or beyond sixteen bits.
pub(super) fn count(depth_m: Option<f64>, unit_m: f64) -> u16 {
    let counts = depth_m.map_or(0.0, |depth| (depth / unit_m).round());
    if (1.0..=65_535.0).contains(&counts) {
        counts as u16
    } else {
        0
    }
}

/// Luma and colour differences of a colour, not rounded.
pub(super) fn yuv(rgb: [f64; 3]) -> [f64; 3] {
    let [r, g, b] = rgb.map(|c| c.clamp(0.0, 255.0) / 255.0);
    [
        16.0 + 65.481 * r + 128.553 * g + 24.966 * b,
        128.0 - 37.797 * r - 74.203 * g + 112.0 * b,
        128.0 + 112.0 * r - 93.786 * g - 18.214 * b,
    ]
}

/// Two neighbouring pixels as four bytes.
pub(super) fn yuyv_pair(first: [f64; 3], second: [f64; 3]) -> [u8; 4] {
    let byte = |v: f64| v.round().clamp(1.0, 254.0) as u8;
    [
        byte(first[0]),
        byte((first[1] + second[1]) / 2.0),
        byte(second[0]),
        byte((first[2] + second[2]) / 2.0),
    ]
}

/// A colour under so much light.
pub(super) fn lit(color: Rgb, light: [f64; 3]) -> [f64; 3] {
    std::array::from_fn(|channel| f64::from(color[channel]) * light[channel])
}
