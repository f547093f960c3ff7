//! Any bytes as a person or a model out of a store: refused, or the same when written again.
#![no_main]

use hachi_store::people::codec::{decode_model, decode_record, encode_model, encode_record};

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    if let Ok(record) = decode_record(bytes) {
        assert_eq!(encode_record(&record), bytes);
    }
    if let Ok((network, model)) = decode_model(bytes) {
        let feature = vec![1.0; model.length()];
        let _ = model.distance(&feature);
        assert_eq!(encode_model(&network, &model), bytes);
    }
});
