//! A capture with the states of a robot besides its LiDAR's packets: its legs say what the scans
//! leave open.

mod program;

use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};

use hachi::config::Settings;
use hachi::service::settings::Platform;
use hachi::service::simulator::WalkingBody;
use hachi_hal::Stamp;
use hachi_unitree::command::{GaitKind, Mode};
use hachi_unitree::device::{SimulatedRobotConfig, SimulatedService};
use hachi_unitree::frame::{CheckForm, HighCmd};
use hachi_world::{
    CaptureWriter, LiveLidar, Preset, SimulatedPacket, Simulation, SimulationConfig, write_tum,
};
use program::{run, text, whole_results};

/// A B1 that walks straight down a corridor without features, as somebody beside it would have
/// captured the wire; and the truth.
fn capture(folder: &Path, seconds: i64) -> (PathBuf, PathBuf) {
    let settings = Settings::load(Some("b1"), None).unwrap();
    let platform = Platform::of_name("b1").unwrap();
    let robot = platform.robot;
    let mut world = SimulationConfig::preset(Preset::Corridor, 1, seconds as f64);
    world.base_from_lidar = settings.base_from_lidar.pose();
    let path = folder.join("walk.pcap");
    let file = BufWriter::new(File::create(&path).unwrap());
    let mut writer = CaptureWriter::new(file, &Simulation::new(world.clone())).unwrap();
    let mut write = |stamp: Stamp, port: u16, bytes: &[u8]| {
        let packet = SimulatedPacket {
            stamp,
            port,
            bytes,
            truth: &[],
        };
        writer.write(&packet).unwrap();
    };
    let body = WalkingBody::standing(&platform, &world);
    let config = SimulatedRobotConfig::for_robot(robot);
    let mut service = SimulatedService::new(&robot.layout, body, config);
    let mut lidar = LiveLidar::new(world.clone());
    let walk = HighCmd {
        mode: Mode::Walk.byte(robot.layout.model),
        gait: GaitKind::Trot as u8,
        velocity: [0.6, 0.0],
        ..HighCmd::default()
    };
    let frame = walk.encode(&robot.layout, CheckForm::Plain).unwrap();
    let mut poses = Vec::new();
    for ms in 0..seconds * 1_000 {
        let now = world.start + ms * 1_000_000;
        if ms % 10 == 0 {
            service.hear(frame.as_bytes(), now);
        }
        if let Some(state) = service.step(now) {
            write(now, robot.endpoints.local_port, state.as_bytes());
        }
        let walker = service.body().walker();
        lidar.advance(now, |stamp| walker.map_from_base(stamp), &mut write);
        poses.push((now, walker.map_from_base(now)));
    }
    writer.into_inner().flush().unwrap();
    let truth = folder.join("truth.tum");
    write_tum(poses, File::create(&truth).unwrap()).unwrap();
    (path, truth)
}

/// Error of a replay against the truth, metres, without alignment of scale.
fn error_m(truth: &Path, out: &Path) -> f64 {
    let trajectory = out.join("trajectory.tum");
    let arguments = [
        "eval",
        "trajectory",
        "--reference",
        text(truth),
        "--estimate",
    ];
    let more = [text(&trajectory), "--align", "se3", "--json"];
    let error = run(&[&arguments[..], &more].concat()).json();
    error["ape"]["rmse"].as_f64().unwrap()
}

#[test]
fn in_a_corridor_without_features_the_legs_in_a_capture_hold_the_pose() {
    let folder = tempfile::tempdir().unwrap();
    let (capture, truth) = capture(folder.path(), 14);
    let replay = |name: &str, more: &[&str]| {
        let out = folder.path().join(name);
        let arguments = ["replay", text(&capture), "--out", text(&out)];
        run(&[&arguments[..], more].concat()).success();
        whole_results(&out);
        error_m(&truth, &out)
    };
    let with_legs = replay("legs", &["--platform", "b1"]);
    let without = replay("scans", &[]);
    assert!(with_legs < 0.15, "{with_legs} m, without legs {without} m");
    assert!(
        without > 2.0 * with_legs,
        "{without} m without, {with_legs} m with"
    );
}
