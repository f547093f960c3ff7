//! The remote control's forty bytes, which every state carries: sticks and keys.
//!
//! With it a person takes over or stops the robot, whatever a program wants.

use super::error::{FieldError, all_finite};
use super::wire::{Fields, Reader};

/// Bytes of a remote control's state.
pub const REMOTE_LEN: usize = 40;

/// A key of the remote control. The discriminant is its bit.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[repr(u8)]
#[allow(missing_docs, reason = "the names are those printed on the keys")]
pub enum Key {
    R1 = 0,
    L1 = 1,
    Start = 2,
    Select = 3,
    R2 = 4,
    L2 = 5,
    F1 = 6,
    F2 = 7,
    A = 8,
    B = 9,
    X = 10,
    Y = 11,
    Up = 12,
    Right = 13,
    Down = 14,
    Left = 15,
}

/// Keys that are held down.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub struct Keys(pub u16);

impl Keys {
    /// These keys.
    pub const fn of(keys: &[Key]) -> Self {
        let (mut bits, mut i) = (0, 0);
        while i < keys.len() {
            bits |= 1 << keys[i] as u8;
            i += 1;
        }
        Self(bits)
    }

    /// Whether all of `keys` are down. None at all are never down.
    pub const fn holds(self, keys: Self) -> bool {
        keys.0 != 0 && self.0 & keys.0 == keys.0
    }
}

/// State of the remote control. Sticks go from -1 to 1: x to the right, y forward.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Remote {
    /// First two bytes; zeros where no remote control is connected.
    pub head: [u8; 2],
    /// Keys.
    pub keys: Keys,
    /// Left stick, x.
    pub lx: f32,
    /// Right stick, x.
    pub rx: f32,
    /// Right stick, y.
    pub ry: f32,
    /// How far L2 is pulled.
    pub l2: f32,
    /// Left stick, y.
    pub ly: f32,
}

/// Sticks rest within this of the middle.
pub const STICK_DEAD_ZONE: f32 = 0.1;

impl Remote {
    /// Reads the forty bytes of a state.
    ///
    /// # Errors
    /// A stick's position is not finite.
    pub fn decode(bytes: &[u8; REMOTE_LEN]) -> Result<Self, FieldError> {
        let mut remote = Self::default();
        remote.lay_out(&mut Reader(bytes));
        all_finite(
            "remote stick",
            &[remote.lx, remote.rx, remote.ry, remote.l2, remote.ly],
        )?;
        Ok(remote)
    }

    /// The forty bytes, the last sixteen of them idle.
    pub fn encode(&self) -> [u8; REMOTE_LEN] {
        let mut bytes = [0; REMOTE_LEN];
        let words = [self.lx, self.rx, self.ry, self.l2, self.ly];
        bytes[..2].copy_from_slice(&self.head);
        bytes[2..4].copy_from_slice(&self.keys.0.to_le_bytes());
        for (word, target) in words.iter().zip(bytes[4..24].chunks_exact_mut(4)) {
            target.copy_from_slice(&word.to_le_bytes());
        }
        bytes
    }

    fn lay_out(&mut self, io: &mut impl Fields) {
        io.bytes(&mut self.head);
        io.u16(&mut self.keys.0);
        for stick in [
            &mut self.lx,
            &mut self.rx,
            &mut self.ry,
            &mut self.l2,
            &mut self.ly,
        ] {
            io.f32(stick);
        }
    }

    /// Whether a person is steering: a stick is off its middle.
    pub fn is_steered(&self) -> bool {
        [self.lx, self.ly, self.rx, self.ry]
            .iter()
            .any(|v| v.abs() > STICK_DEAD_ZONE)
    }
}
