//! PLY files: any bytes are points or an error.
#![no_main]
use hachi_bridge::cloud::{CloudDecoder, CloudFormat, read_cloud_bytes};

libfuzzer_sys::fuzz_target!(|data: &[u8]| {
    let mut points = Vec::new();
    if let Ok(info) = read_cloud_bytes(
        CloudFormat::Ply,
        data,
        &mut CloudDecoder::default(),
        &mut points,
    ) {
        assert_eq!(info.points, points.len());
        assert!(points.is_sorted_by_key(|point| point.time_offset_ns));
    }
});
