//! Table 25: the stereo pair. Depth images are rectified, so a pin hole is all there is.

use hachi_hal::{Distortion, Intrinsics};

use super::{CalibrationError, TABLE_HEAD, believed, contents};
use crate::bytes::{f32_at, f32s_at};

/// Picture sizes in the order of the table's entries; 0 is an entry that is not used.
pub(crate) const SIZES: [(u32, u32); 16] = [
    (1920, 1080),
    (1280, 720),
    (640, 480),
    (848, 480),
    (640, 360),
    (424, 240),
    (320, 240),
    (480, 270),
    (1280, 800),
    (960, 540),
    (0, 0),
    (0, 0),
    (640, 400),
    (576, 576),
    (720, 720),
    (1152, 1152),
];

pub(crate) const BASELINE_AT: usize = 160;
pub(crate) const ENTRIES_AT: usize = 256;

/// A rectified pin hole: focal lengths and centre, pixels.
type PinHole = [f64; 4];

/// The stereo pair's calibration.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DepthCalibration {
    baseline_m: f64,
    entries: [PinHole; 16],
}

impl DepthCalibration {
    /// The table's number.
    pub const TABLE: u16 = 25;
    /// Bytes of the table that are read: the rest is reserved.
    pub const LEN: usize = 512;

    /// Reads the table.
    ///
    /// # Errors
    /// It is not this table, damaged, or has numbers that are none.
    pub fn decode(bytes: &[u8]) -> Result<Self, CalibrationError> {
        let contents = contents(bytes, Self::TABLE, Self::LEN)?;
        // Offsets are those of the whole table.
        let at = |offset: usize| offset - TABLE_HEAD;
        let baseline_mm = f32_at(contents, at(BASELINE_AT)).abs();
        let impossible = |what| CalibrationError::Impossible {
            table: Self::TABLE,
            what,
            width: 0,
            height: 0,
        };
        // Two imagers in one case stand between a centimetre and half a metre apart.
        if !(10.0..=500.0).contains(&baseline_mm) {
            return Err(impossible("a baseline"));
        }
        let entries: [PinHole; 16] =
            core::array::from_fn(|i| f32s_at(contents, at(ENTRIES_AT + 16 * i)));
        if !entries.iter().flatten().all(|v| v.is_finite()) {
            return Err(impossible("intrinsics"));
        }
        Ok(Self {
            baseline_m: baseline_mm * 1e-3,
            entries,
        })
    }

    /// Distance between the two imagers, metres.
    pub fn baseline_m(&self) -> f64 {
        self.baseline_m
    }

    /// Where the pixels of a depth image of this size look.
    ///
    /// Sizes without an entry are cut or scaled from one that has, as librealsense does it.
    ///
    /// # Errors
    /// The entry's numbers are no camera's.
    pub fn intrinsics(&self, width: u32, height: u32) -> Result<Intrinsics, CalibrationError> {
        let [fx, fy, cx, cy] = self.pin_hole(width, height);
        let picture = Intrinsics {
            width,
            height,
            focal: [fx, fy],
            centre: [cx, cy],
            distortion: Distortion::None,
        };
        believed(picture, Self::TABLE)
    }

    fn pin_hole(&self, width: u32, height: u32) -> PinHole {
        let entry = |size| {
            let index = SIZES.iter().position(|&s| s == size);
            index.map(|i| real(self.entries[i], size))
        };
        let full = real(self.entries[0], SIZES[0]);
        match (width, height) {
            // Rows from the middle of 848 x 480.
            (848, 100) => {
                let [fx, fy, cx, cy] = real(self.entries[3], SIZES[3]);
                [fx, fy, cx, cy - 190.0]
            }
            // The middle of the full picture.
            (256, 144) => [full[0], full[1], full[2] - 832.0, full[3] - 468.0],
            size => entry(size).unwrap_or_else(|| {
                let across = f64::from(width) / f64::from(SIZES[0].0);
                let down = f64::from(height) / f64::from(SIZES[0].1);
                [
                    full[0] * across,
                    full[1] * down,
                    full[2] * across,
                    full[3] * down,
                ]
            }),
        }
    }
}

/// An entry whose focal lengths are equal and whose centre coordinates are too is a placeholder of
/// cameras without their own: librealsense then takes a nominal lens. Zeros are no entry at all, and
/// stay what nobody can use.
fn real(entry: PinHole, (width, height): (u32, u32)) -> PinHole {
    let [fx, fy, cx, cy] = entry;
    if fx == fy && cx == cy && fx != 0.0 {
        let (width, height) = (f64::from(width), f64::from(height));
        [1.5 * width, 1.5 * width, width / 2.0, height / 2.0]
    } else {
        entry
    }
}
