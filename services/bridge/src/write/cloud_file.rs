//! A decoded turn to one file, with everything a point knows.

use std::path::Path;

use hachi_hal::Point;

use super::AtomicFile;
use crate::error::WriteError;

/// The columns, in order, with their units: metres, 0 to 255, beam from the lowest, nanoseconds
/// after the scan's first point, degrees in the sensor's own sense, metres, and the number of
/// [`ReturnKind`](hachi_hal::ReturnKind).
pub const COLUMNS: [&str; 9] = [
    "x",
    "y",
    "z",
    "intensity",
    "ring",
    "time_ns",
    "azimuth_deg",
    "distance_m",
    "return_type",
];

/// How each column is written: PCD's TYPE and SIZE, and PLY's type.
const TYPES: [(char, usize, &str); 9] = [
    ('F', 4, "float"),
    ('F', 4, "float"),
    ('F', 4, "float"),
    ('F', 4, "float"),
    ('U', 2, "ushort"),
    ('U', 4, "uint"),
    ('F', 4, "float"),
    ('F', 4, "float"),
    ('U', 1, "uchar"),
];

/// A format that clouds are written in.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum WriteFormat {
    /// PCD 0.7, binary.
    Pcd,
    /// PLY 1.0, binary little-endian.
    Ply,
    /// Comma-separated text with a line of names.
    Csv,
}

impl WriteFormat {
    /// The file name ending, without its dot.
    pub const fn extension(self) -> &'static str {
        match self {
            Self::Pcd => "pcd",
            Self::Ply => "ply",
            Self::Csv => "csv",
        }
    }

    /// The format that a path's ending asks for.
    pub fn of(path: &Path) -> Option<Self> {
        let ending = path.extension()?.to_str()?;
        [Self::Pcd, Self::Ply, Self::Csv]
            .into_iter()
            .find(|format| ending.eq_ignore_ascii_case(format.extension()))
    }
}

/// Writes points with all their columns; the ending of `path` decides the format.
///
/// # Errors
/// [`WriteError`]; nothing half-written is then left behind.
pub fn write_cloud(path: impl AsRef<Path>, points: &[Point]) -> Result<(), WriteError> {
    let path = path.as_ref();
    let format = WriteFormat::of(path).ok_or_else(|| WriteError::UnknownFormat {
        path: path.to_path_buf(),
    })?;
    let mut file = AtomicFile::create(path)?;
    file.write(header(format, points.len()).as_bytes())?;
    let mut row = Vec::with_capacity(128);
    for point in points {
        row.clear();
        match format {
            WriteFormat::Csv => push_text(point, &mut row),
            WriteFormat::Pcd | WriteFormat::Ply => push_binary(point, &mut row),
        }
        file.write(&row)?;
    }
    file.commit()
}

fn header(format: WriteFormat, count: usize) -> String {
    let join = |item: &dyn Fn(usize) -> String| {
        let items: Vec<_> = (0..COLUMNS.len()).map(item).collect();
        items.join(" ")
    };
    match format {
        WriteFormat::Csv => COLUMNS.join(",") + "\n",
        WriteFormat::Pcd => format!(
            "# .PCD v0.7 - Point Cloud Data file format\nVERSION 0.7\nFIELDS {}\nSIZE {}\nTYPE {}\n\
             COUNT {}\nWIDTH {count}\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS {count}\nDATA binary\n",
            COLUMNS.join(" "),
            join(&|index| TYPES[index].1.to_string()),
            join(&|index| TYPES[index].0.to_string()),
            join(&|_| "1".into()),
        ),
        WriteFormat::Ply => {
            let properties: String = (0..COLUMNS.len())
                .map(|index| format!("property {} {}\n", TYPES[index].2, COLUMNS[index]))
                .collect();
            format!(
                "ply\nformat binary_little_endian 1.0\nelement vertex {count}\n{properties}end_header\n"
            )
        }
    }
}

/// The order and types of [`TYPES`], without padding.
fn push_binary(point: &Point, row: &mut Vec<u8>) {
    for value in [point.x, point.y, point.z, point.intensity] {
        row.extend_from_slice(&value.to_le_bytes());
    }
    row.extend_from_slice(&point.ring.to_le_bytes());
    row.extend_from_slice(&point.time_offset_ns.to_le_bytes());
    row.extend_from_slice(&point.azimuth_deg.to_le_bytes());
    row.extend_from_slice(&point.range_m.to_le_bytes());
    row.push(point.returned as u8);
}

/// The shortest decimals that read back as the same floats.
fn push_text(point: &Point, row: &mut Vec<u8>) {
    let line = format!(
        "{},{},{},{},{},{},{},{},{}\n",
        point.x,
        point.y,
        point.z,
        point.intensity,
        point.ring,
        point.time_offset_ns,
        point.azimuth_deg,
        point.range_m,
        point.returned as u8
    );
    row.extend_from_slice(line.as_bytes());
}
