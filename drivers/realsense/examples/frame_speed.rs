//! How long one frame takes on this machine, median of many: copying depth, converting colour and
//! aligning depth to colour:
//! `cargo run --release -p hachi-realsense --example frame_speed`
#![allow(clippy::print_stdout, reason = "this is what it is for")]

use std::hint::black_box;
use std::time::Instant;

use hachi_hal::{Distortion, Intrinsics, Pose, RgbdGeometry};
use hachi_realsense::align::depth_to_color;
use hachi_realsense::encode;
use hachi_realsense::frame::{Layout, YuyvImage, Z16Image};

const ROUNDS: usize = 101;

/// Median milliseconds of one call.
fn median_ms(mut work: impl FnMut()) -> f64 {
    let mut times: Vec<f64> = (0..ROUNDS)
        .map(|_| {
            let begun = Instant::now();
            work();
            begun.elapsed().as_secs_f64() * 1e3
        })
        .collect();
    times.sort_by(f64::total_cmp);
    times[ROUNDS / 2]
}

fn main() {
    let lens = Distortion::BrownConrady([-0.056_98, 0.066_02, 0.000_21, 0.000_69, -0.020_85]);
    let picture = |width, height, focal, centre, distortion| Intrinsics {
        width,
        height,
        focal,
        centre,
        distortion,
    };
    let depth_camera = picture(848, 480, [424.23; 2], [423.43, 236.05], Distortion::None);
    // A wavy wall with holes.
    let counts: Vec<u16> = (0..depth_camera.pixels())
        .map(|i| {
            if i % 13 == 0 {
                0
            } else {
                1_500 + (i % 848 / 8) as u16
            }
        })
        .collect();
    let mut bytes = vec![0; 2 * counts.len()];
    encode::z16(&counts, &mut bytes);
    for color_camera in [
        picture(848, 480, [421.65, 421.10], [429.68, 239.22], lens),
        picture(1_280, 720, [636.45, 635.62], [648.58, 358.82], lens),
    ] {
        let (width, height) = (color_camera.width, color_camera.height);
        let geometry = RgbdGeometry {
            depth: depth_camera,
            color: color_camera,
            color_from_depth: Pose::translation(-0.0591, 0.0, 0.0),
            depth_unit_m: 0.001,
        };
        let yuyv: Vec<u8> = (0..2 * color_camera.pixels())
            .map(|i| (i * 7) as u8)
            .collect();
        let mut depth = vec![0; depth_camera.pixels()];
        let mut rgb = vec![0; 3 * color_camera.pixels()];
        let mut aligned = vec![0; color_camera.pixels()];
        let copy = median_ms(|| {
            let image = Z16Image::new(black_box(&bytes), Layout::packed(848, 480));
            image
                .and_then(|image| image.copy_to(&mut depth))
                .unwrap_or_default();
        });
        let convert = median_ms(|| {
            let image = YuyvImage::new(black_box(&yuyv), Layout::packed(width, height));
            image
                .and_then(|image| image.to_rgb(&mut rgb))
                .unwrap_or_default();
        });
        let align = median_ms(|| {
            depth_to_color(black_box(&geometry), &depth, &mut aligned).unwrap_or_default();
        });
        println!(
            "depth 848x480, colour {width}x{height}: copy {copy:.2} ms, YUYV to RGB {convert:.2} ms, \
             align {align:.2} ms"
        );
    }
}
