//! Any bytes as a VLP-16 position packet: refused, or written back as they came.
#![no_main]

use hachi_velodyne::encode::position_packet;
use hachi_velodyne::packet::PositionPacket;
use libfuzzer_sys::fuzz_target;

fuzz_target!(|data: &[u8]| {
    if let Ok(position) = PositionPacket::decode(data) {
        let _ = (position.sentence(), position.is_utc());
        let again = PositionPacket::decode(&position_packet(&position));
        assert_eq!(again, Ok(position));
    }
});
