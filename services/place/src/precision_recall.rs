//! Precision and recall of place recognition, by the protocol of Rollo's thesis (2026).
//!
//! In: positions of keyframes in the order in which they were seen, and for each the best match
//! among the earlier ones. Out: the curve over the threshold, the area under it, the recall at full
//! precision.
//!
//! Keyframe `n` may be matched with the keyframes up to `n - exclude`. A *detection* is a match more alike than
//! the threshold; it is right if the two lie within the radius of each other. A detection that is
//! right is a true positive, another a false positive; no detection where some earlier keyframe
//! lies within the radius is a false negative, no detection elsewhere a true negative.
//! `P = TP / (TP + FP)`, `R = TP / (TP + FN)`.

/// The best match of one keyframe.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Detection {
    /// How alike; higher is more. NaN counts as no match.
    pub similarity: f64,
    /// True distance between the two, metres.
    pub distance_m: f64,
}

/// One keyframe as the evaluation sees it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Outcome {
    /// Its best match, if it has any.
    pub detection: Option<Detection>,
    /// Whether an earlier keyframe that counts lies within the radius.
    pub is_revisit: bool,
}

/// The counts at one threshold.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CurvePoint {
    /// Detections are at least this much alike.
    pub threshold: f64,
    /// Right detections.
    pub true_positives: usize,
    /// Wrong detections.
    pub false_positives: usize,
    /// Revisits without a detection.
    pub false_negatives: usize,
    /// The rest.
    pub true_negatives: usize,
}

impl CurvePoint {
    /// `TP / (TP + FP)`; 1 without a detection.
    pub fn precision(&self) -> f64 {
        share(
            self.true_positives,
            self.true_positives + self.false_positives,
        )
        .unwrap_or(1.0)
    }

    /// `TP / (TP + FN)`; 0 where there is neither.
    pub fn recall(&self) -> f64 {
        share(
            self.true_positives,
            self.true_positives + self.false_negatives,
        )
        .unwrap_or(0.0)
    }
}

fn share(part: usize, whole: usize) -> Option<f64> {
    (whole > 0).then(|| part as f64 / whole as f64)
}

/// Whether keyframe `n` may be matched with keyframe `earlier`: it is at least `exclude` keyframes
/// before it, and before it at all.
pub fn may_match(n: usize, earlier: usize, exclude: usize) -> bool {
    earlier < n && earlier.saturating_add(exclude) <= n
}

/// Which keyframes are revisits: one that it [may match](may_match) lies within `radius_m`.
pub fn revisits(positions: &[[f64; 3]], exclude: usize, radius_m: f64) -> Vec<bool> {
    positions
        .iter()
        .enumerate()
        .map(|(n, position)| {
            let mut earlier = positions[..n].iter().enumerate();
            earlier.any(|(j, e)| may_match(n, j, exclude) && distance_m(e, position) <= radius_m)
        })
        .collect()
}

/// Distance between two positions, metres.
pub fn distance_m(a: &[f64; 3], b: &[f64; 3]) -> f64 {
    a.iter()
        .zip(b)
        .map(|(a, b)| (a - b) * (a - b))
        .sum::<f64>()
        .sqrt()
}

/// Precision against recall over all thresholds.
#[derive(Debug, Clone, PartialEq)]
pub struct Curve {
    points: Vec<CurvePoint>,
    keyframes: usize,
    revisits: usize,
}

impl Curve {
    /// The curve of a run: one point for each similarity that occurs, highest first.
    pub fn new(outcomes: &[Outcome], radius_m: f64) -> Self {
        let revisits = outcomes.iter().filter(|o| o.is_revisit).count();
        let mut detections: Vec<(Detection, bool)> = outcomes
            .iter()
            .filter_map(|o| Some((o.detection?, o.is_revisit)))
            .filter(|(d, _)| !d.similarity.is_nan())
            .collect();
        detections.sort_by(|(a, _), (b, _)| b.similarity.total_cmp(&a.similarity));
        let mut at = CurvePoint {
            threshold: f64::INFINITY,
            true_positives: 0,
            false_positives: 0,
            false_negatives: revisits,
            true_negatives: outcomes.len() - revisits,
        };
        let mut points: Vec<CurvePoint> = Vec::new();
        for (detection, is_revisit) in detections {
            match detection.distance_m <= radius_m {
                true => at.true_positives += 1,
                false => at.false_positives += 1,
            }
            match is_revisit {
                true => at.false_negatives -= 1,
                // A match that is right is a revisit, whatever the caller says.
                false => at.true_negatives = at.true_negatives.saturating_sub(1),
            }
            at.threshold = detection.similarity;
            match points.last_mut() {
                Some(last) if last.threshold == at.threshold => *last = at,
                _ => points.push(at),
            }
        }
        Self {
            points,
            keyframes: outcomes.len(),
            revisits,
        }
    }

    /// The points, from the highest threshold to the lowest.
    pub fn points(&self) -> &[CurvePoint] {
        &self.points
    }

    /// How many keyframes were looked at.
    pub fn keyframes(&self) -> usize {
        self.keyframes
    }

    /// How many of them are revisits.
    pub fn revisits(&self) -> usize {
        self.revisits
    }

    /// Area under precision over recall, by trapezia, from recall 0 (where the precision is that
    /// of the first point) to the last point's recall. 0 without a detection.
    pub fn area(&self) -> f64 {
        let mut area = 0.0;
        let mut before = self
            .points
            .first()
            .map_or((0.0, 0.0), |p| (0.0, p.precision()));
        for point in &self.points {
            let here = (point.recall(), point.precision());
            area += (here.0 - before.0) * (here.1 + before.1) / 2.0;
            before = here;
        }
        area
    }

    /// The point with the greatest recall among those without a false positive; `None` if the most
    /// alike match of all is wrong, or there is none.
    pub fn at_full_precision(&self) -> Option<&CurvePoint> {
        // The recall only grows.
        let faultless = |point: &&CurvePoint| point.false_positives == 0;
        self.points.iter().take_while(faultless).last()
    }
}
