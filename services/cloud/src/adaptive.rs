//! The reject range learnt from what the sensor returns, band by band of distance.
//!
//! In: the kept points of each scan. Out: a [`RejectRange`] for each distance. Sensors differ in
//! gain and in how they correct for distance, so one number fits one sensor; what holds for all is
//! that glass, mirrors and black surfaces return a small share of what the surfaces around them do
//! at the same distance. The model keeps a fading histogram of intensities for each band and
//! rejects what lies below a share of its median.

use alloc::vec::Vec;

use hachi_hal::Point;

use crate::intensity::{Height, RejectRange};
use crate::label::Reason;

/// Upper ends of the bands, squared metres: 2, 4, 8, 16, 32 m, then everything farther. Doubling,
/// as received power falls by powers of the distance.
const BAND_ENDS_SQ: [f32; 5] = [4.0, 16.0, 64.0, 256.0, 1024.0];
const BANDS: usize = BAND_ENDS_SQ.len() + 1;
const LEVELS: usize = 256;
/// The share of the median below which a return is weak: it gives the fixed range's 15 on a
/// VLP-16 indoors, whose painted walls return about 60.
const WEAK_SHARE: f32 = 0.25;
/// Old counts fade by this a scan: a memory of 2 s at 10 Hz.
const FADE: f32 = 0.95;
/// Points a band needs before it is believed; until then its range is the fixed one.
const BELIEVED: f32 = 500.0;

/// What intensities surfaces return at each distance.
#[derive(Debug, Clone)]
pub struct IntensityModel {
    fixed: RejectRange,
    reject: [RejectRange; BANDS],
    histograms: Vec<[f32; LEVELS]>,
}

impl IntensityModel {
    /// A model that knows nothing yet and answers with `fixed`.
    pub fn new(fixed: RejectRange) -> Self {
        Self {
            fixed,
            reject: [fixed; BANDS],
            histograms: alloc::vec![[0.0; LEVELS]; BANDS],
        }
    }

    /// Takes in one scan: kept points, those of the ground left out where it is known, since its
    /// grazing returns say nothing about the walls.
    pub fn learn(
        &mut self,
        points: &[Point],
        height: Option<Height>,
        ground_margin_m: f32,
        labels: &[Reason],
    ) {
        for histogram in &mut self.histograms {
            histogram.iter_mut().for_each(|count| *count *= FADE);
        }
        for (point, label) in points.iter().zip(labels) {
            let above = height.is_none_or(|h| h.of(point.position()) >= ground_margin_m);
            if label.is_kept() && above && !point.intensity.is_nan() {
                // The cast saturates: 0 to 255 whatever the source holds.
                self.histograms[band(point.position())][usize::from(point.intensity as u8)] += 1.0;
            }
        }
        for (reject, histogram) in self.reject.iter_mut().zip(&self.histograms) {
            let total: f32 = histogram.iter().sum();
            *reject = if total < BELIEVED {
                self.fixed
            } else {
                RejectRange {
                    low: self.fixed.low,
                    high: median(histogram, total) * WEAK_SHARE,
                }
            };
        }
    }

    /// The reject range for a position in the sensor frame.
    pub fn reject_at(&self, position: [f32; 3]) -> RejectRange {
        self.reject[band(position)]
    }
}

/// The band of a position's distance.
#[inline]
fn band(position: [f32; 3]) -> usize {
    let distance_sq = position.iter().map(|c| c * c).sum::<f32>();
    BAND_ENDS_SQ
        .iter()
        .filter(|end| distance_sq >= **end)
        .count()
}

fn median(histogram: &[f32; LEVELS], total: f32) -> f32 {
    let mut below = 0.0;
    for (level, count) in (0u16..).zip(histogram) {
        below += count;
        if below >= total * 0.5 {
            return f32::from(level);
        }
    }
    0.0
}

#[cfg(test)]
mod tests {
    use super::*;
    use alloc::vec;

    fn wall(distance: f32, intensity: f32, count: usize) -> impl Iterator<Item = Point> {
        (0..count).map(move |i| Point {
            intensity,
            ..Point::at(distance, i as f32 * 1e-4, 0.5)
        })
    }

    #[test]
    fn the_range_follows_the_sensor_and_the_distance() {
        // Near walls return 120 and far ones 12: a fixed 15 would remove every far wall.
        let mut points: Vec<_> = wall(3.0, 120.0, 900).chain(wall(3.0, 20.0, 100)).collect();
        points.extend(wall(20.0, 12.0, 900).chain(wall(20.0, 2.0, 100)));
        let labels = vec![Reason::Kept; points.len()];
        let mut model = IntensityModel::new(RejectRange::default());
        assert_eq!(model.reject_at([3.0, 0.0, 0.0]).high, 15.0);
        model.learn(&points, None, 0.05, &labels);
        assert_eq!(model.reject_at([3.0, 0.0, 0.0]).high, 30.0);
        assert_eq!(model.reject_at([20.0, 0.0, 0.0]).high, 3.0);
        assert_eq!(
            model.reject_at([50.0, 0.0, 0.0]).high,
            15.0,
            "nothing seen there"
        );
        let mut labels = labels;
        crate::intensity::label_weak_by_model(&points, &model, None, 0.05, &mut labels);
        let weak: Vec<_> = points
            .iter()
            .map(|p| p.intensity == 20.0 || p.intensity == 2.0)
            .collect();
        let gone: Vec<_> = labels.iter().map(|l| *l == Reason::Suspect).collect();
        assert_eq!(gone, weak);
    }

    #[test]
    fn the_ground_and_what_was_removed_teach_nothing() {
        let height = Height {
            up: [0.0, 0.0, 1.0],
            sensor_height_m: 0.5,
        };
        let ground = (0..2000).map(|i| Point {
            intensity: 2.0,
            ..Point::at(3.0, i as f32 * 1e-4, -0.5)
        });
        let mut points: Vec<_> = ground.collect();
        let mut labels = vec![Reason::Kept; points.len()];
        points.extend(wall(3.0, 2.0, 2000));
        labels.extend(vec![Reason::SelfHit; 2000]);
        points.extend(wall(3.0, 80.0, 600));
        labels.extend(vec![Reason::Kept; 600]);
        let mut model = IntensityModel::new(RejectRange::default());
        model.learn(&points, Some(height), 0.05, &labels);
        assert_eq!(model.reject_at([3.0, 0.0, 0.0]).high, 20.0);
    }
}
