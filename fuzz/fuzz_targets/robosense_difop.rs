//! Any bytes as an RS-Helios-16P DIFOP packet: refused, or angles that a decoder can use.
#![no_main]

use hachi_robosense::packet::{Decoder, DecoderConfig, Difop};
use libfuzzer_sys::fuzz_target;

fuzz_target!(|data: &[u8]| {
    if let Ok(difop) = Difop::decode(data) {
        let _ = difop.gprmc();
        if let Ok(calibration) = difop.calibration {
            let mut rings = calibration.rings();
            rings.sort_unstable();
            assert!(rings.iter().copied().eq(0..16));
            let _ = Decoder::new(DecoderConfig::default(), &calibration);
        }
    }
});
