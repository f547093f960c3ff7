//! Recordings in a temporary file: any bytes are messages or errors, and reading ends.
#![no_main]
use hachi_bridge::Bag;

libfuzzer_sys::fuzz_target!(|data: &[u8]| {
    let folder = tempfile::tempdir().expect("a folder for temporary files");
    let path = folder.path().join("fuzzed.mcap");
    std::fs::write(&path, data).expect("room for a temporary file");
    let Ok(mut bag) = Bag::open(&path) else {
        return;
    };
    // No message takes less than a byte, and no error is told twice.
    for _ in 0..=2 * data.len() {
        if matches!(bag.next_message(), Ok(None)) {
            return;
        }
    }
    panic!("more messages than bytes");
});
