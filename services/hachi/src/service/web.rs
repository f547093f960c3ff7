//! What the service tells over HTTP: `/metrics` (Prometheus), `/tasks` (JSON, as `hachi top` reads
//! it), `/health`.
//!
//! A thread of its own, below all tasks: it reads counters and never holds one up. It answers one
//! caller after the other, each within a second, reads no more than 4 kB of a request, and takes
//! no orders.

use std::io::{self, Read, Write};
use std::net::{SocketAddr, TcpListener, TcpStream};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use hachi_runtime::telemetry::LatencyRow;
use hachi_runtime::{Health, TaskRow, Telemetry, prometheus};
use serde::{Deserialize, Serialize};

use super::signs::{ImuSigns, SharedSigns};

/// What `/tasks` says.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Status {
    /// The robot.
    pub platform: String,
    /// The state of the service, and what is wrong.
    pub health: String,
    /// How far the place is to be trusted.
    pub localisation: String,
    /// Why the robot stands, or is slower than was wished; empty where it is not.
    pub standing: Vec<String>,
    /// Nodes of the map.
    pub nodes: u64,
    /// Loops that were closed.
    pub loops: u64,
    /// Commands that were cut to a limit.
    pub limited: u64,
    /// People in view.
    pub people_in_view: u32,
    /// What is known of the first person whom the robot knows: `SEEN`, `FOUND`, `UNSURE`, `LOST`,
    /// `SEARCHING`; `None` where it knows nobody.
    pub person: Option<String>,
    /// Charge of the battery, per cent, where it is known.
    pub battery_percent: Option<u32>,
    /// The inertial sensor on a bus, where there is one.
    pub imu: Option<ImuStatus>,
    /// Every task.
    pub tasks: Vec<TaskRow>,
    /// Times from end to end.
    pub latencies: Vec<LatencyRow>,
}

/// What the inertial sensor on a bus did.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ImuStatus {
    /// How often it was started, or that was tried.
    pub starts: u64,
    /// Reads, and attempts to start it, that failed.
    pub faults: u64,
    /// Samples of the chip.
    pub samples: u64,
    /// Those of them that odometry is not given: the robot lies on its side, or the mount is wrong.
    pub tilted: u64,
    /// Measurements that nobody fetched in time.
    pub missed: u64,
    /// Measurements that the chip marks as none.
    pub not_measured: u64,
    /// Samples with a value at the end of its range.
    pub saturated: u64,
    /// How often the chip had lost its settings.
    pub restarts: u64,
}

impl ImuStatus {
    /// As it is now; `None` where there is no such sensor.
    fn of(signs: &ImuSigns) -> Option<Self> {
        let counters = signs.counters();
        let starts = signs.starts.load(Ordering::Relaxed);
        (starts > 0).then(|| Self {
            starts,
            faults: signs.faults.load(Ordering::Relaxed),
            samples: counters.samples,
            tilted: signs.tilted.load(Ordering::Relaxed),
            missed: counters.missed,
            not_measured: counters.not_measured,
            saturated: counters.saturated,
            restarts: counters.restarts,
        })
    }
}

impl Status {
    /// As it is now.
    pub fn of(platform: &str, telemetry: &Telemetry, health: &Health, signs: &SharedSigns) -> Self {
        let battery = signs.battery_percent.load(Ordering::Relaxed);
        Self {
            platform: platform.to_owned(),
            health: health.line(),
            localisation: signs.condition.get().to_owned(),
            standing: signs.causes().iter().map(|c| c.line().to_owned()).collect(),
            nodes: signs.nodes.load(Ordering::Relaxed),
            loops: signs.loops.load(Ordering::Relaxed),
            limited: signs.limited.load(Ordering::Relaxed),
            people_in_view: signs.people_in_view.load(Ordering::Relaxed),
            person: Some(signs.person.get().to_owned()).filter(|word| !word.is_empty()),
            battery_percent: (1..=100).contains(&battery).then_some(battery),
            imu: ImuStatus::of(&signs.imu),
            tasks: telemetry.rows(),
            latencies: telemetry.latency_rows(),
        }
    }
}

/// What is told.
pub struct Page {
    /// The robot.
    pub platform: String,
    /// The tasks.
    pub telemetry: Arc<Telemetry>,
    /// The state of the service.
    pub health: Health,
    /// What tasks leave.
    pub signs: SharedSigns,
}

/// A request is cut off after this many bytes, and a caller after this time.
const MOST_BYTES: usize = 4096;
const PATIENCE: Duration = Duration::from_secs(1);

/// Looks this often whether to stop.
const LOOK_UP: Duration = Duration::from_millis(50);

/// Opens the address.
///
/// # Errors
/// It is taken, or not this computer's.
pub fn listen(address: SocketAddr) -> io::Result<TcpListener> {
    let listener = TcpListener::bind(address)?;
    listener.set_nonblocking(true)?;
    Ok(listener)
}

/// Answers until `stop`.
pub fn serve(listener: &TcpListener, page: &Page, stop: &AtomicBool) {
    while !stop.load(Ordering::Acquire) {
        match listener.accept() {
            Ok((caller, _)) => {
                // A caller that goes away is its own matter.
                let _ = answer(caller, page);
            }
            Err(_) => std::thread::sleep(LOOK_UP),
        }
    }
}

fn answer(mut caller: TcpStream, page: &Page) -> io::Result<()> {
    caller.set_nonblocking(false)?;
    caller.set_read_timeout(Some(PATIENCE))?;
    caller.set_write_timeout(Some(PATIENCE))?;
    let path = read_path(&mut caller)?;
    let (status, kind, body) = match path.as_deref() {
        Some("/metrics") => {
            let text = prometheus::text(&page.telemetry, &page.health);
            ("200 OK", "text/plain; version=0.0.4", text)
        }
        Some("/tasks") => {
            let Page {
                platform,
                telemetry,
                health,
                signs,
            } = page;
            let status = Status::of(platform, telemetry, health, signs);
            let json = serde_json::to_string(&status).map_err(io::Error::other)?;
            ("200 OK", "application/json", json)
        }
        Some("/health") => ("200 OK", "text/plain", page.health.line() + "\n"),
        Some(_) => (
            "404 Not Found",
            "text/plain",
            "try /metrics, /tasks or /health\n".to_owned(),
        ),
        None => (
            "400 Bad Request",
            "text/plain",
            "only GET is answered\n".to_owned(),
        ),
    };
    let head = format!(
        "HTTP/1.1 {status}\r\nContent-Type: {kind}\r\nContent-Length: {}\r\nConnection: close\r\n\r\n",
        body.len()
    );
    caller.write_all(head.as_bytes())?;
    caller.write_all(body.as_bytes())
}

/// The path of a GET; `None` for anything else.
fn read_path(caller: &mut TcpStream) -> io::Result<Option<String>> {
    let begun = Instant::now();
    let mut request = Vec::with_capacity(MOST_BYTES);
    let mut piece = [0; 512];
    while !request.windows(4).any(|end| end == b"\r\n\r\n") {
        let count = caller.read(&mut piece)?;
        request.extend_from_slice(&piece[..count]);
        if count == 0 || request.len() > MOST_BYTES || begun.elapsed() > PATIENCE {
            break;
        }
    }
    let text = String::from_utf8_lossy(&request);
    let mut words = text.lines().next().unwrap_or_default().split(' ');
    Ok(match (words.next(), words.next()) {
        (Some("GET"), Some(path)) => Some(path.to_owned()),
        _ => None,
    })
}
