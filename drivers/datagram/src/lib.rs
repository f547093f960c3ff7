//! UDP payloads with their arrival times, from a live socket or from a capture file.
//!
//! In: ports to listen on, or the bytes of a pcap or pcapng file. Out: [`hachi_hal::PacketSource`],
//! and a count of everything that was not delivered, by reason. What the payloads mean is for the
//! sensor's driver; no driver is named here.
//!
//! | module | holds |
//! |---|---|
//! | [`clock`] | [`SystemClock`]: the robot's clock, monotonic and set to UNIX time once |
//! | [`udp`] | [`UdpSource`]: live sockets with kernel receive stamps |
//! | [`capture`] | [`CaptureSource`]: capture files over any reader |

pub mod capture;
pub mod clock;
pub mod udp;

pub use capture::{CaptureConfig, CaptureCounters, CaptureError, CaptureSource};
pub use clock::SystemClock;
pub use udp::{UdpConfig, UdpCounters, UdpError, UdpSource};
