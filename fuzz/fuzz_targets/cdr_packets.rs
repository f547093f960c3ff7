//! Packet, IMU and odometry messages in every dialect: any bytes are a message or an error, and
//! every packet that was counted is handed out.
#![no_main]
use hachi_bridge::message::{Body, Encoding, MessageKind, decode};

libfuzzer_sys::fuzz_target!(|data: &[u8]| {
    for encoding in [Encoding::Cdr, Encoding::Ros1] {
        for kind in [
            MessageKind::VelodyneScan,
            MessageKind::RobosenseScan,
            MessageKind::RslidarPacket,
            MessageKind::Imu,
            MessageKind::Odometry,
        ] {
            if let Ok(Body::Packets(packets)) = decode(kind, encoding, data) {
                assert_eq!(packets.iter().count(), packets.len());
            }
        }
    }
});
