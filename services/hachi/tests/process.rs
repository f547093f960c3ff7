//! The service as a process: killed, stopped, watched by systemd.

mod program;
mod rig;

use std::os::unix::net::UnixDatagram;
use std::sync::{Arc, Mutex};

use program::{run, text};
use rig::{Rig, alone, until};

/// Nodes in a map file, by the program's own reader.
fn nodes(map: &std::path::Path) -> u64 {
    let info = run(&["map", "info", text(map), "--json"]).json();
    info["nodes"].as_u64().unwrap()
}

#[test]
fn a_killed_service_leaves_the_robot_standing_and_the_map_whole() {
    let _alone = alone();
    let rig = Rig::new("b1");
    let settings = rig.write(&rig.settings());
    let mut service = rig.run(&settings);
    until("it walks far enough for a node", || rig.now().way_m > 5.0);
    let before = rig.now();
    service.signal(9);
    assert!(!service.wait().success());
    // The simulated robot waits a quarter of a second for the next command, and stops within a
    // third from 0.6 m/s.
    let stopped_s = rig.stands_after(before);
    program::stop_time("service killed", stopped_s);
    assert!(stopped_s < 1.5, "{stopped_s} s");
    assert!(nodes(&rig.map()) > 0);
    // And another one goes on where it was.
    let again = rig.run(&settings);
    until("it says so", || again.said("starting"));
}

#[test]
fn on_another_building_s_map_nobody_moves_the_robot() {
    let _alone = alone();
    let folder = tempfile::tempdir().unwrap();
    let office = folder.path().join("office.map");
    let mapped = run(&[
        "demo",
        "--seconds",
        "20",
        "--headless",
        "--map",
        text(&office),
        "--out",
        text(&folder.path().join("out")),
    ]);
    assert!(
        mapped.status == 0 && nodes(&office) > 3,
        "{}",
        mapped.stderr
    );
    let rig = Rig::in_world("b1", "glass-corridor");
    std::fs::copy(&office, rig.map()).unwrap();
    let service = rig.run(&rig.write(&rig.settings()));
    until("it says that it does not know the place", || {
        service.said("localisation poor")
    });
    let begun = rig.now().time_s;
    until("five seconds are over", || rig.now().time_s > begun + 5.0);
    assert_eq!(rig.now().way_m, 0.0);
    let status: serde_json::Value = {
        let top = run(&["top", "--json", "--address", &rig.http.to_string()]);
        top.json()
    };
    assert_ne!(status["localisation"], "OK", "{status}");
}

#[test]
fn a_service_that_is_asked_to_stop_does_and_systemd_hears_of_everything() {
    let _alone = alone();
    let rig = Rig::new("go1");
    let settings = rig.write(&rig.settings());
    let path = rig.folder.path().join("notify");
    let systemd = UnixDatagram::bind(&path).unwrap();
    let heard = Arc::new(Mutex::new(Vec::new()));
    let kept = Arc::clone(&heard);
    std::thread::spawn(move || {
        let mut buffer = [0; 1024];
        while let Ok(len) = systemd.recv(&mut buffer) {
            let text = String::from_utf8_lossy(&buffer[..len]).into_owned();
            kept.lock().unwrap().extend(text.lines().map(str::to_owned));
        }
    });
    let count = |line: &str| heard.lock().unwrap().iter().filter(|l| *l == line).count();
    let mut service = rig.run_with(&settings, |command| {
        command
            .env("NOTIFY_SOCKET", &path)
            .env("WATCHDOG_USEC", "400000");
    });
    until("it walks", || rig.now().way_m > 1.0);
    assert_eq!(count("READY=1"), 1);
    // Twice in the 0.4 s that systemd waits; it has walked for at least two seconds.
    assert!(count("WATCHDOG=1") >= 5);
    let begins = |text: &str| heard.lock().unwrap().iter().any(|l| l.starts_with(text));
    assert!(begins("STATUS=running"), "{:?}", heard.lock().unwrap());
    let before = rig.now();
    service.signal(15);
    assert!(service.wait().success(), "{:?}", service.lines());
    let stopped_s = rig.stands_after(before);
    program::stop_time("service asked to stop", stopped_s);
    assert!(stopped_s < 1.5, "{stopped_s} s");
    until("the end", || count("STOPPING=1") == 1);
    nodes(&rig.map());
}
