//! The whole service against the simulated robot, over sockets and in real time.

mod program;
mod rig;

use program::{hachi, text};
use rig::{Rig, alone, until};

#[test]
fn the_service_drives_the_robot_knows_where_it_is_and_says_what_it_does() {
    let _alone = alone();
    let rig = Rig::new("b1");
    let settings = rig.write(&rig.settings());
    let _service = rig.run(&settings);
    until("it walks", || rig.now().way_m > 3.0);
    let now = rig.now();
    assert!(
        now.at[0] > 2.5 && now.at[1].abs() < 0.4,
        "down the corridor: {now:?}"
    );
    assert_eq!(rig.health(), "running");

    let top = hachi()
        .args(["top", "--json", "--address", &rig.http.to_string()])
        .output();
    let status: serde_json::Value = serde_json::from_slice(&top.unwrap().stdout).unwrap();
    assert_eq!(status["platform"], "B1");
    assert_eq!(status["localisation"], "OK");
    assert_eq!(status["battery_percent"], 80);
    let runs = |name: &str| {
        let tasks = status["tasks"].as_array().unwrap();
        let task = tasks.iter().find(|task| task["name"] == name).unwrap();
        task["execution"]["runs"].as_u64().unwrap()
    };
    // At least five seconds of walking: 200 commands, 10 scans and 20 wishes a second.
    assert!(runs("base command") > 800 && runs("behaviour") > 80);
    assert!(runs("filter") > 40 && runs("odometry") > 40 && runs("slam") > 40);
    assert!(runs("legs") > 400);
    let latency = &status["latencies"][1];
    assert_eq!(latency["name"], "last packet to pose");
    assert!(latency["times"]["runs"].as_u64().unwrap() > 40);

    let table = hachi()
        .args(["top", "--once", "--address", &rig.http.to_string()])
        .output();
    let table = String::from_utf8(table.unwrap().stdout).unwrap();
    assert!(
        table.lines().any(|line| line.starts_with("base command *")),
        "{table}"
    );
    let metrics = rig.get("/metrics").unwrap();
    assert!(metrics.starts_with("HTTP/1.1 200 OK\r\n"), "{metrics}");
    assert!(
        metrics.contains("\nhachi_health{state=\"running\"} 1\n"),
        "{metrics}"
    );
    assert!(
        metrics.contains("hachi_task_overruns_total{task=\"odometry\"}"),
        "{metrics}"
    );
    assert!(rig.get("/nonsense").unwrap().starts_with("HTTP/1.1 404 "));
}

#[test]
fn a_lidar_that_falls_silent_stops_the_robot_and_one_that_comes_back_lets_it_go_on() {
    let _alone = alone();
    let rig = Rig::new("go1");
    let settings = rig.write(&rig.settings());
    let service = rig.run(&settings);
    until("it walks", || rig.now().way_m > 1.0);
    let before = rig.now();
    rig.cable.cut(true);
    // 0.35 s until the scan is stale, one turn of the sensor before, half a second of braking; and
    // this machine may be busy.
    let stopped_s = rig.stands_after(before);
    program::stop_time("LiDAR's cable cut", stopped_s);
    assert!(stopped_s < 2.0, "{stopped_s} s");
    assert!(
        service.said("standing: the lidar shows nothing new"),
        "{:?}",
        service.lines()
    );
    until("it is said", || {
        rig.health().starts_with("sensor lost: lidar lost")
    });
    let way_m = rig.now().way_m;
    rig.cable.cut(false);
    until("it walks on", || rig.now().way_m > way_m + 0.5);
    until("all is well", || rig.health() == "running");
}

#[test]
fn settings_that_cannot_work_are_said_with_file_line_and_key_and_nobody_moves_the_robot() {
    let _alone = alone();
    let rig = Rig::new("b1");
    let good = rig.settings();
    let settings = rig.write(&good.replace("local_port = 0", "local_prot = 0"));
    let service = rig.run(&settings);
    until("the unknown key", || service.said("local_prot"));
    let said = service.lines().join("\n");
    assert!(
        said.contains(text(&settings)) && said.contains("line 5"),
        "{said}"
    );
    // Each is read when it is written: another mistake, then none.
    rig.write(&format!("{good}[safety]\nlidar_stale_s = 350.0\n"));
    until("the wrong unit", || {
        service.said("safety.lidar_stale_s = 350")
    });
    let said = service.lines().join("\n");
    assert!(
        said.contains("hachi.toml, line 15: safety.lidar_stale_s"),
        "{said}"
    );
    assert!(said.contains("seconds, not milliseconds"), "{said}");
    assert_eq!(rig.now().commands, 0);
    rig.write(&good);
    until("it walks", || rig.now().way_m > 0.3);
}
