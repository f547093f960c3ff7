//! Writes what a simulation sends as a capture file, and the truth as a trajectory.
//!
//! The capture is a nanosecond pcap of Ethernet frames, as a recorder beside the real sensor would
//! have written it: any program that reads captures of the sensor reads this one.

use std::borrow::Cow;
use std::io::Write;
use std::time::Duration;

use etherparse::{EtherType, Ethernet2Header, IpNumber, Ipv4Header, UdpHeader};
use hachi_hal::{Pose, Stamp};
use pcap_file::pcap::{PcapHeader, PcapPacket, PcapWriter};
use pcap_file::{DataLink, Endianness, TsResolution};

use crate::simulation::{SimulatedPacket, Simulation};

/// Why a file could not be written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum CaptureError {
    /// The container refused it, or the disk.
    #[error("could not write the capture: {0}")]
    Capture(#[from] pcap_file::PcapError),
    /// The disk refused it.
    #[error("could not write the trajectory: {0}")]
    Trajectory(#[from] std::io::Error),
}

/// Ethernet, IPv4 and UDP headers, bytes.
const HEADERS: usize = 14 + 20 + 8;
/// The longest payload of the simulated sensors, bytes.
const LONGEST: usize = 1248;

/// Writes packets as frames of a pcap file.
pub struct CaptureWriter<W: Write> {
    writer: PcapWriter<W>,
    sensor: [u8; 4],
    frame: Vec<u8>,
}

impl<W: Write> CaptureWriter<W> {
    /// Begins a capture of the packets of `simulation`'s sensor. A buffered writer is quicker.
    ///
    /// # Errors
    /// If the file's header cannot be written.
    pub fn new(writer: W, simulation: &Simulation) -> Result<Self, CaptureError> {
        let header = PcapHeader {
            datalink: DataLink::ETHERNET,
            ts_resolution: TsResolution::NanoSecond,
            endianness: Endianness::Little,
            ..PcapHeader::default()
        };
        Ok(Self {
            writer: PcapWriter::with_header(writer, header)?,
            sensor: simulation.config().sensor.address(),
            frame: Vec::with_capacity(HEADERS + LONGEST),
        })
    }

    /// Writes one packet.
    ///
    /// # Errors
    /// If it cannot be written.
    pub fn write(&mut self, packet: &SimulatedPacket<'_>) -> Result<(), CaptureError> {
        let ethernet = Ethernet2Header {
            // The Velodyne range of addresses, and everyone: sensors broadcast out of the box.
            source: [0x60, 0x76, 0x88, 0, 0, 1],
            destination: [0xff; 6],
            ether_type: EtherType::IPV4,
        };
        let udp_length = (8 + packet.bytes.len().min(LONGEST)) as u16;
        let mut ip = Ipv4Header {
            total_len: 20 + udp_length,
            dont_fragment: true,
            time_to_live: 64,
            protocol: IpNumber::UDP,
            source: self.sensor,
            destination: [255; 4],
            ..Ipv4Header::default()
        };
        ip.header_checksum = ip.calc_header_checksum();
        let udp = UdpHeader {
            source_port: packet.port,
            destination_port: packet.port,
            length: udp_length,
            checksum: 0, // none, as the sensors send it
        };
        self.frame.clear();
        self.frame.extend_from_slice(&ethernet.to_bytes());
        self.frame.extend_from_slice(&ip.to_bytes());
        self.frame.extend_from_slice(&udp.to_bytes());
        self.frame.extend_from_slice(packet.bytes);
        self.writer.write_packet(&PcapPacket {
            timestamp: Duration::from_nanos(packet.stamp.as_nanos().max(0) as u64),
            orig_len: self.frame.len() as u32,
            data: Cow::Borrowed(&self.frame),
        })?;
        Ok(())
    }

    /// The writer; flush it.
    pub fn into_inner(self) -> W {
        self.writer.into_writer()
    }
}

/// Writes all packets that `simulation` has still to send as a pcap file; how many.
///
/// # Errors
/// If the file cannot be written; what was written until then stays readable.
pub fn write_pcap<W: Write>(simulation: &mut Simulation, writer: W) -> Result<u64, CaptureError> {
    let mut capture = CaptureWriter::new(writer, simulation)?;
    let mut packets = 0;
    while let Some(packet) = simulation.next_packet() {
        capture.write(&packet)?;
        packets += 1;
    }
    capture.into_inner().flush()?;
    Ok(packets)
}

/// Writes poses in TUM format: `t x y z qx qy qz qw`, seconds and metres, one a line.
///
/// # Errors
/// If the file cannot be written.
pub fn write_tum<W: Write>(
    poses: impl IntoIterator<Item = (Stamp, Pose)>,
    mut writer: W,
) -> Result<(), CaptureError> {
    for (stamp, pose) in poses {
        let (p, q) = (pose.translation.vector, pose.rotation.coords);
        writeln!(
            writer,
            "{stamp} {:.6} {:.6} {:.6} {:.9} {:.9} {:.9} {:.9}",
            p.x, p.y, p.z, q.x, q.y, q.z, q.w
        )?;
    }
    writer.flush()?;
    Ok(())
}
