//! Turns from scripted and live packets: what is delivered, what is counted, and what it costs.

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;
use std::net::{IpAddr, Ipv4Addr, UdpSocket};
use std::time::{Duration, Instant};

use hachi_datagram::{CaptureConfig, CaptureSource, SystemClock, UdpConfig, UdpSource};
use hachi_hal::conformance::{ScanPromise, check_lidar_scans};
use hachi_hal::mock::{MockPackets, Packet, Step};
use hachi_hal::{
    Clock, Completeness, FaultKind, LidarScans, PacketSource, Point, Received, ScanHeader, Stamp,
};
use hachi_velodyne::encode::{Echo, Firing, PacketWriter, position_packet};
use hachi_velodyne::packet::{DATA_LEN, Model, PositionPacket, Pps, ReturnMode};
use hachi_velodyne::{VelodyneConfig, VelodyneCounters, VelodyneScans};

/// Counts the heap allocations of the thread that asks for it.
struct Counting;

thread_local! {
    static ALLOCATIONS: Cell<u64> = const { Cell::new(0) };
}

// SAFETY: hands everything to the system's allocator unchanged; the counter is a thread-local that
// needs no allocation.
#[allow(unsafe_code)]
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        ALLOCATIONS.with(|count| count.set(count.get() + 1));
        // SAFETY: the caller's promise is passed on.
        unsafe { System.alloc(layout) }
    }
    unsafe fn dealloc(&self, block: *mut u8, layout: Layout) {
        // SAFETY: as above.
        unsafe { System.dealloc(block, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

const NEVER: Stamp = Stamp::from_nanos(i64::MAX);
/// Where the scripted sensor's clock begins on the receiver's, ns.
const EPOCH_NS: i64 = 1_700_000_000_000_000_000;
const PERIOD_NS: i64 = 1_327_104;

/// Packets of a rotor at 600 rpm in a round room of 5 m, from 0° and the given hour stamp on; each
/// arrives when its last firing is done.
fn room(packets: usize, hour_us: u64, mode: ReturnMode) -> Vec<(Vec<u8>, Stamp)> {
    let mut writer = PacketWriter::new(mode, Model::Vlp16);
    let echoes = [Echo::from_metres(5.0, 40); 16];
    let mut written = Vec::new();
    for firing in 0_u64.. {
        if written.len() == packets {
            break;
        }
        let elapsed_us = firing as f64 * 55.296;
        let packet = writer.push(&Firing {
            azimuth_deg: elapsed_us * 3_600e-6,
            time_us: hour_us + elapsed_us as u64,
            echoes,
            strongest: echoes,
        });
        if let Some(packet) = packet {
            let arrival_ns = (elapsed_us + 55.296) * 1e3;
            written.push((
                packet.to_vec(),
                Stamp::from_nanos(EPOCH_NS + arrival_ns as i64),
            ));
        }
    }
    written
}

fn single(packets: usize) -> Vec<(Vec<u8>, Stamp)> {
    room(packets, 0, ReturnMode::Strongest)
}

fn script(packets: &[(Vec<u8>, Stamp)]) -> Vec<Step<Packet<'_>>> {
    packets
        .iter()
        .map(|(payload, stamp)| {
            Step::Batch(Packet {
                payload,
                stamp: *stamp,
                port: 2368,
            })
        })
        .collect()
}

type Scans = Vec<(ScanHeader, Vec<Point>)>;

/// All scans of a script, held to the promise of `LidarScans`.
fn run(script: &[Step<Packet<'_>>]) -> (Scans, VelodyneCounters) {
    let mut lidar = VelodyneScans::new(MockPackets::script(script), VelodyneConfig::default());
    let (mut scans, mut promise) = (Vec::new(), ScanPromise::default());
    let mut points = Vec::new();
    while !lidar.at_end() {
        // Scripted faults and silences are passed over.
        if let Ok(Some(header)) = lidar.read_scan(&mut points, NEVER) {
            promise.check(&header, &points).unwrap();
            scans.push((header, points.clone()));
        }
    }
    lidar.source().assert_done();
    (scans, lidar.counters())
}

fn drops(counters: &VelodyneCounters) -> Vec<(&'static str, u64)> {
    counters.dropped().filter(|(_, count)| *count > 0).collect()
}

#[test]
fn a_whole_turn_of_a_round_room_has_every_shot_at_its_time() {
    let packets = single(240);
    let (scans, counters) = run(&script(&packets));
    assert_eq!(drops(&counters), []);
    let (header, points) = &scans[0];
    assert_eq!(header.completeness, Completeness::Complete);
    // 0.1 s hold 1808.4 firings.
    assert!(
        (1_808 * 16..1_810 * 16).contains(&points.len()),
        "{}",
        points.len()
    );
    assert_eq!(header.start.as_nanos(), EPOCH_NS);
    let duration_ns = header.end.nanos_since(header.start);
    assert!((duration_ns - 100_000_000).abs() < 100_000, "{duration_ns}");
    let next = &scans[1].0;
    assert!(next.start > header.end);
    for point in points {
        let shot_deg = f64::from(point.time_offset_ns) * 3_600e-9;
        // The azimuth is rounded to 0.01° at each block.
        assert!(
            (f64::from(point.azimuth_deg) - shot_deg).abs() < 0.02,
            "{point:?}"
        );
    }
}

#[test]
fn faults_are_passed_on_and_cost_nothing_but_themselves() {
    let packets = single(160);
    let mut steps = script(&packets);
    steps.insert(80, Step::Fault(FaultKind::ReadAgain));
    steps.insert(20, Step::Nothing);
    let (scans, counters) = run(&steps);
    assert_eq!(drops(&counters), []);
    assert_eq!(scans.len(), 3);
    assert_eq!(scans[0].1.len(), run(&script(&packets)).0[0].1.len());
}

#[test]
fn lost_repeated_and_overtaken_packets_are_counted() {
    let packets = single(230);
    let mut order: Vec<usize> = (0..230).collect();
    order.drain(100..103);
    order.insert(50, 49);
    order.swap(20, 21);
    let chosen: Vec<_> = order.iter().map(|&n| packets[n].clone()).collect();
    let (scans, counters) = run(&script(&chosen));
    let expected = [("lost", 3), ("duplicate", 1), ("out_of_order", 1)];
    assert_eq!(drops(&counters), expected);
    assert_eq!(scans[0].0.completeness, Completeness::Complete);
}

#[test]
fn a_corrupt_packet_costs_itself_and_is_named() {
    let packets = single(150);
    let damage: [(usize, &str); 5] = [
        (0, "block_flag"),
        (3, "azimuth"),
        (402, "azimuth_step"),
        (1_204, "return_mode"),
        (1_205, "wrong_product"),
    ];
    for (at, reason) in damage {
        let mut packets = packets.clone();
        packets[40].0[at] ^= 0xF8;
        let (scans, counters) = run(&script(&packets));
        // It is missing from the stream as well.
        assert_eq!(drops(&counters), [("lost", 1), (reason, 1)], "{at}");
        assert_eq!(scans.len(), 2);
        assert_eq!(scans[0].0.completeness, Completeness::Complete);
    }
}

#[test]
fn foreign_sizes_and_stopped_rotors_are_counted() {
    let packets = single(80);
    let mut steps = script(&packets);
    let stranger = [7; 33];
    let foreign = Step::Batch(Packet {
        payload: &stranger,
        stamp: packets[0].1,
        port: 2368,
    });
    let mut still = packets[10].0.clone();
    for block in 0..12 {
        still[100 * block + 2] = 5;
        still[100 * block + 3] = 5;
    }
    steps[10] = Step::Batch(Packet {
        payload: &still,
        stamp: packets[10].1,
        port: 2368,
    });
    steps.insert(3, foreign);
    let (_, counters) = run(&steps);
    assert_eq!(
        drops(&counters),
        [("lost", 1), ("wrong_size", 1), ("rotor_stopped", 1)]
    );
}

#[test]
fn turns_go_on_over_the_top_of_the_hour() {
    let packets = room(160, 3_599_900_000, ReturnMode::Strongest);
    let (scans, counters) = run(&script(&packets));
    assert_eq!(drops(&counters), []);
    let kinds: Vec<_> = scans.iter().map(|(h, _)| h.completeness).collect();
    assert_eq!(kinds[..2], [Completeness::Complete; 2]);
    let sensor_ns: Vec<_> = scans
        .iter()
        .map(|(h, _)| h.sensor_start_ns.unwrap())
        .collect();
    assert!(sensor_ns.is_sorted() && sensor_ns[1] > 3_599_999_000_000);
}

#[test]
fn a_sensor_that_restarts_ends_the_turn_and_begins_another() {
    let mut packets = single(100);
    let mut again = room(100, 1_500_000_000, ReturnMode::Strongest);
    for (_, stamp) in &mut again {
        *stamp = *stamp + 100 * PERIOD_NS;
    }
    packets.extend(again);
    let (scans, counters) = run(&script(&packets));
    assert_eq!(drops(&counters), [("stamp_jump", 1)]);
    let kinds: Vec<_> = scans.iter().map(|(h, _)| h.completeness).collect();
    let expected = [
        Completeness::Complete,
        Completeness::PartialLast,
        Completeness::PartialFirst,
        Completeness::PartialLast,
    ];
    assert_eq!(kinds, expected);
}

#[test]
fn dual_return_packets_make_turns_of_the_same_length() {
    let packets = room(320, 0, ReturnMode::Dual);
    let (scans, counters) = run(&script(&packets));
    assert_eq!(drops(&counters), []);
    // Both returns are the same, so one of each pair is left out.
    assert!((1_808 * 16..1_810 * 16).contains(&scans[0].1.len()));
}

#[test]
fn position_packets_between_data_packets_are_read() {
    let packets = single(20);
    let sentence = b"$GPRMC,120000.00,A,4807.038,N,01131.000,E,000.0,000.0,221126,,,A*5B\r\n";
    let position = position_packet(&PositionPacket::new(77, Pps::Locked, sentence));
    let mut steps = script(&packets);
    steps.insert(
        5,
        Step::Batch(Packet {
            payload: &position,
            stamp: packets[5].1,
            port: 8308,
        }),
    );
    let source = MockPackets::script(steps);
    let mut lidar = VelodyneScans::new(source, VelodyneConfig::default());
    lidar.read_scan(&mut Vec::new(), NEVER).unwrap();
    assert_eq!(lidar.position().unwrap().pps, Pps::Locked);
    assert_eq!(lidar.counters().position_packets, 1);
}

#[test]
fn an_empty_source_ends_at_once() {
    let (scans, counters) = run(&[]);
    assert!(scans.is_empty() && drops(&counters).is_empty());
}

/// Plays packets over and over with stamps that go on, without allocating.
struct Endless {
    packets: Vec<(Vec<u8>, Stamp)>,
    played: usize,
}

impl PacketSource for Endless {
    type Error = std::convert::Infallible;

    fn receive(&mut self, buffer: &mut [u8], _: Stamp) -> Result<Option<Received>, Self::Error> {
        let (payload, _) = &self.packets[self.played % self.packets.len()];
        buffer[..DATA_LEN].copy_from_slice(payload);
        let at_us = self.played as i64 * PERIOD_NS / 1_000;
        buffer[1_200..1_204].copy_from_slice(&(at_us as u32).to_le_bytes());
        self.played += 1;
        Ok(Some(Received {
            len: DATA_LEN,
            stamp: Stamp::from_nanos(EPOCH_NS + at_us * 1_000),
            port: 2368,
        }))
    }

    fn at_end(&self) -> bool {
        false
    }
}

#[test]
fn nothing_is_allocated_once_warm() {
    let source = Endless {
        packets: single(76),
        played: 0,
    };
    let mut lidar = VelodyneScans::new(source, VelodyneConfig::default());
    let mut points = Vec::with_capacity(120_000);
    let mut read = |count: usize| {
        let mut seen = 0;
        for _ in 0..count {
            lidar.read_scan(&mut points, NEVER).unwrap().unwrap();
            seen += points.len();
        }
        seen
    };
    read(3);
    let before = ALLOCATIONS.with(Cell::get);
    let seen = read(50);
    let allocations = ALLOCATIONS.with(Cell::get) - before;
    assert!(seen > 1_000_000);
    assert_eq!(allocations, 0);
}

#[test]
fn an_endless_source_does_not_hold_a_caller_past_its_deadline() {
    let source = Endless {
        packets: single(76),
        played: 0,
    };
    let mut lidar = VelodyneScans::new(source, VelodyneConfig::default());
    let deadline = Stamp::from_nanos(EPOCH_NS + 20_000_000);
    assert_eq!(lidar.read_scan(&mut Vec::new(), deadline).unwrap(), None);
    // The turn goes on with the next call.
    let header = lidar.read_scan(&mut Vec::new(), NEVER).unwrap().unwrap();
    assert_eq!(header.completeness, Completeness::Complete);
}

/// The data packets of a recording, if there is one.
fn recorded(name: &str) -> Option<Vec<(Vec<u8>, Stamp)>> {
    let data = std::env::var("HACHI_DATA").ok()?;
    let path = format!("{data}/velodyne/{name}");
    let mut capture = CaptureSource::open(path, CaptureConfig::default()).unwrap();
    let mut buffer = [0; 2_048];
    let mut packets = Vec::new();
    while let Some(received) = capture.receive(&mut buffer, NEVER).unwrap() {
        packets.push((buffer[..received.len].to_vec(), received.stamp));
    }
    Some(packets)
}

/// Sends packets to a live driver, `speed` times as fast as they were recorded; what it counted and
/// what its socket lost.
fn send_live(packets: Vec<(Vec<u8>, Stamp)>, speed: Option<f64>) -> (VelodyneCounters, u64, usize) {
    let config = UdpConfig {
        bind_address: IpAddr::V4(Ipv4Addr::LOCALHOST),
        ..UdpConfig::on_ports(&[0])
    };
    let source = UdpSource::open(&config, SystemClock::new()).unwrap();
    let clock = source.clock();
    let target = (Ipv4Addr::LOCALHOST, source.local_ports()[0]);
    let mut lidar = VelodyneScans::new(source, VelodyneConfig::default());
    let sending = std::thread::spawn(move || {
        let socket = UdpSocket::bind((Ipv4Addr::LOCALHOST, 0)).unwrap();
        let (begun, first) = (Instant::now(), packets[0].1);
        for (payload, stamp) in &packets {
            if let Some(speed) = speed {
                let due = Duration::from_secs_f64(stamp.secs_since(first) / speed);
                std::thread::sleep(due.saturating_sub(begun.elapsed()));
            }
            socket.send_to(payload, target).unwrap();
        }
        // The kernel tells its drops with the next datagram: one of a size that is not counted as
        // data ends the stream.
        std::thread::sleep(Duration::from_millis(300));
        socket.send_to(&[0], target).unwrap();
    });
    let mut points = Vec::new();
    let mut scans = 0;
    let mut promise = ScanPromise::default();
    let end = clock.now() + 20_000_000_000;
    while lidar.counters().wrong_size == 0 && clock.now() < end {
        let deadline = clock.now() + 100_000_000;
        if let Some(header) = lidar.read_scan(&mut points, deadline).unwrap() {
            promise.check(&header, &points).unwrap();
            scans += 1;
        }
    }
    sending.join().unwrap();
    let dropped = lidar.source().counters().kernel_drop;
    (lidar.counters(), dropped, scans)
}

#[test]
fn packets_sent_at_live_speed_all_become_turns() {
    let packets = recorded("vlp16_single_13turns.pcap").unwrap_or_else(|| single(500));
    let packets: Vec<_> = packets.into_iter().take(500).collect();
    let (counters, dropped, scans) = send_live(packets, Some(1.0));
    assert_eq!((counters.packets, counters.lost, dropped), (500, 0, 0));
    // 0.66 s: six or seven passages of the cut angle.
    assert!((6..=7).contains(&scans), "{scans}");
}

#[test]
fn packets_sent_as_fast_as_possible_arrive_or_are_counted() {
    let packets = recorded("vlp16_single_13turns.pcap").unwrap_or_else(|| single(1_000));
    let sent = packets.len() as u64;
    let (counters, dropped, _) = send_live(packets, None);
    assert_eq!(counters.packets + dropped, sent, "{counters:?}");
    // Losses inside the stream show in the stamps too; at its end nothing follows.
    assert!(counters.lost <= dropped);
}

#[test]
fn a_live_driver_keeps_the_promise_of_a_lidar() {
    let config = UdpConfig {
        bind_address: IpAddr::V4(Ipv4Addr::LOCALHOST),
        ..UdpConfig::on_ports(&[0])
    };
    let source = UdpSource::open(&config, SystemClock::new()).unwrap();
    let (clock, port) = (source.clock(), source.local_ports()[0]);
    let mut lidar = VelodyneScans::new(source, VelodyneConfig::default());
    let socket = UdpSocket::bind((Ipv4Addr::LOCALHOST, 0)).unwrap();
    for (payload, _) in single(200) {
        socket
            .send_to(&payload, (Ipv4Addr::LOCALHOST, port))
            .unwrap();
    }
    let mut points = Vec::new();
    let tally = check_lidar_scans(&mut lidar, &clock, &mut points, 4, 50_000_000).unwrap();
    assert_eq!((tally.items, tally.nothing), (2, 2));
}
