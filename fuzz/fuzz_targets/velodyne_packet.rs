//! Any bytes as a VLP-16 data packet: refused, or points that are finite and in order.
#![no_main]

use hachi_velodyne::packet::{Decoder, DecoderConfig, PointBatch, recognise};
use libfuzzer_sys::fuzz_target;

fuzz_target!(|data: &[u8]| {
    let Some((&switches, payload)) = data.split_first() else {
        return;
    };
    let config = DecoderConfig {
        vertical_correction: switches & 1 != 0,
        limited_view: switches & 2 != 0,
    };
    let mut batch = PointBatch::new();
    let _ = recognise(payload);
    let Ok(info) = Decoder::new(config).decode(payload, 0, &mut batch) else {
        assert!(batch.as_slice().is_empty());
        return;
    };
    let points = batch.as_slice();
    assert!(points.iter().all(|p| p.is_finite() && p.ring < 16));
    assert!(points.iter().all(|p| (0.0..360.0).contains(&p.azimuth_deg)));
    assert!(points.is_sorted_by_key(|p| p.time_offset_ns));
    assert!(points.iter().all(|p| p.time_offset_ns <= info.last_shot_ns));
});
