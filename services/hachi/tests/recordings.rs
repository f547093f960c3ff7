//! Real recordings through the program, from `HACHI_DATA`.

mod program;

use std::path::Path;

use hachi_hal::{Pose, Rotation, Vector3};
use program::{file, names, recording, report, run, text, tum, whole_results};
use serde_json::Value;

fn replay(input: &Path, out: &Path) -> Value {
    run(&["replay", text(input), "--out", text(out)]).success();
    let report = whole_results(out);
    assert_eq!(report["state"], "finished");
    report
}

/// The recording's report, or nothing where there are no recordings.
fn replayed(name: &str) -> Option<(tempfile::TempDir, Value)> {
    let input = recording(name)?;
    let folder = tempfile::tempdir().unwrap();
    let report = replay(&input, folder.path());
    Some((folder, report))
}

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap()
}

/// Truth: `office_35s.truth.tum`. KISS-ICP 1.3.0 has 0.056 m there.
#[test]
fn the_walk_through_the_office_stays_on_the_truth() {
    let Some((out, report)) = replayed("velodyne/office_35s.pcap") else {
        return;
    };
    // 24,270 packets at 754 a second, ten turns a second.
    assert!(
        (321..=324).contains(&report["scans"].as_u64().unwrap()),
        "{report}"
    );
    assert_eq!(report["conditions"]["lost"], 0);
    let truth = recording("velodyne/office_35s.truth.tum").unwrap();
    let evaluated = run(&[
        "eval",
        "trajectory",
        "--reference",
        text(&truth),
        "--estimate",
        text(&out.path().join("trajectory.tum")),
        "--align",
        "se3",
        "--json",
    ])
    .json();
    assert!(number(&evaluated["ape"]["rmse"]) < 0.056, "{evaluated}");
    assert!(number(&evaluated["ape"]["n"]) > 320.0, "{evaluated}");
}

/// Peers: 38.43 to 38.86 m.
#[test]
fn a_car_s_hundred_scans_are_as_long_as_the_peers_say() {
    let Some((_out, report)) = replayed("scans/car_100") else {
        return;
    };
    assert_eq!(report["scans"], 100);
    let path = number(&report["path_length_m"]);
    assert!((38.2..39.1).contains(&path), "{path}");
    assert_eq!(report["conditions"]["lost"], 0);
}

/// Peers: 8.34 to 8.38 m.
#[test]
fn twelve_kitti_scans_are_as_long_as_the_peers_say() {
    let Some((_out, report)) = replayed("scans/kitti00_first12") else {
        return;
    };
    assert_eq!(report["scans"], 12);
    let path = number(&report["path_length_m"]);
    assert!((8.3..8.45).contains(&path), "{path}");
}

#[test]
fn thirteen_turns_of_a_sensor_that_stands_go_nowhere() {
    let Some((out, report)) = replayed("velodyne/vlp16_single_13turns.pcap") else {
        return;
    };
    // 13 wraps: twelve whole turns between them, and a part at either end.
    assert_eq!(report["scans"], 14);
    assert!(
        (number(&report["duration_s"]) - 1.33).abs() < 0.1,
        "{report}"
    );
    for [_, x, y, z] in tum(&out.path().join("trajectory.tum")) {
        assert!(x.hypot(y).hypot(z) < 0.05, "{x} {y} {z}");
    }
}

/// The capture was made from the bag: same packets, other container.
#[test]
fn a_bag_and_a_capture_of_the_same_packets_give_the_same_path() {
    let Some((bag, in_bag)) = replayed("velodyne/vlp16_dual_8scans.db3") else {
        return;
    };
    let (capture, in_capture) = replayed("velodyne/vlp16_dual_8scans.pcap").unwrap();
    assert_eq!(in_bag["scans"], in_capture["scans"]);
    assert_eq!(in_bag["points"], in_capture["points"]);
    assert!((8..=9).contains(&in_bag["scans"].as_u64().unwrap()));
    let a = tum(&bag.path().join("trajectory.tum"));
    let b = tum(&capture.path().join("trajectory.tum"));
    for (a, b) in a.iter().zip(&b) {
        assert!((1..4).all(|i| (a[i] - b[i]).abs() < 0.02), "{a:?} {b:?}");
    }
}

/// 750 data packets and one of device information, 0.5 s.
#[test]
fn the_helios_gives_the_same_turns_from_a_bag_and_from_a_capture() {
    for name in ["helios16p_5scans.pcap", "helios16p_5scans.db3"] {
        let Some(input) = recording(&format!("robosense/{name}")) else {
            return;
        };
        let (out, map) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
        run(&["decode", text(&input), "--out", text(out.path())]).success();
        let decoded = report(out.path());
        assert_eq!(decoded["packets"], 750, "{name}");
        assert!(
            (5..=6).contains(&decoded["turns"].as_u64().unwrap()),
            "{decoded}"
        );
        let replayed = replay(&input, map.path());
        assert_eq!(replayed["scans"], decoded["turns"], "{name}");
        assert_eq!(replayed["points"], decoded["points"], "{name}");
    }
}

/// A page of zeros and flipped bits in a bag: what can be read is, and it ends.
#[test]
fn a_damaged_bag_ends_with_what_could_be_read_or_a_reason() {
    const PAGE: usize = 4096;
    let Some(input) = recording("velodyne/vlp16_dual_8scans.db3") else {
        return;
    };
    let whole = std::fs::read(input).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let damaged = folder.path().join("damaged.db3");
    for (case, page) in [3, 40, 150, 300].into_iter().enumerate() {
        let mut bytes = whole.clone();
        bytes[page * PAGE..(page + 1) * PAGE].fill(0);
        for index in (2 * PAGE + case..bytes.len()).step_by(37_777) {
            bytes[index] ^= 1 << (index % 8);
        }
        std::fs::write(&damaged, bytes).unwrap();
        let out = folder.path().join(case.to_string());
        let run = run(&["replay", text(&damaged), "--out", text(&out)]);
        match run.status {
            0 => assert!(whole_results(&out)["scans"].as_u64().unwrap() > 0),
            _ if out.join("report.json").exists() => {
                let report = report(&out);
                assert_eq!(report["scans"], 0);
                assert!(
                    report["dropped"]["damaged_bag"].as_u64().unwrap() > 0,
                    "{report}"
                );
            }
            _ => assert!(run.late_failure().contains("damaged.db3"), "{}", run.stderr),
        }
    }
}

/// `eval registration` of two clouds, from a guess.
fn registered(source: &Path, target: &Path, guess: Option<&Pose>) -> Value {
    let folder = tempfile::tempdir().unwrap();
    let base = ["eval", "registration", "--json"];
    let clouds = ["--source", text(source), "--target", text(target)];
    let mut arguments = [&base[..], &clouds[..]].concat();
    let file = guess.map(|guess| {
        let numbers = guess.to_homogeneous().transpose();
        let numbers: Vec<_> = numbers.iter().map(f64::to_string).collect();
        file(folder.path(), "guess.txt", &numbers.join(" "))
    });
    if let Some(file) = &file {
        arguments.extend(["--guess", text(file)]);
    }
    run(&arguments).json()
}

/// How far an outcome is from the truth: metres and radians.
fn off(outcome: &Value, truth: &Pose) -> (f64, f64) {
    let numbers = outcome["target_from_source"].as_array().unwrap();
    let numbers: Vec<f64> = numbers.iter().map(number).collect();
    assert_eq!(numbers.len(), 16);
    let off = truth.inv_mul(&pose_of(&numbers));
    (off.translation.vector.norm(), off.rotation.angle())
}

/// A 4x4 matrix, row by row.
fn pose_of(numbers: &[f64]) -> Pose {
    let matrix = nalgebra::Matrix4::from_row_slice(numbers);
    let rotation = Rotation::from_matrix(&matrix.fixed_view::<3, 3>(0, 0).into_owned());
    let translation = matrix.fixed_view::<3, 1>(0, 3).into_owned();
    Pose::from_parts(translation.into(), rotation)
}

fn numbers_in(path: &Path) -> Vec<f64> {
    let text = std::fs::read_to_string(path).unwrap();
    let words = text.split_whitespace();
    words.filter_map(|word| word.parse().ok()).collect()
}

/// Truth: `T_target_source.txt` beside the clouds.
#[test]
fn two_real_clouds_are_laid_over_each_other() {
    let Some(folder) = recording("registration/pair_a") else {
        return;
    };
    let truth = pose_of(&numbers_in(&folder.join("T_target_source.txt")));
    let (source, target) = (folder.join("source.ply"), folder.join("target.ply"));
    let outcome = registered(&source, &target, None);
    let (metres, radians) = off(&outcome, &truth);
    assert!(
        metres < 0.2 && radians.to_degrees() < 2.5,
        "{metres} m, {radians} rad"
    );
    assert_eq!(outcome["converged"], true);
}

/// Truth: `graph.txt`, a pose for each submap. From guesses up to 0.6 m and 4 degrees off.
#[test]
fn neighbouring_submaps_of_a_drive_are_laid_over_each_other() {
    let Some(folder) = recording("registration/kitti_07_submaps") else {
        return;
    };
    // Each line: a name, which is no number, then x y z and the quaternion x y z w.
    let numbers = numbers_in(&folder.join("graph.txt"));
    let poses: Vec<_> = numbers
        .chunks_exact(7)
        .map(|v| {
            let rotation = nalgebra::Quaternion::new(v[6], v[3], v[4], v[5]);
            let translation = Vector3::new(v[0], v[1], v[2]);
            Pose::from_parts(translation.into(), Rotation::from_quaternion(rotation))
        })
        .collect();
    assert_eq!(poses.len(), 5);
    let cloud = |i: usize| folder.join(format!("{i:06}/points.bin"));
    for i in 0..4 {
        let truth = poses[i].inv_mul(&poses[i + 1]);
        for (shift, turn) in [
            ([0.0, 0.0, 0.0], [0.0, 0.0, 0.0]),
            ([0.4, -0.4, 0.2], [0.02, -0.02, 0.06]),
            ([-0.5, 0.3, -0.1], [-0.01, 0.02, -0.07]),
        ] {
            let guess = truth * Pose::new(Vector3::from(shift), Vector3::from(turn));
            let outcome = registered(&cloud(i + 1), &cloud(i), Some(&guess));
            let (metres, radians) = off(&outcome, &truth);
            #[allow(clippy::print_stderr, reason = "the figures are worth reading")]
            {
                eprintln!("submap {} on {i}: {metres:.4} m, {radians:.5} rad", i + 1);
            }
            assert!(
                metres < 0.15 && radians < 0.015,
                "{i}: {metres} m, {radians} rad"
            );
            assert_eq!(outcome["converged"], true);
        }
    }
}

#[test]
fn a_thousand_packets_decode_to_the_turns_between_thirteen_wraps() {
    let Some(input) = recording("velodyne/vlp16_single_13turns.pcap") else {
        return;
    };
    for format in ["pcd", "ply", "csv"] {
        let out = tempfile::tempdir().unwrap();
        run(&[
            "decode",
            text(&input),
            "--out",
            text(out.path()),
            "--format",
            format,
        ])
        .success();
        let report = report(out.path());
        assert_eq!(report["packets"], 1000);
        assert_eq!(
            (&report["turns"], &report["partial_turns"]),
            (&14.into(), &2.into())
        );
        assert_eq!(report["dropped"], serde_json::json!({}));
        let mut expected: Vec<_> = (0..14).map(|n| format!("{n:06}.{format}")).collect();
        expected.push("report.json".into());
        assert_eq!(names(out.path()), expected);
        if format != "csv" {
            let mut points = 0;
            for name in &expected[..14] {
                let mut cloud = Vec::new();
                hachi_bridge::read_cloud(out.path().join(name), &mut cloud).unwrap();
                points += cloud.len() as u64;
            }
            assert_eq!(report["points"], points);
        }
    }
}

#[test]
fn other_sensors_and_odd_captures_are_decoded_or_refused_with_a_reason() {
    let Some(folder) = recording("velodyne/odd") else {
        return;
    };
    for name in names(&folder) {
        let out = tempfile::tempdir().unwrap();
        let run = run(&[
            "decode",
            text(&folder.join(&name)),
            "--out",
            text(out.path()),
        ]);
        match run.status {
            0 => assert!(report(out.path())["turns"].as_u64().unwrap() > 0, "{name}"),
            _ => assert!(run.failure().contains(&name), "{}", run.stderr),
        }
        assert_eq!(
            run.status == 0,
            // The only one of them whose packets say VLP-16 themselves.
            name == "velodyne_example.pcap",
            "{name}: {}",
            run.stderr
        );
    }
}
