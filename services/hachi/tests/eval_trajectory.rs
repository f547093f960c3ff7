//! `hachi eval trajectory` from outside.

mod program;

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use program::{Run, file, run};

/// A square of 4 m walked at 1 m a second, shifted by `shift` metres along x.
fn square(shift: f64) -> String {
    let mut text = String::from("# a square\n");
    for i in 0..=16 {
        let (side, along) = (i / 4, f64::from(i % 4));
        let (x, y) = [
            (along, 0.0),
            (4.0, along),
            (4.0 - along, 4.0),
            (0.0, 4.0 - along),
            (0.0, 0.0),
        ][side as usize];
        writeln!(text, "{i}.5 {} {y} 0 0 0 0 1", x + shift).unwrap();
    }
    text
}

fn compare(reference: &Path, estimate: &Path, more: &[&str]) -> Run {
    let files = [
        "eval",
        "trajectory",
        "--reference",
        reference.to_str().unwrap(),
        "--estimate",
        estimate.to_str().unwrap(),
    ];
    run(&[&files, more].concat())
}

struct Files {
    folder: tempfile::TempDir,
    reference: PathBuf,
    estimate: PathBuf,
}

fn shifted_square() -> Files {
    let folder = tempfile::tempdir().unwrap();
    Files {
        reference: file(folder.path(), "truth.tum", &square(0.0)),
        estimate: file(folder.path(), "estimate.tum", &square(0.25)),
        folder,
    }
}

#[test]
fn a_shift_is_an_absolute_error_and_no_relative_one() {
    let files = shifted_square();
    let json = compare(&files.reference, &files.estimate, &["--json"]).json();
    for key in ["rmse", "mean", "median", "min", "max"] {
        assert!(
            (json["ape"][key].as_f64().unwrap() - 0.25).abs() < 1e-12,
            "{key}"
        );
        assert!(json["rpe"][key].as_f64().unwrap().abs() < 1e-12, "{key}");
    }
    assert_eq!(json["ape"]["n"], 17);
    assert_eq!(json["rpe"]["n"], 16);
    assert_eq!(json["rpe_delta_frames"], 1);
}

#[test]
fn alignment_takes_the_shift_away_and_says_what_it_was() {
    let files = shifted_square();
    let json = compare(
        &files.reference,
        &files.estimate,
        &["--align", "se3", "--json"],
    )
    .json();
    assert!(json["ape"]["max"].as_f64().unwrap() < 1e-9);
    let x = json["reference_from_estimate"][3].as_f64().unwrap();
    assert!((x + 0.25).abs() < 1e-9, "{x}");
}

#[test]
fn people_get_a_table_and_a_picture() {
    let files = shifted_square();
    let plot = files.folder.path().join("error.svg");
    let run = compare(
        &files.reference,
        &files.estimate,
        &["--rpe-delta-m", "2", "--plot", plot.to_str().unwrap()],
    );
    assert_eq!(run.status, 0, "{}", run.stderr);
    assert!(run.stdout.contains("0.250000"), "{}", run.stdout);
    assert!(run.stdout.contains("rpe over 2 m"), "{}", run.stdout);
    let svg = std::fs::read_to_string(plot).unwrap();
    assert!(svg.contains("<svg") && svg.contains("estimate.tum against truth.tum"));
}

#[test]
fn what_was_put_right_in_a_file_is_said() {
    let files = shifted_square();
    let untidy = format!("{}3.5 3.25 0 0 0 0 0 1\n", square(0.25));
    let untidy = file(files.folder.path(), "untidy.tum", &untidy);
    let json = compare(&files.reference, &untidy, &["--json"]).json();
    assert_eq!(json["estimate"]["reordered"], 1);
    assert_eq!(json["estimate"]["repeated"], 1);
    assert_eq!(json["notes"].as_array().unwrap().len(), 2);
    assert_eq!(json["ape"]["n"], 17);
}

#[test]
fn failures_are_one_line_that_says_what_and_what_to_do() {
    let files = shifted_square();
    let folder = files.folder.path();
    let cut = file(folder, "cut.tum", "0 0 0 0 0 0 0 1\n1 0 0 0\n");
    let empty = file(folder, "empty.tum", "");
    let other_day = file(folder, "other_day.tum", "90000 0 0 0 0 0 0 1\n");
    let kitti = file(folder, "two.txt", &"1 0 0 0 0 1 0 0 0 0 1 0\n".repeat(2));
    let named_badly = folder.join("no\nsuch.tum");
    let cases = [
        (
            &cut,
            vec![],
            "cut.tum: line 2: 4 numbers, expected 8 (TUM); mend that line",
        ),
        (&empty, vec![], "holds no pose; give a trajectory"),
        (&other_day, vec![], "raise --max-diff-s"),
        (
            &kitti,
            vec![],
            "the reference has 17 and the estimate 2; give files with one line",
        ),
        (&named_badly, vec![], "check the name"),
        (
            &files.estimate,
            vec!["--rpe-delta-m", "500"],
            "give a smaller --rpe-delta-m",
        ),
        (
            &files.estimate,
            vec!["--plot", "/no/such/folder/a.svg"],
            "make its folder first",
        ),
    ];
    for (estimate, more, expected) in cases {
        let run = compare(&files.reference, estimate, &more);
        let line = run.failure();
        assert!(line.contains(expected), "{line}");
        let with_json = compare(
            &files.reference,
            estimate,
            &[&more[..], &["--json"]].concat(),
        );
        with_json.failure();
    }
}

#[test]
fn a_folder_instead_of_a_file_is_a_failure() {
    let files = shifted_square();
    let run = compare(&files.reference, files.folder.path(), &[]);
    assert!(run.failure().contains("check the name"));
}
