//! Captures of every kind that users bring, built here from `pcap-file`'s writers and
//! `etherparse`'s packet builder or byte by byte, and real ones where `HACHI_DATA` is set.
#![allow(clippy::print_stderr, reason = "a test without its recordings says so")]

use std::path::PathBuf;

use etherparse::{IpFragOffset, IpNumber, Ipv4Header, PacketBuilder, VlanId};
use hachi_datagram::{CaptureConfig, CaptureCounters, CaptureError, CaptureSource, SystemClock};
use hachi_hal::conformance::{check_packet_source, check_refuses_to_cut};
use hachi_hal::{PacketSource, Stamp};
use pcap_file::pcap::{PcapHeader, PcapPacket, PcapWriter};
use pcap_file::{DataLink, Endianness, TsResolution};

const PORT: u16 = 2368;
const SENSOR: [u8; 4] = [192, 168, 1, 201];

#[derive(Debug, PartialEq)]
struct Payload {
    bytes: Vec<u8>,
    stamp_ns: i64,
    port: u16,
}

fn read_with(config: CaptureConfig, capture: &[u8]) -> (Vec<Payload>, CaptureCounters) {
    let mut source = CaptureSource::new(capture, config).unwrap();
    let mut buffer = [0; 65_536];
    let mut payloads = Vec::new();
    while let Some(received) = source.receive(&mut buffer, Stamp::default()).unwrap() {
        payloads.push(Payload {
            bytes: buffer[..received.len].to_vec(),
            stamp_ns: received.stamp.as_nanos(),
            port: received.port,
        });
    }
    assert!(source.at_end());
    (payloads, source.counters())
}

fn read(capture: &[u8]) -> (Vec<Payload>, CaptureCounters) {
    read_with(CaptureConfig::default(), capture)
}

fn drops(counters: &CaptureCounters) -> Vec<(&'static str, u64)> {
    counters.dropped().filter(|(_, count)| *count > 0).collect()
}

/// An Ethernet frame with one UDP datagram.
fn frame(port: u16, payload: &[u8]) -> Vec<u8> {
    let builder = PacketBuilder::ethernet2([1; 6], [2; 6])
        .ipv4(SENSOR, [255; 4], 64)
        .udp(PORT, port);
    let mut bytes = Vec::new();
    builder.write(&mut bytes, payload).unwrap();
    bytes
}

fn pcap_header(endianness: Endianness, resolution: TsResolution, link: u32) -> PcapHeader {
    PcapHeader {
        endianness,
        ts_resolution: resolution,
        datalink: DataLink::from(link),
        ..PcapHeader::default()
    }
}

/// A pcap of frames, one a millisecond from second 100 on.
fn pcap_with(header: PcapHeader, frames: &[Vec<u8>]) -> Vec<u8> {
    let mut bytes = Vec::new();
    let mut writer = PcapWriter::with_header(&mut bytes, header).unwrap();
    for (n, frame) in frames.iter().enumerate() {
        let stamp = std::time::Duration::from_millis(100_000 + n as u64);
        let packet = PcapPacket::new(stamp, frame.len() as u32, frame);
        writer.write_packet(&packet).unwrap();
    }
    bytes
}

fn pcap(link: u32, frames: &[Vec<u8>]) -> Vec<u8> {
    pcap_with(
        pcap_header(Endianness::Little, TsResolution::NanoSecond, link),
        frames,
    )
}

/// The one payload of a capture with one frame.
fn payload_of(link: u32, frame: Vec<u8>) -> Vec<u8> {
    let (mut payloads, counters) = read(&pcap(link, &[frame]));
    assert_eq!(drops(&counters), []);
    payloads.remove(0).bytes
}

#[test]
fn both_byte_orders_and_both_resolutions_of_pcap_are_read() {
    for endianness in [Endianness::Little, Endianness::Big] {
        for resolution in [TsResolution::MicroSecond, TsResolution::NanoSecond] {
            let frames = [frame(PORT, &[1, 2, 3]), frame(8308, &[4])];
            let (payloads, counters) =
                read(&pcap_with(pcap_header(endianness, resolution, 1), &frames));
            let expected = [
                Payload {
                    bytes: vec![1, 2, 3],
                    stamp_ns: 100_000_000_000,
                    port: PORT,
                },
                Payload {
                    bytes: vec![4],
                    stamp_ns: 100_001_000_000,
                    port: 8308,
                },
            ];
            assert_eq!(payloads, expected);
            assert_eq!((counters.frames, counters.delivered), (2, 2));
        }
    }
}

/// A pcapng block of either byte order.
fn block(big: bool, kind: u32, body: &[u8]) -> Vec<u8> {
    let word = |value: u32| {
        if big {
            value.to_be_bytes()
        } else {
            value.to_le_bytes()
        }
    };
    let mut padded = body.to_vec();
    padded.resize(body.len().next_multiple_of(4), 0);
    let len = word(12 + padded.len() as u32);
    [&word(kind)[..], &len, &padded, &len].concat()
}

/// A section with one Ethernet interface whose stamps count `resolution` (option 9), and packets at
/// the given ticks.
fn pcapng(big: bool, resolution: Option<u8>, packets: &[(u64, Vec<u8>)]) -> Vec<u8> {
    let word = |value: u32| {
        if big {
            value.to_be_bytes()
        } else {
            value.to_le_bytes()
        }
    };
    let half = |value: u16| {
        if big {
            value.to_be_bytes()
        } else {
            value.to_le_bytes()
        }
    };
    let mut section = word(0x1A2B_3C4D).to_vec();
    section.extend(half(1));
    section.extend(half(0));
    section.extend([0xFF; 8]);
    let mut bytes = block(big, 0x0A0D_0D0A, &section);
    let mut interface = [&half(1)[..], &half(0), &word(0)].concat();
    if let Some(resolution) = resolution {
        // An interface name that is not UTF-8 comes first, as Windows writes them.
        interface.extend([&half(2)[..], &half(3), &[0xE9, 0x74, 0xE9, 0]].concat());
        interface.extend([&half(9)[..], &half(1), &[resolution, 0, 0, 0]].concat());
        interface.extend([half(0), half(0)].concat());
    }
    bytes.extend(block(big, 1, &interface));
    for (ticks, frame) in packets {
        let body = [
            &word(0)[..],
            &word((ticks >> 32) as u32),
            &word(*ticks as u32),
            &word(frame.len() as u32),
            &word(frame.len() as u32),
            frame,
        ];
        bytes.extend(block(big, 6, &body.concat()));
    }
    bytes
}

#[test]
fn pcapng_stamps_follow_the_resolution_of_their_interface() {
    let second: u64 = 1_700_000_000;
    for big in [false, true] {
        for (resolution, ticks) in [
            (None, second * 1_000_000 + 5),
            (Some(6), second * 1_000_000 + 5),
            (Some(9), second * 1_000_000_000 + 5_000),
            (Some(3), second * 1_000),
            // Powers of two: 2^-20 s.
            (Some(0x80 | 20), second << 20),
        ] {
            let capture = pcapng(big, resolution, &[(ticks, frame(PORT, &[7]))]);
            let (payloads, counters) = read(&capture);
            assert_eq!(drops(&counters), []);
            let after_ns = payloads[0].stamp_ns - second as i64 * 1_000_000_000;
            let expected = match resolution {
                Some(3 | 0x94) => 0,
                _ => 5_000,
            };
            assert_eq!(after_ns, expected, "{resolution:?}");
        }
    }
}

#[test]
fn simple_packets_and_sections_of_both_byte_orders_in_one_file_are_read() {
    let mut capture = pcapng(true, None, &[(1, frame(PORT, &[1]))]);
    capture.extend(pcapng(false, Some(9), &[(2_000, frame(PORT, &[2]))]));
    let datagram = frame(PORT, &[3, 3]);
    let body = [&(datagram.len() as u32).to_le_bytes()[..], &datagram].concat();
    capture.extend(block(false, 3, &body));
    let (payloads, _) = read(&capture);
    let bytes: Vec<_> = payloads.iter().map(|p| p.bytes.clone()).collect();
    assert_eq!(bytes, [vec![1], vec![2], vec![3, 3]]);
    let stamps: Vec<_> = payloads.iter().map(|p| p.stamp_ns).collect();
    assert_eq!(stamps, [1_000, 2_000, 2_000]);
}

#[test]
fn tagged_frames_are_read_through_one_and_two_tags() {
    let vlan = |id| VlanId::try_new(id).unwrap();
    let mut single = Vec::new();
    PacketBuilder::ethernet2([1; 6], [2; 6])
        .single_vlan(vlan(5))
        .ipv4(SENSOR, [255; 4], 64)
        .udp(1, PORT)
        .write(&mut single, &[9])
        .unwrap();
    assert_eq!(payload_of(1, single), [9]);
    let mut double = Vec::new();
    PacketBuilder::ethernet2([1; 6], [2; 6])
        .double_vlan(vlan(5), vlan(6))
        .ipv4(SENSOR, [255; 4], 64)
        .udp(1, PORT)
        .write(&mut double, &[8])
        .unwrap();
    assert_eq!(payload_of(1, double), [8]);
}

#[test]
fn cooked_raw_and_loopback_captures_are_read() {
    let ip = frame(PORT, &[5, 6])[14..].to_vec();
    // LINUX_SLL: type, ARPHRD, address length, address, protocol.
    let cooked = [&[0, 0, 0, 1, 0, 6, 1, 2, 3, 4, 5, 6, 0, 0, 8, 0][..], &ip].concat();
    assert_eq!(payload_of(113, cooked), [5, 6]);
    // LINUX_SLL2: protocol, reserved, interface, ARPHRD, type, address length, address.
    let header = [8, 0, 0, 0, 0, 0, 0, 2, 0, 1, 0, 6, 1, 2, 3, 4, 5, 6, 0, 0];
    assert_eq!(payload_of(276, [&header[..], &ip].concat()), [5, 6]);
    for raw in [12, 14, 101, 228] {
        assert_eq!(payload_of(raw, ip.clone()), [5, 6]);
    }
    for family in [[2, 0, 0, 0], [0, 0, 0, 2]] {
        assert_eq!(payload_of(0, [&family[..], &ip].concat()), [5, 6]);
    }
    assert_eq!(payload_of(108, [&[0, 0, 0, 2][..], &ip].concat()), [5, 6]);
}

#[test]
fn ipv6_datagrams_are_read() {
    let mut bytes = Vec::new();
    PacketBuilder::ethernet2([1; 6], [2; 6])
        .ipv6([1; 16], [2; 16], 64)
        .udp(1, PORT)
        .write(&mut bytes, &[4, 4])
        .unwrap();
    assert_eq!(payload_of(1, bytes), [4, 4]);
}

/// The datagram of `payload` as IPv4 fragments with at most `size` bytes each, on Ethernet.
fn fragments(payload: &[u8], size: usize, identification: u16) -> Vec<Vec<u8>> {
    let whole = frame(PORT, payload)[34..].to_vec();
    let parts = whole.chunks(size).enumerate();
    parts
        .map(|(n, part)| {
            let mut header =
                Ipv4Header::new(part.len() as u16, 64, IpNumber::UDP, SENSOR, [255; 4]).unwrap();
            header.identification = identification;
            header.more_fragments = (n + 1) * size < whole.len();
            header.fragment_offset = IpFragOffset::try_new((n * size / 8) as u16).unwrap();
            let mut bytes = vec![1; 12];
            bytes.extend([8, 0]);
            header.write(&mut bytes).unwrap();
            bytes.extend(part);
            bytes
        })
        .collect()
}

#[test]
fn fragments_are_put_together_and_a_missing_one_is_counted() {
    let payload: Vec<u8> = (0..1_206).map(|n| n as u8).collect();
    let mut parts = fragments(&payload, 512, 7);
    assert_eq!(parts.len(), 3);
    parts.swap(0, 2);
    let mut incomplete = fragments(&payload, 512, 8);
    incomplete.remove(1);
    let frames = [parts, incomplete, vec![frame(PORT, &[1])]].concat();
    let (payloads, counters) = read(&pcap(1, &frames));
    assert_eq!(payloads.len(), 2);
    assert_eq!(payloads[0].bytes, payload);
    // The datagram arrives with its last missing part.
    assert_eq!(payloads[0].stamp_ns, 100_002_000_000);
    assert_eq!(drops(&counters), [("fragment_lost", 1)]);
}

#[test]
fn ipv6_fragments_are_put_together() {
    let payload = [7; 40];
    let mut whole = Vec::new();
    PacketBuilder::ethernet2([1; 6], [2; 6])
        .ipv6([1; 16], [2; 16], 64)
        .udp(1, PORT)
        .write(&mut whole, &payload)
        .unwrap();
    let udp = &whole[54..];
    let part = |start: usize, end: usize| {
        let more = u16::from(end < udp.len());
        let mut bytes = whole[..54].to_vec();
        bytes[18..20].copy_from_slice(&((8 + end - start) as u16).to_be_bytes());
        bytes[20] = 44;
        let place = (start as u16) | more;
        bytes.extend([17, 0]);
        bytes.extend(place.to_be_bytes());
        bytes.extend([0, 0, 0, 9]);
        bytes.extend(&udp[start..end]);
        bytes
    };
    let (payloads, counters) = read(&pcap(1, &[part(24, 48), part(0, 24)]));
    assert_eq!(payloads[0].bytes, payload);
    assert_eq!(drops(&counters), []);
}

/// The last header says that a hop-by-hop header follows, where none may stand and no byte is left.
#[test]
fn ipv6_extension_headers_that_end_early_are_malformed() {
    let mut bytes = Vec::new();
    PacketBuilder::ethernet2([1; 6], [2; 6])
        .ipv6([1; 16], [2; 16], 64)
        .udp(1, PORT)
        .write(&mut bytes, &[])
        .unwrap();
    for (first, second) in [(60, 0), (43, 60), (60, 44), (60, 51), (0, 0)] {
        bytes[20] = first;
        bytes[54..].copy_from_slice(&[second, 0, 0, 0, 0, 0, 0, 0]);
        let (payloads, counters) = read(&pcap(1, &[bytes.clone()]));
        assert!(payloads.is_empty());
        assert_eq!(drops(&counters), [("malformed", 1)], "{first}, {second}");
    }
}

#[test]
fn what_is_not_delivered_is_counted_by_reason() {
    let mut arp = vec![0xFF; 12];
    arp.extend([8, 6]);
    arp.extend([0; 28]);
    let mut tcp = Vec::new();
    PacketBuilder::ethernet2([1; 6], [2; 6])
        .ipv4(SENSOR, [1; 4], 64)
        .tcp(1, 2, 3, 4)
        .write(&mut tcp, &[1])
        .unwrap();
    let mut short = frame(PORT, &[1; 100]);
    short.truncate(80);
    let frames = [
        arp,
        tcp,
        frame(9_999, &[1]),
        short,
        vec![1, 2, 3],
        frame(PORT, &[2]),
    ];
    let (payloads, counters) = read_with(CaptureConfig::on_ports(&[PORT]), &pcap(1, &frames));
    assert_eq!(payloads.len(), 1);
    let expected = [
        ("not_ip", 1),
        ("not_udp", 1),
        ("other_port", 1),
        ("truncated_frame", 2),
    ];
    assert_eq!(drops(&counters), expected);
    let (_, counters) = read(&pcap(147, &frames[5..]));
    assert_eq!(drops(&counters), [("unsupported_link", 1)]);
}

#[test]
fn a_configured_sender_keeps_others_out() {
    let config = CaptureConfig {
        source_address: Some([10, 0, 0, 1].into()),
        ..CaptureConfig::default()
    };
    let (payloads, counters) = read_with(config, &pcap(1, &[frame(PORT, &[2])]));
    assert_eq!(payloads, []);
    assert_eq!(drops(&counters), [("foreign_sender", 1)]);
}

#[test]
fn packets_cut_by_the_snap_length_are_counted_as_such() {
    let whole = frame(PORT, &[1; 1_206]);
    let mut bytes = pcap(1, &[]);
    for value in [100_u32, 0, 96, whole.len() as u32] {
        bytes.extend(value.to_le_bytes());
    }
    bytes.extend(&whole[..96]);
    let (payloads, counters) = read(&bytes);
    assert_eq!(payloads, []);
    assert_eq!(drops(&counters), [("cut_by_snaplen", 1)]);
}

#[test]
fn a_capture_cut_anywhere_delivers_what_is_whole() {
    let capture = pcap(
        1,
        &[frame(PORT, &[1]), frame(PORT, &[2]), frame(PORT, &[3])],
    );
    let frame_len = 16 + frame(PORT, &[1]).len();
    for len in 24..capture.len() {
        let (payloads, counters) = read(&capture[..len]);
        assert_eq!(payloads.len(), (len - 24) / frame_len);
        let cut = u64::from(!(len - 24).is_multiple_of(frame_len));
        assert_eq!(counters.truncated_capture, cut, "{len}");
        assert_eq!(counters.corrupt_capture, 0);
    }
}

#[test]
fn nonsense_in_the_middle_ends_the_capture_and_is_said() {
    let mut capture = pcapng(
        false,
        None,
        &[(1, frame(PORT, &[1])), (2, frame(PORT, &[2]))],
    );
    let second = capture.len() - 12;
    capture[second..].fill(0xAB);
    let (payloads, counters) = read(&capture);
    assert_eq!(payloads.len(), 1);
    assert_eq!(drops(&counters), [("corrupt_capture", 1)]);
}

#[test]
fn a_length_that_promises_gigabytes_costs_no_memory() {
    let mut capture = pcap(1, &[frame(PORT, &[1])]);
    for value in [100_u32, 0, u32::MAX, u32::MAX] {
        capture.extend(value.to_le_bytes());
    }
    capture.extend([0; 1_000]);
    let (payloads, counters) = read(&capture);
    assert_eq!(payloads.len(), 1);
    assert_eq!(drops(&counters), [("truncated_capture", 1)]);
}

#[test]
fn what_is_no_capture_is_refused_with_its_first_bytes() {
    for (start, word) in [
        (&b""[..], "empty"),
        (b"\x1f\x8b\x08", "gzip"),
        (b"PLY\n", "50, 4c"),
    ] {
        let error = CaptureSource::new(start, CaptureConfig::default()).unwrap_err();
        assert!(matches!(error, CaptureError::NotACapture { .. }));
        assert!(error.to_string().contains(word), "{error}");
    }
    let missing = CaptureSource::open("no/such.pcap", CaptureConfig::default()).unwrap_err();
    assert!(missing.to_string().contains("no/such.pcap"), "{missing}");
}

#[test]
fn a_capture_keeps_the_promise_of_a_packet_source() {
    let capture = pcap(1, &[frame(PORT, &[1; 10]), frame(PORT, &[2; 3])]);
    let clock = SystemClock::new();
    let mut source = CaptureSource::new(&capture[..], CaptureConfig::default()).unwrap();
    let refused = check_refuses_to_cut(&mut source, &mut [0; 9], 10, Stamp::default()).unwrap();
    assert!(refused.is_some());
    let tally = check_packet_source(&mut source, &clock, &mut [0; 9], 5, 0).unwrap();
    assert_eq!((tally.items, tally.contents, tally.faults), (1, 3, 0));
    assert_eq!(source.counters().oversize, 1);
}

fn recording(name: &str) -> Option<PathBuf> {
    let Ok(data) = std::env::var("HACHI_DATA") else {
        eprintln!("skipped: HACHI_DATA is not set, {name} not read");
        return None;
    };
    Some(PathBuf::from(data).join(name))
}

#[test]
fn a_real_capture_of_two_ports_is_read_whole() {
    let Some(path) = recording("velodyne/vlp16_gps.pcap") else {
        return;
    };
    let (payloads, counters) = read(&std::fs::read(path).unwrap());
    let on = |port, len| {
        let right = |p: &&Payload| p.port == port && p.bytes.len() == len;
        payloads.iter().filter(right).count()
    };
    assert_eq!((on(2368, 1206), on(8308, 512)), (293, 57));
    assert_eq!(drops(&counters), []);
    // As the file's first record has it: 1453364282 s, 708714 µs.
    assert_eq!(payloads[0].stamp_ns, 1_453_364_282_708_714_000);
}
