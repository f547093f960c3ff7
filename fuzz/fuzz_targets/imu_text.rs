//! IMU text: any bytes are samples or errors, and reading ends.
#![no_main]
use hachi_bridge::ImuText;

libfuzzer_sys::fuzz_target!(|data: &[u8]| {
    if let Ok(text) = ImuText::new("imu.txt".into(), data.to_vec()) {
        let samples: Vec<_> = text.flatten().collect();
        assert!(samples.is_sorted_by_key(|sample| sample.stamp));
    }
});
