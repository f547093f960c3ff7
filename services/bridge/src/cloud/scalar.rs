//! The number types that cloud formats share.

/// One number's type. PCD calls it SIZE and TYPE, PLY a property type, ROS a datatype.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Scalar {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    I64,
    U64,
    F32,
    F64,
}

impl Scalar {
    /// Bytes of one number.
    pub(crate) const fn size(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::I32 | Self::U32 | Self::F32 => 4,
            Self::I64 | Self::U64 | Self::F64 => 8,
        }
    }

    pub(crate) const fn is_float(self) -> bool {
        matches!(self, Self::F32 | Self::F64)
    }

    /// Appends the little-endian bytes of a number written as text; integers that do not fit
    /// saturate. `false` if the text is no number.
    pub(crate) fn push_text(self, text: &str, row: &mut Vec<u8>) -> bool {
        if self.is_float() {
            let Ok(value) = text.parse::<f64>() else {
                return false;
            };
            match self {
                Self::F64 => row.extend_from_slice(&value.to_le_bytes()),
                _ => row.extend_from_slice(&(value as f32).to_le_bytes()),
            }
            return true;
        }
        // Whole numbers are read as such: a nanosecond time does not fit an f64.
        let value = match text.parse::<i128>() {
            Ok(value) => value,
            Err(_) => match text.parse::<f64>() {
                Ok(value) if value.is_finite() => value as i128,
                _ => return false,
            },
        };
        let (low, high) = self.range();
        let bytes = value.clamp(low, high).to_le_bytes();
        row.extend_from_slice(&bytes[..self.size()]);
        true
    }

    /// The smallest and largest value of an integer type.
    const fn range(self) -> (i128, i128) {
        match self {
            Self::I8 => (i8::MIN as i128, i8::MAX as i128),
            Self::U8 => (0, u8::MAX as i128),
            Self::I16 => (i16::MIN as i128, i16::MAX as i128),
            Self::U16 => (0, u16::MAX as i128),
            Self::I32 => (i32::MIN as i128, i32::MAX as i128),
            Self::U32 => (0, u32::MAX as i128),
            Self::I64 => (i64::MIN as i128, i64::MAX as i128),
            Self::U64 | Self::F32 | Self::F64 => (0, u64::MAX as i128),
        }
    }
}

/// Where one number of a point lies.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Column {
    pub(crate) offset: usize,
    pub(crate) scalar: Scalar,
    pub(crate) big_endian: bool,
}

impl Column {
    /// The bytes of this number, in the reader's own order. `row` holds the whole point: `Layout`
    /// has checked that the column ends inside it.
    fn take<const N: usize>(self, row: &[u8]) -> [u8; N] {
        let mut bytes = [0; N];
        bytes.copy_from_slice(&row[self.offset..self.offset + N]);
        if self.big_endian {
            bytes.reverse();
        }
        bytes
    }

    pub(crate) fn f64(self, row: &[u8]) -> f64 {
        match self.scalar {
            Scalar::F32 => f64::from(f32::from_le_bytes(self.take(row))),
            Scalar::F64 => f64::from_le_bytes(self.take(row)),
            Scalar::U64 => u64::from_le_bytes(self.take(row)) as f64,
            _ => self.i64(row) as f64,
        }
    }

    pub(crate) fn f32(self, row: &[u8]) -> f32 {
        match self.scalar {
            Scalar::F32 => f32::from_le_bytes(self.take(row)),
            _ => self.f64(row) as f32,
        }
    }

    /// As a whole number; floats are cut, what does not fit saturates.
    pub(crate) fn i64(self, row: &[u8]) -> i64 {
        match self.scalar {
            Scalar::I8 => i64::from(i8::from_le_bytes(self.take(row))),
            Scalar::U8 => i64::from(u8::from_le_bytes(self.take(row))),
            Scalar::I16 => i64::from(i16::from_le_bytes(self.take(row))),
            Scalar::U16 => i64::from(u16::from_le_bytes(self.take(row))),
            Scalar::I32 => i64::from(i32::from_le_bytes(self.take(row))),
            Scalar::U32 => i64::from(u32::from_le_bytes(self.take(row))),
            Scalar::I64 => i64::from_le_bytes(self.take(row)),
            Scalar::U64 => i64::try_from(u64::from_le_bytes(self.take(row))).unwrap_or(i64::MAX),
            Scalar::F32 | Scalar::F64 => self.f64(row) as i64,
        }
    }
}
