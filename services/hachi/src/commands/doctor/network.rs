//! Whether LiDAR packets can be received: ports and the kernel's buffer.

use std::fs;
use std::io::ErrorKind;
use std::net::{Ipv4Addr, UdpSocket};

use super::finding::Finding;

/// Ports by maker's default, and whether points come on them. PROTOCOLS of the sensors: VLP-16
/// manual (data 2368, position 8308); RS-Helios manual (MSOP 6699, DIFOP 7788).
const PORTS: [(u16, &str, bool); 4] = [
    (2368, "VLP-16 data", true),
    (8308, "VLP-16 position", false),
    (6699, "RS-Helios data (MSOP)", true),
    (7788, "RS-Helios device information (DIFOP)", false),
];

/// A VLP-16 in dual return mode sends this many packets a second (1,508: two for each of 754).
const PACKETS_PER_SECOND: f64 = 1508.0;
/// What one packet of 1,206 or 1,248 bytes takes of the kernel's buffer with its headers and
/// bookkeeping on Linux, bytes.
const BUFFER_PER_PACKET: f64 = 2304.0;
/// A busy machine may leave the receiver waiting for this long, ms: two turns at 10 Hz.
const PAUSE_MS: f64 = 200.0;
/// What is asked for instead, bytes: over a second of packets.
const BUFFER_ADVISED: u64 = 4 << 20;

pub(super) fn check() -> Vec<Finding> {
    let mut findings = vec![receive_buffer()];
    findings.extend(PORTS.map(|(port, use_, points)| udp_port(port, use_, points)));
    findings
}

fn receive_buffer() -> Finding {
    const NAME: &str = "UDP receive buffer";
    let text = fs::read_to_string("/proc/sys/net/core/rmem_max");
    let Some(bytes) = text.ok().and_then(|t| t.trim().parse::<u64>().ok()) else {
        return Finding::ok(NAME, "this system does not say");
    };
    // Linux sets aside twice what a program asks for.
    let milliseconds = 2.0 * bytes as f64 / BUFFER_PER_PACKET / PACKETS_PER_SECOND * 1e3;
    let what = format!(
        "net.core.rmem_max {bytes} bytes: {milliseconds:.0} ms of packets of a VLP-16 in dual return mode"
    );
    if milliseconds >= PAUSE_MS {
        Finding::ok(NAME, what)
    } else {
        Finding::warn(
            NAME,
            what,
            format!(
                "sudo sysctl -w net.core.rmem_max={BUFFER_ADVISED}, or packets are lost when the machine is busy"
            ),
        )
    }
}

fn udp_port(port: u16, use_: &str, points: bool) -> Finding {
    let name = "UDP port";
    let error = match UdpSocket::bind((Ipv4Addr::UNSPECIFIED, port)) {
        Ok(_) => return Finding::ok(name, format!("{port} can be opened: {use_}")),
        Err(error) => error,
    };
    let (what, next_step) = if error.kind() == ErrorKind::AddrInUse {
        (
            format!("{port} is held by another program: {use_}"),
            format!("find it with ss -ulpn 'sport = :{port}' and end it"),
        )
    } else {
        (
            format!("{port} can't be opened ({error}): {use_}"),
            "check the network of this machine and the rights of this user".to_owned(),
        )
    };
    if points {
        Finding::fail(name, what, next_step)
    } else {
        Finding::warn(name, what, next_step)
    }
}

#[cfg(test)]
mod tests {
    use super::super::finding::Level;
    use super::*;

    /// On a port that the system chose: the sensors' own may be in use by a real robot, or by
    /// another test.
    #[test]
    fn a_port_that_another_program_holds_is_named() {
        let held = UdpSocket::bind((Ipv4Addr::UNSPECIFIED, 0)).unwrap();
        let port = held.local_addr().unwrap().port();
        let finding = udp_port(port, "points", true);
        assert_eq!(finding.level, Level::Fail);
        assert_eq!(
            finding.what,
            format!("{port} is held by another program: points")
        );
        let next_step = finding.next_step.unwrap();
        assert!(next_step.contains(&port.to_string()), "{next_step}");
        assert_eq!(udp_port(port, "position", false).level, Level::Warn);
    }
}
