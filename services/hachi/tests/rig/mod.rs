//! A simulated robot and the service that drives it, as two processes with sockets between them.
#![allow(dead_code, reason = "each test file uses its own part of this")]

use std::io::{BufRead, BufReader, Read};
use std::net::{SocketAddr, TcpListener, TcpStream, UdpSocket};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use serde_json::Value;

use crate::program::hachi;

/// Nothing here takes a quarter of this on a machine that does little else.
pub const PATIENCE: Duration = Duration::from_secs(60);

/// Two services at once would fight for the cores.
static ONE_AT_A_TIME: Mutex<()> = Mutex::new(());

pub fn alone() -> MutexGuard<'static, ()> {
    ONE_AT_A_TIME
        .lock()
        .unwrap_or_else(std::sync::PoisonError::into_inner)
}

/// Waits until something is so.
#[track_caller]
pub fn until(what: &str, mut is_so: impl FnMut() -> bool) {
    let begun = Instant::now();
    while !is_so() {
        assert!(begun.elapsed() < PATIENCE, "never: {what}");
        std::thread::sleep(Duration::from_millis(20));
    }
}

/// A process whose output is kept line by line; it does not outlive the test.
pub struct Process {
    pub child: Child,
    lines: Arc<Mutex<Vec<String>>>,
}

impl Process {
    fn new(command: &mut Command, of_stderr: bool) -> Self {
        let piped = if of_stderr {
            Command::stderr
        } else {
            Command::stdout
        };
        piped(command, Stdio::piped());
        let mut child = command.spawn().unwrap();
        let output: Box<dyn Read + Send> = match of_stderr {
            true => Box::new(child.stderr.take().unwrap()),
            false => Box::new(child.stdout.take().unwrap()),
        };
        let lines = Arc::new(Mutex::new(Vec::new()));
        let kept = Arc::clone(&lines);
        std::thread::spawn(move || {
            for line in BufReader::new(output).lines().map_while(Result::ok) {
                kept.lock().unwrap().push(line);
            }
        });
        Self { child, lines }
    }

    pub fn lines(&self) -> Vec<String> {
        self.lines.lock().unwrap().clone()
    }

    pub fn said(&self, text: &str) -> bool {
        self.lines
            .lock()
            .unwrap()
            .iter()
            .any(|line| line.contains(text))
    }

    /// Sends a signal by its number.
    pub fn signal(&self, number: i32) {
        let pid = self.child.id().to_string();
        let status = Command::new("kill")
            .args([format!("-{number}"), pid])
            .status();
        assert!(status.unwrap().success());
    }

    pub fn wait(&mut self) -> ExitStatus {
        let begun = Instant::now();
        loop {
            if let Some(status) = self.child.try_wait().unwrap() {
                return status;
            }
            assert!(
                begun.elapsed() < PATIENCE,
                "it does not end: {:?}",
                self.lines()
            );
            std::thread::sleep(Duration::from_millis(20));
        }
    }
}

impl Drop for Process {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// What the simulated robot truly does at one moment.
#[derive(Debug, Clone, Copy)]
pub struct Moment {
    pub time_s: f64,
    pub at: [f64; 2],
    pub moves: bool,
    pub way_m: f64,
    pub commands: u64,
}

/// Passes datagrams on, or does not: the LiDAR's cable.
pub struct Cable {
    pub address: SocketAddr,
    cut: Arc<AtomicBool>,
    gone: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl Cable {
    pub fn to(target: SocketAddr) -> Self {
        let socket = UdpSocket::bind("127.0.0.1:0").unwrap();
        let address = socket.local_addr().unwrap();
        socket
            .set_read_timeout(Some(Duration::from_millis(50)))
            .unwrap();
        let (cut, gone) = (
            Arc::new(AtomicBool::new(false)),
            Arc::new(AtomicBool::new(false)),
        );
        let (is_cut, is_gone) = (Arc::clone(&cut), Arc::clone(&gone));
        let thread = std::thread::spawn(move || {
            let mut buffer = [0; 2048];
            while !is_gone.load(Ordering::Relaxed) {
                if let Ok(len) = socket.recv(&mut buffer)
                    && !is_cut.load(Ordering::Relaxed)
                {
                    let _ = socket.send_to(&buffer[..len], target);
                }
            }
        });
        Self {
            address,
            cut,
            gone,
            thread: Some(thread),
        }
    }

    pub fn cut(&self, cut: bool) {
        self.cut.store(cut, Ordering::Relaxed);
    }
}

impl Drop for Cable {
    fn drop(&mut self) {
        self.gone.store(true, Ordering::Relaxed);
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

/// The robot, the cable of its LiDAR, and the settings of a service for them.
pub struct Rig {
    pub folder: tempfile::TempDir,
    pub robot: Process,
    pub cable: Cable,
    pub http: SocketAddr,
    robot_address: String,
    lidar_port: u16,
    platform: &'static str,
}

impl Rig {
    pub fn new(platform: &'static str) -> Self {
        Self::in_world(platform, "office")
    }

    pub fn in_world(platform: &'static str, world: &str) -> Self {
        let lidar_port = {
            let socket = UdpSocket::bind("127.0.0.1:0").unwrap();
            socket.local_addr().unwrap().port()
        };
        let http = TcpListener::bind("127.0.0.1:0")
            .unwrap()
            .local_addr()
            .unwrap();
        let cable = Cable::to(SocketAddr::from(([127, 0, 0, 1], lidar_port)));
        let mut simulate = hachi();
        simulate.args(["simulate", "--trace", "--platform", platform]);
        simulate.args(["--world", world]);
        simulate.args([
            "--robot",
            "127.0.0.1:0",
            "--lidar",
            &cable.address.to_string(),
        ]);
        let robot = Process::new(&mut simulate, false);
        until("the robot is there", || robot.said(" at 127.0.0.1:"));
        let first = robot.lines()[0].clone();
        let robot_address = first
            .split_once(" at ")
            .unwrap()
            .1
            .split_once(',')
            .unwrap()
            .0;
        Self {
            folder: tempfile::tempdir().unwrap(),
            robot_address: robot_address.to_owned(),
            robot,
            cable,
            http,
            lidar_port,
            platform,
        }
    }

    pub fn map(&self) -> PathBuf {
        self.folder.path().join("run.map")
    }

    /// Settings that drive it up and down the first corridor.
    pub fn settings(&self) -> String {
        format!(
            "motion = \"odometry\"\n[robot]\nplatform = \"{}\"\naddress = \"{}\"\nlocal_port = 0\n\
             [lidar]\nports = [{}]\nbind_address = \"127.0.0.1\"\n\
             [service]\nlisten = \"{}\"\nmap = \"{}\"\n\
             [patrol]\nplaces = [[8.0, 0.0], [0.0, 0.0]]\n",
            self.platform,
            self.robot_address,
            self.lidar_port,
            self.http,
            self.map().display()
        )
    }

    pub fn write(&self, settings: &str) -> PathBuf {
        let path = self.folder.path().join("hachi.toml");
        std::fs::write(&path, settings).unwrap();
        path
    }

    pub fn run(&self, settings: &Path) -> Process {
        self.run_with(settings, |_| ())
    }

    pub fn run_with(&self, settings: &Path, change: impl FnOnce(&mut Command)) -> Process {
        let mut run = hachi();
        run.arg("run").arg("--config").arg(settings);
        change(&mut run);
        Process::new(&mut run, true)
    }

    /// What the robot did so far.
    pub fn moments(&self) -> Vec<Moment> {
        let moment = |line: &String| {
            let value: Value = serde_json::from_str(line).ok()?;
            let number = |key: &str| value[key].as_f64().unwrap();
            Some(Moment {
                time_s: number("time_s"),
                at: [number("x_m"), number("y_m")],
                moves: number("speed_m_per_s") > 0.0 || number("yaw_rate_rad_per_s") != 0.0,
                way_m: number("way_m"),
                commands: value["commands"].as_u64().unwrap(),
            })
        };
        self.robot.lines().iter().filter_map(moment).collect()
    }

    pub fn now(&self) -> Moment {
        until("the robot moves in time", || !self.moments().is_empty());
        *self.moments().last().unwrap()
    }

    /// Waits until the robot has stood for half a second; for how long it went on after `from`, s.
    #[track_caller]
    pub fn stands_after(&self, from: Moment) -> f64 {
        let stood = || {
            let later = self.moments();
            let later: Vec<_> = later
                .into_iter()
                .filter(|m| m.time_s > from.time_s)
                .collect();
            let last = later.iter().rposition(|m| m.moves).map_or(0, |i| i + 1);
            (later.len() > last + 5).then(|| later[last].time_s - from.time_s)
        };
        until("the robot stands", || stood().is_some());
        stood().unwrap()
    }

    /// The answer to a GET, whole.
    pub fn get(&self, path: &str) -> Option<String> {
        use std::io::Write;
        let mut link = TcpStream::connect(self.http).ok()?;
        link.set_read_timeout(Some(Duration::from_secs(5))).ok()?;
        link.write_all(format!("GET {path} HTTP/1.1\r\n\r\n").as_bytes())
            .ok()?;
        let mut answer = String::new();
        link.read_to_string(&mut answer).ok()?;
        Some(answer)
    }

    pub fn health(&self) -> String {
        let answer = self.get("/health").unwrap_or_default();
        answer
            .split_once("\r\n\r\n")
            .map_or_else(String::new, |(_, body)| body.trim().to_owned())
    }
}
