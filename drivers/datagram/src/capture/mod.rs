//! Capture files: pcap and pcapng, read as a stream.
//!
//! In: any reader. Out: the UDP payloads that the file holds, with the times and ports at which
//! they were captured. The container is recognised by its first bytes. Memory is bounded whatever
//! the file says: one block of the file, and a fixed pool for IP fragments.
//!
//! A recording never waits, so deadlines are not looked at. What is not delivered is counted by
//! reason in [`CaptureCounters`]; a file that breaks off or turns to nonsense delivers what stands
//! before that, then ends.

mod container;
mod fragments;
mod link;

use std::fs::File;
use std::io::{self, Read};
use std::net::IpAddr;
use std::path::{Path, PathBuf};

use hachi_hal::{DeviceError, FaultKind, PacketSource, Received, Stamp};

use container::{Container, Stop};
use fragments::FragmentPool;
use link::Ignored;

/// What to take from a capture.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct CaptureConfig {
    /// Destination ports to deliver; empty for all.
    pub ports: Vec<u16>,
    /// If set, datagrams from any other address are counted and left out.
    pub source_address: Option<IpAddr>,
}

impl CaptureConfig {
    /// Datagrams to these ports, from anyone.
    pub fn on_ports(ports: &[u16]) -> Self {
        Self {
            ports: ports.to_vec(),
            source_address: None,
        }
    }
}

/// What happened to the frames of a capture.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct CaptureCounters {
    /// Frames read.
    pub frames: u64,
    /// Datagrams handed to the caller.
    pub delivered: u64,
    /// Frames of a link type that is not decoded.
    pub unsupported_link: u64,
    /// Frames that carry no IP (ARP, LLDP, ...).
    pub not_ip: u64,
    /// IP that is not UDP.
    pub not_udp: u64,
    /// UDP to a port that was not asked for.
    pub other_port: u64,
    /// UDP from another address than the configured one.
    pub foreign_sender: u64,
    /// Datagrams of which the capture kept only the beginning (its snap length).
    pub cut_by_snaplen: u64,
    /// Datagrams shorter than their headers say.
    pub truncated_frame: u64,
    /// Frames whose headers contradict themselves.
    pub malformed: u64,
    /// Fragmented datagrams of which a part never came, or came too late.
    pub fragment_lost: u64,
    /// Datagrams longer than the caller's buffer.
    pub oversize: u64,
    /// 1 if the file breaks off within a frame.
    pub truncated_capture: u64,
    /// 1 if the file's structure stops making sense; what follows could not be read.
    pub corrupt_capture: u64,
}

impl CaptureCounters {
    /// Reasons for which something was not delivered, and how often.
    pub fn dropped(&self) -> impl Iterator<Item = (&'static str, u64)> {
        [
            ("unsupported_link", self.unsupported_link),
            ("not_ip", self.not_ip),
            ("not_udp", self.not_udp),
            ("other_port", self.other_port),
            ("foreign_sender", self.foreign_sender),
            ("cut_by_snaplen", self.cut_by_snaplen),
            ("truncated_frame", self.truncated_frame),
            ("malformed", self.malformed),
            ("fragment_lost", self.fragment_lost),
            ("oversize", self.oversize),
            ("truncated_capture", self.truncated_capture),
            ("corrupt_capture", self.corrupt_capture),
        ]
        .into_iter()
    }

    fn count(&mut self, reason: Ignored) {
        let counter = match reason {
            Ignored::UnsupportedLink => &mut self.unsupported_link,
            Ignored::NotIp => &mut self.not_ip,
            Ignored::NotUdp => &mut self.not_udp,
            Ignored::CutBySnaplen => &mut self.cut_by_snaplen,
            Ignored::Truncated => &mut self.truncated_frame,
            Ignored::Malformed => &mut self.malformed,
            Ignored::AwaitingFragments => return,
        };
        *counter += 1;
    }
}

/// What can go wrong with a capture.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum CaptureError {
    /// The file cannot be opened.
    #[error("cannot open {}: {source}", path.display())]
    Open {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: io::Error,
    },
    /// Neither pcap nor pcapng.
    #[error(
        "not a pcap or pcapng capture: it starts with {start:02x?}{}",
        hint(start)
    )]
    NotACapture {
        /// Its first bytes, at most eight.
        start: Vec<u8>,
    },
    /// Reading failed. What came before was delivered; the capture ends here.
    #[error("cannot read the capture after {frames} frames: {source}")]
    Read {
        /// Frames read before.
        frames: u64,
        /// What the system said.
        source: io::Error,
    },
    /// The datagram is longer than the caller's buffer. It is passed over; the next one can be
    /// read.
    #[error("a datagram of {len} bytes to port {port} does not fit in {capacity}")]
    Oversize {
        /// The port.
        port: u16,
        /// Bytes of the datagram.
        len: usize,
        /// Bytes of the buffer.
        capacity: usize,
    },
}

/// What a file that is no capture probably is, by its first bytes.
fn hint(start: &[u8]) -> &'static str {
    match start {
        [] => " (it is empty)",
        [0x1F, 0x8B, ..] => " (gzip: decompress it first)",
        [0x28, 0xB5, 0x2F, 0xFD, ..] => " (zstd: decompress it first)",
        _ => "",
    }
}

impl DeviceError for CaptureError {
    fn kind(&self) -> FaultKind {
        match self {
            Self::Open { .. } | Self::NotACapture { .. } => FaultKind::FixConfig,
            Self::Read { .. } => FaultKind::GiveUp,
            Self::Oversize { .. } => FaultKind::ReadAgain,
        }
    }
}

/// A capture as a packet source.
#[derive(Debug)]
pub struct CaptureSource<R> {
    container: Container<R>,
    fragments: FragmentPool,
    config: CaptureConfig,
    counters: CaptureCounters,
    ended: bool,
}

impl CaptureSource<File> {
    /// Opens a capture file.
    pub fn open(path: impl AsRef<Path>, config: CaptureConfig) -> Result<Self, CaptureError> {
        let path = path.as_ref();
        let file = File::open(path).map_err(|source| CaptureError::Open {
            path: path.to_owned(),
            source,
        })?;
        Self::new(file, config)
    }
}

impl<R: Read> CaptureSource<R> {
    /// Reads a capture from its first byte. Reading is in large pieces: no buffering is needed
    /// around `reader`.
    pub fn new(reader: R, config: CaptureConfig) -> Result<Self, CaptureError> {
        Ok(Self {
            container: Container::open(reader)?,
            fragments: FragmentPool::new(),
            config,
            counters: CaptureCounters::default(),
            ended: false,
        })
    }

    /// What happened so far.
    pub fn counters(&self) -> CaptureCounters {
        self.counters
    }

    /// Ends the recording: what is still incomplete will stay so.
    fn end(&mut self) {
        self.ended = true;
        self.counters.fragment_lost += self.fragments.abandon_all();
    }

    /// The next datagram into `buffer`, or `None` if the frame held none that was asked for.
    fn next_frame(&mut self, buffer: &mut [u8]) -> Result<Option<Received>, CaptureError> {
        let frame = match self.container.next_frame() {
            Ok(frame) => frame,
            Err(stop) => {
                self.end();
                return match stop {
                    Stop::End => Ok(None),
                    Stop::Truncated => {
                        self.counters.truncated_capture = 1;
                        Ok(None)
                    }
                    Stop::Corrupt => {
                        self.counters.corrupt_capture = 1;
                        Ok(None)
                    }
                    Stop::Failed(source) => Err(CaptureError::Read {
                        frames: self.counters.frames,
                        source,
                    }),
                };
            }
        };
        self.counters.frames += 1;
        let stamp = frame.stamp;
        self.counters.fragment_lost += self.fragments.expire(stamp);
        let datagram = match link::datagram(&frame, &mut self.fragments) {
            Ok(datagram) => datagram,
            Err(reason) => {
                self.counters.count(reason);
                return Ok(None);
            }
        };
        let port = datagram.port;
        if !self.config.ports.is_empty() && !self.config.ports.contains(&port) {
            self.counters.other_port += 1;
            return Ok(None);
        }
        if self
            .config
            .source_address
            .is_some_and(|a| a != datagram.sender)
        {
            self.counters.foreign_sender += 1;
            return Ok(None);
        }
        let (len, capacity) = (datagram.payload.len(), buffer.len());
        let Some(target) = buffer.get_mut(..len) else {
            self.counters.oversize += 1;
            return Err(CaptureError::Oversize {
                port,
                len,
                capacity,
            });
        };
        target.copy_from_slice(datagram.payload);
        self.counters.delivered += 1;
        Ok(Some(Received { len, stamp, port }))
    }
}

impl<R: Read> PacketSource for CaptureSource<R> {
    type Error = CaptureError;

    fn receive(&mut self, buffer: &mut [u8], _: Stamp) -> Result<Option<Received>, CaptureError> {
        while !self.ended {
            if let Some(received) = self.next_frame(buffer)? {
                return Ok(Some(received));
            }
        }
        Ok(None)
    }

    fn at_end(&self) -> bool {
        self.ended
    }
}
