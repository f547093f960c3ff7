//! The loop ledger: every candidate, what became of it, and the numbers that decided.
//!
//! An entry holds what it takes to decide again: read from a saved map, the accepted entries with
//! their edges are the map's loops.

use std::fmt;

use hachi_hal::{Pose, Stamp};

use crate::node::NodeId;

/// A ledger entry's number: counts from 0 over the life of a map.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct LoopId(pub u32);

impl fmt::Display for LoopId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.fmt(f)
    }
}

/// How a candidate came up.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FoundBy {
    /// The graph puts the two nodes close to each other.
    Nearness,
    /// The two places look alike.
    Looks,
    /// The place looks like one of another piece of map, or of a saved one.
    Recognition,
    /// Somebody, or another program, said so.
    Proposal,
    /// A submap that became no node was laid on the candidate; `node` is what it followed, or what
    /// followed it.
    Coverage,
}

impl FoundBy {
    /// All of them.
    pub const ALL: [Self; 5] = [
        Self::Nearness,
        Self::Looks,
        Self::Recognition,
        Self::Proposal,
        Self::Coverage,
    ];

    /// The word for it in files.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Nearness => "nearness",
            Self::Looks => "looks",
            Self::Recognition => "recognition",
            Self::Proposal => "proposal",
            Self::Coverage => "coverage",
        }
    }
}

/// Why a candidate is no loop.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Refusal {
    /// The alignment did not come to rest.
    NotConverged,
    /// Too little of one place was seen at the other.
    LittleOverlap,
    /// What overlaps does not lie on the same surfaces.
    PoorFit,
    /// The surroundings leave the place open in a direction that matters.
    Unobserved,
    /// It says that the robot is where the graph says it can't be.
    AgainstGraph,
    /// It contradicts loops that support each other.
    AgainstLoops,
    /// Another place fits about as well.
    Ambiguous,
    /// A submap could not be read.
    Unreadable,
    /// Newer nodes needed the time.
    NoTime,
    /// The node has loops to that place already.
    Redundant,
}

impl Refusal {
    /// All of them.
    pub const ALL: [Self; 10] = [
        Self::NotConverged,
        Self::LittleOverlap,
        Self::PoorFit,
        Self::Unobserved,
        Self::AgainstGraph,
        Self::AgainstLoops,
        Self::Ambiguous,
        Self::Unreadable,
        Self::NoTime,
        Self::Redundant,
    ];

    /// The word for it in files.
    pub const fn name(self) -> &'static str {
        match self {
            Self::NotConverged => "not_converged",
            Self::LittleOverlap => "little_overlap",
            Self::PoorFit => "poor_fit",
            Self::Unobserved => "unobserved",
            Self::AgainstGraph => "against_graph",
            Self::AgainstLoops => "against_loops",
            Self::Ambiguous => "ambiguous",
            Self::Unreadable => "unreadable",
            Self::NoTime => "no_time",
            Self::Redundant => "redundant",
        }
    }
}

/// What became of a candidate.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Verdict {
    /// It is part of the map.
    Accepted,
    /// It never was.
    Refused(Refusal),
    /// It was accepted, and the rest of the graph has overruled it since.
    Outvoted,
    /// It was accepted, and taken out by hand.
    Vetoed,
    /// It fits, and waits for another that agrees.
    Waiting,
}

impl Verdict {
    /// Whether it holds the map together now.
    pub fn is_accepted(self) -> bool {
        matches!(self, Self::Accepted)
    }

    /// The word for it in files: the reason where it was refused.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Accepted => "accepted",
            Self::Refused(refusal) => refusal.name(),
            Self::Outvoted => "outvoted",
            Self::Vetoed => "vetoed",
            Self::Waiting => "waiting",
        }
    }

    /// The verdict of a word.
    pub fn from_name(name: &str) -> Option<Self> {
        let plain = [Self::Accepted, Self::Outvoted, Self::Vetoed, Self::Waiting];
        plain
            .into_iter()
            .chain(Refusal::ALL.map(Self::Refused))
            .find(|v| v.name() == name)
    }
}

/// A candidate, and what became of it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LedgerEntry {
    /// Its number.
    pub id: LoopId,
    /// The time of the node.
    pub stamp: Stamp,
    /// The node that may have been somewhere before.
    pub node: NodeId,
    /// The node it may be at.
    pub candidate: NodeId,
    /// How it came up.
    pub found_by: FoundBy,
    /// How much alike the two places look, 0 to 1; not a number where looks were not asked.
    pub similarity: f32,
    /// Heading of the node as seen from the candidate by looks alone, radians; not a number likewise.
    pub yaw_rad: f32,
    /// Distance between the two nodes before, as the graph had it, metres.
    pub distance_m: f32,
    /// Share of the surfaces that fit after alignment from the graph's guess.
    pub graph_fitness: f32,
    /// The same from the descriptor's guess; not a number where there was none.
    pub looks_fitness: f32,
    /// Share of the node's surfaces that have one of the candidate's near them.
    pub overlap: f32,
    /// Share of these that lie on it.
    pub inlier_share: f32,
    /// Root mean square distance of these from it, metres.
    pub residual_m: f32,
    /// Share of the lines of sight of either place that lead through surfaces of the other, both added
    /// up; not a number where it was not asked.
    pub seen_through: f32,
    /// Directions and axes that the surroundings leave open.
    pub open: u8,
    /// Squared Mahalanobis distance between alignment and graph, of six degrees of freedom less the
    /// open ones.
    pub chi2: f32,
    /// Other loops that agree with it, and submaps since that said the same again and became no node.
    pub agreeing: u16,
    /// Takes points of the node's frame to the candidate's, by alignment.
    pub candidate_from_node: Pose,
    /// What became of it.
    pub verdict: Verdict,
}

impl LedgerEntry {
    /// An entry of which nothing is known yet but the candidate.
    pub fn new(
        id: LoopId,
        stamp: Stamp,
        node: NodeId,
        candidate: NodeId,
        found_by: FoundBy,
    ) -> Self {
        Self {
            id,
            stamp,
            node,
            candidate,
            found_by,
            similarity: f32::NAN,
            yaw_rad: f32::NAN,
            distance_m: f32::NAN,
            graph_fitness: f32::NAN,
            looks_fitness: f32::NAN,
            overlap: f32::NAN,
            inlier_share: f32::NAN,
            residual_m: f32::NAN,
            seen_through: f32::NAN,
            open: 0,
            chi2: f32::NAN,
            agreeing: 0,
            candidate_from_node: Pose::identity(),
            verdict: Verdict::Waiting,
        }
    }
}

/// How many candidates there were, and what became of them.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct LoopCounts {
    /// All.
    pub candidates: u64,
    /// Part of the map.
    pub accepted: u64,
    /// All others.
    pub refused: u64,
}

impl LoopCounts {
    /// Counts entries.
    pub fn of(entries: &[LedgerEntry]) -> Self {
        let accepted = entries.iter().filter(|e| e.verdict.is_accepted()).count();
        Self {
            candidates: entries.len() as u64,
            accepted: accepted as u64,
            refused: (entries.len() - accepted) as u64,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_verdict_is_found_by_its_word() {
        let refused = Refusal::ALL.map(Verdict::Refused);
        for verdict in refused
            .into_iter()
            .chain([Verdict::Accepted, Verdict::Outvoted])
        {
            assert_eq!(Verdict::from_name(verdict.name()), Some(verdict));
        }
        assert_eq!(Verdict::from_name("perhaps"), None);
    }
}
