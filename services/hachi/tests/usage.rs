//! Wrong usage, help, logging, and the ends of pipes.

mod program;

use std::process::Stdio;

use program::{finished, hachi, run};

const COMMANDS: [&[&str]; 12] = [
    &[],
    &["demo"],
    &["decode"],
    &["replay"],
    &["eval"],
    &["eval", "registration"],
    &["eval", "trajectory"],
    &["doctor"],
    &["people", "watch"],
    &["people", "pick"],
    &["people", "enrol"],
    &["people", "release"],
];

#[test]
fn every_command_explains_itself_with_an_example() {
    for command in COMMANDS {
        let help = run(&[command, &["--help"]].concat());
        assert_eq!(help.status, 0, "{command:?}");
        assert!(help.stdout.contains("Example:\n  hachi"), "{command:?}");
        assert!(help.stdout.contains("Usage:"), "{command:?}");
        assert_eq!(help.stderr, "");
    }
}

#[test]
fn wrong_usage_ends_with_status_2_and_nothing_on_standard_output() {
    let wrong: [&[&str]; 14] = [
        &[],
        &["dance"],
        &["eval"],
        &["eval", "trajectory", "--reference", "a"],
        &[
            "eval",
            "trajectory",
            "--reference",
            "a",
            "--estimate",
            "b",
            "--align",
            "so3",
        ],
        &[
            "eval",
            "trajectory",
            "--reference",
            "a",
            "--estimate",
            "b",
            "--rpe-delta-m",
            "0",
        ],
        &[
            "eval",
            "trajectory",
            "--reference",
            "a",
            "--estimate",
            "b",
            "--rpe-delta-m",
            "1",
            "--rpe-delta-frames",
            "1",
        ],
        &["doctor", "--log", "hachi=verbose"],
        &["people", "pick"],
        &["people", "pick", "--track", "3", "--at", "1,2"],
        &["people", "pick", "--at", "320"],
        &["people", "pick", "--at", "nan,2"],
        &["people", "enrol", "Anna"],
        &["people", "enrol", "Anna", "--live", "--store", "people.db"],
    ];
    for arguments in wrong {
        let run = run(arguments);
        assert_eq!(run.status, 2, "{arguments:?}");
        assert_eq!(run.stdout, "", "{arguments:?}");
        assert_ne!(run.stderr, "", "{arguments:?}");
    }
}

#[test]
fn a_wrong_filter_in_the_environment_names_the_variable() {
    let output = hachi()
        .env("HACHI_LOG", "hachi=verbose")
        .arg("doctor")
        .output()
        .unwrap();
    let run = finished(output);
    assert_eq!(run.status, 2);
    assert!(run.stderr.contains("HACHI_LOG"), "{}", run.stderr);
}

#[test]
fn the_version_is_printed() {
    let version = run(&["--version"]);
    assert_eq!(version.status, 0);
    assert_eq!(
        version.stdout,
        format!("hachi {}\n", env!("CARGO_PKG_VERSION"))
    );
}

/// `hachi doctor | true`: the reader is gone before the first line.
#[test]
fn a_closed_pipe_is_no_reason_to_complain() {
    for arguments in [&["doctor"][..], &["doctor", "--json"], &["--help"]] {
        let (reader, writer) = std::io::pipe().unwrap();
        drop(reader);
        let child = hachi()
            .args(arguments)
            .stdout(writer)
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        let run = finished(child.wait_with_output().unwrap());
        assert_eq!(run.stderr, "", "{arguments:?}");
        assert_eq!(run.status, 0, "{arguments:?}");
    }
}
