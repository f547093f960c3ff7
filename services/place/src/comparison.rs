//! How alike two places look, and by how much one is turned against the other.
//!
//! In: descriptors. Out: [`Features`] of each, made once; [`Alignment`] of two: similarity and the
//! shift of their sectors. Features are whole numbers, so that a similarity has the same bits
//! however its sum is taken, and a place takes 2.4 kB with the usual grid.

use crate::descriptor::Descriptor;

/// How two descriptors are compared.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(rename_all = "snake_case"))]
#[non_exhaustive]
pub enum Comparison {
    /// `<Q, C> / (|Q| |C|)` over the whole matrices: the thesis's form. All values are positive, so
    /// any two places are alike to a high degree.
    Frobenius,
    /// The mean of the columns' cosines over the columns that both have: the form of the original
    /// Scan Context.
    Columns,
    /// As [`Frobenius`](Self::Frobenius) after the mean of each ring is taken out: what is the same
    /// all around tells places apart least, and hides what differs.
    #[default]
    Centred,
}

impl Comparison {
    /// All of them.
    pub const ALL: [Self; 3] = [Self::Frobenius, Self::Columns, Self::Centred];

    pub(crate) const fn code(self) -> u8 {
        match self {
            Self::Frobenius => 0,
            Self::Columns => 1,
            Self::Centred => 2,
        }
    }

    pub(crate) fn from_code(code: u8) -> Option<Self> {
        Self::ALL.into_iter().find(|c| c.code() == code)
    }
}

/// Length that features are scaled to, over all bins. A dot product is at most its square (Cauchy
/// and Schwarz), rounding included: it fits 32 bits.
const LENGTH: f64 = 32_000.0;
/// Greatest squared length of features that came from a file.
pub(crate) const MAX_LENGTH_SQ: i64 = 32_400 * 32_400;

/// A descriptor made ready to be compared.
#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct Features {
    /// Sector by sector, as in the descriptor.
    pub(crate) values: Vec<i16>,
    /// Sum of squares of `values`; 0 for a place without features.
    pub(crate) length_sq: i64,
    /// Sum of each sector's values: a coarse look all around.
    sector_key: Vec<f32>,
    /// One bit a sector: whether it has features.
    filled: Vec<bool>,
    rings: usize,
}

/// How one place is turned against another, and how alike they are then.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Alignment {
    /// The candidate's sectors are the query's plus this, in sectors with a fraction.
    pub(crate) shift: f32,
    pub(crate) similarity: f32,
}

impl Features {
    /// Makes a descriptor's features. An empty one, and with [`Comparison::Centred`] one that looks
    /// the same all around, has none.
    pub(crate) fn of(descriptor: &Descriptor, comparison: Comparison, out: &mut Self) {
        let rings = descriptor.layout.profile.rings();
        let sectors = descriptor.layout.profile.sectors();
        let values = &descriptor.values;
        let mut scaled: Vec<f64> = values.iter().map(|v| f64::from(*v)).collect();
        if comparison == Comparison::Centred {
            for ring in 0..rings {
                let of_ring = || (ring..scaled.len()).step_by(rings);
                let mean = of_ring().map(|i| scaled[i]).sum::<f64>() / sectors as f64;
                of_ring().for_each(|i| scaled[i] -= mean);
            }
        }
        match comparison {
            Comparison::Columns => {
                let length = LENGTH / (sectors as f64).sqrt();
                scaled
                    .chunks_exact_mut(rings)
                    .for_each(|column| scale_to(column, length));
            }
            Comparison::Frobenius | Comparison::Centred => scale_to(&mut scaled, LENGTH),
        }
        out.values.clear();
        out.values
            .extend(scaled.iter().map(|v| v.round_ties_even() as i16));
        out.complete(rings);
    }

    /// Features from stored values; `None` if they are too long to have been made here.
    pub(crate) fn from_values(values: Vec<i16>, rings: usize) -> Option<Self> {
        let mut features = Self {
            values,
            ..Self::default()
        };
        features.complete(rings);
        (features.length_sq <= MAX_LENGTH_SQ).then_some(features)
    }

    fn complete(&mut self, rings: usize) {
        self.rings = rings;
        self.length_sq = self.values.iter().map(|v| i64::from(*v).pow(2)).sum();
        let columns = || self.values.chunks_exact(rings);
        self.sector_key.clear();
        self.sector_key
            .extend(columns().map(|c| c.iter().map(|v| i32::from(*v)).sum::<i32>() as f32));
        self.filled.clear();
        self.filled
            .extend(columns().map(|c| c.iter().any(|v| *v != 0)));
    }

    pub(crate) fn is_empty(&self) -> bool {
        self.length_sq == 0
    }
}

/// Scales to a length; what is too short to have a direction becomes zero.
fn scale_to(values: &mut [f64], length: f64) {
    let greatest = values.iter().fold(0f64, |a, v| a.max(v.abs()));
    let now = values.iter().map(|v| v * v).sum::<f64>().sqrt();
    // Rounding errors of a mean taken out are no features.
    let factor = if now > 1e-6 && now.is_finite() && greatest > 1e-6 {
        length / now
    } else {
        0.0
    };
    values.iter_mut().for_each(|v| *v *= factor);
}

/// Where the full comparison looks for the best shift.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(rename_all = "snake_case"))]
#[non_exhaustive]
pub enum ShiftSearch {
    /// Around the best shifts of the sector keys.
    SectorKey {
        /// How many of the sector keys' best shifts are tried.
        peaks: usize,
        /// How many sectors to each side of them.
        window: usize,
    },
    /// Everywhere.
    Exhaustive,
}

impl Default for ShiftSearch {
    fn default() -> Self {
        Self::SectorKey {
            peaks: 3,
            window: 2,
        }
    }
}

/// Compares pairs of features of one layout. Keeps its memory.
#[derive(Debug, Clone, Default)]
pub(crate) struct Aligner {
    key_correlation: Vec<f32>,
    similarity: Vec<Option<f32>>,
}

impl Aligner {
    /// The best shift of `candidate` against `query`; `None` if one of them has no features.
    pub(crate) fn align(
        &mut self,
        query: &Features,
        candidate: &Features,
        comparison: Comparison,
        search: ShiftSearch,
    ) -> Option<Alignment> {
        let sectors = query.filled.len();
        if query.is_empty() || candidate.is_empty() || sectors != candidate.filled.len() {
            return None;
        }
        self.similarity.clear();
        self.similarity.resize(sectors, None);
        match search {
            ShiftSearch::Exhaustive => {
                for shift in 0..sectors {
                    self.at(shift, query, candidate, comparison);
                }
            }
            ShiftSearch::SectorKey { peaks, window } => {
                self.correlate_keys(query, candidate);
                let window = window.min(sectors / 2);
                for _ in 0..peaks.max(1).min(sectors) {
                    let peak = greatest(self.key_correlation.iter().copied());
                    for step in 0..=2 * window {
                        let shift = (peak + sectors + step - window) % sectors;
                        self.at(shift, query, candidate, comparison);
                        self.key_correlation[shift] = f32::NEG_INFINITY;
                    }
                }
            }
        }
        let best = greatest(
            self.similarity
                .iter()
                .map(|s| s.unwrap_or(f32::NEG_INFINITY)),
        );
        let middle = self.at(best, query, candidate, comparison);
        let before = self.at((best + sectors - 1) % sectors, query, candidate, comparison);
        let after = self.at((best + 1) % sectors, query, candidate, comparison);
        Some(Alignment {
            shift: best as f32 + summit(before, middle, after),
            similarity: middle.clamp(-1.0, 1.0),
        })
    }

    fn correlate_keys(&mut self, query: &Features, candidate: &Features) {
        let (q, c) = (&query.sector_key, &candidate.sector_key);
        self.key_correlation.clear();
        self.key_correlation.extend((0..q.len()).map(|shift| {
            let (head, tail) = q.split_at(q.len() - shift);
            let (wrapped, straight) = c.split_at(shift);
            dot_f32(head, straight) + dot_f32(tail, wrapped)
        }));
    }

    /// The similarity at a shift, computed once.
    fn at(&mut self, shift: usize, q: &Features, c: &Features, comparison: Comparison) -> f32 {
        if let Some(known) = self.similarity[shift] {
            return known;
        }
        let boundary = shift * q.rings;
        let (head, tail) = q.values.split_at(q.values.len() - boundary);
        let (wrapped, straight) = c.values.split_at(boundary);
        let dot = f64::from(dot(head, straight) + dot(tail, wrapped));
        let lengths = (q.length_sq as f64 * c.length_sq as f64).sqrt();
        let similarity = match comparison {
            Comparison::Frobenius | Comparison::Centred => dot / lengths,
            Comparison::Columns => {
                let filled = |f: &Features| f.filled.iter().filter(|f| **f).count() as f64;
                let sectors = q.filled.len();
                let both = (0..sectors)
                    .filter(|j| q.filled[*j] && c.filled[(j + shift) % sectors])
                    .count();
                let column_sq = lengths / (filled(q) * filled(c)).sqrt();
                dot / (column_sq * both.max(1) as f64)
            }
        };
        let similarity = similarity as f32;
        self.similarity[shift] = Some(similarity);
        similarity
    }
}

/// The first place of the greatest.
fn greatest(values: impl Iterator<Item = f32>) -> usize {
    let mut best = (0, f32::NEG_INFINITY);
    for (i, value) in values.enumerate() {
        if value > best.1 {
            best = (i, value);
        }
    }
    best.0
}

/// Where the parabola through three neighbours has its summit, in steps from the middle one.
fn summit(before: f32, middle: f32, after: f32) -> f32 {
    let bend = 2.0 * middle - before - after;
    if bend > 1e-6 {
        (0.5 * (after - before) / bend).clamp(-0.5, 0.5)
    } else {
        0.0
    }
}

/// At most `LENGTH` squared in size, partial sums too.
#[inline]
fn dot(a: &[i16], b: &[i16]) -> i32 {
    a.iter()
        .zip(b)
        .map(|(a, b)| i32::from(*a) * i32::from(*b))
        .fold(0, i32::wrapping_add)
}

fn dot_f32(a: &[f32], b: &[f32]) -> f32 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}
