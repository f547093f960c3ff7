//! Any bytes as an RS-Helios-16P MSOP packet: refused, or points that are finite and in order.
#![no_main]

use hachi_robosense::packet::{
    Calibration, Decoder, DecoderConfig, MsopHeader, PointBatch, ReturnMode, recognise,
};
use libfuzzer_sys::fuzz_target;

fuzz_target!(|data: &[u8]| {
    let Some((&switches, payload)) = data.split_first() else {
        return;
    };
    let config = DecoderConfig {
        return_mode: if switches & 1 != 0 {
            ReturnMode::Dual
        } else {
            ReturnMode::First
        },
        limited_view: switches & 2 != 0,
        ..DecoderConfig::default()
    };
    let _ = (recognise(payload), MsopHeader::decode(payload));
    let decoder = Decoder::new(config, &Calibration::nominal());
    let mut batch = PointBatch::new();
    let Ok(info) = decoder.decode(payload, 0, &mut batch) else {
        assert!(batch.as_slice().is_empty());
        return;
    };
    let points = batch.as_slice();
    assert!(points.iter().all(|p| p.is_finite() && p.ring < 16));
    assert!(points.iter().all(|p| (0.0..360.0).contains(&p.azimuth_deg)));
    assert!(points.is_sorted_by_key(|p| p.time_offset_ns));
    assert!(points.iter().all(|p| p.time_offset_ns <= info.last_shot_ns));
    assert!(
        batch
            .firings()
            .iter()
            .all(|f| f.first_point <= points.len())
    );
});
