//! Any bytes as MOTChallenge text: read, tracked, measured against themselves, written and read.
#![no_main]

use hachi_people::metrics::evaluate;
use hachi_people::mot::{read, write};
use hachi_people::recording::track_detections;
use hachi_people::track::TrackerConfig;
use libfuzzer_sys::fuzz_target;

/// Pairing takes cubic time: a fuzzer's thousands of boxes would only be slow.
const MANY: usize = 300;

fuzz_target!(|bytes: &[u8]| {
    let Ok(boxes) = read(bytes) else { return };
    let mut text = Vec::new();
    write(&boxes, &mut text).expect("a Vec takes everything");
    assert_eq!(
        read(&text[..]).map(|again| again.len()).ok(),
        Some(boxes.len())
    );
    if boxes.len() > MANY {
        return;
    }
    let tracks = track_detections(&boxes, TrackerConfig::default(), 10.0);
    for line in &tracks {
        assert!(line.bounding_box.is_sound(), "{line:?}");
    }
    if let Ok(metrics) = evaluate(&boxes, &tracks) {
        assert!(
            metrics.mota <= 1.0 && (0.0..=1.0).contains(&metrics.idf1),
            "{metrics:?}"
        );
    }
});
