//! `hachi people` and `hachi eval tracks` from outside.

mod program;

use std::fmt::Write as _;
use std::path::Path;

use hachi::images::Rgb;
use hachi::people_pictures::write_png;
use hachi_realsense::frame::{Layout, YuyvImage};
use hachi_world::SimulatedCamera;
use hachi_world::scenes::Script;
use program::{file, recording, run, text};

/// One person who walks, as detections; the detector misses frames 10 to 12.
fn walk() -> String {
    let mut lines = String::new();
    for frame in (1..=30).filter(|frame| !(10..=12).contains(frame)) {
        let _ = writeln!(lines, "{frame},-1,{},50,40,100,0.9", 2 * frame);
    }
    lines
}

/// What `hachi eval tracks` says.
#[track_caller]
fn evaluated(reference: &Path, estimate: &Path) -> serde_json::Value {
    run(&[
        "eval",
        "tracks",
        "--reference",
        text(reference),
        "--estimate",
        text(estimate),
        "--json",
    ])
    .json()
}

#[test]
fn detections_become_tracks_that_the_evaluation_accepts() {
    let folder = tempfile::tempdir().unwrap();
    let detections = file(folder.path(), "det.txt", &walk());
    let tracks = folder.path().join("tracks.txt");
    let out = run(&[
        "people",
        "track",
        text(&detections),
        "--out",
        text(&tracks),
        "--json",
    ])
    .json();
    assert_eq!((&out["people"], &out["boxes"]), (&1.into(), &30.into()));
    let truth: String = (1..=30)
        .map(|frame| format!("{frame},1,{},50,40,100,1\n", 2 * frame))
        .collect();
    let truth = file(folder.path(), "gt.txt", &truth);
    let metrics = evaluated(&truth, &tracks);
    assert_eq!(
        (&metrics["mota"], &metrics["idf1"]),
        (&1.0.into(), &1.0.into())
    );
    for key in ["ids", "fp", "fn", "ml"] {
        assert_eq!(metrics[key], 0, "{key}");
    }
    assert_eq!(metrics["mt"], 1);
}

#[test]
fn a_bad_line_is_named_and_nothing_is_written() {
    let folder = tempfile::tempdir().unwrap();
    let detections = file(
        folder.path(),
        "det.txt",
        "1,-1,5,5,10,20,0.9\n2,-1,x,5,10,20,0.9\n",
    );
    let tracks = folder.path().join("tracks.txt");
    let failed = run(&["people", "track", text(&detections), "--out", text(&tracks)]);
    assert!(
        failed.failure().contains("line 2: the left edge is \"x\""),
        "{}",
        failed.stderr
    );
    assert!(!tracks.exists());
}

#[test]
fn metrics_of_a_real_result_are_the_published_ones() {
    let Some(people) = recording("people") else {
        return;
    };
    let sequence = people.join("tud/TUD-Campus");
    let metrics = evaluated(&sequence.join("gt.txt"), &sequence.join("test.txt"));
    let counts = ["fp", "fn", "ids", "mt", "ml"].map(|key| metrics[key].as_u64().unwrap());
    assert_eq!(counts, [13, 150, 7, 1, 1]);
    assert!((metrics["mota"].as_f64().unwrap() - 0.526).abs() < 5e-4);
    assert!((metrics["idf1"].as_f64().unwrap() - 0.558).abs() < 5e-4);
}

/// A folder of frames: three of a real sequence.
fn real_frames(people: &Path, folder: &Path) {
    let from = people.join("MOT17-mini/train/MOT17-04-FRCNN/img1");
    for name in ["000001.jpg", "000002.jpg", "000003.jpg"] {
        std::fs::copy(from.join(name), folder.join(name)).unwrap();
    }
}

#[test]
fn people_in_real_images_keep_their_numbers() {
    let Some(people) = recording("people") else {
        return;
    };
    let folder = tempfile::tempdir().unwrap();
    let frames = folder.path().join("frames");
    std::fs::create_dir(&frames).unwrap();
    real_frames(&people, &frames);
    // What is no image costs one frame, and is said.
    std::fs::write(frames.join("000004.jpg"), b"\xFF\xD8 cut short").unwrap();
    let tracks = folder.path().join("tracks.txt");
    let out = run(&[
        "people",
        "track",
        text(&frames),
        "--out",
        text(&tracks),
        "--fps",
        "30",
        "--json",
        "--log",
        "error",
    ])
    .json();
    assert_eq!((&out["frames"], &out["unreadable"]), (&4.into(), &1.into()));
    let truth = people.join("MOT17-mini/train/MOT17-04-FRCNN/gt/gt.txt");
    let metrics = evaluated(&truth, &tracks);
    assert_eq!(metrics["ids"], 0);
    assert!(metrics["precision"].as_f64().unwrap() > 0.8, "{metrics}");
    // Three frames make only the surest a person.
    assert!(out["people"].as_u64().unwrap() >= 3, "{out}");
}

#[test]
fn the_person_of_a_picture_is_found_and_nobody_else() {
    let Some(people) = recording("people") else {
        return;
    };
    let search = people.join("person_search");
    let frames = search.join("data/samples");
    let names = program::names(&frames);
    let folder = tempfile::tempdir().unwrap();
    for name in names.iter().step_by(5) {
        std::fs::copy(frames.join(name), folder.path().join(name)).unwrap();
    }
    let query = search.join("query/0001_c1s1_001051_00.jpg");
    let out = run(&[
        "people",
        "find",
        "--query",
        text(&query),
        text(folder.path()),
        "--json",
    ])
    .json();
    let sightings = out["frames"].as_array().unwrap();
    assert_eq!(sightings.len(), 4);
    assert_eq!(out["found"], 4, "{out}");
    // Searched for in frames of other people, nobody is found.
    let strangers = tempfile::tempdir().unwrap();
    real_frames(&people, strangers.path());
    let out = run(&[
        "people",
        "find",
        text(strangers.path()),
        "--query",
        text(&query),
        "--json",
    ])
    .json();
    assert_eq!(out["found"], 0, "{out}");
}

#[test]
fn frames_that_are_none_and_impossible_distances_are_refused() {
    let Some(people) = recording("people") else {
        return;
    };
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("1.jpg"), b"\xFF\xD8 cut short").unwrap();
    let query = people.join("person_search/query/0001_c1s1_001051_00.jpg");
    let find = |distance: &str| {
        let distance = format!("--max-distance={distance}");
        let query = text(&query);
        run(&[
            "people",
            "find",
            text(folder.path()),
            "--query",
            query,
            &distance,
        ])
    };
    let failed = find("0.4");
    let line = failed.failure();
    assert!(
        line.contains("no frame can be looked at") && line.contains("1.jpg"),
        "{line}"
    );
    for distance in ["nan", "-0.1", "near"] {
        let refused = find(distance);
        assert_eq!(refused.status, 2);
        assert!(refused.stderr.contains("from 0"), "{}", refused.stderr);
    }
}

#[test]
fn a_model_is_checked_against_its_manifest() {
    let Some(models) = recording("models") else {
        return;
    };
    let model = models.join("osnet_x0_25_msmt17.onnx");
    let out = run(&["model", "check", text(&model), "--json"]).json();
    assert_eq!(out["input"], "\"input\" [any, 3, 256, 128]");
    let folder = tempfile::tempdir().unwrap();
    let manifest = include_str!("../../inference/src/known/osnet_x0_25_msmt17.toml");
    let wrong = file(folder.path(), "wrong.toml", &manifest.replace("512", "256"));
    let failed = run(&["model", "check", text(&model), "--manifest", text(&wrong)]);
    let line = failed.failure();
    assert!(
        line.contains("expects [1, 256]") && line.contains("[any, 512]"),
        "{line}"
    );
    let timed = run(&["model", "bench", text(&model), "--runs", "2", "--json"]).json();
    assert_eq!(timed["runs"], 2);
    assert!(timed["median_ms"].as_f64().unwrap() > 0.0);
}

/// Follows people through a folder's images by the folder's models.
fn tracked(folder: &Path) -> program::Run {
    run(&[
        "people",
        "track",
        text(folder),
        "--models",
        text(folder),
        "--out",
        text(&folder.join("t.txt")),
        "--log",
        "warn",
    ])
}

#[test]
fn without_a_network_it_is_said_what_to_do() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("1.jpg"), b"x").unwrap();
    let failed = tracked(folder.path());
    assert!(
        failed.failure().contains("holds no detector"),
        "{}",
        failed.stderr
    );
}

#[test]
fn a_manifest_that_can_t_be_read_is_said() {
    let folder = tempfile::tempdir().unwrap();
    for name in ["1.jpg", "mine.onnx"] {
        std::fs::write(folder.path().join(name), b"x").unwrap();
    }
    file(folder.path(), "mine.toml", "abuot = \"a detector\"");
    let failed = tracked(folder.path());
    let said = &failed.stderr;
    let named = ["model left out", "mine.toml", "abuot", "holds no detector"];
    assert!(named.iter().all(|part| said.contains(part)), "{said}");
}

/// Pictures of a simulated scene, one a file, as a camera's driver gives them.
fn film(folder: &Path, frames: usize) {
    let scene = Script::Return.scene(1);
    let optics = scene.camera.geometry.color;
    let mut camera = SimulatedCamera::new(&scene.simulation, scene.camera);
    let mut pixels = vec![0; 3 * optics.pixels()];
    for number in 1..=frames {
        let frame = camera.next_color_frame().unwrap();
        let layout = Layout::packed(optics.width, optics.height);
        let image = YuyvImage::new(&frame.color, layout).unwrap();
        image.to_rgb(&mut pixels).unwrap();
        let picture = Rgb {
            width: optics.width as usize,
            height: optics.height as usize,
            pixels: pixels.clone(),
        };
        write_png(&folder.join(format!("{number}.png")), &picture).unwrap();
    }
}

#[test]
fn frames_are_drawn_with_everybody_marked() {
    let folder = tempfile::tempdir().unwrap();
    let [frames, drawn] = ["frames", "drawn"].map(|name| folder.path().join(name));
    std::fs::create_dir(&frames).unwrap();
    film(&frames, 8);
    let summary = run(&[
        "people",
        "track",
        text(&frames),
        "--detector",
        "own:detector",
        "--reid",
        "own:reid",
        "--out",
        text(&folder.path().join("t.txt")),
        "--pictures",
        text(&drawn),
        "--json",
    ])
    .json();
    assert_eq!(summary["people"], 1, "{summary}");
    let [before, first, last] = [
        frames.join("8.png"),
        drawn.join("000001.png"),
        drawn.join("000008.png"),
    ]
    .map(|path| hachi::images::read(&path).unwrap());
    // Nobody is believed in the first frame, but its number stands there; the last has a box too.
    let changed = |picture: &Rgb| {
        let pairs = picture.pixels.iter().zip(&before.pixels);
        pairs.filter(|(a, b)| a.abs_diff(**b) > 60).count()
    };
    assert!(
        changed(&last) > 2 * changed(&first),
        "{} {}",
        changed(&last),
        changed(&first)
    );
    let sheet = hachi::images::read(&drawn.join("sheet.png")).unwrap();
    assert!(sheet.width > 3 * 400 && sheet.height > 3 * 200 - 1);
}

#[test]
fn a_scene_is_watched_and_its_person_known_to_all_three_ways() {
    let report = run(&[
        "eval",
        "scenes",
        "--scenes",
        "return",
        "--seconds",
        "7",
        "--json",
    ])
    .json();
    let scene = &report["scenes"][0];
    assert_eq!(scene["scene"], "return");
    for way in ["track_alone", "follow_me", "carpe_id"] {
        let figure = &scene[way];
        // Picked after three seconds; the person walks about in plain sight.
        let visible_s = figure["visible_s"].as_f64().unwrap();
        assert!((3.5..4.2).contains(&visible_s), "{way}: {figure}");
        assert!(
            figure["tracked_share"].as_f64().unwrap() > 0.9,
            "{way}: {figure}"
        );
        assert_eq!(figure["wrong_s"], 0.0, "{way}: {figure}");
    }
    let failed = run(&["eval", "scenes", "--scenes", "retrun"]);
    assert!(
        failed.stderr.contains("expected one of return, crossing"),
        "{}",
        failed.stderr
    );
}
