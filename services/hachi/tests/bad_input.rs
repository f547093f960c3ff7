//! Recordings and settings that are broken, foreign or senseless: a clear line or a counted drop.

mod program;

use std::fs;
use std::path::Path;

use program::scenes::{Row, STEP_M, capture, room, walk, write_bin};
use program::{file, names, report, run, text, tum, whole_results};

fn scans(folder: &Path, scans: &[Vec<Row>]) -> std::path::PathBuf {
    let path = folder.join("scans");
    for (number, scan) in scans.iter().enumerate() {
        write_bin(&path, number, scan);
    }
    path
}

#[test]
fn a_capture_cut_in_the_middle_gives_what_came_before_and_counts_the_cut() {
    let folder = tempfile::tempdir().unwrap();
    let whole = capture(folder.path(), 1.0);
    let bytes = fs::read(&whole).unwrap();
    let cut = folder.path().join("cut.pcap");
    fs::write(&cut, &bytes[..bytes.len() / 2 + 7]).unwrap();
    let (out, clouds) = (folder.path().join("out"), folder.path().join("clouds"));
    run(&["replay", text(&cut), "--out", text(&out)]).success();
    let replayed = whole_results(&out);
    assert!(
        (4..=7).contains(&replayed["scans"].as_u64().unwrap()),
        "{replayed}"
    );
    assert_eq!(replayed["dropped"]["truncated_capture"], 1, "{replayed}");
    run(&["decode", text(&cut), "--out", text(&clouds)]).success();
    let decoded = report(&clouds);
    assert_eq!(decoded["dropped"]["truncated_capture"], 1, "{decoded}");
    assert_eq!(decoded["turns"], replayed["scans"]);

    // Cut in its header, and behind it.
    for length in [0, 3, 20, 24, 30] {
        fs::write(&cut, &bytes[..length]).unwrap();
        for command in ["decode", "replay"] {
            let run = run(&[command, text(&cut), "--out", text(&out)]);
            assert!(run.failure().contains("cut.pcap"), "{}", run.stderr);
        }
    }
}

/// A flipped bit in a packet, a repeated packet and a lost one cost no more than themselves.
#[test]
fn flipped_repeated_and_missing_packets_are_counted() {
    const FILE_HEADER: usize = 24;
    const RECORD_HEADER: usize = 16;
    const FRAME_HEADERS: usize = 42;
    let folder = tempfile::tempdir().unwrap();
    let bytes = fs::read(capture(folder.path(), 1.0)).unwrap();
    let (header, mut rest) = bytes.split_at(FILE_HEADER);
    let (mut data, mut other) = (Vec::new(), Vec::new());
    while !rest.is_empty() {
        let length = u32::from_le_bytes(rest[8..12].try_into().unwrap()) as usize;
        let (record, after) = rest.split_at(RECORD_HEADER + length);
        let is_data = length == FRAME_HEADERS + hachi_velodyne::packet::DATA_LEN;
        if is_data { &mut data } else { &mut other }.push(record.to_vec());
        rest = after;
    }
    assert!((740..770).contains(&data.len()), "{}", data.len());
    data[100][RECORD_HEADER + FRAME_HEADERS] ^= 0x10; // the flag of its first block
    let again = data[200].clone();
    data.insert(201, again);
    data.remove(300);
    let broken = folder.path().join("broken.pcap");
    fs::write(&broken, [header, &data.concat()].concat()).unwrap();
    let out = folder.path().join("clouds");
    run(&["decode", text(&broken), "--out", text(&out)]).success();
    let decoded = report(&out);
    let dropped = decoded["dropped"].as_object().unwrap();
    let total: u64 = dropped.values().map(|n| n.as_u64().unwrap()).sum();
    // The packet refused leaves a gap as well.
    assert_eq!((dropped.len(), total), (3, 4), "{decoded}");
    let mapped = folder.path().join("map");
    run(&["replay", text(&broken), "--out", text(&mapped)]).success();
    assert_eq!(whole_results(&mapped)["conditions"]["lost"], 0);
}

#[test]
fn what_is_no_recording_is_refused_in_one_line_that_names_it() {
    let folder = tempfile::tempdir().unwrap();
    let picture = folder.path().join("photo.png");
    fs::write(
        &picture,
        b"\x89PNG\r\n\x1a\n\0\0\0\x0dIHDR\0\0\0\x01\0\0\0\x01",
    )
    .unwrap();
    let disguised = folder.path().join("photo.pcap");
    fs::copy(&picture, &disguised).unwrap();
    let empty = folder.path().join("empty");
    fs::create_dir(&empty).unwrap();
    let nothing = folder.path().join("nothing.bag");
    fs::write(&nothing, b"").unwrap();
    let missing = folder.path().join("missing.pcap");
    let out = folder.path().join("out");
    for input in [&picture, &disguised, &empty, &nothing, &missing] {
        for command in ["replay", "decode"] {
            let run = run(&[command, text(input), "--out", text(&out)]);
            assert!(run.failure().contains(text(input)), "{}", run.stderr);
        }
    }
    assert!(!out.exists(), "a refused recording left a folder behind");
    for side in ["--source", "--target"] {
        let other = if side == "--source" {
            "--target"
        } else {
            "--source"
        };
        let good = write_bin(folder.path(), 0, &room(0.0));
        let run = run(&[
            "eval",
            "registration",
            side,
            text(&picture),
            other,
            text(&good),
        ]);
        assert!(run.failure().contains("photo.png"), "{}", run.stderr);
    }
}

#[test]
fn senseless_scans_are_counted_and_placed_nowhere() {
    let nan = f32::NAN;
    let cases: [(&str, Row); 6] = [
        ("NaN", [nan; 4]),
        ("infinite", [f32::INFINITY, f32::NEG_INFINITY, 1.0, 1.0]),
        ("zero", [0.0; 4]),
        ("equal", [1.0, 2.0, 3.0, 50.0]),
        ("far", [1e30, -1e30, 1e30, 50.0]),
        ("farthest", [f32::MAX; 4]),
    ];
    for (name, row) in cases {
        let folder = tempfile::tempdir().unwrap();
        let input = scans(folder.path(), &vec![vec![row; 1000]; 3]);
        let out = folder.path().join("out");
        run(&["replay", text(&input), "--out", text(&out)]).success();
        let report = whole_results(&out);
        assert_eq!(report["scans"], 3, "{name}");
        assert_eq!(report["conditions"]["ok"], 0, "{name}: {report}");
        assert_eq!(report["path_length_m"], 0.0, "{name}");
    }
    let folder = tempfile::tempdir().unwrap();
    let input = scans(folder.path(), &[vec![], vec![], vec![]]);
    let out = folder.path().join("out");
    run(&["replay", text(&input), "--out", text(&out)]).success();
    assert_eq!(whole_results(&out)["conditions"]["ok"], 0);
}

#[test]
fn senseless_scans_among_good_ones_cost_no_more_than_themselves() {
    let mut walk: Vec<Vec<Row>> = (0..12).map(|n| room(n as f32 * STEP_M)).collect();
    walk[3].extend([[f32::NAN, 1.0, 1.0, 1.0]; 500]);
    walk[4] = vec![[f32::NAN; 4]; 3000];
    walk[6].extend(vec![[1.0, 2.0, 0.0, 50.0]; 1_000_000]);
    walk[10] = vec![];
    let folder = tempfile::tempdir().unwrap();
    let input = scans(folder.path(), &walk);
    // Half a point more than a whole number of them.
    let torn = input.join("000008.bin");
    let length = fs::metadata(&torn).unwrap().len();
    fs::File::options()
        .write(true)
        .open(&torn)
        .unwrap()
        .set_len(length - 8)
        .unwrap();
    let out = folder.path().join("out");
    run(&["replay", text(&input), "--out", text(&out)]).success();
    let report = whole_results(&out);
    assert_eq!(report["dropped"]["unreadable_scan"], 1, "{report}");
    assert!(
        report["dropped"]["non_finite"].as_u64().unwrap() >= 3500,
        "{report}"
    );
    let poses = tum(&out.join("trajectory.tum"));
    let [_, x, y, z] = poses[poses.len() - 1];
    let truth = f64::from(11.0 * STEP_M);
    assert!(
        (x - truth).abs() < 0.05 && y.abs() < 0.05 && z.abs() < 0.05,
        "{x} {y} {z}"
    );
}

/// 0.3 seconds without a usable scan, at 1 m/s.
#[test]
#[ignore = "the odometry stands still while it carries the pose, then reports OK 0.27 m beside the \
            truth; services/odometry unskips this once a gap is bridged or said"]
fn two_empty_scans_in_a_row_are_bridged() {
    let mut walk: Vec<Vec<Row>> = (0..12).map(|n| room(n as f32 * STEP_M)).collect();
    walk[4] = vec![];
    walk[5] = vec![];
    let folder = tempfile::tempdir().unwrap();
    let input = scans(folder.path(), &walk);
    let out = folder.path().join("out");
    run(&["replay", text(&input), "--out", text(&out)]).success();
    let poses = tum(&out.join("trajectory.tum"));
    let [_, x, y, z] = poses[poses.len() - 1];
    let truth = f64::from(11.0 * STEP_M);
    assert!(
        (x - truth).abs() < 0.05 && y.abs() < 0.05 && z.abs() < 0.05,
        "{x} {y} {z}"
    );
}

#[test]
fn a_million_times_the_same_point_takes_neither_long_nor_much_memory() {
    let folder = tempfile::tempdir().unwrap();
    let input = scans(folder.path(), &[vec![[1.0, 2.0, 0.5, 50.0]; 1_000_000]]);
    let out = folder.path().join("out");
    run(&["replay", text(&input), "--out", text(&out)]).success();
    let report = whole_results(&out);
    assert_eq!(report["points"], 1_000_000);
    assert!(report["peak_rss_mb"].as_f64().unwrap() < 500.0, "{report}");
    let cloud = input.join("000000.bin");
    let run = run(&[
        "eval",
        "registration",
        "--source",
        text(&cloud),
        "--target",
        text(&cloud),
    ]);
    assert!(matches!(run.status, 0 | 1), "{}", run.stderr);
}

#[test]
fn one_scan_is_a_recording_too() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    run(&["replay", text(&walk(folder.path(), 1)), "--out", text(&out)]).success();
    let report = whole_results(&out);
    assert_eq!(
        (&report["scans"], &report["path_length_m"]),
        (&1.into(), &0.0.into())
    );
    assert!(
        fs::read_to_string(out.join("report.json"))
            .unwrap()
            .contains("\"path_length_m\": 0.0")
    );
}

#[test]
fn times_that_repeat_leave_scans_out_and_say_so() {
    let folder = tempfile::tempdir().unwrap();
    let input = walk(folder.path(), 5);
    file(&input, "times.txt", "0.0\n0.1\n0.1\n0.05\n0.4\n");
    let out = folder.path().join("out");
    let run = run(&["replay", text(&input), "--out", text(&out)]);
    match run.status {
        0 => assert_eq!(whole_results(&out)["conditions"]["not_later"], 2),
        _ => assert!(run.failure().contains("times.txt"), "{}", run.stderr),
    }
}

#[test]
fn a_setting_that_is_not_understood_is_named_with_file_line_and_key() {
    let folder = tempfile::tempdir().unwrap();
    let input = walk(folder.path(), 2);
    let out = folder.path().join("out");
    let wrong = [
        (
            "[odometry]\n\nvoxel_metres = 1.0\n",
            "line 3",
            "voxel_metres",
        ),
        ("[filter]\nnear_m = \"close\"\n", "line 2", "near_m"),
        ("motion = \"sonar\"\n", "line 1", "sonar"),
        ("[map\n", "line 1", "hachi.toml"),
        ("[[filter.body]]\nmin_m = [0.0, 0.0]\n", "line 2", "min_m"),
    ];
    for (content, line, key) in wrong {
        let config = file(folder.path(), "hachi.toml", content);
        let run = run(&[
            "replay",
            text(&input),
            "--out",
            text(&out),
            "--config",
            text(&config),
        ]);
        let failure = run.failure();
        assert!(failure.contains(text(&config)), "{failure}");
        assert!(failure.contains(line) && failure.contains(key), "{failure}");
    }
    assert!(!out.exists());
}

#[test]
fn a_setting_that_cannot_work_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let input = walk(folder.path(), 2);
    let out = folder.path().join("out");
    let wrong = [
        ("[odometry]\ntarget_points = 0\n", "odometry.target_points"),
        ("[odometry]\ncell_m = nan\n", "odometry.cell_m"),
        ("[odometry]\ncell_m = -1.0\n", "odometry.cell_m"),
        ("[odometry]\nmap_range_m = 0.0\n", "odometry.map_range_m"),
        (
            "[odometry]\nknot_interval_s = -0.1\n",
            "odometry.knot_interval_s",
        ),
        ("[odometry]\nlost_after = 0\n", "odometry.lost_after"),
        (
            "[odometry]\ndegeneracy_threshold = nan\n",
            "odometry.degeneracy_threshold",
        ),
        (
            "[odometry.agility]\nacceleration = 0.0\nangular_acceleration = 8.0\n",
            "odometry.agility.acceleration",
        ),
        ("[map]\nvoxel_m = 0.0\n", "map.voxel_m"),
        (
            "[base_from_lidar]\nxyz_m = [nan, 0.0, 0.0]\n",
            "base_from_lidar.xyz_m",
        ),
        ("[filter]\nnear_m = -1.0\n", "near_m"),
    ];
    for (content, key) in wrong {
        let config = file(folder.path(), "hachi.toml", content);
        let run = run(&[
            "replay",
            text(&input),
            "--out",
            text(&out),
            "--config",
            text(&config),
        ]);
        assert!(run.failure().contains(key), "{content}: {}", run.stderr);
    }
}

#[test]
fn a_guess_that_is_no_transform_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let cloud = write_bin(folder.path(), 0, &room(0.0));
    let cloud = text(&cloud);
    for (name, content) in [
        ("short", "1 0 0 0".to_owned()),
        ("words", "one 0 0 0 ".repeat(4)),
        ("scaled", "2 0 0 0 0 2 0 0 0 0 2 0 0 0 0 1".to_owned()),
        ("infinite", "1 0 0 inf 0 1 0 0 0 0 1 0 0 0 0 1".to_owned()),
    ] {
        let guess = file(folder.path(), name, &content);
        let base = ["eval", "registration", "--source", cloud, "--target", cloud];
        let run = run(&[&base[..], &["--guess", text(&guess)]].concat());
        assert!(run.failure().contains(name), "{}", run.stderr);
    }
    assert!(names(folder.path()).contains(&"000000.bin".to_owned()));
}
