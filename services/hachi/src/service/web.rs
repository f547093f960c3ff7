//! What the service tells over HTTP: `/metrics` (Prometheus), `/tasks` (JSON, as `hachi top` reads
//! it), `/health`; and `/people`, where orders are taken too ([`people`]).
//!
//! A thread of its own, below all tasks: it reads counters and never holds one up. It answers one
//! caller after the other, reads no more than 4 kB of a request, and for no longer than a second.
//! What a request is, and what it may not be, is `hachi_http`'s.

pub mod people;
pub mod sentences;
pub mod shapes;

use std::io::{self, Read, Write};
use std::net::{Shutdown, SocketAddr, TcpListener, TcpStream};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use hachi_http::{Method, Refusal, Request, Response, request};
use hachi_runtime::telemetry::LatencyRow;
use hachi_runtime::{Health, TaskRow, Telemetry, prometheus};
use serde::{Deserialize, Serialize};

use self::people::PeoplePage;
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
    /// What is known of the robot's person, or the first whom it knows: `SEEN`, `FOUND`, `UNSURE`, `LOST`,
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
    /// Who is in view, and orders about them.
    pub people: PeoplePage,
}

/// A caller who has not sent a request, or not taken the answer, is left after this time.
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
pub fn serve(listener: &TcpListener, page: &mut Page, stop: &AtomicBool) {
    while !stop.load(Ordering::Acquire) {
        match listener.accept() {
            Ok((caller, _)) => {
                // A caller that goes away is its own matter.
                let _ = answer(caller, page);
            }
            Err(_) => {
                // Names that are forgotten go, whether somebody asks or not.
                page.people.hear();
                std::thread::sleep(LOOK_UP);
            }
        }
    }
}

fn answer(mut caller: TcpStream, page: &mut Page) -> io::Result<()> {
    caller.set_nonblocking(false)?;
    let from_here = caller.peer_addr()?.ip().to_canonical().is_loopback();
    let mut bytes = [0; request::MOST_BYTES + 1];
    let response = match receive(&mut caller, &mut bytes)? {
        Ok(request) if request.path == people::PATH || request.path.starts_with(people::BELOW) => {
            page.people.answer(&request, from_here)
        }
        Ok(request) => page.answer(&request)?,
        Err(refusal) => Response::text(refusal.status(), format!("{refusal}\n")),
    };
    send(&mut caller, &response.to_bytes())?;
    drain(&mut caller)
}

impl Page {
    /// What is asked for most.
    fn answer(&self, request: &Request<'_>) -> io::Result<Response> {
        let Self {
            platform,
            telemetry,
            health,
            signs,
            ..
        } = self;
        Ok(match (request.method, request.path) {
            (Method::Get, "/metrics") => Response {
                content_type: "text/plain; version=0.0.4",
                ..Response::text(200, prometheus::text(telemetry, health))
            },
            (Method::Get, "/tasks") => {
                let status = Status::of(platform, telemetry, health, signs);
                let json = serde_json::to_string(&status).map_err(io::Error::other)?;
                Response::json(200, json)
            }
            (Method::Get, "/health") => Response::text(200, health.line() + "\n"),
            (Method::Post, "/metrics" | "/tasks" | "/health") => {
                Response::text(405, "only GET is answered here\n")
            }
            _ => Response::text(404, "try /metrics, /tasks, /health or /people\n"),
        })
    }
}

/// The caller's request, or why there is none.
fn receive<'a>(
    caller: &mut TcpStream,
    bytes: &'a mut [u8; request::MOST_BYTES + 1],
) -> io::Result<Result<Request<'a>, Refusal>> {
    let ends = Instant::now() + PATIENCE;
    let mut length = 0;
    loop {
        match request::parse(&bytes[..length]) {
            Ok(Some(_)) => break,
            Ok(None) => {}
            Err(refusal) => return Ok(Err(refusal)),
        }
        let late = || Refusal::Late {
            limit_ms: PATIENCE.as_millis() as u64,
        };
        let left = ends.saturating_duration_since(Instant::now());
        if left.is_zero() {
            return Ok(Err(late()));
        }
        caller.set_read_timeout(Some(left))?;
        match caller.read(&mut bytes[length..]) {
            Ok(0) => return Ok(Err(Refusal::CutShort)),
            Ok(count) => length += count,
            Err(error) if is_timeout(&error) => return Ok(Err(late())),
            Err(error) => return Err(error),
        }
    }
    // Parsed once more, now that nothing is written into the bytes any more.
    Ok(request::parse(&bytes[..length]).and_then(|request| request.ok_or(Refusal::CutShort)))
}

/// Sends all of it, or as much as the caller takes in time.
fn send(caller: &mut TcpStream, mut bytes: &[u8]) -> io::Result<()> {
    let ends = Instant::now() + PATIENCE;
    while !bytes.is_empty() {
        let left = ends.saturating_duration_since(Instant::now());
        if left.is_zero() {
            return Err(io::ErrorKind::TimedOut.into());
        }
        caller.set_write_timeout(Some(left))?;
        match caller.write(bytes)? {
            0 => return Err(io::ErrorKind::WriteZero.into()),
            count => bytes = &bytes[count..],
        }
    }
    Ok(())
}

/// Takes what the caller still sends, for a moment and not much of it: a line that is closed with
/// something unread is torn down, and the answer with it.
fn drain(caller: &mut TcpStream) -> io::Result<()> {
    caller.shutdown(Shutdown::Write)?;
    caller.set_read_timeout(Some(LOOK_UP))?;
    let mut rest = [0; request::MOST_BYTES];
    for _ in 0..4 {
        if caller.read(&mut rest)? == 0 {
            break;
        }
    }
    Ok(())
}

fn is_timeout(error: &io::Error) -> bool {
    // Which of the two it is depends on the system.
    matches!(
        error.kind(),
        io::ErrorKind::WouldBlock | io::ErrorKind::TimedOut
    )
}
