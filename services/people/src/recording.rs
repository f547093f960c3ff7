//! Tracks of a whole recording, completed once it is over.
//!
//! In: detections of all frames, or a tracker's tracks frame by frame. Out: boxes of everyone who
//! turned out to be a person, from the first frame in which they were seen: a live tracker believes
//! a person only in their third. Short gaps between two sightings are filled along a straight line,
//! as ByteTrack does on recordings.

use std::collections::{BTreeMap, BTreeSet};

use crate::BoundingBox;
use crate::mot::MotLine;
use crate::track::{Detection, Frame, Track, Tracker, TrackerConfig};

/// Gaps up to this are filled, seconds: longer ones are seldom straight.
pub const LONGEST_GAP_S: f64 = 1.0;

#[derive(Debug, Clone, Copy)]
struct Sighting {
    frame: u64,
    bounding_box: BoundingBox,
    score: f64,
}

/// What was seen of each track.
#[derive(Debug, Clone, Default)]
pub struct TrackHistory {
    sightings: BTreeMap<u64, Vec<Sighting>>,
    believed: BTreeSet<u64>,
}

impl TrackHistory {
    /// Takes down a frame. Frames come in order.
    pub fn note(&mut self, frame: u64, tracks: &[Track]) {
        for track in tracks.iter().filter(|track| track.is_seen()) {
            self.sightings.entry(track.id).or_default().push(Sighting {
                frame,
                bounding_box: track.bounding_box(),
                score: track.score,
            });
            if track.is_confirmed() {
                self.believed.insert(track.id);
            }
        }
    }

    /// Boxes of everyone believed, by frame and number; numbers are counted from 1 without gaps.
    /// Gaps of up to `longest_gap` frames are filled.
    pub fn finish(self, longest_gap: u64) -> Vec<MotLine> {
        let mut lines = Vec::new();
        let believed = self
            .sightings
            .into_iter()
            .filter(|(id, _)| self.believed.contains(id));
        for (number, (_, sightings)) in believed.enumerate() {
            let mut put = |frame, bounding_box, confidence| {
                lines.push(MotLine {
                    frame,
                    id: number as i64 + 1,
                    bounding_box,
                    confidence,
                });
            };
            for (k, sighting) in sightings.iter().enumerate() {
                put(sighting.frame, sighting.bounding_box, sighting.score);
                let Some(next) = sightings.get(k + 1) else {
                    continue;
                };
                let steps = next.frame - sighting.frame;
                if steps > longest_gap.saturating_add(1) {
                    continue;
                }
                for step in 1..steps {
                    let share = step as f64 / steps as f64;
                    let between = sighting.bounding_box.between(&next.bounding_box, share);
                    put(
                        sighting.frame + step,
                        between,
                        sighting.score.min(next.score),
                    );
                }
            }
        }
        lines.sort_by_key(|line| (line.frame, line.id));
        lines
    }
}

/// Tracks people through the detections of a recording.
///
/// `frames_per_second` says how much time a frame takes. Ids of the detections are not read.
pub fn track_detections(
    detections: &[MotLine],
    config: TrackerConfig,
    frames_per_second: f64,
) -> Vec<MotLine> {
    let mut by_frame = BTreeMap::<u64, Vec<Detection>>::new();
    for line in detections {
        by_frame.entry(line.frame).or_default().push(Detection {
            bounding_box: line.bounding_box,
            score: line.confidence,
        });
    }
    let mut tracker = Tracker::new(config);
    let mut history = TrackHistory::default();
    let mut step = |tracker: &mut Tracker, frame: u64, detections: &[Detection]| {
        tracker.step(&Frame {
            dt_s: 1.0 / frames_per_second,
            detections,
            features: None,
        });
        history.note(frame, tracker.tracks());
    };
    let mut last = None;
    for (&frame, detections) in &by_frame {
        // Frames without a detection have no line; nobody is left after a long gap.
        let empty = last.map_or(frame, |last: u64| last + 1)..frame;
        for frame in empty {
            if tracker.tracks().is_empty() {
                break;
            }
            step(&mut tracker, frame, &[]);
        }
        step(&mut tracker, frame, detections);
        last = Some(frame);
    }
    history.finish(longest_gap(frames_per_second))
}

/// [`LONGEST_GAP_S`] in frames.
pub fn longest_gap(frames_per_second: f64) -> u64 {
    (LONGEST_GAP_S * frames_per_second).round() as u64
}

#[cfg(test)]
mod tests {
    use super::*;

    fn detection(frame: u64, left: f64) -> MotLine {
        MotLine {
            frame,
            id: -1,
            bounding_box: BoundingBox::new(left, 20.0, 40.0, 100.0),
            confidence: 0.9,
        }
    }

    #[test]
    fn a_person_is_there_from_the_first_frame_and_through_a_short_gap() {
        let seen = (1..=30).filter(|frame| !(10..=14).contains(frame));
        let detections: Vec<_> = seen.map(|f| detection(f, 2.0 * f as f64)).collect();
        let lines = track_detections(&detections, TrackerConfig::default(), 25.0);
        assert_eq!(lines.len(), 30);
        assert!(lines.iter().all(|line| line.id == 1));
        for line in &lines {
            let off = line.bounding_box.left - 2.0 * line.frame as f64;
            assert!(off.abs() < 3.0, "{line:?}");
        }
    }

    #[test]
    fn a_detector_s_flicker_is_nobody() {
        let detections = [detection(1, 0.0), detection(2, 1.0), detection(9, 200.0)];
        assert!(track_detections(&detections, TrackerConfig::default(), 25.0).is_empty());
    }

    #[test]
    fn frames_far_apart_cost_no_time() {
        let far = [detection(1, 0.0), detection(1_000_000_000, 0.0)];
        assert!(track_detections(&far, TrackerConfig::default(), 25.0).is_empty());
    }
}
