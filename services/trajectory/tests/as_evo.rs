//! The numbers of evo 1.38.1 (`evo_ape`, `evo_rpe`, from PyPI) on the same files.
//!
//! The KITTI files are found through `HACHI_DATA`; the TUM case is built here by a formula, was
//! written with nine decimals, and went through evo in that form.
#![allow(clippy::print_stderr)] // says which recordings are missing

use std::num::NonZeroUsize;
use std::path::PathBuf;

use hachi_hal::{Pose, Rotation, Stamp};
use hachi_trajectory::{
    Alignment, EvaluationOptions, RelativeDelta, Statistics, Trajectory, evaluate, read, write,
};
use nalgebra::{Quaternion, Translation3};

/// How far from evo, metres, a figure may be. KITTI's truth has matrices of seven digits: evo
/// takes them as they are, this crate the nearest rotations, and over the 85 m of 100 frames their
/// 1e-7 grows to 2e-6.
fn tolerance(delta: RelativeDelta) -> f64 {
    let far = delta == frames(100) || delta == RelativeDelta::Metres(100.0);
    if far { 4e-6 } else { 1e-6 }
}

/// rmse, mean, median, std, min, max
type Expected = ([f64; 6], usize);

fn assert_statistics(got: Option<Statistics>, expected: Expected, what: &str) {
    assert_within(got, expected, 1e-6, what);
}

fn assert_within(got: Option<Statistics>, expected: Expected, tolerance: f64, what: &str) {
    let got = got.unwrap_or_else(|| panic!("{what}: no statistics"));
    let values = [got.rmse, got.mean, got.median, got.std, got.min, got.max];
    for (value, expected) in values.iter().zip(expected.0) {
        assert!(
            (value - expected).abs() < tolerance,
            "{what}: {value} is not {expected}"
        );
    }
    assert_eq!(got.n, expected.1, "{what}");
}

fn frames(count: usize) -> RelativeDelta {
    RelativeDelta::Frames(NonZeroUsize::new(count).unwrap())
}

fn options(alignment: Alignment, relative_delta: RelativeDelta) -> EvaluationOptions {
    EvaluationOptions {
        alignment,
        relative_delta,
        ..EvaluationOptions::default()
    }
}

/// A turning, climbing path; `noise` metres of wobble on it.
fn pose(i: f64, scale: f64, noise: f64) -> Pose {
    let a = 0.05 * i;
    let position = Translation3::new(
        scale * (10.0 * a.cos() + 0.02 * i) + noise * (1.7 * i).sin(),
        scale * (10.0 * a.sin()) + noise * (2.3 * i).cos(),
        scale * (0.3 * (0.2 * i).sin()) + noise * (0.9 * i + 1.0).sin(),
    );
    let h = a / 2.0 + std::f64::consts::FRAC_PI_4 + 0.05 * noise * (3.1 * i).sin();
    let p = 0.05 * (0.3 * i).sin();
    let q = Quaternion::new(
        p.cos() * h.cos(),
        p.sin() * h.cos(),
        p.sin() * h.sin(),
        p.cos() * h.sin(),
    );
    Pose::from_parts(position, Rotation::from_quaternion(q))
}

/// Reads back what was written: evo saw the rounded text.
fn through_text(samples: impl Iterator<Item = (i64, Pose)>) -> Trajectory {
    let mut text = Vec::new();
    for (nanos, pose) in samples {
        write::tum_line(Stamp::from_nanos(nanos), &pose, &mut text).unwrap();
    }
    let loaded = read::from_reader(text.as_slice()).unwrap();
    assert!(loaded.repairs.is_none());
    loaded.trajectory
}

const START_NS: i64 = 1_700_000_000_000_000_000;

fn wobbly_pair() -> (Trajectory, Trajectory) {
    let reference =
        through_text((0..200).map(|i| (START_NS + i * 100_000_000, pose(i as f64, 1.0, 0.0))));
    let estimate = through_text((5..190).filter(|i| i % 7 != 0).map(|i| {
        let late = 4_000_000
            + if i % 3 == 0 { 5_500_000 } else { 0 }
            + if i % 6 == 0 { 2_000_000 } else { 0 };
        (START_NS + i * 100_000_000 + late, pose(i as f64, 0.9, 0.05))
    }));
    (reference, estimate)
}

#[test]
fn timed_trajectories_have_evos_errors() {
    let (reference, estimate) = wobbly_pair();
    let run =
        |alignment, delta| evaluate(&reference, &estimate, &options(alignment, delta)).unwrap();

    let none = run(Alignment::None, frames(1));
    assert_statistics(
        Some(none.ape),
        (
            [
                1.015204631597,
                1.002219056282,
                0.981833245642,
                0.161856131306,
                0.587122294651,
                1.295331733883,
            ],
            131,
        ),
        "ape none",
    );
    assert_statistics(
        none.rpe,
        (
            [
                0.118272129834,
                0.109909686523,
                0.108834520875,
                0.043682462201,
                0.022975458914,
                0.222374653412,
            ],
            130,
        ),
        "rpe none, 1 frame",
    );

    let se3 = run(Alignment::Se3, frames(5));
    assert_statistics(
        Some(se3.ape),
        (
            [
                0.979162746077,
                0.961833858094,
                0.952305090744,
                0.183399325866,
                0.671000098764,
                1.263010912171,
            ],
            131,
        ),
        "ape se3",
    );
    assert_statistics(
        se3.rpe,
        (
            [
                0.355607306788,
                0.350457439828,
                0.365125603173,
                0.060300410536,
                0.183018152835,
                0.434991015037,
            ],
            26,
        ),
        "rpe se3, 5 frames",
    );

    let sim3 = run(Alignment::Sim3, RelativeDelta::Metres(3.0));
    assert_statistics(
        Some(sim3.ape),
        (
            [
                0.065705270740,
                0.063826568740,
                0.064704398261,
                0.015599734801,
                0.008124191385,
                0.097768912196,
            ],
            131,
        ),
        "ape sim3",
    );
    assert_statistics(
        sim3.rpe_from_first_pose,
        (
            [
                0.079401000915,
                0.075254857006,
                0.075316719409,
                0.025322429649,
                0.025457480835,
                0.116378363346,
            ],
            26,
        ),
        "rpe sim3, 3 m",
    );
}

#[test]
fn the_limit_in_time_leaves_out_what_evo_leaves_out() {
    let (reference, estimate) = wobbly_pair();
    let near = EvaluationOptions {
        max_difference_s: 0.005,
        ..options(Alignment::Sim3, frames(1))
    };
    assert_statistics(
        Some(evaluate(&reference, &estimate, &near).unwrap().ape),
        (
            [
                0.065719607532,
                0.063910573526,
                0.064856964132,
                0.015313569337,
                0.008329880342,
                0.098160355789,
            ],
            105,
        ),
        "ape sim3 within 5 ms",
    );
}

fn kitti(name: &str) -> Option<Trajectory> {
    let Some(data) = std::env::var_os("HACHI_DATA") else {
        eprintln!("skipped: HACHI_DATA does not name the folder of recordings");
        return None;
    };
    let path = PathBuf::from(data).join("metrics").join(name);
    let loaded = read::from_file(&path).unwrap();
    assert_eq!(loaded.format, read::Format::Kitti);
    Some(loaded.trajectory)
}

struct KittiCase {
    alignment: Alignment,
    delta: RelativeDelta,
    ape: [f64; 6],
    rpe: Expected,
}

fn check_kitti(file: &str, cases: &[KittiCase]) {
    let (Some(reference), Some(estimate)) = (kitti("KITTI_00_gt.txt"), kitti(file)) else {
        return;
    };
    for case in cases {
        let what = format!("{file} {:?} {:?}", case.alignment, case.delta);
        let got = evaluate(&reference, &estimate, &options(case.alignment, case.delta)).unwrap();
        assert_statistics(Some(got.ape), (case.ape, 4541), &what);
        assert_within(
            got.rpe_from_first_pose,
            case.rpe,
            tolerance(case.delta),
            &what,
        );
    }
}

#[test]
fn orb_slam_on_kitti_00_has_evos_errors() {
    check_kitti(
        "KITTI_00_ORB.txt",
        &[
            KittiCase {
                alignment: Alignment::None,
                delta: frames(1),
                ape: [
                    7.790288882657,
                    7.011750401667,
                    6.801631674560,
                    3.394695447308,
                    0.000000004000,
                    13.458508807382,
                ],
                rpe: (
                    [
                        0.028120377017,
                        0.019301310981,
                        0.014709043439,
                        0.020450305572,
                        0.000312400263,
                        0.302712490595,
                    ],
                    4540,
                ),
            },
            KittiCase {
                alignment: Alignment::Se3,
                delta: frames(100),
                ape: [
                    1.303449714565,
                    1.156997128539,
                    1.065624769556,
                    0.600282269397,
                    0.069313220215,
                    3.587949120679,
                ],
                rpe: (
                    [
                        1.053256076685,
                        0.916762133395,
                        0.863190027726,
                        0.518551399426,
                        0.225587381806,
                        2.949534537430,
                    ],
                    45,
                ),
            },
            KittiCase {
                alignment: Alignment::Sim3,
                delta: RelativeDelta::Metres(100.0),
                ape: [
                    0.937709073611,
                    0.872692631969,
                    0.844691013486,
                    0.343082900827,
                    0.179514666880,
                    2.693499863613,
                ],
                rpe: (
                    [
                        1.179829958547,
                        1.022354475289,
                        0.872906731057,
                        0.588888833263,
                        0.134154029208,
                        2.715387554245,
                    ],
                    37,
                ),
            },
        ],
    );
}

#[test]
fn s_ptam_on_kitti_00_has_evos_errors() {
    check_kitti(
        "KITTI_00_SPTAM.txt",
        &[
            KittiCase {
                alignment: Alignment::Se3,
                delta: RelativeDelta::Metres(10.0),
                ape: [
                    3.738487907583,
                    3.490976633085,
                    3.642584641743,
                    1.337674841805,
                    0.694787347406,
                    7.768977406571,
                ],
                rpe: (
                    [
                        0.281613323239,
                        0.225268875426,
                        0.178347768331,
                        0.168997034264,
                        0.018752321056,
                        1.206594425578,
                    ],
                    356,
                ),
            },
            KittiCase {
                alignment: Alignment::Sim3,
                delta: RelativeDelta::Metres(10.0),
                ape: [
                    3.635293564339,
                    3.357305778621,
                    3.479863755296,
                    1.394222797032,
                    0.226992813948,
                    7.291831027982,
                ],
                rpe: (
                    [
                        0.292814880676,
                        0.227434171911,
                        0.177342175354,
                        0.184429530694,
                        0.016165206507,
                        1.663894735545,
                    ],
                    357,
                ),
            },
        ],
    );
}

/// The figures that evo's own test data carries, from versions up to 1.36, which leave out the
/// stretch from the first pose.
#[test]
fn relative_errors_over_10_m_are_those_published_with_the_trajectories() {
    for (file, rmse) in [
        ("KITTI_00_ORB.txt", 0.22626134329),
        ("KITTI_00_SPTAM.txt", 0.27607109044),
    ] {
        let (Some(reference), Some(estimate)) = (kitti("KITTI_00_gt.txt"), kitti(file)) else {
            return;
        };
        let over_10_m = options(Alignment::None, RelativeDelta::Metres(10.0));
        let rpe = evaluate(&reference, &estimate, &over_10_m)
            .unwrap()
            .rpe
            .unwrap();
        assert!((rpe.rmse - rmse).abs() < 1e-6, "{file}: {}", rpe.rmse);
    }
}
