//! The tables that the factory measured for this one camera and wrote into it.
//!
//! In: a table's bytes as the hardware monitor gives them. Out: [`hachi_hal::Intrinsics`] for any
//! picture size, and where the colour camera stands beside the depth camera. A table is believed
//! only if its checksum is right and its numbers can be a camera's.

pub(crate) mod color;
pub(crate) mod depth;

use crc::{CRC_32_ISO_HDLC, Crc};
use hachi_hal::Intrinsics;

use crate::bytes::u32_at;

pub use color::ColorCalibration;
pub use depth::DepthCalibration;

/// Bytes before a table's contents.
pub(crate) const TABLE_HEAD: usize = 16;
pub(crate) const CRC: Crc<u32> = Crc::<u32>::new(&CRC_32_ISO_HDLC);

/// Why a table was refused, with what was seen.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum CalibrationError {
    /// Too short for what is read from it.
    #[error("calibration table {table}: {got} bytes, {needed} are needed")]
    Length {
        /// The table's number.
        table: u16,
        /// Bytes there.
        got: usize,
        /// Bytes needed.
        needed: usize,
    },
    /// Another table.
    #[error("calibration table {table} was asked for and {got} came")]
    Table {
        /// The table's number.
        table: u16,
        /// What the header says.
        got: u16,
    },
    /// Damaged.
    #[error(
        "calibration table {table} is damaged: checksum {computed:#010x}, {said:#010x} written"
    )]
    Checksum {
        /// The table's number.
        table: u16,
        /// Of the bytes there.
        computed: u32,
        /// In the header.
        said: u32,
    },
    /// Whole, but not what a camera can be.
    #[error("calibration table {table} has {what} that no camera can have for {width} x {height}")]
    Impossible {
        /// The table's number.
        table: u16,
        /// Which numbers.
        what: &'static str,
        /// Columns of the picture asked for; 0 if it is not about a picture.
        width: u32,
        /// Rows.
        height: u32,
    },
}

/// A table's numbers for a picture, if they are a camera's: it looks out of its own picture.
fn believed(intrinsics: Intrinsics, table: u16) -> Result<Intrinsics, CalibrationError> {
    let Intrinsics { width, height, .. } = intrinsics;
    let mut centre = intrinsics.centre.into_iter().zip([width, height]);
    if intrinsics.is_sound() && centre.all(|(c, size)| (0.0..f64::from(size)).contains(&c)) {
        Ok(intrinsics)
    } else {
        Err(CalibrationError::Impossible {
            table,
            what: "intrinsics",
            width,
            height,
        })
    }
}

/// The table's contents, behind a header that fits and a checksum that is right.
///
/// Header: version (big-endian, the only one), kind, size of the contents, a parameter, and the
/// checksum of everything behind the header.
fn contents(bytes: &[u8], table: u16, needed: usize) -> Result<&[u8], CalibrationError> {
    let got = bytes.len();
    let length = CalibrationError::Length { table, got, needed };
    if got < TABLE_HEAD {
        return Err(length);
    }
    let kind = u16::from_le_bytes([bytes[2], bytes[3]]);
    if kind != table {
        return Err(CalibrationError::Table { table, got: kind });
    }
    let all = &bytes[TABLE_HEAD..];
    let size = usize::try_from(u32_at(bytes, 4)).map_err(|_| length)?;
    let sized = all.get(..size).ok_or(length)?;
    if size < needed - TABLE_HEAD {
        return Err(length);
    }
    // Firmware differs in whether the checksum covers what the size says or all that is sent.
    let said = u32_at(bytes, 12);
    let computed = CRC.checksum(sized);
    if computed != said && CRC.checksum(all) != said {
        return Err(CalibrationError::Checksum {
            table,
            computed,
            said,
        });
    }
    Ok(sized)
}
