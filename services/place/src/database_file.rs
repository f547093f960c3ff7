//! A database as bytes.
//!
//! In and out: little-endian bytes: a magic number with the version, the layout, how descriptors
//! are compared, the search's configuration, the number of places; for each its id, ring key and
//! features. Trees are built anew. Elsewhere: files (the caller writes them whole or not at all).

use std::collections::HashSet;

use crate::bytes::{Reader, Unreadable, Writer};
use crate::comparison::{Comparison, Features, ShiftSearch};
use crate::database::{Database, DatabaseConfig, SearchConfig};
use crate::descriptor::Layout;
use crate::ring_key::{GREATEST, RingKey};

/// First bytes; the last one is the version.
const MAGIC: &[u8; 4] = b"HPB1";
const EXHAUSTIVE: u16 = u16::MAX;

impl Database {
    /// Everything in it, for a file.
    pub fn to_bytes(&self) -> Vec<u8> {
        let mut out = Writer::default();
        out.bytes(MAGIC);
        out.u8(self.config.comparison.code());
        out.u8(self.config.ring_key.code());
        self.config.search.write(&mut out);
        out.u8(u8::from(self.layout.is_some()));
        let Some(layout) = &self.layout else {
            return out.into_bytes();
        };
        layout.write(&mut out);
        out.u32(self.len() as u32);
        for (slot, place) in self.places.iter().enumerate() {
            let Some(place) = place else { continue };
            out.u64(place.id);
            self.keys.key(slot).iter().for_each(|k| out.u16(*k));
            place.features.values.iter().for_each(|v| out.i16(*v));
        }
        out.into_bytes()
    }

    /// The database in bytes that [`to_bytes`](Self::to_bytes) made. It answers as it did, and can
    /// go on growing.
    ///
    /// # Errors
    /// [`Unreadable`]: the bytes may say anything; no more memory is asked for than they hold.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, Unreadable> {
        let mut bytes = Reader::new(bytes);
        bytes.magic(MAGIC, "a place database")?;
        let (comparison, ring_key) = (bytes.u8()?, bytes.u8()?);
        let unknown = |name, got| Unreadable::Code { name, got };
        let config = DatabaseConfig {
            comparison: Comparison::from_code(comparison)
                .ok_or(unknown("comparison", comparison))?,
            ring_key: RingKey::from_code(ring_key).ok_or(unknown("ring key", ring_key))?,
            search: SearchConfig::read(&mut bytes)?,
        };
        match bytes.u8()? {
            0 => {
                bytes.end()?;
                return Ok(Self::new(config));
            }
            1 => {}
            got => return Err(unknown("whether it has a layout", got)),
        }
        let layout = Layout::read(&mut bytes)?;
        let mut database = Self::with_layout(layout, config);
        let (rings, bins) = (layout.profile.rings(), layout.profile.bins());
        let dimensions = config.ring_key.dimensions(rings);
        let count = bytes.u32()? as usize;
        bytes.expect(count.saturating_mul(8 + 2 * dimensions + 2 * bins))?;
        let mut ids = HashSet::with_capacity(count);
        for _ in 0..count {
            let id = bytes.u64()?;
            if !ids.insert(id) {
                return Err(Unreadable::Twice(id));
            }
            let key = (0..dimensions).map(|_| bytes.u16());
            let key: Vec<u16> = key.collect::<Result<_, _>>()?;
            if key.iter().any(|k| *k > GREATEST) {
                return Err(Unreadable::Number { name: "a ring key" });
            }
            let values = (0..bins).map(|_| bytes.i16()).collect::<Result<_, _>>()?;
            let features = Features::from_values(values, rings)
                .ok_or(Unreadable::Number { name: "a place" })?;
            database.append(id, features, &key);
        }
        bytes.end()?;
        Ok(database)
    }
}

impl SearchConfig {
    fn write(&self, out: &mut Writer) {
        out.u32(self.candidates.min(u32::MAX as usize) as u32);
        out.f32(self.min_similarity);
        match self.shifts {
            ShiftSearch::SectorKey { peaks, window } => {
                out.u16(peaks.min(usize::from(EXHAUSTIVE) - 1) as u16);
                out.u16(window.min(usize::from(u16::MAX)) as u16);
            }
            ShiftSearch::Exhaustive => {
                out.u16(EXHAUSTIVE);
                out.u16(0);
            }
        }
    }

    fn read(bytes: &mut Reader<'_>) -> Result<Self, Unreadable> {
        let candidates = bytes.u32()? as usize;
        let min_similarity = bytes.f32()?;
        if !min_similarity.is_finite() {
            return Err(Unreadable::Number {
                name: "the least similarity",
            });
        }
        let (peaks, window) = (bytes.u16()?, bytes.u16()?);
        let shifts = match peaks {
            EXHAUSTIVE => ShiftSearch::Exhaustive,
            peaks => ShiftSearch::SectorKey {
                peaks: peaks.into(),
                window: window.into(),
            },
        };
        Ok(Self {
            candidates,
            shifts,
            min_similarity,
        })
    }
}
