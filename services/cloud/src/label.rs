//! Why each point of a scan is kept or goes.
//!
//! In: nothing but the points' number. Out: one [`Reason`] for each point, counted by
//! [`RemovalCounts`], and the kept points gathered once by [`compact`]. A filter looks only at
//! points that are still [`Reason::Kept`] and never takes a reason back, so the reason that stands
//! at the end is the first that applied.

use alloc::vec::Vec;

use hachi_hal::Point;

/// Why a point was removed, or that it was not. One byte.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(rename_all = "snake_case"))]
#[repr(u8)]
pub enum Reason {
    /// It stays.
    #[default]
    Kept = 0,
    /// A coordinate is NaN or infinite.
    NonFinite = 1,
    /// It lies on the robot's own body.
    SelfHit = 2,
    /// It is nearer or farther than the sensor is trusted.
    Range = 3,
    /// It is far from everything else.
    Outlier = 4,
    /// Its intensity is in the reject range and it is not ground.
    Suspect = 5,
    /// It is the mirror image of measured structure.
    Ghost = 6,
    /// It is the ceiling or above it.
    Ceiling = 7,
}

impl Reason {
    /// All reasons, in the order of their numbers.
    pub const ALL: [Self; 8] = [
        Self::Kept,
        Self::NonFinite,
        Self::SelfHit,
        Self::Range,
        Self::Outlier,
        Self::Suspect,
        Self::Ghost,
        Self::Ceiling,
    ];

    /// The name used in reports and as the name of a layer.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Kept => "kept",
            Self::NonFinite => "non_finite",
            Self::SelfHit => "self",
            Self::Range => "range",
            Self::Outlier => "outlier",
            Self::Suspect => "suspect",
            Self::Ghost => "ghost",
            Self::Ceiling => "ceiling",
        }
    }

    /// Whether the point stays.
    pub const fn is_kept(self) -> bool {
        matches!(self, Self::Kept)
    }
}

/// How many points went, by reason. Adds up over scans with `+=`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct RemovalCounts {
    counts: [u64; Reason::ALL.len()],
}

impl RemovalCounts {
    /// Counts the labels of one scan.
    pub fn of(labels: &[Reason]) -> Self {
        let mut counts = [0; Reason::ALL.len()];
        for label in labels {
            counts[*label as usize] += 1;
        }
        Self { counts }
    }

    /// How many points carry one reason.
    pub fn get(&self, reason: Reason) -> u64 {
        self.counts[reason as usize]
    }

    /// How many points stay.
    pub fn kept(&self) -> u64 {
        self.get(Reason::Kept)
    }

    /// How many points go, whatever the reason.
    pub fn removed(&self) -> u64 {
        self.iter().map(|(_, count)| count).sum()
    }

    /// Each reason for removal by name, with its count, zeros included, in a fixed order.
    pub fn iter(&self) -> impl Iterator<Item = (&'static str, u64)> + '_ {
        Reason::ALL
            .into_iter()
            .filter(|reason| !reason.is_kept())
            .map(|reason| (reason.name(), self.get(reason)))
    }
}

impl core::ops::AddAssign for RemovalCounts {
    fn add_assign(&mut self, other: Self) {
        for (sum, count) in self.counts.iter_mut().zip(other.counts) {
            *sum = sum.saturating_add(count);
        }
    }
}

/// Puts the kept points into `out`, in their order. `out` is cleared first and keeps its memory.
///
/// If the slices differ in length, the points beyond the shorter one are left out.
pub fn compact(points: &[Point], labels: &[Reason], out: &mut Vec<Point>) {
    out.clear();
    out.extend(
        points
            .iter()
            .zip(labels)
            .filter(|(_, label)| label.is_kept())
            .map(|(point, _)| *point),
    );
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counts_add_up_and_name_every_reason_but_kept() {
        let labels = [
            Reason::Kept,
            Reason::Suspect,
            Reason::Suspect,
            Reason::SelfHit,
        ];
        let mut counts = RemovalCounts::of(&labels);
        counts += RemovalCounts::of(&[Reason::Suspect]);
        assert_eq!((counts.kept(), counts.removed()), (1, 4));
        let listed: Vec<_> = counts.iter().collect();
        assert_eq!(
            listed,
            [
                ("non_finite", 0),
                ("self", 1),
                ("range", 0),
                ("outlier", 0),
                ("suspect", 3),
                ("ghost", 0),
                ("ceiling", 0)
            ]
        );
    }

    #[test]
    fn compaction_keeps_order_and_memory() {
        let points = [1.0, 2.0, 3.0].map(|x| Point::at(x, 0.0, 0.0));
        let mut out = Vec::with_capacity(8);
        compact(
            &points,
            &[Reason::Kept, Reason::Ghost, Reason::Kept],
            &mut out,
        );
        assert_eq!(out, [points[0], points[2]]);
        assert_eq!(out.capacity(), 8);
    }
}
