//! Any bytes as an NMEA sentence: refused, or fields within their ranges.
#![no_main]

use hachi_velodyne::packet::nmea::Sentence;
use libfuzzer_sys::fuzz_target;

fuzz_target!(|data: &[u8]| {
    // With a checksum put behind, so that the fields are reached.
    let sum = data.iter().fold(0, |sum, byte| sum ^ byte);
    let mut text = vec![b'$'];
    text.extend_from_slice(data);
    text.extend(format!("*{sum:02X}").bytes());
    for text in [data, &text] {
        if let Ok(sentence) = Sentence::parse(text) {
            let _ = (sentence.unix_time(), sentence.has_fix());
            let (Sentence::Rmc { place, .. } | Sentence::Gga { place, .. }) = sentence;
            if let Some(place) = place {
                assert!(place.latitude_deg.abs() <= 90.0);
                assert!(place.longitude_deg.abs() <= 180.0);
            }
        }
    }
});
