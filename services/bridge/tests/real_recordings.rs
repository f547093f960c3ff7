//! The readers on real recordings, which are found through `HACHI_DATA` and never copied here.
//! Expected values come from elsewhere: the captures that the bags were made from, another
//! decoder's clouds, the sizes that their makers state.
#![allow(clippy::print_stderr)] // A test that does not run says so.

use std::fs;
use std::path::{Path, PathBuf};

use hachi_bridge::input::InputKind;
use hachi_bridge::message::Sensor;
use hachi_bridge::{
    Bag, BagError, BagPackets, BagScans, Body, CloudFormat, ImuText, Input, PointTimes, ScanFiles,
    read_cloud,
};
use hachi_hal::{LidarScans, PacketSource, Point, Stamp};

fn data(path: &str) -> Option<PathBuf> {
    let Some(folder) = std::env::var_os("HACHI_DATA") else {
        eprintln!("not run: HACHI_DATA does not name the folder of recordings");
        return None;
    };
    Some(Path::new(&folder).join(path))
}

/// UDP payloads of a little-endian, microsecond or nanosecond Ethernet capture without fragments:
/// port and bytes. A few lines of its own, so that the bags are compared with something else.
fn udp_payloads(capture: &Path) -> Vec<(u16, Vec<u8>)> {
    let bytes = fs::read(capture).unwrap();
    let u32_at = |at: usize| u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap()) as usize;
    let mut at = 24;
    let mut payloads = Vec::new();
    while at < bytes.len() {
        let frame = &bytes[at + 16..at + 16 + u32_at(at + 8)];
        at += 16 + frame.len();
        let udp = &frame[14 + 4 * usize::from(frame[14] & 15)..];
        let port = u16::from_be_bytes([udp[2], udp[3]]);
        let length = usize::from(u16::from_be_bytes([udp[4], udp[5]]));
        payloads.push((port, udp[8..length].to_vec()));
    }
    payloads
}

fn all_packets(source: &mut BagPackets) -> Vec<(Stamp, u16, Vec<u8>)> {
    let mut buffer = [0; 2048];
    let mut packets = Vec::new();
    while !source.at_end() {
        if let Some(received) = source.receive(&mut buffer, Stamp::default()).unwrap() {
            packets.push((
                received.stamp,
                received.port,
                buffer[..received.len].to_vec(),
            ));
        }
    }
    packets
}

#[test]
fn the_velodyne_bag_holds_the_packets_of_the_capture() {
    let Some(bag) = data("velodyne/vlp16_dual_8scans.db3") else {
        return;
    };
    let before = fs::metadata(&bag).unwrap().modified().unwrap();
    let mut source = BagPackets::open(&bag).unwrap();
    assert_eq!(source.sensor(), Sensor::Velodyne);
    assert_eq!(source.topic().messages, 8);
    let packets = all_packets(&mut source);
    let expected = udp_payloads(&bag.with_extension("pcap"));
    assert_eq!(packets.len(), expected.len());
    for ((_, port, payload), (_, expected)) in packets.iter().zip(&expected) {
        assert_eq!((*port, payload), (2368, expected));
    }
    // The first stamp in the first message: 0x63be1097 s and 0x2bf95f5e ns.
    assert_eq!(
        packets[0].0,
        Stamp::from_secs_nanos(0x63be_1097, 0x2bf9_5f5e).unwrap()
    );
    assert!(packets.is_sorted_by_key(|packet| packet.0));
    assert_eq!(fs::metadata(&bag).unwrap().modified().unwrap(), before);
    for beside in ["-wal", "-shm", "-journal"] {
        assert!(!PathBuf::from(format!("{}{beside}", bag.display())).exists());
    }
}

#[test]
fn the_helios_bag_holds_the_packets_of_the_capture_and_its_one_difop() {
    let Some(bag) = data("robosense/helios16p_5scans.db3") else {
        return;
    };
    let mut source = BagPackets::open(&bag).unwrap();
    assert_eq!(source.sensor(), Sensor::Robosense);
    let packets = all_packets(&mut source);
    let mut expected = udp_payloads(&bag.with_extension("pcap"));
    assert_eq!((packets.len(), expected.len()), (751, 751));
    let ports = |port| packets.iter().filter(|packet| packet.1 == port).count();
    assert_eq!((ports(6699), ports(7788)), (750, 1));
    // The bag's scan lists the DIFOP packet at its end of the turn: compared without order.
    let mut payloads: Vec<_> = packets.into_iter().map(|(_, port, p)| (port, p)).collect();
    payloads.sort_unstable();
    expected.sort_unstable();
    assert!(payloads == expected);
}

#[test]
fn the_other_decoders_clouds_have_their_points_beams_and_times() {
    let Some(folder) = data("velodyne/vlp16_dual_expected") else {
        return;
    };
    let mut scans = ScanFiles::open(&folder).unwrap();
    assert_eq!((scans.len(), scans.format()), (3, CloudFormat::Pcd));
    let mut points = Vec::new();
    let (header, info) = scans.next_scan(&mut points).unwrap().unwrap();
    assert_eq!((points.len(), info.non_finite), (14_673, 0));
    // Its times are f64 seconds: 1673400472.0383565 to 1673400472.137224, to 0.2 µs.
    let near = |stamp: Stamp, nanos: i64| (stamp.as_nanos() - nanos).abs() < 1000;
    assert!(near(header.start, 1_673_400_472_038_356_500), "{header:?}");
    assert!(near(header.end, 1_673_400_472_137_224_000), "{header:?}");
    let first = points[0];
    assert_eq!((first.ring, first.intensity), (8, 100.0));
    assert!((first.x - 0.960_793_7).abs() < 1e-6 && (first.range_m - 0.962).abs() < 1e-6);
    assert_eq!(scans.intensity_scale(), Some(1.0));
    let counts: Vec<_> = std::iter::from_fn(|| {
        let scan = scans.next_scan(&mut points).unwrap()?;
        Some(scan.1.points)
    })
    .collect();
    assert_eq!(counts, [14_818, 14_916]);

    let helios = data("robosense/helios16p_expected").unwrap();
    let mut scans = ScanFiles::open(&helios).unwrap();
    let (header, info) = scans.next_scan(&mut points).unwrap().unwrap();
    assert_eq!((info.points, info.times), (15_258, PointTimes::None));
    // All points of that file have one time; the file's name is the scan's.
    assert_eq!(header.end, Stamp::from_nanos(1_691_031_766_781_547_066));
    assert!(!header.has_point_times);
    assert_eq!((points[0].ring, points[0].intensity), (13, 4.0));
}

#[test]
fn a_ros_1_bag_of_a_camera_opens_and_lists_what_it_does_not_read() {
    let Some(path) = data("rgbd/realsense_single.bag") else {
        return;
    };
    let mut bag = Bag::open(&path).unwrap();
    assert!(bag.notes().is_empty(), "{:?}", bag.notes());
    let images = bag
        .topics()
        .iter()
        .filter(|topic| topic.type_name == "sensor_msgs/Image")
        .map(|topic| topic.messages)
        .sum::<u64>();
    assert_eq!(images, 3, "{:?}", bag.topics());
    assert!(bag.topics().iter().all(|topic| topic.kind.is_none()));
    assert!(bag.next_message().unwrap().is_none());
    let error = BagScans::open(&path).unwrap_err();
    assert!(matches!(error, BagError::NoTopic { .. }), "{error}");
    assert!(error.to_string().contains("sensor_msgs/Image"), "{error}");
}

#[test]
fn kitti_scans_have_their_times_and_the_scale_of_hal() {
    let Some(folder) = data("scans/kitti00_first12") else {
        return;
    };
    let mut scans = ScanFiles::open(&folder).unwrap();
    let mut points: Vec<Point> = Vec::new();
    let mut ends = Vec::new();
    while let Some(header) = scans.read_scan(&mut points, Stamp::default()).unwrap() {
        assert!(header.start == header.end && !header.has_point_times);
        ends.push((header.end.as_nanos(), points.len()));
    }
    assert_eq!(ends.len(), 12);
    assert_eq!(ends[0], (0, 1_994_688 / 16));
    assert_eq!(ends[11], (1_139_600_000, 1_935_120 / 16));
    assert_eq!(scans.intensity_scale(), Some(1.0));
    assert!(scans.at_end() && scans.dropped_points() == 0);
    // This export's intensities are in 0 to 1, and it has no times.
    let mut scans = ScanFiles::open(data("scans/car_100").unwrap()).unwrap();
    let mut last = None;
    while let Some((header, info)) = scans.next_scan(&mut points).unwrap() {
        let strongest = points.iter().map(|p| p.intensity).fold(0.0, f32::max);
        assert!((200.0..=255.0).contains(&strongest) && info.non_finite == 0);
        last = Some(header);
    }
    let last = last.unwrap();
    assert_eq!((last.sequence, last.end.as_nanos()), (99, 9_900_000_000));
    assert_eq!(scans.intensity_scale(), Some(255.0));
    let mut scans = ScanFiles::open(data("scans/vlp16_indoor_15").unwrap()).unwrap();
    assert_eq!(scans.len(), 15);
    let (_, info) = scans.next_scan(&mut points).unwrap().unwrap();
    assert_eq!(info.points, 450_704 / 16);
}

#[test]
fn keyframes_take_the_times_that_lie_beside_their_folder() {
    let Some(folder) = data("loops/keyframes_hku1") else {
        return;
    };
    for path in [folder.clone(), folder.join("Scans")] {
        let mut scans = ScanFiles::open(path).unwrap();
        assert!(scans.len() == 314 && scans.has_times());
        let mut points = Vec::new();
        let (header, _) = scans.next_scan(&mut points).unwrap().unwrap();
        assert_eq!(header.end, Stamp::from_nanos(1_577_836_980_099_104_600));
        assert_eq!(points.len(), 3430);
    }
}

#[test]
fn ply_clouds_have_the_points_their_maker_states() {
    let Some(folder) = data("registration/pair_a") else {
        return;
    };
    let mut points = Vec::new();
    let mut count = |name| read_cloud(folder.join(name), &mut points).unwrap().points;
    assert_eq!((count("target.ply"), count("source.ply")), (69_088, 69_792));
    let first = points[0];
    assert_eq!(
        first.position(),
        [0.004_045_109_3, 2.575_194_6, -1.527_217_4]
    );
    assert_eq!(first.intensity, 70.0);
}

#[test]
fn imu_text_gives_gravity_where_it_belongs() {
    let Some(path) = data("imu/imu.txt") else {
        return;
    };
    let samples: Vec<_> = ImuText::open(path).unwrap().map(Result::unwrap).collect();
    assert_eq!(samples.len(), 23_739);
    assert_eq!(
        samples[0].stamp,
        Stamp::from_nanos(1_647_090_478_710_633_039)
    );
    let mean = |norm: fn(&hachi_hal::ImuSample) -> f64| {
        samples.iter().map(norm).sum::<f64>() / samples.len() as f64
    };
    assert!((mean(|s| s.specific_force.norm()) - 9.81).abs() < 0.01);
    assert!(mean(|s| s.angular_velocity.norm()) < 0.2);
}

#[test]
fn every_recording_is_recognised_for_what_it_is() {
    let Some(root) = data("") else {
        return;
    };
    for (path, kind) in [
        ("velodyne/vlp16_single_13turns.pcap", InputKind::Pcap),
        ("velodyne/vlp16_dual_8scans.db3", InputKind::Db3),
        ("rgbd/realsense_single.bag", InputKind::Ros1Bag),
        ("rgbd/kitti_camera_lidar", InputKind::KittiSequence),
        ("scans/car_100", InputKind::ScanFolder(CloudFormat::Bin)),
        (
            "loops/keyframes_hku1",
            InputKind::ScanFolder(CloudFormat::Pcd),
        ),
        (
            "registration/pair_a",
            InputKind::ScanFolder(CloudFormat::Ply),
        ),
        (
            "registration/pair_a/source.ply",
            InputKind::Cloud(CloudFormat::Ply),
        ),
    ] {
        assert_eq!(
            Input::recognise(root.join(path)).unwrap().kind,
            kind,
            "{path}"
        );
    }
    let error = Input::recognise(root.join("imu/imu.txt")).unwrap_err();
    assert!(error.to_string().contains("accepted are"), "{error}");
}

#[test]
fn messages_come_with_their_topic_and_record_time() {
    let Some(path) = data("velodyne/vlp16_dual_8scans.db3") else {
        return;
    };
    let mut bag = Bag::open(path).unwrap();
    let mut stamps = Vec::new();
    while let Some(message) = bag.next_message().unwrap() {
        assert_eq!(message.topic.name, "/velodyne_packets");
        let Body::Packets(packets) = message.body else {
            panic!("not packets");
        };
        assert!((150..=151).contains(&packets.len()));
        stamps.push(message.stamp.as_nanos());
    }
    assert_eq!(stamps[0], 1_673_400_471_837_873_222);
    assert_eq!(stamps[7], 1_673_400_472_537_996_703);
}
