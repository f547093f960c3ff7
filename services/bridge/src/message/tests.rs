//! Messages are built by a serialiser of a few lines that shares nothing with the reader.

use hachi_hal::{Point, Stamp};

use super::*;
use crate::error::CloudError;

/// Writes values as CDR or ROS 1 do.
struct Builder {
    bytes: Vec<u8>,
    origin: usize,
    big: bool,
    ros1: bool,
}

impl Builder {
    fn cdr(big: bool) -> Self {
        Self {
            bytes: vec![0, u8::from(!big), 0, 0],
            origin: 4,
            big,
            ros1: false,
        }
    }
    fn ros1() -> Self {
        Self {
            bytes: Vec::new(),
            origin: 0,
            big: false,
            ros1: true,
        }
    }
    fn value(mut self, little: &[u8]) -> Self {
        while !self.ros1 && !(self.bytes.len() - self.origin).is_multiple_of(little.len()) {
            self.bytes.push(0);
        }
        if self.big {
            self.bytes.extend(little.iter().rev());
        } else {
            self.bytes.extend(little);
        }
        self
    }
    fn u8(self, value: u8) -> Self {
        self.value(&[value])
    }
    fn u32(self, value: u32) -> Self {
        self.value(&value.to_le_bytes())
    }
    fn f64s(mut self, values: &[f64]) -> Self {
        for value in values {
            self = self.value(&value.to_le_bytes());
        }
        self
    }
    fn raw(mut self, bytes: &[u8]) -> Self {
        self.bytes.extend_from_slice(bytes);
        self
    }
    fn string(self, text: &str) -> Self {
        let zero: &[u8] = if self.ros1 { &[] } else { &[0] };
        self.u32((text.len() + zero.len()) as u32)
            .raw(text.as_bytes())
            .raw(zero)
    }
    fn header(mut self, seconds: u32, nanos: u32, frame: &str) -> Self {
        if self.ros1 {
            self = self.u32(77);
        }
        self.u32(seconds).u32(nanos).string(frame)
    }
}

fn every_dialect() -> [(Encoding, Builder); 3] {
    [
        (Encoding::Cdr, Builder::cdr(false)),
        (Encoding::Cdr, Builder::cdr(true)),
        (Encoding::Ros1, Builder::ros1()),
    ]
}

#[test]
fn an_imu_sample_reads_the_same_in_every_dialect() {
    for (encoding, builder) in every_dialect() {
        let bytes = builder
            .header(1_700_000_000, 250_000_000, "imu")
            .f64s(&[0.0, 0.0, 0.0, 1.0])
            .f64s(&[0.0; 9])
            .f64s(&[0.1, -0.2, 0.3])
            .f64s(&[0.0; 9])
            .f64s(&[0.5, -0.25, 9.75])
            .f64s(&[0.0; 9])
            .bytes;
        let Body::Imu(sample) = decode(MessageKind::Imu, encoding, &bytes).unwrap() else {
            panic!("not an IMU sample");
        };
        assert_eq!(sample.stamp, Stamp::from_nanos(1_700_000_000_250_000_000));
        assert_eq!(sample.angular_velocity.as_slice(), [0.1, -0.2, 0.3]);
        assert_eq!(sample.specific_force.as_slice(), [0.5, -0.25, 9.75]);
        for cut in 0..bytes.len() {
            assert!(decode(MessageKind::Imu, encoding, &bytes[..cut]).is_err());
        }
    }
}

#[test]
fn odometry_gives_the_pose_and_refuses_one_that_is_none() {
    let build = |quaternion: [f64; 4]| {
        Builder::cdr(false)
            .header(5, 0, "odom")
            .string("base_link")
            .f64s(&[1.0, 2.0, 3.0])
            .f64s(&quaternion)
            .f64s(&[0.0; 36])
            .bytes
    };
    // A quarter turn to the left takes x forward to y left.
    let half = 0.5_f64.sqrt();
    let bytes = build([0.0, 0.0, half, half]);
    let Body::Odometry(sample) = decode(MessageKind::Odometry, Encoding::Cdr, &bytes).unwrap()
    else {
        panic!("not odometry");
    };
    let ahead = sample.odom_from_base * nalgebra::Point3::new(1.0, 0.0, 0.0);
    assert!((ahead - nalgebra::Point3::new(1.0, 3.0, 3.0)).norm() < 1e-12);
    for bad in [[0.0; 4], [f64::NAN, 0.0, 0.0, 1.0], [0.0, 0.0, 0.0, 2.0]] {
        assert!(matches!(
            decode(MessageKind::Odometry, Encoding::Cdr, &build(bad)),
            Err(DecodeError::Value { .. })
        ));
    }
}

/// Two rows of two points, 20 bytes each, with 4 bytes of padding behind each row: x, y, z,
/// intensity as f32 and `t` as u32 nanoseconds.
struct Cloud {
    width: u32,
    height: u32,
    point_step: u32,
    row_step: u32,
    claimed: Option<u32>,
    fields: Vec<(&'static str, u32, u8)>,
}

impl Default for Cloud {
    fn default() -> Self {
        Self {
            width: 2,
            height: 2,
            point_step: 20,
            row_step: 44,
            claimed: None,
            fields: vec![
                ("x", 0, 7),
                ("y", 4, 7),
                ("z", 8, 7),
                ("intensity", 12, 7),
                ("t", 16, 6),
            ],
        }
    }
}

impl Cloud {
    fn build(&self, builder: Builder) -> Vec<u8> {
        let mut builder = builder
            .header(100, 5, "lidar")
            .u32(self.height)
            .u32(self.width)
            .u32(self.fields.len() as u32);
        for &(name, offset, datatype) in &self.fields {
            builder = builder.string(name).u32(offset).u8(datatype).u32(1);
        }
        let mut data = Vec::new();
        for index in 0..4_u8 {
            for value in [f32::from(index), 0.5, -0.5, 10.0 * f32::from(index)] {
                data.extend(value.to_le_bytes());
            }
            data.extend((30_000_000 * u32::from(3 - index)).to_le_bytes());
            if index % 2 == 1 {
                data.extend([0xee; 4]);
            }
        }
        builder
            .u8(0)
            .u32(self.point_step)
            .u32(self.row_step)
            .u32(self.claimed.unwrap_or(data.len() as u32))
            .raw(&data)
            .u8(1)
            .bytes
    }

    fn refused(&self) -> DecodeError {
        decode(
            MessageKind::PointCloud,
            Encoding::Cdr,
            &self.build(Builder::cdr(false)),
        )
        .unwrap_err()
    }
}

#[test]
fn a_cloud_with_padded_rows_comes_out_oldest_first_with_its_times() {
    for (encoding, builder) in every_dialect() {
        let bytes = Cloud::default().build(builder);
        let body = decode(MessageKind::PointCloud, encoding, &bytes).unwrap();
        let Body::PointCloud(cloud) = body else {
            panic!("not a cloud");
        };
        assert_eq!((cloud.frame_id(), cloud.len()), ("lidar", 4));
        let mut reader = CloudReader::default();
        let mut points: Vec<Point> = vec![Point::default(); 9];
        let (header, info) = reader.read(&cloud, Stamp::default(), &mut points);
        let seen: Vec<_> = points
            .iter()
            .map(|p| (p.x, p.intensity, p.time_offset_ns))
            .collect();
        assert_eq!(
            seen,
            [
                (3.0, 30.0, 0),
                (2.0, 20.0, 30_000_000),
                (1.0, 10.0, 60_000_000),
                (0.0, 0.0, 90_000_000)
            ]
        );
        assert_eq!(header.start, Stamp::from_nanos(100_000_000_005));
        assert_eq!(header.end, Stamp::from_nanos(100_090_000_005));
        assert!(header.has_point_times && info.non_finite == 0);
        for cut in 0..bytes.len() - 1 {
            assert!(decode(MessageKind::PointCloud, encoding, &bytes[..cut]).is_err());
        }
    }
}

#[test]
fn tables_and_sizes_that_lie_are_refused() {
    let outside = Cloud {
        point_step: 16,
        row_step: 36,
        ..Cloud::default()
    };
    assert!(matches!(
        outside.refused(),
        DecodeError::Cloud(CloudError::FieldOutside {
            end: 20,
            stride: 16,
            ..
        })
    ));
    let overflow = Cloud {
        width: u32::MAX,
        height: u32::MAX,
        ..Cloud::default()
    };
    assert!(matches!(
        overflow.refused(),
        DecodeError::Cloud(CloudError::TooLarge { .. })
    ));
    let tall = Cloud {
        height: 3,
        ..Cloud::default()
    };
    assert!(matches!(
        tall.refused(),
        DecodeError::Cloud(CloudError::Truncated { points: 6, .. })
    ));
    let overlapping = Cloud {
        row_step: 8,
        ..Cloud::default()
    };
    assert!(matches!(
        overlapping.refused(),
        DecodeError::Cloud(CloudError::Truncated { .. })
    ));
    let gigabytes = Cloud {
        claimed: Some(u32::MAX),
        ..Cloud::default()
    };
    assert!(matches!(gigabytes.refused(), DecodeError::Truncated { .. }));
    let no_z = Cloud {
        fields: vec![("x", 0, 7), ("y", 4, 7), ("z", 8, 99)],
        ..Cloud::default()
    };
    assert!(matches!(
        no_z.refused(),
        DecodeError::Cloud(CloudError::NoField { missing: "z", .. })
    ));
    let stepless = Cloud {
        point_step: 0,
        fields: vec![("x", u32::MAX, 7)],
        ..Cloud::default()
    };
    assert!(matches!(
        stepless.refused(),
        DecodeError::Cloud(CloudError::FieldOutside { .. })
    ));
    assert_eq!(
        decode(MessageKind::Imu, Encoding::Cdr, &[0, 3, 0, 0, 0]).unwrap_err(),
        DecodeError::Encapsulation { got: [0, 3] }
    );
}

#[test]
fn zero_points_are_a_cloud() {
    let empty = Cloud {
        width: 0,
        height: u32::MAX,
        ..Cloud::default()
    };
    let bytes = empty.build(Builder::cdr(false));
    let body = decode(MessageKind::PointCloud, Encoding::Cdr, &bytes).unwrap();
    let Body::PointCloud(cloud) = body else {
        panic!("not a cloud");
    };
    let (header, info) = CloudReader::default().read(&cloud, Stamp::from_nanos(1), &mut Vec::new());
    assert!(cloud.is_empty() && info.points == 0 && !header.has_point_times);
    assert_eq!(header.end, Stamp::from_nanos(100_000_000_005));
}

#[test]
fn velodyne_packets_keep_their_stamps_and_bytes() {
    for (encoding, builder) in every_dialect() {
        let mut builder = builder.header(9, 0, "velodyne").u32(2);
        for (stamp, fill) in [((9, 1), 0x11), ((0, 0), 0x22)] {
            builder = builder.u32(stamp.0).u32(stamp.1).raw(&[fill; 1206]);
        }
        let bytes = builder.bytes;
        let body = decode(MessageKind::VelodyneScan, encoding, &bytes).unwrap();
        let Body::Packets(packets) = body else {
            panic!("not packets");
        };
        let seen: Vec<_> = packets.iter().collect();
        assert_eq!((packets.sensor(), packets.len()), (Sensor::Velodyne, 2));
        assert_eq!(seen[0].stamp, Stamp::from_nanos(9_000_000_001));
        // A packet without a stamp has its message's.
        assert_eq!(seen[1].stamp, Stamp::from_nanos(9_000_000_000));
        assert_eq!((seen[1].payload, seen[1].port), (&[0x22; 1206][..], 2368));
        for cut in 0..bytes.len() {
            assert!(decode(MessageKind::VelodyneScan, encoding, &bytes[..cut]).is_err());
        }
    }
}

#[test]
fn robosense_packets_are_told_apart_by_their_magic() {
    let mut msop = [0_u8; 1500];
    msop[..4].copy_from_slice(&[0x55, 0xaa, 0x05, 0x5a]);
    let mut difop = [0_u8; 1500];
    difop[..8].copy_from_slice(&[0xa5, 0xff, 0, 0x5a, 0x11, 0x11, 0x55, 0x55]);
    let build = |size: u32| {
        let mut builder = Builder::cdr(false).header(9, 0, "rs").u32(2);
        for data in [&msop, &difop] {
            builder = builder.u32(9).u32(1).u8(0).raw(data).u32(size);
        }
        builder.bytes
    };
    let bytes = build(1248);
    let body = decode(MessageKind::RobosenseScan, Encoding::Cdr, &bytes).unwrap();
    let Body::Packets(packets) = body else {
        panic!("not packets");
    };
    let ports: Vec<_> = packets.iter().map(|p| (p.port, p.payload.len())).collect();
    assert_eq!(ports, [(6699, 1248), (7788, 1248)]);
    assert_eq!(
        decode(MessageKind::RobosenseScan, Encoding::Cdr, &build(1501)).unwrap_err(),
        DecodeError::PacketLength {
            index: 0,
            claimed: 1501,
            capacity: 1500
        }
    );
    let single = Builder::cdr(false)
        .header(4, 0, "rs")
        .u8(1)
        .u8(0)
        .u32(1248)
        .raw(&difop[..1248])
        .bytes;
    let body = decode(MessageKind::RslidarPacket, Encoding::Cdr, &single).unwrap();
    let Body::Packets(packets) = body else {
        panic!("not packets");
    };
    let packet = packets.iter().next().unwrap();
    assert_eq!(
        (packet.port, packet.stamp),
        (7788, Stamp::from_nanos(4_000_000_000))
    );
}

#[test]
fn a_length_of_gigabytes_is_refused_before_any_work() {
    let bytes = Builder::cdr(false).header(9, 0, "v").u32(u32::MAX).bytes;
    assert!(matches!(
        decode(MessageKind::VelodyneScan, Encoding::Cdr, &bytes),
        Err(DecodeError::Truncated { left: 0, .. })
    ));
}

#[test]
fn type_names_of_both_ros_generations_are_known() {
    for name in ["sensor_msgs/PointCloud2", "sensor_msgs/msg/PointCloud2"] {
        assert_eq!(
            MessageKind::from_type_name(name),
            Some(MessageKind::PointCloud)
        );
    }
    for name in ["sensor_msgs/Image", "PointCloud2", "", "my/PointCloud2"] {
        assert_eq!(MessageKind::from_type_name(name), None);
    }
}
