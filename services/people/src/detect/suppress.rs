//! Leaves out what was found twice.

use super::candidate::Candidate;

/// Two boxes of one class that overlap further are one thing.
const SAME_THING: f64 = 0.5;
/// So many of the surest are looked at: no scene holds more, and pairs grow with the square.
const MOST_CANDIDATES: usize = 1000;

/// Keeps the surest of boxes of one class that overlap, surest first.
pub fn suppress(candidates: &mut Vec<Candidate>) {
    candidates.retain(|c| c.bounding_box.is_sound());
    candidates.sort_unstable_by(|a, b| b.score.total_cmp(&a.score).then(a.place.cmp(&b.place)));
    candidates.truncate(MOST_CANDIDATES);
    let mut kept = 0;
    for next in 0..candidates.len() {
        let candidate = candidates[next];
        let again = |other: &Candidate| {
            other.class == candidate.class
                && other.bounding_box.iou(&candidate.bounding_box) > SAME_THING
        };
        if !candidates[..kept].iter().any(again) {
            candidates[kept] = candidate;
            kept += 1;
        }
    }
    candidates.truncate(kept);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::BoundingBox;

    #[test]
    fn the_surest_of_each_thing_stays() {
        let candidate = |left: f64, score: f64, class: usize| Candidate {
            bounding_box: BoundingBox::new(left, 0.0, 10.0, 10.0),
            score,
            class,
            place: 0,
        };
        let mut candidates = vec![
            candidate(0.0, 0.5, 0),
            candidate(1.0, 0.9, 0),
            candidate(1.0, 0.6, 1),
            candidate(30.0, 0.4, 0),
            candidate(f64::NAN, 0.99, 0),
        ];
        suppress(&mut candidates);
        let kept: Vec<_> = candidates.iter().map(|c| (c.score, c.class)).collect();
        assert_eq!(kept, [(0.9, 0), (0.6, 1), (0.4, 0)]);
    }
}
