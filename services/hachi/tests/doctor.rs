//! `hachi doctor` from outside. What it finds depends on the machine; its shape does not.

mod program;

use program::run;

#[test]
fn the_json_lists_findings_and_agrees_with_the_exit_status() {
    let run = run(&["doctor", "--json"]);
    let json: serde_json::Value = serde_json::from_str(&run.stdout).unwrap();
    let findings = json["findings"].as_array().unwrap();
    let mut failures = 0;
    for finding in findings {
        let level = finding["level"].as_str().unwrap();
        assert!(["ok", "warn", "fail"].contains(&level), "{finding}");
        assert_ne!(finding["what"], "", "{finding}");
        // Whatever is not fine says what to do next.
        assert_eq!(finding["next_step"].is_string(), level != "ok", "{finding}");
        failures += usize::from(level == "fail");
    }
    assert_eq!(json["failures"], failures);
    assert_eq!(json["ok"], failures == 0);
    assert_eq!(run.status, i32::from(failures > 0));
    for name in [
        "cores",
        "memory",
        "clock",
        "UDP receive buffer",
        "UDP port",
        "SCHED_FIFO",
        "disk space here",
        "configuration",
    ] {
        assert!(findings.iter().any(|f| f["name"] == name), "{name}");
    }
}

#[test]
fn an_emergency_stop_whose_bus_is_not_there_is_named() {
    let settings = "[emergency_stop]\ncan = \"nobus9\"\nnode = 7\n";
    let stop = program::doctor_finding(settings, "emergency stop");
    assert_eq!(stop["level"], "warn");
    let what = stop["what"].as_str().unwrap();
    assert!(what.contains("node 7 on nobus9"), "{what}");
    let next_step = stop["next_step"].as_str().unwrap();
    assert!(
        next_step.contains("[emergency_stop] in hachi.toml"),
        "{next_step}"
    );
}

#[test]
fn a_broken_configuration_file_is_named_with_its_line() {
    let folder = tempfile::tempdir().unwrap();
    program::file(folder.path(), "hachi.toml", "[odometry]\nvoxel_m = = 3\n");
    let output = program::hachi()
        .arg("doctor")
        .current_dir(folder.path())
        .output()
        .unwrap();
    let run = program::finished(output);
    assert!(run.stdout.contains("hachi.toml: line 2"), "{}", run.stdout);
}
