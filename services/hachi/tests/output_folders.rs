//! Where results go: full disks, folders that can't be written, earlier results, interruptions.
#![cfg(unix)]

mod program;

use std::fs;
use std::os::unix::fs::PermissionsExt;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use program::scenes::{capture, long_walk, walk};
use program::{finished, hachi, names, report, run, text, whole_results};

/// The program where no file may grow beyond so many kB, which the operating system enforces as a
/// full disk would.
fn on_a_disk_of(kilobytes: u32, arguments: &[&str]) -> program::Run {
    let limited = format!("trap '' XFSZ; ulimit -f {kilobytes}; exec \"$0\" \"$@\"");
    let output = Command::new("bash")
        .args(["-c", &limited, env!("CARGO_BIN_EXE_hachi")])
        .args(arguments)
        .stdin(Stdio::null())
        .output()
        .unwrap();
    finished(output)
}

fn nothing_half_written(folder: &Path) {
    let hidden: Vec<_> = names(folder)
        .into_iter()
        .filter(|n| n.starts_with('.'))
        .collect();
    assert_eq!(hidden, [""; 0]);
}

#[test]
fn a_disk_too_small_for_the_map_still_takes_the_rest() {
    let folder = tempfile::tempdir().unwrap();
    let input = walk(folder.path(), 4);
    let out = folder.path().join("out");
    let run = on_a_disk_of(32, &["replay", text(&input), "--out", text(&out)]);
    let line = run.late_failure();
    assert!(line.contains("map.ply") && line.contains("space"), "{line}");
    nothing_half_written(&out);
    assert!(!out.join("map.ply").exists());
    assert_eq!(program::tum(&out.join("trajectory.tum")).len(), 4);
    assert_eq!(report(&out)["state"], "output_failed");
}

#[test]
fn a_disk_that_fills_up_on_the_way_costs_the_map_alone() {
    let folder = tempfile::tempdir().unwrap();
    let input = capture(folder.path(), 4.0);
    // Cubes so small that hardly two points share one: more than stay in memory.
    let config = program::file(folder.path(), "fine.toml", "[map]\nvoxel_m = 0.001\n");
    let out = folder.path().join("out");
    let arguments = [
        "replay",
        text(&input),
        "--out",
        text(&out),
        "--config",
        text(&config),
    ];
    run(&arguments).success();
    let points = fs::metadata(out.join("map.ply")).unwrap().len() / 16;
    assert!(points > 150_000, "{points}");
    fs::remove_dir_all(&out).unwrap();

    let run = on_a_disk_of(1_000, &arguments);
    let line = run.late_failure();
    assert!(line.contains("map.ply") && line.contains("space"), "{line}");
    nothing_half_written(&out);
    assert!(!out.join("map.ply").exists() && !out.join("map.png").exists());
    let report = report(&out);
    assert_eq!(report["state"], "output_failed");
    let poses = program::tum(&out.join("trajectory.tum"));
    assert_eq!(report["scans"], poses.len());
}

#[test]
fn a_full_disk_stops_decoding_with_the_turns_so_far() {
    let folder = tempfile::tempdir().unwrap();
    let input = capture(folder.path(), 0.35);
    let out = folder.path().join("out");
    // A csv turn is larger than any other: some 1.5 MB where the whole turn returned.
    let arguments = [
        "decode",
        text(&input),
        "--out",
        text(&out),
        "--format",
        "csv",
    ];
    let run = on_a_disk_of(200, &arguments);
    assert!(run.late_failure().contains(".csv"), "{}", run.stderr);
    nothing_half_written(&out);
    assert_eq!(report(&out)["state"], "output_failed");
}

#[test]
fn a_disk_with_no_room_at_all_is_one_line() {
    let folder = tempfile::tempdir().unwrap();
    let input = walk(folder.path(), 2);
    let out = folder.path().join("out");
    let run = on_a_disk_of(0, &["replay", text(&input), "--out", text(&out)]);
    assert!(
        run.late_failure().contains("trajectory.tum"),
        "{}",
        run.stderr
    );
    assert_eq!(names(&out), [""; 0]);
}

#[test]
fn a_folder_that_takes_no_files_is_said_before_the_work_begins() {
    let folder = tempfile::tempdir().unwrap();
    let input = walk(folder.path(), 2);
    let read_only = folder.path().join("read-only");
    fs::create_dir(&read_only).unwrap();
    fs::set_permissions(&read_only, fs::Permissions::from_mode(0o555)).unwrap();
    let is_file = folder.path().join("file");
    fs::write(&is_file, "kept").unwrap();
    let mut places = vec![is_file.clone(), is_file.join("below")];
    // The superuser may write anywhere, except where the kernel itself keeps the files.
    places.push(match fs::write(read_only.join("probe"), "") {
        Ok(()) => "/proc/hachi".into(),
        Err(_) => read_only,
    });
    let capture = capture(folder.path(), 0.2);
    for out in &places {
        for arguments in [
            &["replay", text(&input)][..],
            &["decode", text(&capture)],
            &["demo", "--seconds", "1"],
        ] {
            let run = run(&[arguments, &["--out", text(out)]].concat());
            assert!(run.failure().contains(text(out)), "{}", run.stderr);
        }
    }
    assert_eq!(fs::read(&is_file).unwrap(), b"kept");
}

#[test]
fn results_do_not_go_into_the_recording() {
    let folder = tempfile::tempdir().unwrap();
    let input = walk(folder.path(), 2);
    let before = names(&input);
    let around = input.join("../scans/.");
    let run = run(&["replay", text(&input), "--out", text(&around)]);
    assert!(run.failure().contains("--out"), "{}", run.stderr);
    assert_eq!(names(&input), before);
}

#[test]
fn a_second_run_replaces_the_first_one_s_results() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    let input = walk(folder.path(), 6);
    run(&["replay", text(&input), "--out", text(&out)]).success();
    let first = names(&out);
    fs::remove_file(input.join("000005.bin")).unwrap();
    run(&["replay", text(&input), "--out", text(&out)]).success();
    assert_eq!(whole_results(&out)["scans"], 5);
    assert_eq!(names(&out), first);

    // Turns of a longer recording, or in another format, would look like turns of this one.
    let clouds = folder.path().join("clouds");
    let long = capture(folder.path(), 0.45);
    run(&["decode", text(&long), "--out", text(&clouds)]).success();
    let turns = report(&clouds)["turns"].as_u64().unwrap();
    let short = capture(folder.path(), 0.25);
    run(&[
        "decode",
        text(&short),
        "--out",
        text(&clouds),
        "--format",
        "ply",
    ])
    .success();
    let kept = report(&clouds)["turns"].as_u64().unwrap();
    assert!(kept < turns);
    let mut expected: Vec<_> = (0..kept).map(|n| format!("{n:06}.ply")).collect();
    expected.push("report.json".into());
    assert_eq!(names(&clouds), expected);

    // Clouds that this program did not write there stay.
    fs::remove_file(clouds.join("report.json")).unwrap();
    let refused = run(&["decode", text(&short), "--out", text(&clouds)]);
    assert!(
        refused.failure().contains("000000.ply"),
        "{}",
        refused.stderr
    );
    expected.pop();
    assert_eq!(names(&clouds), expected);
}

#[test]
fn any_number_of_threads_gives_the_same_bytes() {
    let folder = tempfile::tempdir().unwrap();
    let input = capture(folder.path(), 2.0);
    let replay = |threads: &str| {
        let out = folder.path().join(threads);
        run(&[
            "replay",
            text(&input),
            "--out",
            text(&out),
            "--threads",
            threads,
        ])
        .success();
        assert_eq!(report(&out)["threads"].to_string(), threads);
        ["trajectory.tum", "map.ply"].map(|name| fs::read(out.join(name)).unwrap())
    };
    let one = replay("1");
    for threads in ["2", "5"] {
        assert!(one == replay(threads), "{threads} threads give other bytes");
    }
}

/// Whether a process catches a signal: bit `signal - 1` of `SigCgt`.
fn catches(process: u32, signal: u32) -> bool {
    let status = fs::read_to_string(format!("/proc/{process}/status")).unwrap_or_default();
    let mask = status.lines().find_map(|l| l.strip_prefix("SigCgt:"));
    let mask = mask.and_then(|m| u64::from_str_radix(m.trim(), 16).ok());
    mask.is_some_and(|m| m & (1 << (signal - 1)) != 0)
}

/// Starts the program, waits until it has worked for a while, and stops it as Ctrl-C does.
#[cfg(target_os = "linux")]
fn interrupted(arguments: &[&str]) -> program::Run {
    const SIGINT: u32 = 2;
    let child = hachi()
        .args(arguments)
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let begun = Instant::now();
    while !catches(child.id(), SIGINT) {
        assert!(begun.elapsed() < Duration::from_secs(60), "it never began");
        std::thread::sleep(Duration::from_millis(5));
    }
    std::thread::sleep(Duration::from_millis(1500));
    let mut kill = Command::new("bash");
    kill.args(["-c", &format!("kill -INT {}", child.id())]);
    assert!(
        kill.status().unwrap().success(),
        "it was over before it was stopped"
    );
    finished(child.wait_with_output().unwrap())
}

#[cfg(target_os = "linux")]
#[test]
fn ctrl_c_in_the_middle_keeps_what_was_done() {
    let folder = tempfile::tempdir().unwrap();
    let input = long_walk(folder.path());
    let out = folder.path().join("out");
    let run = interrupted(&["replay", text(&input), "--out", text(&out)]);
    let line = run.late_failure();
    assert!(line.starts_with("hachi: interrupted: "), "{line}");
    let report = whole_results(&out);
    assert_eq!(report["state"], "interrupted");
    let scans = report["scans"].as_u64().unwrap();
    assert!((1..20_000).contains(&scans), "{scans}");
    assert!(line.contains(&scans.to_string()), "{line}");
    nothing_half_written(&out);
}

#[cfg(target_os = "linux")]
#[test]
fn ctrl_c_in_a_demo_keeps_what_was_done() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    let run = interrupted(&["demo", "--seconds", "600", "--out", text(&out)]);
    assert!(
        run.late_failure().starts_with("hachi: interrupted: "),
        "{}",
        run.stderr
    );
    nothing_half_written(&out);
    if !names(&out).is_empty() {
        assert_eq!(whole_results(&out)["state"], "interrupted");
    }
}
