//! Turns from scripted and live packets: what is delivered, what is counted, and what it costs.

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;
use std::net::{IpAddr, Ipv4Addr, UdpSocket};
use std::time::{Duration, Instant};

use hachi_datagram::{SystemClock, UdpConfig, UdpSource};
use hachi_hal::conformance::ScanPromise;
use hachi_hal::mock::{MockPackets, Packet, Step};
use hachi_hal::{
    Clock, Completeness, LidarScans, PacketSource, Point, Received, ScanHeader, Stamp,
};
use hachi_robosense::encode::{DifopContents, Echo, Firing, PacketWriter, difop_packet};
use hachi_robosense::packet::{
    Calibration, PACKET_LEN, ReturnMode, SyncSource, SyncStatus, recognise,
};
use hachi_robosense::{CalibrationSource, RobosenseConfig, RobosenseCounters, RobosenseScans};

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
const EPOCH_NS: i64 = 1_700_000_000_000_000_000;
/// The sensor's clock was never set: 2017.
const SENSOR_US: u64 = 1_483_724_884_000_000;
const PERIOD_NS: i64 = 666_720;

/// Packets of a rotor at 600 rpm in a round room of 5 m, from 0° on.
fn room(packets: usize) -> Vec<(Vec<u8>, Stamp)> {
    let mut writer = PacketWriter::new(ReturnMode::Strongest);
    let echoes = [Echo::from_metres(5.0, 40); 16];
    let mut written = Vec::new();
    for firing in 0_u64.. {
        if written.len() == packets {
            break;
        }
        let elapsed_us = firing as f64 * 27.78;
        let packet = writer.push(&Firing {
            azimuth_deg: elapsed_us * 3_600e-6,
            time_us: SENSOR_US + elapsed_us as u64,
            echoes,
            second: echoes,
        });
        if let Some(packet) = packet {
            let arrival_ns = (elapsed_us * 1e3) as i64 + 23_550;
            written.push((packet.to_vec(), Stamp::from_nanos(EPOCH_NS + arrival_ns)));
        }
    }
    written
}

/// A fan that is not the manual's: from −8° upwards in steps of 1.5°.
fn own_angles() -> Calibration {
    let vertical = core::array::from_fn(|laser| 14.5 - 1.5 * laser as f32);
    Calibration::new(vertical, [0.0; 16]).unwrap()
}

fn difop(calibration: Option<Calibration>) -> Vec<u8> {
    difop_packet(&DifopContents {
        rpm: 600,
        return_mode: ReturnMode::Strongest,
        sync_source: SyncSource::Gps,
        sync_status: SyncStatus::Unsynchronised,
        time_us: SENSOR_US,
        calibration,
    })
    .to_vec()
}

fn with_difop(
    mut packets: Vec<(Vec<u8>, Stamp)>,
    at: usize,
    calibration: Option<Calibration>,
) -> Vec<(Vec<u8>, Stamp)> {
    let stamp = packets[at].1;
    packets.insert(at, (difop(calibration), stamp));
    packets
}

type Scans = Vec<(ScanHeader, Vec<Point>)>;

fn run_with(config: RobosenseConfig, packets: &[(Vec<u8>, Stamp)]) -> (Scans, RobosenseCounters) {
    let script: Vec<_> = packets
        .iter()
        .map(|(payload, stamp)| {
            Step::Batch(Packet {
                payload,
                stamp: *stamp,
                port: 6699,
            })
        })
        .collect();
    let mut lidar = RobosenseScans::new(MockPackets::script(script), config);
    let (mut scans, mut promise) = (Vec::new(), ScanPromise::default());
    let mut points = Vec::new();
    while let Some(header) = lidar.read_scan(&mut points, NEVER).unwrap() {
        promise.check(&header, &points).unwrap();
        scans.push((header, points.clone()));
    }
    lidar.source().assert_done();
    (scans, lidar.counters())
}

fn run(packets: &[(Vec<u8>, Stamp)]) -> (Scans, RobosenseCounters) {
    run_with(RobosenseConfig::default(), packets)
}

fn drops(counters: &RobosenseCounters) -> Vec<(&'static str, u64)> {
    counters.dropped().filter(|(_, count)| *count > 0).collect()
}

/// Elevation of the lowest ring of a scan, degrees.
fn lowest_deg(points: &[Point]) -> f32 {
    let point = points.iter().find(|p| p.ring == 0).unwrap();
    (point.z / point.range_m).asin().to_degrees()
}

#[test]
fn packets_wait_for_the_sensors_own_angles() {
    for at in [0, 100, 299] {
        let packets = with_difop(room(300), at, Some(own_angles()));
        let (scans, counters) = run(&packets);
        assert_eq!(drops(&counters), [], "{at}");
        assert_eq!(counters.packets, 300);
        assert!((lowest_deg(&scans[0].1) + 8.0).abs() < 1e-3);
        assert_eq!(scans[0].0.completeness, Completeness::Complete);
    }
}

#[test]
fn without_calibration_the_manuals_angles_are_used_and_counted() {
    let (scans, counters) = run(&room(200));
    assert_eq!(drops(&counters), [("uncalibrated_packets", 200)]);
    assert!((lowest_deg(&scans[0].1) + 15.0).abs() < 1e-3);

    let (_, counters) = run(&with_difop(room(200), 10, None));
    let expected = [("uncalibrated_packets", 200), ("bad_calibration", 1)];
    assert_eq!(drops(&counters), expected);
}

#[test]
fn a_calibration_that_is_awaited_too_long_takes_effect_when_it_comes() {
    let packets = with_difop(room(9_000), 8_500, Some(own_angles()));
    let (scans, counters) = run(&packets);
    assert_eq!(drops(&counters), [("uncalibrated_packets", 8_500)]);
    assert!((lowest_deg(&scans[0].1) + 15.0).abs() < 1e-3);
    assert!((lowest_deg(&scans.last().unwrap().1) + 8.0).abs() < 1e-3);
}

#[test]
fn configured_angles_need_no_waiting() {
    let config = RobosenseConfig {
        calibration: CalibrationSource::Fixed(own_angles()),
        ..RobosenseConfig::default()
    };
    let (scans, counters) = run_with(config, &room(200));
    assert_eq!(drops(&counters), []);
    assert!((lowest_deg(&scans[0].1) + 8.0).abs() < 1e-3);
}

#[test]
fn a_whole_turn_of_a_round_room_has_every_shot_at_its_time() {
    let (scans, _) = run(&with_difop(room(300), 0, Some(own_angles())));
    let (header, points) = &scans[0];
    assert!(
        (3_598 * 16..=3_602 * 16).contains(&points.len()),
        "{}",
        points.len()
    );
    let duration_ns = header.end.nanos_since(header.start);
    assert!((duration_ns - 100_000_000).abs() < 100_000, "{duration_ns}");
    assert!((header.start.as_nanos() - EPOCH_NS).abs() < 50_000);
    for point in points {
        let shot_deg = f64::from(point.time_offset_ns) * 3_600e-9;
        let apart = (f64::from(point.azimuth_deg) - shot_deg).abs();
        assert!(apart.min(360.0 - apart) < 0.02, "{point:?}");
    }
}

#[test]
fn damage_loss_and_repetition_are_counted_by_reason() {
    let mut packets = room(300);
    let mut flag = packets[40].0.clone();
    flag[42] = 0;
    packets[40].0 = flag;
    packets[60].0[26] = 0xFF;
    packets.remove(100);
    packets.insert(120, packets[119].clone());
    packets.swap(150, 151);
    packets.insert(9, (vec![1; 100], packets[9].1));
    packets.insert(9, (vec![1; PACKET_LEN], packets[9].1));
    let (_, counters) = run(&with_difop(packets, 0, Some(own_angles())));
    let expected = [
        ("lost", 2),
        ("duplicate", 1),
        ("out_of_order", 1),
        ("wrong_size", 1),
        ("wrong_product", 1),
        ("block_flag", 1),
        ("bad_stamp", 1),
    ];
    // A packet with an unreadable stamp is missing from the stream too.
    assert_eq!(drops(&counters), expected);
}

#[test]
fn a_sensor_whose_clock_is_set_ends_the_turn_and_begins_another() {
    let mut packets = room(200);
    for (payload, _) in &mut packets[100..] {
        // GPS: from 2017 to 2023.
        payload[22..26].copy_from_slice(&1_700_000_000_u32.to_be_bytes());
    }
    let (scans, counters) = run(&with_difop(packets, 0, Some(own_angles())));
    assert_eq!(drops(&counters), [("stamp_jump", 1)]);
    let kinds: Vec<_> = scans.iter().map(|(h, _)| h.completeness).collect();
    let expected = [
        Completeness::PartialLast,
        Completeness::PartialFirst,
        Completeness::PartialLast,
    ];
    assert_eq!(kinds, expected);
}

/// Plays packets over and over with stamps and counters that go on, without allocating.
struct Endless {
    packets: Vec<(Vec<u8>, Stamp)>,
    played: usize,
}

impl PacketSource for Endless {
    type Error = std::convert::Infallible;

    fn receive(&mut self, buffer: &mut [u8], _: Stamp) -> Result<Option<Received>, Self::Error> {
        let (payload, _) = &self.packets[self.played % self.packets.len()];
        buffer[..PACKET_LEN].copy_from_slice(payload);
        let at_us = self.played as i64 * PERIOD_NS / 1_000;
        if recognise(payload) == Some(hachi_robosense::packet::PacketKind::Msop) {
            buffer[12..16].copy_from_slice(&(self.played as u32).to_be_bytes());
            buffer[22..26].copy_from_slice(&((at_us / 1_000_000) as u32).to_be_bytes());
            buffer[26..30].copy_from_slice(&((at_us % 1_000_000) as u32).to_be_bytes());
        }
        self.played += 1;
        Ok(Some(Received {
            len: PACKET_LEN,
            stamp: Stamp::from_nanos(EPOCH_NS + at_us * 1_000),
            port: 6699,
        }))
    }

    fn at_end(&self) -> bool {
        false
    }
}

#[test]
fn nothing_is_allocated_once_warm() {
    let source = Endless {
        packets: with_difop(room(149), 0, Some(own_angles())),
        played: 0,
    };
    let mut lidar = RobosenseScans::new(source, RobosenseConfig::default());
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
    assert!(seen > 2_000_000, "{seen}");
    assert_eq!(allocations, 0);
}

#[test]
fn packets_sent_at_live_speed_over_two_ports_all_become_turns() {
    let config = UdpConfig {
        bind_address: IpAddr::V4(Ipv4Addr::LOCALHOST),
        ..UdpConfig::on_ports(&[0, 0])
    };
    let source = UdpSource::open(&config, SystemClock::new()).unwrap();
    let (clock, ports) = (source.clock(), source.local_ports());
    let mut lidar = RobosenseScans::new(source, RobosenseConfig::default());
    let sending = std::thread::spawn(move || {
        let socket = UdpSocket::bind((Ipv4Addr::LOCALHOST, 0)).unwrap();
        let begun = Instant::now();
        for (n, (payload, _)) in room(600).iter().enumerate() {
            let due = Duration::from_nanos(n as u64 * PERIOD_NS as u64);
            std::thread::sleep(due.saturating_sub(begun.elapsed()));
            if n == 200 {
                let calibration = difop(Some(own_angles()));
                socket
                    .send_to(&calibration, (Ipv4Addr::LOCALHOST, ports[1]))
                    .unwrap();
            }
            socket
                .send_to(payload, (Ipv4Addr::LOCALHOST, ports[0]))
                .unwrap();
        }
    });
    let mut points = Vec::new();
    let (mut scans, mut promise) = (0, ScanPromise::default());
    let end = clock.now() + 20_000_000_000;
    while lidar.counters().packets < 600 && clock.now() < end {
        let deadline = clock.now() + 100_000_000;
        if let Some(header) = lidar.read_scan(&mut points, deadline).unwrap() {
            promise.check(&header, &points).unwrap();
            scans += 1;
        }
    }
    sending.join().unwrap();
    assert_eq!(drops(&lidar.counters()), []);
    assert!(lidar.is_calibrated());
    // 0.4 s.
    assert!((3..=4).contains(&scans), "{scans}");
}
