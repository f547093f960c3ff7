//! Writes what sensors sent as an MCAP file that Foxglove and ROS 2 tools open.
//!
//! In: the LiDAR's packets and the robot's body, with their stamps. Out: one file; its topics are in
//! `schemas`, their bytes in `cdr`. Packets are kept as they came, so that `hachi replay` of the
//! file is what a replay of the wire would have been. What is in a finished chunk (a quarter of a
//! megabyte, a fifth of a second) is there after the program is killed, but for the last few
//! kilobytes; nothing is forced to the disk before the end.

mod cdr;
mod schemas;

use std::collections::BTreeMap;
use std::fs::File;
use std::io::BufWriter;
use std::path::Path;

use hachi_bridge::message::Sensor;
use hachi_hal::{ImuSample, OdometrySample, Stamp};
use hachi_unitree::BodySample;
use mcap::records::MessageHeader;

use crate::exit::Failure;
use cdr::Cdr;

/// Bytes of messages that are put together before they go to the disk.
const CHUNK_BYTES: u64 = 256 << 10;

/// The topic of the inertial sensor on a bus.
pub const IMU_ON_BUS: &str = "/imu_on_bus";

type Writer = mcap::Writer<BufWriter<File>>;

fn channel(
    writer: &mut Writer,
    topic: &str,
    (name, text): (&str, String),
) -> Result<u16, mcap::McapError> {
    let schema = writer.add_schema(name, "ros2msg", text.as_bytes())?;
    writer.add_channel(schema, topic, "cdr", &BTreeMap::new())
}

/// A recording that is being written.
pub struct Recorder {
    writer: Writer,
    sensor: Sensor,
    lidar: u16,
    imu: u16,
    /// Of the inertial sensor on a bus, once it has measured.
    imu_on_bus: Option<u16>,
    joints: u16,
    odometry: u16,
    sequence: u32,
    bytes: Vec<u8>,
}

/// A packet of the LiDAR as it came.
#[derive(Debug, Clone, Copy)]
pub struct Packet<'a> {
    /// When.
    pub stamp: Stamp,
    /// To which port.
    pub port: u16,
    /// The UDP payload.
    pub payload: &'a [u8],
}

impl Recorder {
    /// Begins a file. One that is there already is not touched.
    ///
    /// # Errors
    /// It is there, or can't be made.
    pub fn create(path: &Path, sensor: Sensor) -> Result<Self, Failure> {
        let file = File::create_new(path).map_err(|error| Failure::writing(path, &error))?;
        let failed = |error: mcap::McapError| {
            Failure::new(
                format_args!("{} can't be begun: {error}", path.display()),
                "choose another place",
            )
        };
        let options = mcap::WriteOptions::new()
            .profile("ros2")
            .library("hachi")
            .compression(None)
            .chunk_size(Some(CHUNK_BYTES));
        let mut writer = options.create(BufWriter::new(file)).map_err(failed)?;
        let mut channel = |topic, schema| channel(&mut writer, topic, schema).map_err(failed);
        let lidar = match sensor {
            Sensor::Velodyne => channel("/velodyne_packets", schemas::velodyne_scan())?,
            Sensor::Robosense => channel("/rslidar_packets", schemas::rslidar_packet())?,
        };
        let imu = channel("/imu", schemas::imu())?;
        let joints = channel("/joint_states", schemas::joint_state())?;
        let odometry = channel("/leg_odometry", schemas::odometry())?;
        Ok(Self {
            writer,
            sensor,
            lidar,
            imu,
            imu_on_bus: None,
            joints,
            odometry,
            sequence: 0,
            bytes: Vec::with_capacity(64 << 10),
        })
    }

    /// Packets that came one after the other.
    ///
    /// # Errors
    /// The disk does not take them.
    pub fn packets<'a>(
        &mut self,
        mut packets: impl Iterator<Item = Packet<'a>> + Clone,
    ) -> Result<(), mcap::McapError> {
        match self.sensor {
            Sensor::Velodyne => self.velodyne(packets),
            Sensor::Robosense => packets.try_for_each(|packet| self.robosense(&packet)),
        }
    }

    /// One message for all, of data packets alone: the format has no place for others.
    fn velodyne<'a>(
        &mut self,
        packets: impl Iterator<Item = Packet<'a>> + Clone,
    ) -> Result<(), mcap::McapError> {
        let data = packets.filter(|p| p.payload.len() == schemas::VELODYNE_BYTES);
        let Some(last) = data.clone().last() else {
            return Ok(());
        };
        let mut cdr = Cdr::new(&mut self.bytes);
        cdr.header(last.stamp, "velodyne");
        cdr.u32(data.clone().count() as u32);
        for packet in data {
            cdr.stamp(packet.stamp);
            cdr.raw(packet.payload);
        }
        self.write(self.lidar, last.stamp)
    }

    fn robosense(&mut self, packet: &Packet<'_>) -> Result<(), mcap::McapError> {
        let mut cdr = Cdr::new(&mut self.bytes);
        cdr.header(packet.stamp, "rslidar");
        let is_difop = packet.port == hachi_bridge::message::ROBOSENSE_DIFOP_PORT;
        cdr.u8(u8::from(is_difop));
        cdr.u8(0);
        cdr.u32(packet.payload.len() as u32);
        cdr.raw(packet.payload);
        self.write(self.lidar, packet.stamp)
    }

    /// What the robot's body measured at one moment.
    ///
    /// # Errors
    /// The disk does not take it.
    pub fn body(&mut self, body: &BodySample) -> Result<(), mcap::McapError> {
        let q = body.attitude.level_from_base.coords;
        self.imu(&body.imu, "imu", [q.x, q.y, q.z, q.w], 0.0);
        self.write(self.imu, body.imu.stamp)?;

        let legs = &body.legs;
        let mut cdr = Cdr::new(&mut self.bytes);
        cdr.header(legs.stamp, "base");
        cdr.u32(schemas::JOINTS.len() as u32);
        for name in schemas::JOINTS {
            cdr.string(name);
        }
        for values in [&legs.angles, &legs.speeds, &legs.torques] {
            cdr.u32(schemas::JOINTS.len() as u32);
            for leg in values {
                cdr.f64s(leg.as_slice());
            }
        }
        self.write(self.joints, legs.stamp)
    }

    /// What the inertial sensor on a bus measured, in the base's axes.
    ///
    /// # Errors
    /// The disk does not take it.
    pub fn inertial(&mut self, sample: &ImuSample) -> Result<(), mcap::McapError> {
        let channel = match self.imu_on_bus {
            Some(channel) => channel,
            None => channel(&mut self.writer, IMU_ON_BUS, schemas::imu())?,
        };
        self.imu_on_bus = Some(channel);
        self.imu(sample, "base", [0.0, 0.0, 0.0, 1.0], -1.0);
        self.write(channel, sample.stamp)
    }

    /// A message; `attitude` is known where the first number of its covariance is not -1.
    fn imu(&mut self, sample: &ImuSample, frame: &str, attitude: [f64; 4], known: f64) {
        let mut cdr = Cdr::new(&mut self.bytes);
        cdr.header(sample.stamp, frame);
        cdr.f64s(&attitude);
        cdr.f64s(&[known, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
        cdr.f64s(sample.angular_velocity.as_slice());
        cdr.f64s(&[0.0; 9]);
        cdr.f64s(sample.specific_force.as_slice());
        cdr.f64s(&[0.0; 9]);
    }

    /// Where the legs say the robot is.
    ///
    /// # Errors
    /// The disk does not take it.
    pub fn motion(&mut self, sample: &OdometrySample) -> Result<(), mcap::McapError> {
        let (t, q) = (
            sample.odom_from_base.translation.vector,
            sample.odom_from_base.rotation.coords,
        );
        let mut cdr = Cdr::new(&mut self.bytes);
        cdr.header(sample.stamp, "odom");
        cdr.string("base");
        cdr.f64s(&[t.x, t.y, t.z, q.x, q.y, q.z, q.w]);
        cdr.f64s(&[0.0; 36]);
        // No twist of its own: its place is zeros.
        cdr.f64s(&[0.0; 6]);
        cdr.f64s(&[0.0; 36]);
        self.write(self.odometry, sample.stamp)
    }

    fn write(&mut self, channel_id: u16, stamp: Stamp) -> Result<(), mcap::McapError> {
        self.sequence = self.sequence.wrapping_add(1);
        let time = u64::try_from(stamp.as_nanos()).unwrap_or(0);
        let header = MessageHeader {
            channel_id,
            sequence: self.sequence,
            log_time: time,
            publish_time: time,
        };
        self.writer.write_to_known_channel(&header, &self.bytes)
    }

    /// Ends the file: with its index, tools find their way in it.
    ///
    /// # Errors
    /// The disk does not take it.
    pub fn finish(&mut self) -> Result<(), mcap::McapError> {
        self.writer.finish().map(|_| ())
    }
}
