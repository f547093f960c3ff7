//! Which bytes of a point are which quantity, found by field names.
//!
//! In: a table of named fields. Out: a [`Layout`], checked so that every column lies inside the
//! point. Names are compared without case and without CloudCompare's `scalar_` in front:
//!
//! | quantity | names |
//! |---|---|
//! | position | `x`, `y`, `z` (metres) |
//! | intensity | `intensity`, `reflectivity`, `reflectance`, `remission`, `i` |
//! | beam | `ring`, `channel`, `line` |
//! | time | `time_ns`, `t`, `time`, `timestamp`, `time_stamp`, `offset_time`, `time_offset` |
//! | azimuth, distance | `azimuth_deg`, `distance_m`; `distance` if it is a float |
//! | which return | `return_type`, in files with this program's own columns |
//!
//! `azimuth`, `range` and a foreign `return_type` are left alone: programs disagree about their
//! units and numbering (radians or 0.01°, metres or millimetres).

use super::scalar::{Column, Scalar};
use crate::error::CloudError;

/// A field as a header declares it.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Field<'a> {
    pub(crate) name: &'a str,
    pub(crate) scalar: Scalar,
    pub(crate) offset: u64,
}

/// Where the quantities of a point lie.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Layout {
    pub(crate) stride: usize,
    pub(crate) position: [Column; 3],
    pub(crate) intensity: Option<Column>,
    pub(crate) ring: Option<Column>,
    pub(crate) time: Option<Column>,
    pub(crate) azimuth_deg: Option<Column>,
    pub(crate) distance_m: Option<Column>,
    pub(crate) return_type: Option<Column>,
}

const INTENSITY: &[&str] = &["intensity", "reflectivity", "reflectance", "remission", "i"];
const RING: &[&str] = &["ring", "channel", "line"];
const TIME: &[&str] = &[
    "time_ns",
    "t",
    "time",
    "timestamp",
    "time_stamp",
    "offset_time",
    "time_offset",
];

impl Layout {
    /// Finds the quantities among the fields of a point of `stride` bytes.
    pub(crate) fn new<'a>(
        fields: impl Iterator<Item = Field<'a>> + Clone,
        stride: usize,
        big_endian: bool,
    ) -> Result<Self, CloudError> {
        let find = |names: &[&str]| -> Result<Option<Column>, CloudError> {
            // The first name of the list wins, not the first field.
            for name in names {
                if let Some(field) = fields.clone().find(|field| is_named(field.name, name)) {
                    return column(field, stride, big_endian).map(Some);
                }
            }
            Ok(None)
        };
        let needed = |name: &'static str| {
            find(&[name])?.ok_or_else(|| CloudError::NoField {
                missing: name,
                seen: names(fields.clone()),
            })
        };
        let position = [needed("x")?, needed("y")?, needed("z")?];
        let azimuth_deg = find(&["azimuth_deg"])?;
        let own_distance = find(&["distance_m"])?;
        let own = azimuth_deg.is_some() && own_distance.is_some() && find(&["time_ns"])?.is_some();
        let distance = find(&["distance"])?.filter(|column| column.scalar.is_float());
        Ok(Self {
            stride,
            position,
            intensity: find(INTENSITY)?,
            ring: find(RING)?,
            time: find(TIME)?,
            azimuth_deg,
            distance_m: own_distance.or(distance),
            return_type: if own { find(&["return_type"])? } else { None },
        })
    }
}

fn is_named(field: &str, name: &str) -> bool {
    const PREFIX: &str = "scalar_";
    let bare = match field.get(..PREFIX.len()) {
        Some(head) if head.eq_ignore_ascii_case(PREFIX) => &field[PREFIX.len()..],
        _ => field,
    };
    bare.eq_ignore_ascii_case(name)
}

fn column(field: Field<'_>, stride: usize, big_endian: bool) -> Result<Column, CloudError> {
    let end = field.offset.saturating_add(field.scalar.size() as u64);
    if end > stride as u64 {
        return Err(CloudError::FieldOutside {
            field: crate::error::seen(field.name.as_bytes()),
            end,
            stride: stride as u64,
        });
    }
    Ok(Column {
        // Fits: it is not beyond `stride`, which is a usize.
        offset: field.offset as usize,
        scalar: field.scalar,
        big_endian,
    })
}

fn names<'a>(fields: impl Iterator<Item = Field<'a>>) -> String {
    let mut list = String::new();
    for field in fields.take(20) {
        if !list.is_empty() {
            list.push_str(", ");
        }
        list.push_str(&crate::error::seen(field.name.as_bytes()));
    }
    list
}
