//! A byte string as a stream of packets: what the scan targets read from.

use std::convert::Infallible;

use hachi_hal::{PacketSource, Received, Stamp};

/// Cuts bytes into packets: a head says what to do, the rest of the packet follows.
///
/// Most packets are the last one with a few bytes changed, so that the fuzzer reaches what lies
/// behind the checks of a single packet.
pub struct Stream<'a> {
    bytes: &'a [u8],
    packet: Vec<u8>,
    now_ns: i64,
}

impl<'a> Stream<'a> {
    /// A stream whose packets derive from `template`.
    pub fn new(bytes: &'a [u8], template: Vec<u8>) -> Self {
        Self {
            bytes,
            packet: template,
            now_ns: 1_700_000_000_000_000_000,
        }
    }

    fn take<const N: usize>(&mut self) -> Option<[u8; N]> {
        let (head, rest) = self.bytes.split_first_chunk()?;
        self.bytes = rest;
        Some(*head)
    }

    /// The next packet: whole from the bytes, or the last one changed at a few places.
    fn next_packet(&mut self) -> Option<usize> {
        let [command, ticks] = self.take()?;
        self.now_ns += (i64::from(ticks) - 32) * 100_000;
        if command == 0xFF {
            let [high, low] = self.take()?;
            let len = usize::from(u16::from_be_bytes([high, low])).min(self.bytes.len());
            let (packet, rest) = self.bytes.split_at(len);
            self.packet.clear();
            self.packet.extend_from_slice(packet);
            self.bytes = rest;
        } else {
            for _ in 0..command % 8 {
                let [high, low, value] = self.take()?;
                let at = usize::from(u16::from_be_bytes([high, low]));
                if let Some(byte) = self.packet.get_mut(at) {
                    *byte = value;
                }
            }
        }
        Some(self.packet.len())
    }
}

impl PacketSource for Stream<'_> {
    type Error = Infallible;

    fn receive(&mut self, buffer: &mut [u8], _: Stamp) -> Result<Option<Received>, Infallible> {
        let Some(len) = self.next_packet() else {
            self.bytes = &[];
            return Ok(None);
        };
        buffer[..len].copy_from_slice(&self.packet);
        Ok(Some(Received {
            len,
            stamp: Stamp::from_nanos(self.now_ns),
            port: 0,
        }))
    }

    fn at_end(&self) -> bool {
        self.bytes.is_empty()
    }
}

/// A source that turns on: between packets the given function moves the packet's own time and
/// azimuth forward.
pub struct Turning<'a> {
    stream: Stream<'a>,
    advance: fn(&mut [u8]),
}

impl<'a> Turning<'a> {
    /// A stream whose packets go on by `advance` unless the bytes change them.
    pub fn new(bytes: &'a [u8], template: Vec<u8>, advance: fn(&mut [u8])) -> Self {
        Self {
            stream: Stream::new(bytes, template),
            advance,
        }
    }
}

impl PacketSource for Turning<'_> {
    type Error = Infallible;

    fn receive(&mut self, buffer: &mut [u8], end: Stamp) -> Result<Option<Received>, Infallible> {
        (self.advance)(&mut self.stream.packet);
        self.stream.receive(buffer, end)
    }

    fn at_end(&self) -> bool {
        self.stream.at_end()
    }
}
