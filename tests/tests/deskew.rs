//! A real LiDAR that turned by up to nine degrees while it measured one scan: its motion is found
//! by registration alone, without the inertial sensor that the reference was deskewed by.
//!
//! Truth: `registration/deskew_newer_06` of the folder that `HACHI_DATA` names, three scans of the
//! Newer College data set as the sensor gave them, with a time for each point, and the same points
//! in the frame of the inertial sensor at the scan's first point.
#![allow(
    clippy::print_stderr,
    reason = "figures, and a test that does not run says so"
)]

use std::path::Path;

use hachi_hal::{Pose, Rotation, Vector3};
use hachi_registration::{
    Agility, Chain, Kernel, MovingAligner, MovingConfig, Preparer, SurfaceCloud, TimedSurface,
};
use nalgebra::{Matrix3, Point3};

const INTERVALS: usize = 4;

fn floats(path: &Path) -> Vec<f32> {
    let bytes = std::fs::read(path).unwrap();
    let float = |b: &[u8]| f32::from_le_bytes(b.try_into().unwrap());
    bytes.chunks_exact(4).map(float).collect()
}

fn positions(path: &Path) -> Vec<[f32; 3]> {
    let row = |row: &[f32]| [row[0], row[1], row[2]];
    floats(path).chunks_exact(3).map(row).collect()
}

fn vector(p: [f32; 3]) -> Vector3 {
    Vector3::from(p.map(f64::from))
}

/// The rigid motion that takes the first positions nearest to the second (Kabsch).
fn between(pairs: &[([f32; 3], [f32; 3])]) -> Pose {
    let n = pairs.len() as f64;
    let from: Vector3 = pairs.iter().map(|(a, _)| vector(*a)).sum::<Vector3>() / n;
    let to: Vector3 = pairs.iter().map(|(_, b)| vector(*b)).sum::<Vector3>() / n;
    let mut product = Matrix3::zeros();
    for (a, b) in pairs {
        product += (vector(*b) - to) * (vector(*a) - from).transpose();
    }
    let svd = product.svd(true, true);
    let (u, vt) = (svd.u.unwrap(), svd.v_t.unwrap());
    let handed = Matrix3::from_diagonal(&Vector3::new(1.0, 1.0, (u * vt).determinant().signum()));
    let rotation = Rotation::from_matrix(&(u * handed * vt));
    Pose::from_parts((to - rotation * from).into(), rotation)
}

#[test]
fn the_motion_within_a_scan_is_found_without_an_inertial_sensor() {
    let Some(data) = std::env::var_os("HACHI_DATA") else {
        eprintln!("skipped: HACHI_DATA names no folder with registration/deskew_newer_06");
        return;
    };
    let folder = Path::new(&data).join("registration/deskew_newer_06");
    for scan in 0..3 {
        let read = |what: &str| positions(&folder.join(format!("{what}_{scan:02}.bin")));
        let (raw, deskewed) = (read("raw"), read("deskewed"));
        let times = floats(&folder.join(format!("times_{scan:02}.bin")));
        let last = times.iter().copied().fold(0.0, f32::max);
        let at = |from: f32, to: f32| {
            let pairs = raw.iter().zip(&deskewed).zip(&times);
            let pairs = pairs.filter(|(_, t)| (from..=to).contains(&(**t / last)));
            between(&pairs.map(|((a, b), _)| (*a, *b)).collect::<Vec<_>>())
        };
        let (start, end) = (at(0.0, 0.02), at(0.98, 1.0));

        let mut preparer = Preparer::default();
        let (mut target, mut source) = (SurfaceCloud::default(), SurfaceCloud::default());
        preparer.prepare(deskewed.iter().map(|p| (*p, 0.0)), 0.25, &mut target);
        let timed = raw.iter().zip(&times).map(|(p, t)| (*p, t / last));
        preparer.prepare(timed, 0.25, &mut source);
        let source: Vec<_> = (source.points.iter().zip(&source.times))
            .map(|(surface, share)| {
                let along = share.clamp(0.0, 1.0) * INTERVALS as f32;
                let interval = (along as u32).min(INTERVALS as u32 - 1);
                TimedSurface {
                    surface: *surface,
                    interval,
                    share: along - interval as f32,
                }
            })
            .collect();
        // The guess: the sensor stands still.
        let mut chain = Chain::starting_at(start);
        chain.extend(0.0, INTERVALS, f64::from(last));
        let config = MovingConfig {
            reach_m: 1.0,
            first_reach_m: 2.0,
            kernel: Kernel::GemanMcClure { scale_m: 0.3 },
            fits_within_m: 0.1,
            max_iterations: 30,
            epsilon: 1e-4,
            agility: Agility::default(),
            degeneracy_threshold: 0.0,
        };
        let fit = MovingAligner::default().align(&source, &target, &mut chain, &[], &config);

        let off = end.inv_mul(chain.last());
        let (metres, radians) = (off.translation.vector.norm(), off.rotation.angle());
        let turned = start.rotation.angle_to(&end.rotation);
        let mut errors: Vec<f64> = (raw.iter().zip(&deskewed).zip(&times))
            .map(|((raw, deskewed), t)| {
                let along = f64::from((t / last).clamp(0.0, 1.0)) * INTERVALS as f64;
                let i = (along as usize).min(INTERVALS - 1);
                let (a, b) = (&chain.poses()[i], &chain.poses()[i + 1]);
                let pose = a.try_lerp_slerp(b, along - i as f64, 1e-9).unwrap();
                let ours = pose * Point3::from(vector(*raw));
                (ours.coords - vector(*deskewed)).norm()
            })
            .collect();
        errors.sort_by(f64::total_cmp);
        let median = errors[errors.len() / 2];
        eprintln!(
            "scan {scan}, turned by {:.1} degrees: its end {metres:.3} m and {radians:.4} rad off, \
             points {median:.3} m in the median",
            turned.to_degrees()
        );
        assert!(fit.converged, "{fit:?}");
        assert!(turned > 0.04, "the scans of this set turn: {turned} rad");
        assert!(
            metres < 0.15 && radians < 0.015,
            "scan {scan}: {metres} m, {radians} rad"
        );
        assert!(median < 0.15, "scan {scan}: {median} m");
    }
}
