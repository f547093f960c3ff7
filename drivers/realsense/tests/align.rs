//! Alignment against geometry worked out by hand.

use hachi_hal::{Distortion, Intrinsics, Pose, RgbdGeometry};
use hachi_realsense::align::depth_to_color;

fn pin_hole(width: u32, height: u32, focal: f64) -> Intrinsics {
    Intrinsics {
        width,
        height,
        focal: [focal; 2],
        centre: [
            (f64::from(width) - 1.0) / 2.0,
            (f64::from(height) - 1.0) / 2.0,
        ],
        distortion: Distortion::None,
    }
}

fn geometry(depth: Intrinsics, color: Intrinsics, right_m: f64) -> RgbdGeometry {
    RgbdGeometry {
        depth,
        color,
        // A colour camera to the right sees everything further left.
        color_from_depth: Pose::translation(-right_m, 0.0, 0.0),
        depth_unit_m: 0.001,
    }
}

#[test]
fn the_same_camera_sees_the_same() {
    let camera = pin_hole(8, 6, 10.0);
    let depth: Vec<u16> = (0..48).map(|i| 500 + i).collect();
    let mut aligned = vec![9; 48];
    depth_to_color(&geometry(camera, camera, 0.0), &depth, &mut aligned).unwrap();
    assert_eq!(aligned, depth);
}

#[test]
fn a_wall_moves_by_its_disparity_and_what_is_not_seen_stays_empty() {
    // 10 px of focal length, 20 cm apart, 1 m away: two pixels to the left.
    let camera = pin_hole(8, 2, 10.0);
    let mut depth = [1_000; 16];
    depth[8..].fill(0);
    let mut aligned = [7; 16];
    depth_to_color(&geometry(camera, camera, 0.2), &depth, &mut aligned).unwrap();
    assert_eq!(
        aligned[..8],
        [1_000, 1_000, 1_000, 1_000, 1_000, 1_000, 0, 0]
    );
    assert_eq!(aligned[8..], [0; 8]);
}

#[test]
fn the_nearer_of_two_surfaces_is_seen() {
    let camera = pin_hole(8, 1, 10.0);
    // The last pixel at half a metre moves by four, onto the place of the fifth at one metre.
    let depth = [0, 0, 0, 0, 0, 1_000, 0, 500];
    let mut aligned = [0; 8];
    depth_to_color(&geometry(camera, camera, 0.2), &depth, &mut aligned).unwrap();
    assert_eq!(aligned, [0, 0, 0, 500, 0, 0, 0, 0]);
}

#[test]
fn a_finer_colour_image_is_filled_without_gaps_and_a_coarser_one_too() {
    let depth_camera = pin_hole(40, 30, 40.0);
    let depth = vec![2_000; 1_200];
    for color in [pin_hole(120, 90, 120.0), pin_hole(13, 10, 13.3)] {
        let mut aligned = vec![0; color.pixels()];
        depth_to_color(&geometry(depth_camera, color, 0.0), &depth, &mut aligned).unwrap();
        let inner = |i: &usize| {
            let (column, row) = (i % color.width as usize, i / color.width as usize);
            (1..color.width as usize - 1).contains(&column)
                && (1..color.height as usize - 1).contains(&row)
        };
        assert!(
            (0..aligned.len())
                .filter(inner)
                .all(|i| aligned[i] == 2_000)
        );
    }
}

#[test]
fn depth_is_measured_along_the_colour_cameras_axis() {
    // The colour camera stands half a metre further forward.
    let camera = pin_hole(9, 9, 10.0);
    let geometry = RgbdGeometry {
        color_from_depth: Pose::translation(0.0, 0.0, -0.5),
        ..geometry(camera, camera, 0.0)
    };
    let mut aligned = vec![0; 81];
    depth_to_color(&geometry, &[2_000; 81], &mut aligned).unwrap();
    assert!(aligned.iter().all(|&count| count == 1_500));
    // Half a metre away it is in the camera's plane, nearer behind it.
    for count in [500, 300] {
        depth_to_color(&geometry, &[count; 81], &mut aligned).unwrap();
        assert!(aligned.iter().all(|&count| count == 0));
    }
}

#[test]
fn images_of_another_size_are_refused() {
    let camera = pin_hole(4, 4, 4.0);
    let geometry = geometry(camera, camera, 0.0);
    assert!(depth_to_color(&geometry, &[0; 15], &mut [0; 16]).is_err());
    assert!(depth_to_color(&geometry, &[0; 16], &mut [0; 15]).is_err());
}
