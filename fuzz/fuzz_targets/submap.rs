//! Any bytes as a submap: read as they are, and with their checksum set right, written and read again.
#![no_main]

use hachi_slam::codec::{checksum, decode, encode};
use hachi_slam::submap::Submap;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let mut submap = Submap::default();
    let _ = decode(bytes, &mut submap);
    let mut right = bytes.to_vec();
    if right.len() > 12 {
        let sum = checksum(&right[12..]).to_le_bytes();
        right[4..12].copy_from_slice(&sum);
    }
    if decode(&right, &mut submap).is_err() {
        assert!(submap.points.is_empty() && submap.viewpoints.is_empty());
        return;
    }
    let mut written = Vec::new();
    encode(&submap, &mut written);
    let mut again = Submap::default();
    decode(&written, &mut again).expect("what was written can be read");
    assert_eq!(again.points.len(), submap.points.len());
    assert_eq!(again.viewpoints.len(), submap.viewpoints.len());
});
