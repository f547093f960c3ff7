//! Fields in order, in either direction: one description of a frame serves reading and writing.

use super::check::{CheckForm, check_value_of_frame};
use super::error::FrameError;
use super::layout::{FrameKind, LONGEST_FRAME, Layout};

/// The first two bytes of every frame.
pub const HEAD: [u8; 2] = [0xFE, 0xEF];

/// One way through a frame: a reader sets what it is shown, a writer copies it out.
pub(crate) trait Fields {
    /// Whether values are set rather than copied out.
    const READS: bool;

    /// The next `N` bytes.
    fn bytes<const N: usize>(&mut self, value: &mut [u8; N]);

    fn u8(&mut self, value: &mut u8) {
        let mut raw = [*value];
        self.bytes(&mut raw);
        *value = raw[0];
    }

    fn i8(&mut self, value: &mut i8) {
        let mut raw = value.to_le_bytes();
        self.bytes(&mut raw);
        *value = i8::from_le_bytes(raw);
    }

    fn u16(&mut self, value: &mut u16) {
        let mut raw = value.to_le_bytes();
        self.bytes(&mut raw);
        *value = u16::from_le_bytes(raw);
    }

    fn i16(&mut self, value: &mut i16) {
        let mut raw = value.to_le_bytes();
        self.bytes(&mut raw);
        *value = i16::from_le_bytes(raw);
    }

    fn u32(&mut self, value: &mut u32) {
        let mut raw = value.to_le_bytes();
        self.bytes(&mut raw);
        *value = u32::from_le_bytes(raw);
    }

    fn i32(&mut self, value: &mut i32) {
        let mut raw = value.to_le_bytes();
        self.bytes(&mut raw);
        *value = i32::from_le_bytes(raw);
    }

    fn f32(&mut self, value: &mut f32) {
        let mut raw = value.to_le_bytes();
        self.bytes(&mut raw);
        *value = f32::from_le_bytes(raw);
    }

    fn f32s(&mut self, values: &mut [f32]) {
        for value in values {
            self.f32(value);
        }
    }

    /// A value that travels as a count of `per_unit` a unit: cut towards zero, held at the ends
    /// of its range.
    fn i16_scaled(&mut self, value: &mut f32, per_unit: f32) {
        // The conversion saturates, and turns not-a-number into zero.
        let mut raw = (*value * per_unit) as i16;
        self.i16(&mut raw);
        if Self::READS {
            *value = f32::from(raw) / per_unit;
        }
    }

    /// As [`Self::i16_scaled`], without sign.
    fn u16_scaled(&mut self, value: &mut f32, per_unit: f32) {
        let mut raw = (*value * per_unit) as u16;
        self.u16(&mut raw);
        if Self::READS {
            *value = f32::from(raw) / per_unit;
        }
    }
}

/// Reads from a frame whose length was checked; beyond its end there would be zeros.
pub(crate) struct Reader<'a>(pub(crate) &'a [u8]);

impl Fields for Reader<'_> {
    const READS: bool = true;

    fn bytes<const N: usize>(&mut self, value: &mut [u8; N]) {
        match self.0.split_first_chunk() {
            Some((chunk, rest)) => (*value, self.0) = (*chunk, rest),
            None => (*value, self.0) = ([0; N], &[]),
        }
    }
}

/// Bytes of one frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Frame {
    bytes: [u8; LONGEST_FRAME],
    len: usize,
}

impl Frame {
    /// What goes on the wire.
    pub fn as_bytes(&self) -> &[u8] {
        &self.bytes[..self.len]
    }

    /// The bytes, to damage them in a test or to send what no robot would.
    pub fn as_bytes_mut(&mut self) -> &mut [u8] {
        &mut self.bytes[..self.len]
    }

    /// Puts the check value where it belongs.
    pub fn seal(&mut self, form: CheckForm) {
        let value = form.of(check_value_of_frame(self.as_bytes()));
        if let Some(last) = self.as_bytes_mut().last_chunk_mut() {
            *last = value.to_le_bytes();
        }
    }
}

/// Writes into a frame that is long enough for every robot; beyond its end nothing is written.
pub(crate) struct Writer(Frame);

impl Writer {
    pub(crate) fn new() -> Self {
        Self(Frame {
            bytes: [0; LONGEST_FRAME],
            len: 0,
        })
    }

    /// Adds the check value to all that was written.
    pub(crate) fn sealed(mut self, form: CheckForm) -> Frame {
        self.bytes(&mut [0; 4]);
        self.0.seal(form);
        self.0
    }
}

impl Fields for Writer {
    const READS: bool = false;

    fn bytes<const N: usize>(&mut self, value: &mut [u8; N]) {
        let Frame { bytes, len } = &mut self.0;
        if let Some(target) = bytes.get_mut(*len..*len + N) {
            target.copy_from_slice(value);
            *len += N;
        }
    }
}

/// A frame whose length, head and check value are right, and in which form the latter came.
pub(crate) fn opened<'a>(
    layout: &Layout,
    kind: FrameKind,
    bytes: &'a [u8],
) -> Result<(Reader<'a>, CheckForm), FrameError> {
    let (expected, got, model) = (layout.frame_len(kind), bytes.len(), layout.model);
    let (body, stored) = match bytes.split_last_chunk::<4>() {
        Some((body, stored)) if got == expected => (body, u32::from_le_bytes(*stored)),
        _ => {
            return Err(match Layout::frame_of_len(got) {
                Some((got_model, got_kind)) => FrameError::OtherFrame {
                    model,
                    kind,
                    got_model,
                    got_kind,
                    got,
                },
                None => FrameError::Length {
                    model,
                    kind,
                    expected,
                    got,
                },
            });
        }
    };
    if body[..2] != HEAD {
        return Err(FrameError::Head {
            got: [body[0], body[1]],
        });
    }
    let level = body[2];
    let plain = check_value_of_frame(bytes);
    let transformed = CheckForm::Transformed.of(plain);
    // States transform it at high level alone; which commands a robot's firmware wants
    // transformed is a matter of its edition, so the robot's side takes both.
    let may_transform = kind.is_command() || level == super::LEVEL_HIGH;
    let form = if stored == plain {
        CheckForm::Plain
    } else if stored == transformed && may_transform {
        CheckForm::Transformed
    } else {
        return Err(FrameError::Check {
            stored,
            plain,
            transformed,
        });
    };
    let fits = match kind {
        // Robots of the lesser editions leave the flag zero.
        FrameKind::HighCmd | FrameKind::HighState => matches!(level, super::LEVEL_HIGH | 0),
        FrameKind::LowCmd | FrameKind::LowState => level == super::LEVEL_LOW,
    };
    if !fits {
        return Err(FrameError::Level { kind, got: level });
    }
    Ok((Reader(&body[2..]), form))
}
