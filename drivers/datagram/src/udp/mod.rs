//! Live UDP: one source over several ports, with kernel receive stamps.
//!
//! In: which ports, on which address, from whom. Out: payloads as they arrive, stamped by the
//! kernel and moved onto the program's [`SystemClock`]. Elsewhere: what the payloads mean.
//!
//! Between two calls datagrams wait in the socket's buffer, which is made large; what does not fit
//! there the kernel drops and counts, and that count is reported.

mod socket;

use std::io;
use std::net::{IpAddr, Ipv4Addr, SocketAddr};

use hachi_hal::{Clock, DeviceError, FaultKind, PacketSource, Received, Stamp};

use crate::SystemClock;
use socket::{Datagram, Socket};

/// Receive buffer asked for each port. A dual-return VLP-16 sends 1.8 MB/s, a Helios 1.9 MB/s: two
/// seconds of a stalled program.
const RECEIVE_BUFFER_BYTES: usize = 4 << 20;

/// Most ports of one source. Sensors use two.
const MAX_PORTS: usize = 16;

/// What to listen to.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct UdpConfig {
    /// Local address; `0.0.0.0` hears all interfaces, broadcasts included.
    pub bind_address: IpAddr,
    /// Destination ports. Port 0 takes a free one, see [`UdpSource::local_ports`].
    pub ports: Vec<u16>,
    /// If set, datagrams from any other address are counted and left out.
    pub source_address: Option<IpAddr>,
    /// Bytes of receive buffer to ask for each port; the kernel may grant less.
    pub receive_buffer_bytes: usize,
}

impl UdpConfig {
    /// All interfaces, any sender.
    pub fn on_ports(ports: &[u16]) -> Self {
        Self {
            bind_address: IpAddr::V4(Ipv4Addr::UNSPECIFIED),
            ports: ports.to_vec(),
            source_address: None,
            receive_buffer_bytes: RECEIVE_BUFFER_BYTES,
        }
    }
}

/// What happened to datagrams.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct UdpCounters {
    /// Handed to the caller.
    pub delivered: u64,
    /// From another address than the configured one.
    pub foreign_sender: u64,
    /// Dropped by the kernel because the receive buffer was full. Known with the next datagram.
    pub kernel_drop: u64,
    /// Longer than the caller's buffer.
    pub oversize: u64,
    /// Delivered, but stamped when read: the kernel gave no stamp.
    pub without_kernel_stamp: u64,
}

impl UdpCounters {
    /// Reasons for which datagrams were not delivered, and how many.
    pub fn dropped(&self) -> impl Iterator<Item = (&'static str, u64)> {
        [
            ("foreign_sender", self.foreign_sender),
            ("kernel_drop", self.kernel_drop),
            ("oversize", self.oversize),
        ]
        .into_iter()
    }
}

/// What can go wrong with a live source.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum UdpError {
    /// No ports, or too many.
    #[error("{got} ports given; a source listens to 1 to {MAX_PORTS}")]
    Ports {
        /// How many.
        got: usize,
    },
    /// The address cannot be listened to: in use, not this computer's, or not allowed.
    #[error("cannot listen on udp {address}: {source}")]
    Bind {
        /// The address.
        address: SocketAddr,
        /// What the system said.
        source: io::Error,
    },
    /// A socket option was refused.
    #[error("cannot set {option} on udp port {port}: {source}")]
    Option {
        /// Its name.
        option: &'static str,
        /// The port.
        port: u16,
        /// What the system said.
        source: io::Error,
    },
    /// Receiving failed.
    #[error("cannot receive from udp port {port}: {source}")]
    Receive {
        /// The port.
        port: u16,
        /// What the system said.
        source: io::Error,
    },
    /// Sending failed.
    #[error("cannot send to udp {to}: {source}")]
    Send {
        /// Where to.
        to: SocketAddr,
        /// What the system said.
        source: io::Error,
    },
    /// Waiting failed.
    #[error("cannot wait for datagrams: {source}")]
    Wait {
        /// What the system said.
        source: io::Error,
    },
    /// The datagram is longer than the caller's buffer. It is gone; the next one can be read.
    #[error("a datagram of {len} bytes on udp port {port} does not fit in {capacity}")]
    Oversize {
        /// The port.
        port: u16,
        /// Bytes of the datagram.
        len: usize,
        /// Bytes of the buffer.
        capacity: usize,
    },
}

impl DeviceError for UdpError {
    fn kind(&self) -> FaultKind {
        match self {
            Self::Ports { .. } | Self::Bind { .. } => FaultKind::FixConfig,
            Self::Option { .. } | Self::Wait { .. } => FaultKind::GiveUp,
            Self::Receive { .. } => FaultKind::Reopen,
            Self::Oversize { .. } | Self::Send { .. } => FaultKind::ReadAgain,
        }
    }
}

/// A live source over one or more UDP ports.
#[derive(Debug)]
pub struct UdpSource {
    sockets: Vec<Socket>,
    waiting: Vec<libc::pollfd>,
    /// Which socket to look at first, so that a busy port does not starve a quiet one.
    turn: usize,
    source_address: Option<IpAddr>,
    clock: SystemClock,
    counters: UdpCounters,
}

impl UdpSource {
    /// Opens the ports.
    pub fn open(config: &UdpConfig, clock: SystemClock) -> Result<Self, UdpError> {
        let got = config.ports.len();
        if !(1..=MAX_PORTS).contains(&got) {
            return Err(UdpError::Ports { got });
        }
        let mut sockets = Vec::with_capacity(got);
        for &port in &config.ports {
            let address = SocketAddr::new(config.bind_address, port);
            sockets.push(Socket::bind(address, config.receive_buffer_bytes)?);
        }
        Ok(Self {
            waiting: sockets.iter().map(Socket::poll_entry).collect(),
            sockets,
            turn: 0,
            source_address: config.source_address.map(|address| address.to_canonical()),
            clock,
            counters: UdpCounters::default(),
        })
    }

    /// What happened so far.
    pub fn counters(&self) -> UdpCounters {
        self.counters
    }

    /// The ports that are listened to, in the order of the configuration.
    pub fn local_ports(&self) -> Vec<u16> {
        self.sockets.iter().map(|socket| socket.port).collect()
    }

    /// The smallest receive buffer that the kernel granted, in its own accounting, which counts its
    /// overhead as well.
    pub fn granted_buffer_bytes(&self) -> usize {
        let granted = self.sockets.iter().map(|socket| socket.granted_bytes);
        granted.min().unwrap_or(0)
    }

    /// The clock of the stamps, on which deadlines count.
    pub fn clock(&self) -> SystemClock {
        self.clock
    }

    /// Sends a datagram from the first port, so that who answers it is heard by `receive`.
    ///
    /// # Errors
    /// The system does not take it: there is no way to the address, or its buffer is full.
    pub fn send(&self, payload: &[u8], to: SocketAddr) -> Result<(), UdpError> {
        // A source has at least one port.
        self.sockets[0].send(payload, to)
    }

    /// Looks once at every socket, beginning with the one whose turn it is.
    fn poll_sockets(&mut self, buffer: &mut [u8]) -> Result<Option<Received>, UdpError> {
        for _ in 0..self.sockets.len() {
            let index = self.turn;
            self.turn = (index + 1) % self.sockets.len();
            if let Some(datagram) = self.sockets[index].receive(buffer)? {
                let port = self.sockets[index].port;
                return self.accept(datagram, port, buffer.len());
            }
        }
        Ok(None)
    }

    fn accept(
        &mut self,
        datagram: Datagram,
        port: u16,
        capacity: usize,
    ) -> Result<Option<Received>, UdpError> {
        self.counters.kernel_drop += u64::from(datagram.newly_dropped);
        let expected = self.source_address;
        if expected.is_some_and(|address| datagram.sender != Some(address)) {
            self.counters.foreign_sender += 1;
            return Ok(None);
        }
        let len = datagram.len;
        if len > capacity {
            self.counters.oversize += 1;
            return Err(UdpError::Oversize {
                port,
                len,
                capacity,
            });
        }
        self.counters.delivered += 1;
        let stamp = match datagram.unix_ns {
            Some(unix_ns) => self.clock.stamp_of_unix(unix_ns),
            None => {
                self.counters.without_kernel_stamp += 1;
                self.clock.now()
            }
        };
        Ok(Some(Received { len, stamp, port }))
    }
}

impl PacketSource for UdpSource {
    type Error = UdpError;

    fn receive(
        &mut self,
        buffer: &mut [u8],
        deadline: Stamp,
    ) -> Result<Option<Received>, UdpError> {
        loop {
            let refused = self.counters.foreign_sender;
            if let Some(received) = self.poll_sockets(buffer)? {
                return Ok(Some(received));
            }
            let left = self.clock.until(deadline);
            if left.is_zero() {
                return Ok(None);
            }
            // After a stranger's datagram another one may be there already.
            if self.counters.foreign_sender == refused {
                socket::wait(&mut self.waiting, left)?;
            }
        }
    }

    fn at_end(&self) -> bool {
        false
    }
}
