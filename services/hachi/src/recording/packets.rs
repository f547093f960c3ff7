//! Packets through the drivers: captures, bags, the simulated robot.

use std::path::Path;

use hachi_bridge::BagPackets;
use hachi_bridge::message::Sensor;
use hachi_datagram::{CaptureConfig, CaptureSource};
use hachi_hal::{LidarScans, PacketSource, Point, ScanHeader, Stamp};
use hachi_robosense::{RobosenseConfig, RobosenseScans};
use hachi_velodyne::{VelodyneConfig, VelodyneScans};

use super::ScanSource;
use crate::exit::Failure;

/// Packets looked at to recognise the sensor. Position packets and other traffic come in between.
const LOOK_AT: usize = 2_000;

/// Largest UDP payload.
const MAX_PAYLOAD: usize = 65_536;

/// The scans of a capture; the sensor and its ports are recognised by the packets.
///
/// # Errors
/// The capture can't be read, or holds packets of no known LiDAR.
pub fn from_capture(path: &Path) -> Result<Box<dyn ScanSource + Send>, Failure> {
    let open = |ports: &[u16]| {
        CaptureSource::open(path, CaptureConfig::on_ports(ports))
            .map_err(|error| super::unreadable(path, &error))
    };
    let mut peek = open(&[])?;
    let mut buffer = vec![0; MAX_PAYLOAD];
    let mut seen = Seen::default();
    for _ in 0..LOOK_AT {
        match peek.receive(&mut buffer, Stamp::from_nanos(i64::MAX)) {
            Ok(Some(received)) => seen.look(&buffer[..received.len], received.port),
            Ok(None) => break,
            Err(_) => seen.others += 1,
        }
        if let Some((sensor, port)) = seen.sensor {
            return Ok(from_packets(
                sensor,
                open(&sensor_ports(sensor, port))?,
                |source| {
                    source
                        .counters()
                        .dropped()
                        .map(|(r, n)| (r.to_owned(), n))
                        .collect()
                },
            ));
        }
    }
    Err(seen.failure(path))
}

/// The scans of a bag that carries packets.
///
/// # Errors
/// The bag can't be read, or carries none.
pub fn from_bag_packets(path: &Path) -> Result<Box<dyn ScanSource + Send>, Failure> {
    let packets = BagPackets::open(path).map_err(|error| super::unreadable(path, &error))?;
    super::warn_of(packets.bag());
    let damage = |packets: &BagPackets| vec![super::damage(packets.bag())];
    Ok(driven(packets.sensor(), packets, damage, true))
}

/// The scans of any source of one sensor's packets; `counts` tells what the source dropped, its
/// faults included.
pub fn from_packets<S: PacketSource + Send + 'static>(
    sensor: Sensor,
    source: S,
    counts: fn(&S) -> Vec<(String, u64)>,
) -> Box<dyn ScanSource + Send> {
    driven(sensor, source, counts, false)
}

fn driven<S: PacketSource + Send + 'static>(
    sensor: Sensor,
    source: S,
    counts: fn(&S) -> Vec<(String, u64)>,
    count_faults: bool,
) -> Box<dyn ScanSource + Send> {
    match sensor {
        Sensor::Velodyne => Box::new(Driven {
            scans: VelodyneScans::new(source, VelodyneConfig::default()),
            counts,
            faults: 0,
            count_faults,
        }),
        Sensor::Robosense => Box::new(Driven {
            scans: RobosenseScans::new(source, RobosenseConfig::default()),
            counts,
            faults: 0,
            count_faults,
        }),
    }
}

/// The sensor's usual ports, and the one it was seen on.
fn sensor_ports(sensor: Sensor, seen: u16) -> Vec<u16> {
    let usual: &[u16] = match sensor {
        Sensor::Velodyne => &[2368, 8308],
        Sensor::Robosense => &[6699, 7788],
    };
    let mut ports = usual.to_vec();
    if !ports.contains(&seen) {
        ports.push(seen);
    }
    ports
}

/// What the first packets of a capture are.
#[derive(Debug, Default)]
struct Seen {
    sensor: Option<(Sensor, u16)>,
    refused: Option<String>,
    others: usize,
    lengths: Vec<usize>,
}

impl Seen {
    fn look(&mut self, payload: &[u8], port: u16) {
        if hachi_velodyne::packet::recognise(payload)
            == Some(hachi_velodyne::packet::PacketKind::Data)
        {
            self.sensor = Some((Sensor::Velodyne, port));
        } else if hachi_robosense::packet::recognise(payload).is_some() {
            self.sensor = Some((Sensor::Robosense, port));
        } else {
            self.others += 1;
            if self.refused.is_none()
                && payload.len() == hachi_velodyne::packet::DATA_LEN
                && let Err(error) =
                    hachi_velodyne::packet::Decoder::new(Default::default()).inspect(payload)
            {
                self.refused = Some(error.to_string());
            }
            if self.lengths.len() < 4 && !self.lengths.contains(&payload.len()) {
                self.lengths.push(payload.len());
            }
        }
    }

    fn failure(&self, path: &Path) -> Failure {
        let path = path.display();
        let what = match (&self.refused, self.others) {
            (Some(error), _) => format!("{path} holds packets of another sensor: {error}"),
            (None, 0) => format!("{path} holds no UDP packets"),
            (None, n) => format!(
                "{path} holds no packets of a known LiDAR: {n} others, of {:?} bytes",
                self.lengths
            ),
        };
        Failure::new(what, "give a capture of a VLP-16 or an RS-Helios-16P")
    }
}

/// A driver that counts what it drops.
trait Counted<S> {
    fn decoded(&self) -> u64;
    fn dropped(&self) -> Vec<(String, u64)>;
    fn packets(&self) -> &S;
}

impl<S: PacketSource> Counted<S> for VelodyneScans<S> {
    fn decoded(&self) -> u64 {
        self.counters().packets
    }
    fn dropped(&self) -> Vec<(String, u64)> {
        self.counters()
            .dropped()
            .map(|(r, n)| (r.to_owned(), n))
            .collect()
    }
    fn packets(&self) -> &S {
        self.source()
    }
}

impl<S: PacketSource> Counted<S> for RobosenseScans<S> {
    fn decoded(&self) -> u64 {
        self.counters().packets
    }
    fn dropped(&self) -> Vec<(String, u64)> {
        self.counters()
            .dropped()
            .map(|(r, n)| (r.to_owned(), n))
            .collect()
    }
    fn packets(&self) -> &S {
        self.source()
    }
}

struct Driven<D, S> {
    scans: D,
    counts: fn(&S) -> Vec<(String, u64)>,
    faults: u64,
    /// Whether the faults are for this one to report: a capture counts its own by reason.
    count_faults: bool,
}

impl<S, D: LidarScans + Counted<S>> ScanSource for Driven<D, S> {
    fn next_scan(&mut self, points: &mut Vec<Point>) -> Result<Option<ScanHeader>, Failure> {
        // A source whose every packet is broken must end all the same.
        const FAULTS_IN_A_ROW: usize = 100_000;
        for _ in 0..FAULTS_IN_A_ROW {
            match self.scans.read_scan(points, Stamp::from_nanos(i64::MAX)) {
                Ok(Some(header)) => return Ok(Some(header)),
                Ok(None) if self.scans.at_end() => return Ok(None),
                Ok(None) => {}
                Err(error) => {
                    self.faults += 1;
                    tracing::debug!(%error, "a packet was left out");
                }
            }
        }
        Err(Failure::new(
            "the recording gives nothing but errors",
            "check it with `hachi decode`",
        ))
    }

    fn packets(&self) -> u64 {
        self.scans.decoded()
    }

    fn dropped(&self) -> Vec<(String, u64)> {
        let mut dropped = self.scans.dropped();
        if self.count_faults {
            dropped.push(("unreadable".to_owned(), self.faults));
        }
        dropped.extend((self.counts)(self.scans.packets()));
        dropped
    }
}
