//! How well people are tracked: MOTA, IDF1 and their parts.
//!
//! In: the truth and an estimate as boxes of frames. Out: [`TrackMetrics`], equal to what
//! py-motmetrics 1.4.0 computes with `compare_to_groundtruth(truth, estimate, 'iou', 0.5)` and
//! truth of confidence 1 or more.
//!
//! MOTA and its parts after Bernardin and Stiefelhagen, EURASIP Journal on Image and Video
//! Processing 2008, 246309; IDF1 after Ristani et al., ECCV workshops 2016.

use std::collections::{BTreeMap, BTreeSet};

use crate::BoundingBox;
use crate::assignment::{Assignment, CostMatrix};
use crate::mot::MotLine;

/// A box of the truth is found by one that overlaps it so far.
pub const MIN_IOU: f64 = 0.5;

/// Truth with less confidence than this is not counted.
pub const MIN_TRUTH_CONFIDENCE: f64 = 1.0;

/// A person found in at least this share of its frames is mostly tracked.
const MOSTLY_TRACKED: f64 = 0.8;
/// A person found in less than this share is mostly lost.
const MOSTLY_LOST: f64 = 0.2;

/// More identities that meet one another than this take minutes to tell apart.
pub const MAX_IDENTITIES: usize = 3000;

/// More boxes in one frame than this take minutes to pair.
pub const MAX_BOXES_IN_FRAME: usize = 1000;

/// What is counted.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct TrackMetrics {
    /// 1 - (false positives + misses + switches) / truth.
    pub mota: f64,
    /// F1 of boxes under the best one-to-one assignment of identities.
    pub idf1: f64,
    /// The precision in it.
    pub idp: f64,
    /// The recall in it.
    pub idr: f64,
    /// Identity switches.
    pub ids: usize,
    /// False positives.
    pub fp: usize,
    /// Misses.
    pub r#fn: usize,
    /// People found in at least 80 % of their frames.
    pub mt: usize,
    /// People found in less than 20 % of their frames.
    pub ml: usize,
    /// Found boxes of the truth over all of them.
    pub recall: f64,
    /// Right boxes of the estimate over all of them.
    pub precision: f64,
    /// Frames with any box.
    pub frames: usize,
    /// Boxes of the truth.
    pub truth_boxes: usize,
    /// Boxes of the estimate.
    pub estimate_boxes: usize,
    /// People in the truth.
    pub people: usize,
}

/// Why two sets of boxes can't be compared.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum MetricsError {
    /// There is no truth.
    #[error("the reference holds no box with confidence 1 or more")]
    NoTruth,
    /// One identity twice in a frame.
    #[error("{which}: id {id} stands twice in frame {frame}")]
    Twice {
        /// `reference` or `estimate`.
        which: &'static str,
        /// The identity.
        id: i64,
        /// The frame.
        frame: u64,
    },
    /// A frame that is no frame of people.
    #[error("{which}: frame {frame} holds more than {MAX_BOXES_IN_FRAME} boxes")]
    Crowded {
        /// `reference` or `estimate`.
        which: &'static str,
        /// The frame.
        frame: u64,
    },
    /// Too many identities that overlap one another.
    #[error("more than {MAX_IDENTITIES} identities overlap one another")]
    Identities,
}

/// The boxes of one side, by frame, in the order in which they were given.
type Frames = BTreeMap<u64, Vec<(i64, BoundingBox)>>;

/// Compares an estimate with the truth.
///
/// # Errors
/// [`MetricsError`].
pub fn evaluate(truth: &[MotLine], estimate: &[MotLine]) -> Result<TrackMetrics, MetricsError> {
    let counted = |line: &&MotLine| line.confidence >= MIN_TRUTH_CONFIDENCE;
    let truth = by_frame(truth.iter().filter(counted), "reference")?;
    let estimate = by_frame(estimate.iter(), "estimate")?;
    if truth.is_empty() {
        return Err(MetricsError::NoTruth);
    }
    let frames: BTreeSet<u64> = truth.keys().chain(estimate.keys()).copied().collect();
    let mut matcher = Matcher::default();
    for frame in &frames {
        let none = Vec::new();
        matcher.step(
            truth.get(frame).unwrap_or(&none),
            estimate.get(frame).unwrap_or(&none),
        );
    }
    matcher.metrics(frames.len())
}

fn by_frame<'a>(
    lines: impl Iterator<Item = &'a MotLine>,
    which: &'static str,
) -> Result<Frames, MetricsError> {
    let mut frames = Frames::new();
    for line in lines {
        let (frame, id) = (line.frame, line.id);
        let boxes = frames.entry(frame).or_default();
        if boxes.len() == MAX_BOXES_IN_FRAME {
            return Err(MetricsError::Crowded { which, frame });
        }
        if boxes.iter().any(|b| b.0 == id) {
            return Err(MetricsError::Twice { which, id, frame });
        }
        // Pixels are counted from 1 there; the same subtraction keeps the same last bits.
        let mut bounding_box = line.bounding_box;
        bounding_box.left -= 1.0;
        bounding_box.top -= 1.0;
        boxes.push((id, bounding_box));
    }
    Ok(frames)
}

/// How far two boxes are from each other, if they may be one: 1 - IoU.
fn distance(truth: &BoundingBox, estimate: &BoundingBox) -> Option<f64> {
    let distance = 1.0 - truth.iou(estimate);
    (distance <= 1.0 - MIN_IOU).then_some(distance)
}

/// How often one person was there, and found.
#[derive(Debug, Clone, Copy, Default)]
struct Presence {
    frames: usize,
    found: usize,
}

/// Follows who is whom from frame to frame.
#[derive(Debug, Default)]
struct Matcher {
    /// The identity that each person had last.
    last: BTreeMap<i64, i64>,
    people: BTreeMap<i64, Presence>,
    /// Frames of each identity of the estimate.
    identities: BTreeMap<i64, usize>,
    /// Frames in which a person and an identity overlap.
    overlaps: BTreeMap<(i64, i64), usize>,
    switches: usize,
    false_positives: usize,
    costs: CostMatrix,
    solver: Assignment,
}

impl Matcher {
    fn step(&mut self, truth: &[(i64, BoundingBox)], estimate: &[(i64, BoundingBox)]) {
        self.costs.reset(truth.len(), estimate.len(), f64::NAN);
        for (i, (person, a)) in truth.iter().enumerate() {
            self.people.entry(*person).or_default().frames += 1;
            for (j, (identity, b)) in estimate.iter().enumerate() {
                if let Some(distance) = distance(a, b) {
                    self.costs.set(i, j, distance);
                    *self.overlaps.entry((*person, *identity)).or_default() += 1;
                }
            }
        }
        for (identity, _) in estimate {
            *self.identities.entry(*identity).or_default() += 1;
        }
        let mut found = self.keep(truth, estimate);
        // Whoever can be paired is paired: staying apart costs more than all pairs together.
        let apart = 2.0 * (1 + truth.len().min(estimate.len())) as f64;
        let pairs = self.solver.solve(&self.costs, apart);
        for &(i, j) in pairs {
            let (person, identity) = (truth[i].0, estimate[j].0);
            let before = self.last.insert(person, identity);
            self.switches += usize::from(before.is_some_and(|before| before != identity));
            self.people.entry(person).or_default().found += 1;
        }
        found += pairs.len();
        self.false_positives += estimate.len() - found;
    }

    /// Pairs that were pairs before stay, where they still overlap; they leave the matrix.
    fn keep(&mut self, truth: &[(i64, BoundingBox)], estimate: &[(i64, BoundingBox)]) -> usize {
        let mut kept = 0;
        for (i, (person, _)) in truth.iter().enumerate() {
            let Some(identity) = self.last.get(person) else {
                continue;
            };
            let Some(j) = estimate.iter().position(|e| e.0 == *identity) else {
                continue;
            };
            if !self.costs.get(i, j).is_finite() {
                continue;
            }
            (0..estimate.len()).for_each(|other| self.costs.set(i, other, f64::NAN));
            (0..truth.len()).for_each(|other| self.costs.set(other, j, f64::NAN));
            self.people.entry(*person).or_default().found += 1;
            kept += 1;
        }
        kept
    }

    fn metrics(mut self, frames: usize) -> Result<TrackMetrics, MetricsError> {
        let truth_boxes: usize = self.people.values().map(|p| p.frames).sum();
        let estimate_boxes: usize = self.identities.values().sum();
        let found: usize = self.people.values().map(|p| p.found).sum();
        let misses = truth_boxes - found;
        let errors = misses + self.false_positives + self.switches;
        let same_identity = self.same_identity()? as f64;
        let share = |part: &Presence| part.found as f64 / part.frames as f64;
        let ratio = |part: f64, whole: usize| match whole {
            0 => 0.0,
            whole => part / whole as f64,
        };
        Ok(TrackMetrics {
            mota: 1.0 - errors as f64 / truth_boxes as f64,
            idf1: ratio(2.0 * same_identity, truth_boxes + estimate_boxes),
            idp: ratio(same_identity, estimate_boxes),
            idr: ratio(same_identity, truth_boxes),
            ids: self.switches,
            fp: self.false_positives,
            r#fn: misses,
            mt: self
                .people
                .values()
                .filter(|p| share(p) >= MOSTLY_TRACKED)
                .count(),
            ml: self
                .people
                .values()
                .filter(|p| share(p) < MOSTLY_LOST)
                .count(),
            recall: ratio(found as f64, truth_boxes),
            precision: ratio(found as f64, estimate_boxes),
            frames,
            truth_boxes,
            estimate_boxes,
            people: self.people.len(),
        })
    }

    /// Boxes that are right if every person has one identity for good, chosen as well as can be.
    fn same_identity(&mut self) -> Result<usize, MetricsError> {
        let mut total = 0;
        for group in groups(&self.overlaps) {
            let index = |ids: BTreeSet<i64>| -> BTreeMap<i64, usize> {
                ids.into_iter().enumerate().map(|(i, id)| (id, i)).collect()
            };
            let people = index(group.iter().map(|pair| pair.0).collect());
            let identities = index(group.iter().map(|pair| pair.1).collect());
            if people.len().max(identities.len()) > MAX_IDENTITIES {
                return Err(MetricsError::Identities);
            }
            let most = group.iter().map(|pair| self.overlaps[pair]).max();
            let most = most.unwrap_or(0) as f64;
            self.costs.reset(people.len(), identities.len(), f64::NAN);
            for pair in &group {
                let cost = most - self.overlaps[pair] as f64;
                self.costs.set(people[&pair.0], identities[&pair.1], cost);
            }
            let pairs = self.solver.solve(&self.costs, most);
            let right = pairs.iter().map(|&(i, j)| most - self.costs.get(i, j));
            total += right.sum::<f64>() as usize;
        }
        Ok(total)
    }
}

/// The pairs, parted into groups that share no person and no identity.
fn groups(overlaps: &BTreeMap<(i64, i64), usize>) -> Vec<Vec<(i64, i64)>> {
    let mut identities_of = BTreeMap::<i64, Vec<i64>>::new();
    let mut people_of = BTreeMap::<i64, Vec<i64>>::new();
    for &(person, identity) in overlaps.keys() {
        identities_of.entry(person).or_default().push(identity);
        people_of.entry(identity).or_default().push(person);
    }
    let mut groups = Vec::new();
    while let Some((person, _)) = identities_of.first_key_value() {
        let mut waiting = vec![*person];
        let mut group = Vec::new();
        while let Some(person) = waiting.pop() {
            for identity in identities_of.remove(&person).unwrap_or_default() {
                group.push((person, identity));
                waiting.extend(people_of.remove(&identity).unwrap_or_default());
            }
        }
        groups.push(group);
    }
    groups
}

#[cfg(test)]
mod tests {
    use super::*;

    fn line(frame: u64, id: i64, left: f64) -> MotLine {
        MotLine {
            frame,
            id,
            bounding_box: BoundingBox::new(left, 10.0, 10.0, 20.0),
            confidence: 1.0,
        }
    }

    #[test]
    fn the_truth_itself_is_perfect() {
        let truth = [line(1, 1, 0.0), line(1, 2, 50.0), line(2, 1, 1.0)];
        let metrics = evaluate(&truth, &truth).unwrap();
        assert_eq!((metrics.mota, metrics.idf1), (1.0, 1.0));
        assert_eq!((metrics.mt, metrics.people, metrics.frames), (2, 2, 2));
    }

    #[test]
    fn a_change_of_identity_is_one_switch_and_costs_half_the_identity() {
        let truth: Vec<_> = (1..=10).map(|f| line(f, 1, 0.0)).collect();
        let estimate: Vec<_> = (1..=10)
            .map(|f| line(f, if f <= 5 { 7 } else { 8 }, 0.0))
            .collect();
        let metrics = evaluate(&truth, &estimate).unwrap();
        assert_eq!(metrics.ids, 1);
        assert_eq!(metrics.mota, 1.0 - 0.1);
        assert_eq!(metrics.idf1, 0.5);
    }

    #[test]
    fn misses_and_false_positives_are_told_apart() {
        let truth: Vec<_> = (1..=10).map(|f| line(f, 1, 0.0)).collect();
        let estimate = [line(1, 1, 0.0), line(2, 1, 300.0), line(11, 1, 0.0)];
        let metrics = evaluate(&truth, &estimate).unwrap();
        assert_eq!((metrics.fp, metrics.r#fn, metrics.ids), (2, 9, 0));
        assert_eq!((metrics.ml, metrics.mt, metrics.frames), (1, 0, 11));
    }

    #[test]
    fn half_an_overlap_is_enough() {
        let truth = [line(1, 1, 0.0)];
        // 10 x 20 inside 20 x 20: IoU 0.5 exactly.
        let mut wide = line(1, 1, 0.0);
        wide.bounding_box.width = 20.0;
        assert_eq!(evaluate(&truth, &[wide]).unwrap().mota, 1.0);
        wide.bounding_box.width = 20.1;
        assert_eq!(evaluate(&truth, &[wide]).unwrap().mota, -1.0);
    }

    #[test]
    fn truth_that_is_marked_as_not_counted_is_not_counted() {
        let mut ignored = line(1, 2, 80.0);
        ignored.confidence = 0.0;
        let metrics = evaluate(&[line(1, 1, 0.0), ignored], &[line(1, 5, 0.0)]).unwrap();
        assert_eq!((metrics.mota, metrics.truth_boxes), (1.0, 1));
        assert_eq!(evaluate(&[ignored], &[]), Err(MetricsError::NoTruth));
    }

    #[test]
    fn an_identity_twice_in_a_frame_is_refused() {
        let error = evaluate(&[line(1, 1, 0.0)], &[line(3, 4, 0.0), line(3, 4, 9.0)]);
        let expected = MetricsError::Twice {
            which: "estimate",
            id: 4,
            frame: 3,
        };
        assert_eq!(error, Err(expected));
    }
}
