//! Any bytes as a pcap or pcapng file: refused, or read to its end with every frame accounted for.
#![no_main]

use hachi_datagram::{CaptureConfig, CaptureSource};
use hachi_hal::{PacketSource, Stamp};
use libfuzzer_sys::fuzz_target;

fuzz_target!(|data: &[u8]| {
    let Ok(mut source) = CaptureSource::new(data, CaptureConfig::on_ports(&[2_368])) else {
        return;
    };
    let mut buffer = [0; 2_048];
    let mut delivered = 0;
    while !source.at_end() {
        if let Ok(Some(received)) = source.receive(&mut buffer, Stamp::default()) {
            assert!(received.len <= buffer.len());
            delivered += 1;
        }
    }
    let counters = source.counters();
    assert_eq!(counters.delivered, delivered);
    assert!(delivered <= counters.frames);
});
