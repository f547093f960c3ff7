//! Devices that are there, whether they may be opened, and the library that runs networks.

use std::env;
use std::fs::{self, File};
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

use super::finding::Finding;

/// Nodes under `/dev` by kind: how their names begin, and the group that may open them on
/// Debian and Ubuntu.
const KINDS: [(&str, &[&str], &str); 4] = [
    ("video devices", &["video"], "video"),
    ("serial devices", &["ttyUSB", "ttyACM", "ttyTHS"], "dialout"),
    ("I2C buses", &["i2c-"], "i2c"),
    ("SPI devices", &["spidev"], "spi"),
];

/// More devices of one kind than this are not listed by name.
const MOST_NAMED: usize = 8;

pub(super) fn check() -> Vec<Finding> {
    let nodes = names_in(Path::new("/dev"));
    let mut findings: Vec<Finding> = KINDS
        .iter()
        .map(|(kind, beginnings, group)| node_finding(kind, beginnings, group, &nodes))
        .collect();
    findings.push(can_buses());
    findings.push(onnx_runtime());
    findings
}

fn names_in(folder: &Path) -> Vec<String> {
    let entries = fs::read_dir(folder).into_iter().flatten().flatten();
    let mut names: Vec<String> = entries
        .filter_map(|entry| entry.file_name().into_string().ok())
        .collect();
    names.sort();
    names
}

fn node_finding(kind: &'static str, beginnings: &[&str], group: &str, nodes: &[String]) -> Finding {
    let of_kind = |name: &&String| {
        beginnings.iter().any(|b| {
            let rest = name.strip_prefix(b);
            rest.is_some_and(|r| r.starts_with(|c: char| c.is_ascii_digit()))
        })
    };
    let found: Vec<&String> = nodes.iter().filter(of_kind).collect();
    if found.is_empty() {
        return Finding::ok(kind, "none");
    }
    let refused: Vec<&String> = found
        .iter()
        .copied()
        .filter(|name| !may_open(name))
        .collect();
    if refused.is_empty() {
        Finding::ok(kind, listed(&found))
    } else {
        Finding::warn(
            kind,
            format!("no right to open {}", listed(&refused)),
            format!("sudo usermod -aG {group} $USER, then log in again"),
        )
    }
}

/// Whether this user has the right to open the node for reading. A device that is busy or
/// unplugged may be opened.
fn may_open(name: &str) -> bool {
    let mut options = File::options();
    options.read(true);
    #[cfg(unix)]
    {
        use std::os::unix::fs::OpenOptionsExt;
        // A serial line would otherwise wait for its carrier, or become this program's terminal.
        options.custom_flags(libc::O_NONBLOCK | libc::O_NOCTTY);
    }
    match options.open(Path::new("/dev").join(name)) {
        Ok(_) => true,
        Err(error) => error.kind() != ErrorKind::PermissionDenied,
    }
}

fn listed(names: &[&String]) -> String {
    let shown = names.iter().take(MOST_NAMED).map(|n| n.as_str());
    let shown = shown.collect::<Vec<_>>().join(" ");
    match names.len().checked_sub(MOST_NAMED) {
        Some(more @ 1..) => format!("{shown} and {more} more"),
        _ => shown,
    }
}

/// CAN buses are network interfaces of hardware type 280 (`ARPHRD_CAN`, linux/if_arp.h).
fn can_buses() -> Finding {
    const NAME: &str = "CAN buses";
    let interfaces = Path::new("/sys/class/net");
    let read = |name: &str, what: &str| {
        let text = fs::read_to_string(interfaces.join(name).join(what)).unwrap_or_default();
        text.trim().to_owned()
    };
    let is_can = |name: &String| read(name, "type") == "280";
    let buses: Vec<String> = names_in(interfaces).into_iter().filter(is_can).collect();
    let down: Vec<&String> = buses
        .iter()
        .filter(|n| read(n, "operstate") == "down")
        .collect();
    match (buses.first(), down.first()) {
        (None, _) => Finding::ok(NAME, "none"),
        (Some(_), None) => Finding::ok(NAME, listed(&buses.iter().collect::<Vec<_>>())),
        (Some(_), Some(first)) => Finding::warn(
            NAME,
            format!("down: {}", listed(&down)),
            format!("sudo ip link set {first} up type can bitrate 500000"),
        ),
    }
}

/// Runs neural networks several times as fast as the embedded back end; mapping uses neither.
fn onnx_runtime() -> Finding {
    const NAME: &str = "ONNX Runtime";
    match find_library("libonnxruntime.so") {
        Some(path) => Finding::ok(NAME, path.display().to_string()),
        None => Finding::warn(
            NAME,
            "not found: networks run on the embedded back end, several times as slow",
            "install ONNX Runtime, set ORT_DYLIB_PATH to its library, build with --features onnxruntime",
        ),
    }
}

/// A shared library by its explicit setting, the loader's path, and where systems put them.
fn find_library(beginning: &str) -> Option<PathBuf> {
    if let Some(path) = env::var_os("ORT_DYLIB_PATH").map(PathBuf::from)
        && path.is_file()
    {
        return Some(path);
    }
    let from_loader = env::var_os("LD_LIBRARY_PATH").unwrap_or_default();
    let usual = [
        "/usr/local/lib",
        "/usr/lib",
        "/usr/lib64",
        "/usr/lib/x86_64-linux-gnu",
        "/usr/lib/aarch64-linux-gnu",
        "/opt/onnxruntime/lib",
    ];
    let folders = env::split_paths(&from_loader).chain(usual.map(PathBuf::from));
    folders
        .filter(|folder| !folder.as_os_str().is_empty())
        .find_map(|folder| {
            let names = names_in(&folder);
            let name = names.iter().find(|name| name.starts_with(beginning))?;
            Some(folder.join(name))
        })
}
