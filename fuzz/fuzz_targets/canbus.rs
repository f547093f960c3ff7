//! Any frames on a bus: an axis and a stop understand them or not, and a stop that nobody has proved
//! to be closed is pressed.
#![no_main]

use hachi_canbus::frame::CanFrame;
use hachi_canbus::odrive::Message;
use hachi_canbus::stop_node::{StopNode, StopNodeConfig};
use hachi_hal::Stamp;
use libfuzzer_sys::fuzz_target;

fuzz_target!(|data: &[u8]| {
    let config = StopNodeConfig::default();
    let mut stop = StopNode::new(config).unwrap();
    let (mut now, mut heard, mut closed) = (Stamp::from_nanos(0), None, false);
    // Each frame: eleven bits of identifier, its length, ticks of 2 ms, its bytes.
    let mut rest = data;
    while let Some((&[high, low, len, ticks], after)) = rest.split_first_chunk() {
        let len = usize::from(len % 9).min(after.len());
        let (bytes, after) = after.split_at(len);
        rest = after;
        let id = u16::from_be_bytes([high, low]) & 0x7FF;
        let frame = CanFrame::new(id, bytes).unwrap();
        now = now + i64::from(ticks) * 2_000_000;
        if let Ok(Some(message)) = Message::decode((id >> 5) as u8, &frame) {
            assert_eq!(
                message
                    .encode((id >> 5) as u8)
                    .map(|f| Message::decode((id >> 5) as u8, &f)),
                Ok(Ok(Some(message)))
            );
        }
        let taken = stop.take(&frame, now);
        match (id, taken) {
            (0x701, Ok(true)) => heard = Some(now),
            (0x181, Ok(true)) => closed = bytes[0] & 3 == 3,
            _ => {}
        }
        if stop.reason(now).is_none() {
            assert!(closed, "its contacts are not known to be closed");
            let age_ns = now.nanos_since(heard.unwrap());
            assert!(age_ns <= config.heartbeat_limit_ns);
        }
        assert!(stop.reason(now + config.heartbeat_limit_ns + 1).is_some());
    }
});
