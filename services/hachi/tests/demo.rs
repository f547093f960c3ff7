//! `hachi demo` as a new user runs it, only shorter.

mod program;

use program::{hachi, names, run, text, tum, whole_results};

#[test]
fn eight_seconds_in_the_simulated_office_stay_on_the_truth() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("demo");
    let run = run(&["demo", "--seconds", "8", "--headless", "--out", text(&out)]);
    assert!(
        run.success().contains("error against the truth"),
        "{}",
        run.stdout
    );
    let report = whole_results(&out);
    assert_eq!(report["state"], "finished");
    // Ten turns a second; the last one may be cut.
    assert!(
        (79..=81).contains(&report["scans"].as_u64().unwrap()),
        "{report}"
    );
    assert!(
        report["true_path_length_m"].as_f64().unwrap() > 4.0,
        "{report}"
    );
    assert!(report["ate_rmse_m"].as_f64().unwrap() < 0.08, "{report}");
    assert_eq!(report["conditions"]["lost"], 0, "{report}");
    // Its legs reach the end of every scan but the first, which nothing led to.
    assert_eq!(report["guesses"]["speed"], 1, "{report}");
    // A map that begins here is trusted from its first scan on.
    assert_eq!(report["map_conditions"]["ok"], report["conditions"]["ok"]);

    // Its person is in view and followed until they go into a room, and nobody else is.
    let people = &report["people"];
    assert!(
        (19..=20).contains(&people["pictures"].as_u64().unwrap()),
        "{people}"
    );
    assert!(
        people["person"]["visible_s"].as_f64().unwrap() > 3.0,
        "{people}"
    );
    assert!(
        people["person"]["tracked_share"].as_f64().unwrap() > 0.8,
        "{people}"
    );
    assert_eq!(people["person"]["wrong_s"], 0.0, "{people}");
    let sheet = hachi::images::read(&out.join("people.png")).unwrap();
    assert!(sheet.width > 3 * 424, "{}", sheet.width);

    // The figure of the report, measured once more from the files.
    let evaluated = program::run(&[
        "eval",
        "trajectory",
        "--reference",
        text(&out.join("truth.tum")),
        "--estimate",
        text(&out.join("trajectory.tum")),
        "--align",
        "se3",
        "--json",
    ])
    .json();
    let (here, there) = (&evaluated["ape"]["rmse"], &report["ate_rmse_m"]);
    assert!(
        (here.as_f64().unwrap() - there.as_f64().unwrap()).abs() < 1e-6,
        "{here} {there}"
    );
}

/// The robot's person goes into a room while somebody else walks ahead, and comes out again.
#[test]
fn the_robots_person_leaves_and_is_known_again_in_the_demo() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("demo");
    let run = run(&["demo", "--seconds", "25", "--headless", "--out", text(&out)]);
    let person = &whole_results(&out)["people"]["person"];
    let number = |name: &str| person[name].as_f64().unwrap();
    assert_eq!(number("re_identifications_needed"), 1.0, "{person}");
    assert_eq!(number("re_identified"), 1.0, "{person}");
    assert!(number("re_identified_after_s") < 4.0, "{person}");
    assert_eq!(number("wrong_s"), 0.0, "{person}");
    let told = run.success();
    assert!(told.contains("known again 1 of 1 times, after "), "{told}");
}

#[test]
fn the_same_seed_gives_the_same_walk_and_json_is_all_there_is_on_standard_output() {
    let folder = tempfile::tempdir().unwrap();
    let walk = |name: &str, seed: &str| {
        let out = folder.path().join(name);
        let arguments = [
            "demo",
            "--seconds",
            "1",
            "--headless",
            "--json",
            "--seed",
            seed,
        ];
        let output = hachi()
            .args(arguments)
            .arg("--out")
            .arg(&out)
            .output()
            .unwrap();
        let json = program::finished(output).json();
        assert_eq!(json, program::report(&out));
        std::fs::read(out.join("trajectory.tum")).unwrap()
    };
    let first = walk("a", "7");
    assert_eq!(first, walk("b", "7"));
    assert_ne!(first, walk("c", "8"));
}

#[test]
fn the_other_sensor_walks_too_and_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let arguments = [
        "demo",
        "--seconds",
        "1",
        "--headless",
        "--sensor",
        "helios16p",
        "--out",
    ];
    let run = run(&[&arguments[..], &[text(folder.path())]].concat());
    assert!(run.success().starts_with("RS-Helios-16P"), "{}", run.stdout);
    assert!((9..=11).contains(&whole_results(folder.path())["scans"].as_u64().unwrap()));
}

#[test]
fn a_walk_too_short_to_measure_is_said() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("demo");
    let run = run(&["demo", "--seconds", "0", "--headless", "--out", text(&out)]);
    assert!(run.failure().contains("--seconds"), "{}", run.stderr);
    assert!(names(&out).iter().all(|name| !name.starts_with('.')));
}

#[test]
fn what_the_help_calls_results_is_there_and_nothing_half_written() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("deep/er/demo");
    run(&["demo", "--seconds", "1", "--headless", "--out", text(&out)]).success();
    assert_eq!(
        names(&out),
        [
            "loops.csv",
            "map.ply",
            "map.png",
            "odometry.tum",
            "people.png",
            "report.json",
            "trajectory.svg",
            "trajectory.tum",
            "truth.tum"
        ]
    );
    assert!(tum(&out.join("truth.tum")).len() >= 9);
}

/// The whole service in virtual time: every file but the report, which has times, is the same.
#[test]
fn one_thread_and_two_give_the_same_bytes() {
    let folder = tempfile::tempdir().unwrap();
    let walk = |threads: &str| {
        let out = folder.path().join(threads);
        let arguments = ["demo", "--seconds", "4", "--headless", "--platform", "go1"];
        let output = hachi()
            .args(arguments)
            .args(["--sensor", "helios16p", "--out", text(&out)])
            .env("RAYON_NUM_THREADS", threads)
            .output()
            .unwrap();
        assert!(
            program::finished(output)
                .success()
                .contains("driven by the service")
        );
        out
    };
    let (one, two) = (walk("1"), walk("2"));
    let report = whole_results(&one);
    assert_eq!(
        (&report["robot"], &report["threads"]),
        (&"Go1".into(), &1.into())
    );
    assert!(
        report["true_path_length_m"].as_f64().unwrap() > 1.0,
        "{report}"
    );
    // Fifty new states a second reach the ends of scans too.
    assert!(
        report["guesses"]["speed"].as_u64().unwrap() <= 2,
        "{report}"
    );
    for name in names(&one).iter().filter(|name| *name != "report.json") {
        let read = |out: &std::path::Path| std::fs::read(out.join(name)).unwrap();
        assert!(read(&one) == read(&two), "{name} differs");
    }
}

#[test]
fn a_fixed_walk_is_walked_without_a_service() {
    let folder = tempfile::tempdir().unwrap();
    let arguments = [
        "demo",
        "--seconds",
        "1",
        "--headless",
        "--scripted",
        "--out",
    ];
    let run = run(&[&arguments[..], &[text(folder.path())]].concat());
    assert!(run.success().contains("a walking robot"), "{}", run.stdout);
    assert!(whole_results(folder.path()).get("robot").is_none());
}
