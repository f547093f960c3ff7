//! The vertical angles of KITTI's HDL-64, put right.
//!
//! In: points of a scan of the KITTI odometry benchmark. Out: the same points, each seen 0.205
//! degrees higher. The benchmark's clouds were made with an intrinsic calibration whose vertical
//! angles are that much too low: walls bend, and the path climbs or falls. Published results are
//! for corrected clouds: CT-ICP (Dellenbach et al., ICRA 2022) and KISS-ICP (Vizzo et al., RA-L
//! 2023) turn each point by this angle about the horizontal axis across its ray, as is done here.

use hachi_hal::Point;

/// By how much the calibration's vertical angles are too low, degrees.
const TOO_LOW_DEG: f64 = 0.205;

/// Raises every point. One straight above or below the sensor has no direction to be raised in and
/// stays.
pub(super) fn raise(points: &mut [Point]) {
    let (sin, cos) = TOO_LOW_DEG.to_radians().sin_cos();
    for point in points {
        let [x, y, z] = point.position().map(f64::from);
        let across = x.hypot(y);
        if !(across > 0.0 && across.is_finite() && z.is_finite()) {
            continue;
        }
        let scale = cos - sin * z / across;
        point.x = (x * scale) as f32;
        point.y = (y * scale) as f32;
        point.z = (z * cos + across * sin) as f32;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_turn_upward_about_the_axis_across_their_ray() {
        // sin 0.205 degrees = 0.00357792, cos = 0.99999360. Straight ahead: (10 cos, 0, 10 sin).
        // Right and down, 3 across and 4 below: 3 cos + 4 sin across, 3 sin - 4 cos high.
        let mut points = [
            Point::at(10.0, 0.0, 0.0),
            Point::at(0.0, -3.0, -4.0),
            Point::at(0.0, 0.0, 2.0),
            Point::at(f32::NAN, 1.0, 1.0),
        ];
        raise(&mut points);
        let expected = [
            [9.999_936, 0.0, 0.035_779_2],
            [0.0, -3.014_292_5, -3.989_240_6],
            [0.0, 0.0, 2.0],
        ];
        for (point, expected) in points.iter().zip(expected) {
            for (a, b) in point.position().into_iter().zip(expected) {
                assert!((a - b).abs() < 2e-6, "{point:?} is not at {expected:?}");
            }
        }
        assert!(points[3].x.is_nan() && points[3].z == 1.0);
    }

    #[test]
    fn a_sequence_with_its_calibration_is_corrected_and_a_bare_folder_is_not() {
        let folder = tempfile::tempdir().unwrap();
        let scans = folder.path().join("velodyne");
        std::fs::create_dir(&scans).unwrap();
        let row: Vec<u8> = [10f32, 0.0, 0.0, 0.5]
            .iter()
            .flat_map(|v| v.to_le_bytes())
            .collect();
        std::fs::write(scans.join("000000.bin"), row.repeat(20)).unwrap();
        std::fs::write(folder.path().join("times.txt"), "0.0\n").unwrap();
        let height = |path: &std::path::Path| {
            let mut points = Vec::new();
            let mut files = crate::ScanFiles::open(path).unwrap();
            files.next_scan(&mut points).unwrap().unwrap();
            (points[0].z, files.corrects_vertical_angles())
        };
        assert_eq!(height(folder.path()), (0.0, false));
        let calibration = "Tr: 0 -1 0 0 0 0 -1 0 1 0 0 0\n";
        std::fs::write(folder.path().join("calib.txt"), calibration).unwrap();
        let (raised, corrects) = height(folder.path());
        assert!((raised - 0.035_779_2).abs() < 2e-6 && corrects, "{raised}");
        assert_eq!(height(&scans), (0.0, false));
    }
}
