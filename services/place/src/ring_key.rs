//! A few numbers for each ring that do not change when the robot turns: what places are first
//! looked up by.
//!
//! In: a descriptor. Out: whole numbers, so that distances between keys are exact.

use crate::descriptor::{Descriptor, Formula, Kind};

/// What a ring key is made of.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(rename_all = "snake_case"))]
#[non_exhaustive]
pub enum RingKey {
    /// One number a ring: how many of its bins are not empty (L0 norm), as published.
    Occupancy,
    /// Three numbers a ring: the mean of its bins, and how much they vary once and twice around
    /// (magnitudes of the first two harmonics). Tells places apart that fill the same bins.
    #[default]
    Spectrum,
}

/// Greatest number of a key: over all dimensions that a grid may have, squared distances then fit
/// 32 bits (3 * 256 * 2047 * 2047).
pub(crate) const GREATEST: u16 = 2047;
/// Numbers a metre of height.
const PER_METRE: f32 = 50.0;
/// Numbers a unit of intensity, or a square metre.
const PER_UNIT: f32 = 4.0;
/// Harmonics of a ring.
const HARMONICS: usize = 2;

impl RingKey {
    pub(crate) const fn code(self) -> u8 {
        match self {
            Self::Occupancy => 0,
            Self::Spectrum => 1,
        }
    }

    pub(crate) fn from_code(code: u8) -> Option<Self> {
        [Self::Occupancy, Self::Spectrum]
            .into_iter()
            .find(|key| key.code() == code)
    }

    /// Numbers in the key of a grid with so many rings.
    pub(crate) const fn dimensions(self, rings: usize) -> usize {
        match self {
            Self::Occupancy => rings,
            Self::Spectrum => rings * (1 + HARMONICS),
        }
    }

    /// The key of a descriptor.
    pub(crate) fn of(self, descriptor: &Descriptor) -> Vec<u16> {
        match self {
            Self::Occupancy => descriptor.ring_key(),
            Self::Spectrum => spectrum(descriptor),
        }
    }
}

/// Ring by ring the mean, then the magnitude of each harmonic.
fn spectrum(descriptor: &Descriptor) -> Vec<u16> {
    let layout = &descriptor.layout;
    let (rings, sectors) = (layout.profile.rings(), layout.profile.sectors());
    // For each harmonic and ring, cosine and sine sums; the 0th harmonic is the mean.
    let mut sums = vec![[0f32; 2]; rings * (1 + HARMONICS)];
    for (sector, column) in descriptor.values.chunks_exact(rings).enumerate() {
        for (harmonic, sums) in sums.chunks_exact_mut(rings).enumerate() {
            let angle = (harmonic * sector) as f32 * layout.profile.sector_rad();
            let (sin, cos) = angle.sin_cos();
            for (sums, value) in sums.iter_mut().zip(column) {
                sums[0] += value * cos;
                sums[1] += value * sin;
            }
        }
    }
    let in_metres = layout.kind == Kind::ScanContext
        || (layout.kind != Kind::GscIntensity && layout.formula == Formula::Deviation);
    let scale = if in_metres { PER_METRE } else { PER_UNIT } / sectors as f32;
    sums.iter()
        .map(|[cos, sin]| (cos.hypot(*sin) * scale).round().min(GREATEST.into()) as u16)
        .collect()
}
