//! The built program, run as a user runs it.
#![allow(dead_code, reason = "each test file uses its own part of this")]

pub mod scenes;

use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};

/// The program in a quiet environment.
pub fn hachi() -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_hachi"));
    command.env_remove("HACHI_LOG").stdin(Stdio::null());
    command
}

/// What it did with these arguments.
pub struct Run {
    pub status: i32,
    pub stdout: String,
    pub stderr: String,
}

pub fn run(arguments: &[&str]) -> Run {
    finished(hachi().args(arguments).output().unwrap())
}

pub fn finished(output: Output) -> Run {
    Run {
        status: output.status.code().unwrap(),
        stdout: String::from_utf8(output.stdout).unwrap(),
        stderr: String::from_utf8(output.stderr).unwrap(),
    }
}

impl Run {
    /// The one line of a failure: status 1, nothing on standard output.
    #[track_caller]
    pub fn failure(&self) -> &str {
        assert_eq!(self.status, 1, "{}", self.stderr);
        assert_eq!(self.stdout, "");
        let line = self.stderr.strip_suffix('\n').unwrap();
        assert!(!line.contains('\n'), "more than one line: {line}");
        assert!(line.starts_with("hachi: "), "{line}");
        line
    }

    /// The one line of a failure that comes after results were written and summed up.
    #[track_caller]
    pub fn late_failure(&self) -> &str {
        assert_eq!(self.status, 1, "{}", self.stderr);
        let line = self.stderr.strip_suffix('\n').unwrap();
        assert!(!line.contains('\n'), "more than one line: {line}");
        assert!(line.starts_with("hachi: "), "{line}");
        line
    }

    /// A success that had nothing to complain about.
    #[track_caller]
    pub fn success(&self) -> &str {
        assert_eq!((self.status, &*self.stderr), (0, ""));
        &self.stdout
    }

    /// The one JSON object of a success.
    #[track_caller]
    pub fn json(&self) -> serde_json::Value {
        assert_eq!(self.status, 0, "{}", self.stderr);
        assert_eq!(self.stderr, "");
        let value: serde_json::Value = serde_json::from_str(&self.stdout).unwrap();
        assert!(value.is_object());
        value
    }
}

/// A file of this content.
pub fn file(folder: &Path, name: &str, content: &str) -> PathBuf {
    let path = folder.join(name);
    std::fs::write(&path, content).unwrap();
    path
}

/// A recording by its path in the data folder, or `None`, said once, where there is no such folder.
pub fn recording(name: &str) -> Option<PathBuf> {
    let Some(folder) = std::env::var_os("HACHI_DATA") else {
        #[allow(clippy::print_stderr, reason = "a test that does not run says so")]
        {
            eprintln!("skipped: HACHI_DATA names no folder with {name}");
        }
        return None;
    };
    let path = Path::new(&folder).join(name);
    assert!(path.exists(), "HACHI_DATA has no {name}");
    Some(path)
}

/// Says how long a robot took to stop for a fault of `docs/safety.md`: with `--nocapture`, and a grep for
/// `stop time`, what was measured stands in one place.
pub fn stop_time(fault: &str, seconds: f64) {
    #[allow(clippy::print_stdout, reason = "this is what it is for")]
    {
        println!("stop time | {fault} | {seconds:.3} s");
    }
}

/// The text of a path.
pub fn text(path: &Path) -> &str {
    path.to_str().unwrap()
}

/// `report.json` of a run.
#[track_caller]
pub fn report(out: &Path) -> serde_json::Value {
    serde_json::from_slice(&std::fs::read(out.join("report.json")).unwrap()).unwrap()
}

/// Time and position of each line of a TUM file.
#[track_caller]
pub fn tum(path: &Path) -> Vec<[f64; 4]> {
    let line = |line: &str| {
        let numbers: Vec<f64> = line.split(' ').map(|n| n.parse().unwrap()).collect();
        assert_eq!(numbers.len(), 8, "{line}");
        assert!(numbers.iter().all(|n| n.is_finite()), "{line}");
        [numbers[0], numbers[1], numbers[2], numbers[3]]
    };
    std::fs::read_to_string(path)
        .unwrap()
        .lines()
        .map(line)
        .collect()
}

/// Names in a folder, sorted.
pub fn names(folder: &Path) -> Vec<String> {
    let entries = std::fs::read_dir(folder).unwrap();
    let mut names: Vec<_> = entries
        .map(|e| e.unwrap().file_name().into_string().unwrap())
        .collect();
    names.sort();
    names
}

/// The files of a replay, each whole: as many poses as scans, a map its own reader takes.
#[track_caller]
pub fn whole_results(out: &Path) -> serde_json::Value {
    let report = report(out);
    let poses = tum(&out.join("trajectory.tum"));
    assert_eq!(report["scans"], poses.len());
    assert!(poses.windows(2).all(|p| p[0][0] < p[1][0]));
    assert_eq!(tum(&out.join("odometry.tum")).len(), poses.len());
    let mut map = Vec::new();
    hachi_bridge::read_cloud(out.join("map.ply"), &mut map).unwrap();
    assert!(map.iter().all(hachi_hal::Point::is_finite));
    if poses.len() > 1 {
        let svg = std::fs::read_to_string(out.join("trajectory.svg")).unwrap();
        assert!(svg.trim_end().ends_with("</svg>"));
    }
    report
}

/// What `hachi doctor` finds under this name, in a folder with these settings.
pub fn doctor_finding(settings: &str, name: &str) -> serde_json::Value {
    let folder = tempfile::tempdir().unwrap();
    file(folder.path(), "hachi.toml", settings);
    let output = hachi()
        .args(["doctor", "--json"])
        .current_dir(folder.path())
        .output()
        .unwrap();
    let json: serde_json::Value = serde_json::from_str(&finished(output).stdout).unwrap();
    let mut findings = json["findings"].as_array().unwrap().iter();
    findings.find(|f| f["name"] == name).unwrap().clone()
}
