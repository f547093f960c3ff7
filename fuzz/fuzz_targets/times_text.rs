//! `times.txt`: any bytes are increasing times or an error.
#![no_main]
use std::path::Path;

use hachi_bridge::scans::parse_times;

libfuzzer_sys::fuzz_target!(|data: &[u8]| {
    if let Ok(times) = parse_times(Path::new("times.txt"), data) {
        assert!(times.windows(2).all(|pair| pair[0] < pair[1]));
    }
});
