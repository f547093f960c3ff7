//! What one place looks like: the values of a polar grid.
//!
//! In: what [`Describer`](crate::Describer) fills in, or bytes. Out: values, ring key, bytes.

use crate::bytes::{Reader, Unreadable, Writer};
use crate::profile::Profile;

/// First bytes of a stored descriptor.
const MAGIC: &[u8; 4] = b"HPD1";

/// What a bin holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(rename_all = "snake_case"))]
#[non_exhaustive]
pub enum Kind {
    /// The greatest height (Kim, Choi, Kim: "Scan Context++", T-RO 2021).
    ScanContext,
    /// Mean and spread of the heights (Gaussian Scan Context; Rollo, 2026).
    GscHeight,
    /// Mean and spread of the heights, far-off points weighing less.
    #[default]
    GscHuber,
    /// Mean and spread of the intensities.
    GscIntensity,
}

impl Kind {
    /// All of them.
    pub const ALL: [Self; 4] = [
        Self::ScanContext,
        Self::GscHeight,
        Self::GscHuber,
        Self::GscIntensity,
    ];

    /// Its name on a command line.
    pub const fn name(self) -> &'static str {
        match self {
            Self::ScanContext => "sc",
            Self::GscHeight => "gsc-height",
            Self::GscHuber => "gsc-huber",
            Self::GscIntensity => "gsc-intensity",
        }
    }

    const fn code(self) -> u8 {
        match self {
            Self::ScanContext => 0,
            Self::GscHeight => 1,
            Self::GscHuber => 2,
            Self::GscIntensity => 3,
        }
    }

    fn from_code(code: u8) -> Option<Self> {
        Self::ALL.into_iter().find(|kind| kind.code() == code)
    }
}

/// How mean and spread make one value.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(rename_all = "snake_case"))]
#[non_exhaustive]
pub enum Formula {
    /// `mean + alpha * variance`, as printed in the thesis: metres and square metres added.
    Variance,
    /// `mean + alpha * standard deviation`: both metres.
    #[default]
    Deviation,
}

impl Formula {
    const fn code(self) -> u8 {
        match self {
            Self::Variance => 0,
            Self::Deviation => 1,
        }
    }

    fn from_code(code: u8) -> Option<Self> {
        match code {
            0 => Some(Self::Variance),
            1 => Some(Self::Deviation),
            _ => None,
        }
    }
}

/// What two descriptors must share to be compared.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Layout {
    /// The grid.
    pub profile: Profile,
    /// What a bin holds.
    pub kind: Kind,
    /// How a bin's value is made (of no matter to [`Kind::ScanContext`]).
    pub formula: Formula,
}

impl Layout {
    pub(crate) fn write(&self, out: &mut Writer) {
        let (step, steps) = self.profile.lateral();
        out.u16(self.profile.rings() as u16);
        out.u16(self.profile.sectors() as u16);
        out.f32(self.profile.max_range_m());
        out.f32(self.profile.ground_offset_m());
        out.f32(step);
        out.u8(steps as u8);
        out.u8(self.kind.code());
        out.u8(self.formula.code());
    }

    pub(crate) fn read(bytes: &mut Reader<'_>) -> Result<Self, Unreadable> {
        let (rings, sectors) = (bytes.u16()?, bytes.u16()?);
        let (reach, ground, step) = (bytes.f32()?, bytes.f32()?, bytes.f32()?);
        let steps = bytes.u8()?;
        let profile = Profile::new(rings.into(), sectors.into(), reach)?
            .with_ground_offset(ground)?
            .with_lateral(step, steps.into())?;
        let (kind, formula) = (bytes.u8()?, bytes.u8()?);
        Ok(Self {
            profile,
            kind: Kind::from_code(kind).ok_or(Unreadable::Code {
                name: "kind",
                got: kind,
            })?,
            formula: Formula::from_code(formula).ok_or(Unreadable::Code {
                name: "formula",
                got: formula,
            })?,
        })
    }
}

/// What one place looks like from one position.
///
/// An empty one (no point, none usable) matches nothing.
#[derive(Debug, Clone, PartialEq)]
pub struct Descriptor {
    pub(crate) layout: Layout,
    pub(crate) lateral_m: f32,
    /// Sector by sector, rings within: turning the robot rotates this by whole sectors.
    pub(crate) values: Vec<f32>,
}

impl Default for Descriptor {
    /// An empty one, to be filled.
    fn default() -> Self {
        Self {
            layout: Layout {
                profile: Profile::OUTDOOR,
                kind: Kind::default(),
                formula: Formula::default(),
            },
            lateral_m: 0.0,
            values: vec![0.0; Profile::OUTDOOR.bins()],
        }
    }
}

impl Descriptor {
    /// Grid and meaning of the values.
    pub fn layout(&self) -> &Layout {
        &self.layout
    }

    /// How far to the left of the sensor the place is looked at from, metres: 0, or the offset of
    /// a virtual view.
    pub fn lateral_m(&self) -> f32 {
        self.lateral_m
    }

    /// The value of a bin, 0 if it is empty; ring and sector count from 0.
    ///
    /// # Panics
    /// If there is no such ring or sector.
    pub fn value(&self, ring: usize, sector: usize) -> f32 {
        let rings = self.layout.profile.rings();
        assert!(ring < rings, "ring {ring} of {rings}");
        self.values[sector * rings + ring]
    }

    /// All values, sector by sector, the rings of each from the middle outwards.
    pub fn values(&self) -> &[f32] {
        &self.values
    }

    /// Whether no bin holds anything.
    pub fn is_empty(&self) -> bool {
        self.values.iter().all(|v| *v <= 0.0)
    }

    /// For each ring, how many of its bins are not empty (L0 norm): the same whichever way the
    /// robot faces.
    pub fn ring_key(&self) -> Vec<u16> {
        let mut key = vec![0; self.layout.profile.rings()];
        for sector in self.values.chunks_exact(key.len()) {
            for (count, value) in key.iter_mut().zip(sector) {
                *count += u16::from(*value > 0.0);
            }
        }
        key
    }

    /// The descriptor as bytes, for a map file.
    pub fn to_bytes(&self) -> Vec<u8> {
        let mut out = Writer::default();
        out.bytes(MAGIC);
        self.layout.write(&mut out);
        out.f32(self.lateral_m);
        for value in &self.values {
            out.f32(*value);
        }
        out.into_bytes()
    }

    /// The descriptor in bytes that [`to_bytes`](Self::to_bytes) made.
    ///
    /// # Errors
    /// [`Unreadable`]: the bytes may say anything, no more memory is asked for than they hold.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, Unreadable> {
        let mut bytes = Reader::new(bytes);
        bytes.magic(MAGIC, "a place descriptor")?;
        let layout = Layout::read(&mut bytes)?;
        let lateral_m = bytes.f32()?;
        let count = layout.profile.bins();
        bytes.expect(count * 4)?;
        let values: Vec<f32> = (0..count).map(|_| bytes.f32()).collect::<Result<_, _>>()?;
        bytes.end()?;
        if !lateral_m.is_finite() {
            return Err(Unreadable::Number { name: "lateral_m" });
        }
        if !values.iter().all(|v| v.is_finite() && *v >= 0.0) {
            return Err(Unreadable::Number { name: "a bin" });
        }
        Ok(Self {
            layout,
            lateral_m,
            values,
        })
    }
}
