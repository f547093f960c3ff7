//! MSOP packets that wait for the sensor's calibration.
//!
//! The DIFOP packet comes about once a second, so a stream usually begins without it, and a short
//! recording may have it near its end. Until it comes, packets are held; when too many are, they
//! are let go with the manual's angles.

use alloc::collections::VecDeque;

use hachi_hal::Stamp;

use crate::packet::PACKET_LEN;

/// Most packets held: 10 MB, five seconds of single return. A sensor that sends no DIFOP packet for
/// so long sends none.
const MAX_HELD: usize = 8_192;

/// One packet as it came.
#[derive(Debug, Clone, Copy)]
pub(super) struct HeldPacket {
    pub(super) payload: [u8; PACKET_LEN],
    pub(super) received: Stamp,
}

/// A bounded queue of packets.
#[derive(Debug, Default)]
pub(super) struct Held {
    packets: VecDeque<HeldPacket>,
}

impl Held {
    pub(super) fn push(&mut self, payload: &[u8; PACKET_LEN], received: Stamp) {
        self.packets.push_back(HeldPacket {
            payload: *payload,
            received,
        });
    }

    /// The oldest packet. With the last one the queue's memory goes too: it will not be needed
    /// again.
    pub(super) fn pop(&mut self) -> Option<HeldPacket> {
        let packet = self.packets.pop_front();
        if packet.is_none() {
            self.packets = VecDeque::new();
        }
        packet
    }

    pub(super) fn is_full(&self) -> bool {
        self.packets.len() >= MAX_HELD
    }
}
