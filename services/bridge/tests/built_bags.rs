//! The readers on recordings built here byte by byte (ROS 1) or by the containers' own writers
//! (SQLite, MCAP), with what is in them known by construction; then cut, lied about and damaged.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use hachi_bridge::{Bag, BagError, BagPackets, BagScans, Body};
use hachi_hal::{DeviceError, FaultKind, LidarScans, PacketSource, Point, Stamp};

/// `sensor_msgs/Imu`, little-endian: CDR or ROS 1.
fn imu(ros1: bool, nanos: u32) -> Vec<u8> {
    let mut bytes = Vec::new();
    if ros1 {
        bytes.extend(0_u32.to_le_bytes());
    } else {
        bytes.extend([0, 1, 0, 0]);
    }
    bytes.extend(7_u32.to_le_bytes());
    bytes.extend(nanos.to_le_bytes());
    // An empty frame: CDR counts its zero and pads to the doubles behind it.
    if ros1 {
        bytes.extend(0_u32.to_le_bytes());
    } else {
        bytes.extend([1, 0, 0, 0, 0, 0, 0, 0]);
        bytes.resize(4 + 16, 0);
    }
    for index in 0..37 {
        bytes.extend(f64::from(index).to_le_bytes());
    }
    bytes
}

/// `sensor_msgs/PointCloud2` of one point at x = `x`, CDR.
fn cloud(x: f32) -> Vec<u8> {
    let mut bytes = vec![0, 1, 0, 0];
    let u32 = |bytes: &mut Vec<u8>, value: u32| bytes.extend(value.to_le_bytes());
    for value in [7, 0, 1, 0] {
        u32(&mut bytes, value); // stamp, a frame of one zero, padding
    }
    for value in [1, 1, 3] {
        u32(&mut bytes, value); // height, width, fields
    }
    for (index, name) in ["x", "y", "z"].into_iter().enumerate() {
        u32(&mut bytes, 2);
        bytes.extend([name.as_bytes()[0], 0, 0, 0]);
        u32(&mut bytes, 4 * index as u32);
        bytes.extend([7, 0, 0, 0]);
        u32(&mut bytes, 1);
    }
    bytes.extend([0, 0, 0, 0]);
    for value in [12, 12, 12] {
        u32(&mut bytes, value); // point step, row step, bytes
    }
    for value in [x, 0.0, 0.0] {
        bytes.extend(value.to_le_bytes());
    }
    bytes.push(1);
    bytes
}

fn record(fields: &[(&str, &[u8])], data: &[u8]) -> Vec<u8> {
    let mut header = Vec::new();
    for (name, value) in fields {
        header.extend((name.len() as u32 + 1 + value.len() as u32).to_le_bytes());
        header.extend(name.bytes());
        header.push(b'=');
        header.extend(*value);
    }
    let mut bytes = (header.len() as u32).to_le_bytes().to_vec();
    bytes.extend(header);
    bytes.extend((data.len() as u32).to_le_bytes());
    bytes.extend(data);
    bytes
}

fn time(nanos: u32) -> [u8; 8] {
    let mut bytes = [0; 8];
    bytes[..4].copy_from_slice(&7_u32.to_le_bytes());
    bytes[4..].copy_from_slice(&nanos.to_le_bytes());
    bytes
}

fn connection(id: u32, kind: &str) -> Vec<u8> {
    let about = record(&[("topic", b"/imu"), ("type", kind.as_bytes())], &[]);
    // A connection's data are fields like a header's, without the length in front.
    let data = &about[4..about.len() - 4];
    record(
        &[
            ("op", &[7]),
            ("conn", &id.to_le_bytes()),
            ("topic", b"/imu"),
        ],
        data,
    )
}

/// A chunk of IMU messages and, if asked for, its index.
fn chunk(compression: &str, stamps: &[u32], indexed: bool) -> Vec<u8> {
    let mut inner = connection(3, "sensor_msgs/Imu");
    let mut index = Vec::new();
    for &nanos in stamps {
        index.extend(time(nanos));
        index.extend((inner.len() as u32).to_le_bytes());
        let fields: [(&str, &[u8]); 3] = [
            ("op", &[2]),
            ("conn", &3_u32.to_le_bytes()),
            ("time", &time(nanos)),
        ];
        inner.extend(record(&fields, &imu(true, nanos)));
    }
    let packed = match compression {
        "bz2" => {
            use std::io::Read;
            let level = bzip2::Compression::fast();
            let mut packed = Vec::new();
            bzip2::read::BzEncoder::new(&inner[..], level)
                .read_to_end(&mut packed)
                .unwrap();
            packed
        }
        "lz4" => {
            use std::io::Write;
            let mut encoder = lz4_flex::frame::FrameEncoder::new(Vec::new());
            encoder.write_all(&inner).unwrap();
            encoder.finish().unwrap()
        }
        _ => inner.clone(),
    };
    let size = (inner.len() as u32).to_le_bytes();
    let fields: [(&str, &[u8]); 3] = [
        ("op", &[5]),
        ("compression", compression.as_bytes()),
        ("size", &size),
    ];
    let mut bytes = record(&fields, &packed);
    if indexed {
        let count = (stamps.len() as u32).to_le_bytes();
        let fields: [(&str, &[u8]); 4] = [
            ("op", &[4]),
            ("ver", &1_u32.to_le_bytes()),
            ("conn", &3_u32.to_le_bytes()),
            ("count", &count),
        ];
        bytes.extend(record(&fields, &index));
    }
    bytes
}

/// Chunks that overlap in time, as `rosbag reindex` and converters leave them.
fn ros1_bag(compressions: [&str; 2], indexed: bool) -> Vec<u8> {
    let mut bytes = b"#ROSBAG V2.0\n".to_vec();
    let zero = [0_u8; 8];
    bytes.extend(record(&[("op", &[3]), ("index_pos", &zero)], &[b' '; 64]));
    bytes.extend(chunk(compressions[0], &[10, 30, 50], indexed));
    bytes.extend(chunk(compressions[1], &[40, 20], indexed));
    if indexed {
        bytes.extend(connection(3, "sensor_msgs/Imu"));
    }
    bytes
}

fn write(folder: &Path, name: &str, bytes: &[u8]) -> PathBuf {
    let path = folder.join(name);
    // Some file systems flush a file that is written over, which thousands of these cannot bear.
    let _ = fs::remove_file(&path);
    fs::write(&path, bytes).unwrap();
    path
}

/// Nanoseconds of all samples that can be read, and the errors on the way. Ends: every call makes
/// progress.
fn drain(path: &Path) -> Result<(Vec<i64>, Vec<BagError>), BagError> {
    let mut bag = Bag::open(path)?;
    let (mut stamps, mut errors) = (Vec::new(), Vec::new());
    for _ in 0..100_000 {
        match bag.next_message() {
            Ok(Some(message)) => {
                if let Body::Imu(sample) = message.body {
                    stamps.push(sample.stamp.as_nanos() - 7_000_000_000);
                }
            }
            Ok(None) => return Ok((stamps, errors)),
            Err(error) => {
                assert_eq!(error.kind(), FaultKind::ReadAgain);
                errors.push(error);
            }
        }
    }
    panic!("the recording never ends");
}

#[test]
fn ros_1_messages_come_in_time_order_over_chunks_of_any_compression() {
    let folder = tempfile::tempdir().unwrap();
    for compressions in [["none", "bz2"], ["lz4", "none"], ["bz2", "lz4"]] {
        for indexed in [true, false] {
            let path = write(folder.path(), "a.bag", &ros1_bag(compressions, indexed));
            let (stamps, errors) = drain(&path).unwrap();
            assert_eq!(stamps, [10, 20, 30, 40, 50]);
            assert!(errors.is_empty());
            let bag = Bag::open(&path).unwrap();
            assert_eq!(bag.topics()[0].messages, 5);
            assert_eq!(bag.notes().is_empty(), indexed, "{:?}", bag.notes());
        }
    }
}

#[test]
fn a_ros_1_bag_cut_anywhere_gives_what_comes_before_the_cut() {
    let folder = tempfile::tempdir().unwrap();
    let whole = ros1_bag(["none", "lz4"], true);
    for cut in 13..whole.len() {
        let path = write(folder.path(), "cut.bag", &whole[..cut]);
        let (stamps, _) = drain(&path).unwrap();
        let prefix_of_first = stamps.iter().all(|stamp| [10, 30, 50].contains(stamp));
        assert!(
            prefix_of_first || stamps == [10, 20, 30, 40, 50],
            "{cut}: {stamps:?}"
        );
    }
}

#[test]
fn ros_1_bytes_that_lie_cost_what_they_touch() {
    let folder = tempfile::tempdir().unwrap();
    let whole = ros1_bag(["none", "lz4"], true);
    // Every byte turned over, one at a time: never a panic, never a reader that does not end.
    for at in 13..whole.len() {
        for flip in [0xff, 0x80] {
            let mut bytes = whole.clone();
            bytes[at] ^= flip;
            let path = write(folder.path(), "flip.bag", &bytes);
            if let Ok((stamps, errors)) = drain(&path) {
                assert!(
                    stamps.len() + errors.len() <= 10,
                    "{at}: {stamps:?} {errors:?}"
                );
            }
        }
    }
}

const TABLES: &str =
    "CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT NOT NULL, type TEXT NOT \
    NULL, serialization_format TEXT NOT NULL, offered_qos_profiles TEXT NOT NULL);
    CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER NOT NULL, timestamp INTEGER NOT \
    NULL, data BLOB NOT NULL);
    INSERT INTO topics VALUES (1, '/imu', 'sensor_msgs/msg/Imu', 'cdr', ''),
    (2, '/points', 'sensor_msgs/msg/PointCloud2', 'cdr', ''),
    (3, '/image', 'sensor_msgs/msg/Image', 'cdr', '');";

fn db3(path: &Path, messages: &[(i64, i64, Vec<u8>)]) {
    let connection = rusqlite::Connection::open(path).unwrap();
    connection.execute_batch(TABLES).unwrap();
    for (topic, stamp, data) in messages {
        connection
            .execute(
                "INSERT INTO messages (topic_id, timestamp, data) VALUES (?1, ?2, ?3)",
                rusqlite::params![topic, stamp, data],
            )
            .unwrap();
    }
}

#[test]
fn a_folder_of_ros_2_files_is_read_in_the_order_of_its_metadata() {
    let folder = tempfile::tempdir().unwrap();
    let root = folder.path();
    // A name with characters that mean something in a URI.
    db3(
        &root.join("walk?#%_1.db3"),
        &[(1, 30, imu(false, 30)), (3, 31, vec![1, 2, 3])],
    );
    db3(
        &root.join("walk_0.db3"),
        &[(1, 20, imu(false, 20)), (1, 10, imu(false, 10))],
    );
    fs::write(
        root.join("metadata.yaml"),
        "rosbag2_bagfile_information:\n  relative_file_paths:\n    - walk_0.db3\n    - walk?#%_1.db3\n",
    )
    .unwrap();
    let (stamps, errors) = drain(root).unwrap();
    assert_eq!((stamps, errors.len()), (vec![10, 20, 30], 0));
    let bag = Bag::open(root).unwrap();
    let counts: BTreeMap<_, _> = bag
        .topics()
        .iter()
        .map(|topic| (topic.name.as_str(), (topic.messages, topic.kind.is_some())))
        .collect();
    assert_eq!(counts["/imu"], (3, true));
    assert_eq!(counts["/image"], (1, false));
}

#[test]
fn clouds_of_a_bag_are_scans_and_a_broken_one_costs_itself() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("clouds.db3");
    let cut = cloud(2.0)[..60].to_vec();
    db3(
        &path,
        &[
            (2, 1, cloud(1.0)),
            (2, 2, cut),
            (2, 3, cloud(3.0)),
            (1, 4, imu(false, 1)),
        ],
    );
    let mut scans = BagScans::open(&path).unwrap();
    let mut points: Vec<Point> = Vec::new();
    let mut seen = Vec::new();
    while !scans.at_end() {
        match scans.read_scan(&mut points, Stamp::default()) {
            Ok(Some(header)) => seen.push(Ok((header.sequence, points[0].x))),
            Ok(None) => {}
            Err(error) => seen.push(Err(error.kind())),
        }
    }
    assert_eq!(
        seen,
        [Ok((0, 1.0)), Err(FaultKind::ReadAgain), Ok((1, 3.0))]
    );
    assert!(matches!(
        BagPackets::open(&path),
        Err(BagError::NoTopic { .. })
    ));
}

#[test]
fn a_database_that_is_no_bag_or_a_program_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let build = |name: &str, sql: &str| {
        let path = folder.path().join(name);
        let connection = rusqlite::Connection::open(&path).unwrap();
        connection.execute_batch(sql).unwrap();
        Bag::open(&path).unwrap_err().to_string()
    };
    assert!(build("other.db3", "CREATE TABLE t(x)").contains("no ROS 2 bag"));
    let endless = "CREATE VIEW messages AS WITH RECURSIVE n(id) AS (SELECT 1 UNION ALL SELECT id + 1 \
                   FROM n) SELECT id, 1 AS topic_id, id AS timestamp, zeroblob(9) AS data FROM n;";
    let topics = TABLES.split_once("CREATE TABLE messages").unwrap().0;
    assert!(build("view.db3", &format!("{topics}{endless}")).contains("no ROS 2 bag"));
    let computed = "CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id, timestamp, \
                    data BLOB AS (zeroblob(1000000000)))";
    assert!(build("computed.db3", &format!("{topics}{computed}")).contains("computed columns"));
}

#[test]
fn a_database_cut_or_damaged_anywhere_ends() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("whole.db3");
    let messages: Vec<_> = (0..40).map(|n| (1, n, imu(false, n as u32))).collect();
    db3(&path, &messages);
    let whole = fs::read(&path).unwrap();
    for cut in (0..whole.len()).step_by(509) {
        let path = write(folder.path(), "cut.db3", &whole[..cut]);
        if let Ok((stamps, _)) = drain(&path) {
            assert!(stamps.len() <= 40);
        }
    }
    for at in (0..whole.len()).step_by(7) {
        let mut bytes = whole.clone();
        bytes[at] ^= 0xff;
        let path = write(folder.path(), "flip.db3", &bytes);
        let _ = drain(&path);
    }
}

/// Two channels in chunks of a few messages, written out of time order.
fn mcap_file(compression: Option<mcap::Compression>) -> Vec<u8> {
    let options = mcap::WriteOptions::new()
        .compression(compression)
        .chunk_size(Some(700));
    let mut bytes = std::io::Cursor::new(Vec::new());
    let mut writer = options.create(&mut bytes).unwrap();
    let channel = |writer: &mut mcap::Writer<_>, name: &str, kind: &str| {
        let schema = writer.add_schema(kind, "ros2msg", b"").unwrap();
        writer
            .add_channel(schema, name, "cdr", &BTreeMap::new())
            .unwrap()
    };
    let samples = channel(&mut writer, "/imu", "sensor_msgs/msg/Imu");
    let images = channel(&mut writer, "/image", "sensor_msgs/msg/Image");
    for nanos in [10_u32, 50, 30, 20, 40] {
        let header = |channel_id| mcap::records::MessageHeader {
            channel_id,
            sequence: nanos,
            log_time: u64::from(nanos),
            publish_time: 0,
        };
        writer
            .write_to_known_channel(&header(samples), &imu(false, nanos))
            .unwrap();
        writer
            .write_to_known_channel(&header(images), &[0; 30])
            .unwrap();
    }
    writer.finish().unwrap();
    drop(writer);
    bytes.into_inner()
}

#[test]
fn mcap_messages_come_in_time_order_and_without_index_as_written() {
    let folder = tempfile::tempdir().unwrap();
    for compression in [
        None,
        Some(mcap::Compression::Zstd),
        Some(mcap::Compression::Lz4),
    ] {
        let whole = mcap_file(compression);
        let path = write(folder.path(), "whole.mcap", &whole);
        let (stamps, errors) = drain(&path).unwrap();
        assert_eq!((stamps, errors.len()), (vec![10, 20, 30, 40, 50], 0));
        let bag = Bag::open(&path).unwrap();
        let count = |name| {
            bag.topics()
                .iter()
                .find(|t| t.name == name)
                .unwrap()
                .messages
        };
        assert_eq!((count("/imu"), count("/image")), (5, 5));
        assert!(bag.notes().is_empty(), "{:?}", bag.notes());
        // The recorder was killed: no summary, no end.
        let path = write(folder.path(), "cut.mcap", &whole[..whole.len() - 40]);
        let (stamps, errors) = drain(&path).unwrap();
        assert_eq!((stamps, errors.len()), (vec![10, 50, 30, 20, 40], 0));
        assert!(!Bag::open(&path).unwrap().notes().is_empty());
    }
}

/// Found by fuzzing: the container crate's linear reader subtracts such a length unchecked.
#[test]
fn an_mcap_record_longer_than_its_chunk_costs_that_chunk() {
    let folder = tempfile::tempdir().unwrap();
    let mut bytes = mcap_file(None);
    bytes.truncate(bytes.len() - 40);
    // The first record of the first chunk is the schema: its name is 8 + 2 + 1 + 4 bytes behind
    // the start of the record, whose length lies right behind its opcode.
    let name = b"sensor_msgs/msg/Imu";
    let at = bytes.windows(name.len()).position(|w| w == name).unwrap();
    bytes[at - 4 - 2 - 8 + 6] = 1;
    let path = write(folder.path(), "long.mcap", &bytes);
    let (stamps, errors) = drain(&path).unwrap();
    assert!(
        stamps.len() < 5 && errors.len() == 1,
        "{stamps:?} {errors:?}"
    );
}

#[test]
fn an_mcap_file_cut_or_damaged_anywhere_ends() {
    let folder = tempfile::tempdir().unwrap();
    for compression in [None, Some(mcap::Compression::Zstd)] {
        let whole = mcap_file(compression);
        for cut in 8..whole.len() {
            let path = write(folder.path(), "cut.mcap", &whole[..cut]);
            let (stamps, _) = drain(&path).unwrap();
            let written = [10, 50, 30, 20, 40];
            assert!(written.starts_with(&stamps), "{cut}: {stamps:?}");
        }
        for at in (8..whole.len()).step_by(3) {
            let mut bytes = whole.clone();
            bytes[at] ^= 0xff;
            let path = write(folder.path(), "flip.mcap", &bytes);
            let _ = drain(&path);
        }
    }
}

#[test]
fn a_packet_longer_than_the_buffer_is_refused_and_the_next_one_follows() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("packets.db3");
    let mut scan = vec![0, 1, 0, 0];
    for value in [7_u32, 0, 1, 0, 2] {
        scan.extend(value.to_le_bytes());
    }
    for fill in [1_u8, 2] {
        scan.extend([7, 0, 0, 0, fill, 0, 0, 0]);
        scan.extend([fill; 1206]);
        scan.resize(scan.len().next_multiple_of(4), 0);
    }
    db3(&path, &[(4, 1, scan)]);
    let connection = rusqlite::Connection::open(&path).unwrap();
    let topic = "INSERT INTO topics VALUES (4, '/p', 'velodyne_msgs/msg/VelodyneScan', 'cdr', '')";
    connection.execute_batch(topic).unwrap();
    drop(connection);
    let mut source = BagPackets::open(&path).unwrap();
    let error = source.receive(&mut [0; 100], Stamp::default()).unwrap_err();
    assert!(matches!(
        error,
        BagError::PacketTooLong {
            got: 1206,
            capacity: 100,
            ..
        }
    ));
    let mut buffer = [0; 1206];
    let received = source
        .receive(&mut buffer, Stamp::default())
        .unwrap()
        .unwrap();
    assert_eq!(
        (received.stamp.as_nanos(), received.port),
        (7_000_000_002, 2368)
    );
    assert_eq!(buffer, [2; 1206]);
    assert!(!source.at_end());
    assert!(
        source
            .receive(&mut buffer, Stamp::default())
            .unwrap()
            .is_none()
    );
    assert!(source.at_end());
}
