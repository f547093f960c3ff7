//! Values as ROS 2 puts them on the wire: CDR, little-endian, each number aligned to its own size
//! (OMG CDR, as in DDS-XTypes 1.3, 7.4.1).

use hachi_hal::Stamp;

/// Little-endian CDR, no options.
const ENCAPSULATION: [u8; 4] = [0, 1, 0, 0];

/// Writes one message.
#[derive(Debug)]
pub struct Cdr<'a>(&'a mut Vec<u8>);

impl<'a> Cdr<'a> {
    /// Begins a message in place of what is there.
    pub fn new(bytes: &'a mut Vec<u8>) -> Self {
        bytes.clear();
        bytes.extend_from_slice(&ENCAPSULATION);
        Self(bytes)
    }

    /// Alignment counts from behind the encapsulation.
    fn align(&mut self, size: usize) {
        while !(self.0.len() - ENCAPSULATION.len()).is_multiple_of(size) {
            self.0.push(0);
        }
    }

    /// One byte.
    pub fn u8(&mut self, value: u8) {
        self.0.push(value);
    }

    /// Also the length of what follows, in a sequence.
    pub fn u32(&mut self, value: u32) {
        self.align(4);
        self.0.extend_from_slice(&value.to_le_bytes());
    }

    /// Numbers one after the other, as in a fixed array.
    pub fn f64s(&mut self, values: &[f64]) {
        for value in values {
            self.align(8);
            self.0.extend_from_slice(&value.to_le_bytes());
        }
    }

    /// Bytes as they are.
    pub fn raw(&mut self, bytes: &[u8]) {
        self.0.extend_from_slice(bytes);
    }

    /// A text with its length, which counts the zero at its end.
    pub fn string(&mut self, text: &str) {
        self.u32(text.len() as u32 + 1);
        self.raw(text.as_bytes());
        self.u8(0);
    }

    /// `builtin_interfaces/Time`.
    pub fn stamp(&mut self, stamp: Stamp) {
        const SECOND: i64 = 1_000_000_000;
        let nanos = stamp.as_nanos();
        // Seconds are an i32 there: until 2038.
        self.u32(nanos.div_euclid(SECOND) as i32 as u32);
        self.u32(nanos.rem_euclid(SECOND) as u32);
    }

    /// `std_msgs/Header`.
    pub fn header(&mut self, stamp: Stamp, frame: &str) {
        self.stamp(stamp);
        self.string(frame);
    }
}
