//! One CAN frame, of those that are used here: an eleven-bit identifier and up to eight bytes.

/// Largest identifier of eleven bits.
pub const MOST_ID: u16 = 0x7FF;

/// A frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct CanFrame {
    id: u16,
    remote: bool,
    len: u8,
    data: [u8; 8],
}

impl CanFrame {
    /// A frame with these bytes; `None` if they are more than eight or the identifier has more than
    /// eleven bits.
    pub fn new(id: u16, bytes: &[u8]) -> Option<Self> {
        let mut data = [0; 8];
        data.get_mut(..bytes.len())?.copy_from_slice(bytes);
        (id <= MOST_ID).then_some(Self {
            id,
            remote: false,
            // At most eight.
            len: bytes.len() as u8,
            data,
        })
    }

    /// A frame that asks the owner of an identifier to send it.
    pub fn request(id: u16) -> Option<Self> {
        Some(Self {
            remote: true,
            ..Self::new(id, &[])?
        })
    }

    /// Its identifier.
    pub const fn id(&self) -> u16 {
        self.id
    }

    /// Whether it asks instead of says.
    pub const fn is_request(&self) -> bool {
        self.remote
    }

    /// Its bytes.
    pub fn data(&self) -> &[u8] {
        &self.data[..usize::from(self.len)]
    }
}
