//! Fills a descriptor from a cloud.
//!
//! In: levelled points `[x, y, z, intensity]`, the sensor above the origin, z up from the ground,
//! metres ([`Leveller`](crate::Leveller) makes any cloud so). Out: a [`Descriptor`].
//!
//! One pass finds every point's bin and adds it to the bin's sums. The Huber weights need the
//! bin's mean first: for them a second light pass goes over the points again with the bins of the
//! first at hand. No bin keeps a list of its points. Sums are taken in double precision, so the
//! order of the points changes nothing but the last bits.

use crate::descriptor::{Descriptor, Formula, Kind, Layout};
use crate::polar::{self, OUTSIDE};
use crate::profile::Profile;

/// How bins get their values.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(default, deny_unknown_fields))]
pub struct DescriberConfig {
    /// What a bin holds.
    pub kind: Kind,
    /// How mean and spread make one value.
    pub formula: Formula,
    /// Weight of the spread, the thesis's `alpha`.
    pub alpha: f32,
    /// Points farther than this from their bin's mean weigh less, the thesis's `delta`.
    pub delta_m: f32,
    /// Bins with fewer points are empty.
    pub min_points: u32,
    /// Bins with fewer points than this share of the mean over all bins are empty.
    pub min_share: f32,
}

impl Default for DescriberConfig {
    fn default() -> Self {
        Self::for_kind(Kind::default())
    }
}

impl DescriberConfig {
    /// What suits a kind.
    ///
    /// The Gaussian kinds leave bins with fewer than five points empty, or fewer than a fifth of
    /// the mean: four points have no distribution to speak of, and stray returns, which fall into
    /// all bins alike, seldom come in fives. Scan Context takes every return, as published.
    pub fn for_kind(kind: Kind) -> Self {
        let (min_points, min_share) = match kind {
            Kind::ScanContext => (1, 0.0),
            Kind::GscHeight | Kind::GscHuber | Kind::GscIntensity => (5, 0.2),
        };
        Self {
            kind,
            formula: Formula::default(),
            alpha: 2.0,
            delta_m: 1.0,
            min_points,
            min_share,
        }
    }
}

/// Lowest value of a bin with returns, as a share of the ground's: what lies below the ground (a
/// slope, a mirror image in the floor) is still more than nothing.
const LOWEST_SHARE: f32 = 0.1;
/// Greatest intensity: 16 bits, what sensors with more than 8 give.
const MAX_INTENSITY: f32 = 65_535.0;

/// Greatest value of a bin, whatever the configuration: squares of values stay finite.
const GREATEST: f32 = 1e12;

/// Sums over the points of one bin.
#[derive(Debug, Clone, Copy, Default)]
struct Sums {
    weight: f64,
    x: f64,
    y: f64,
    value: f64,
    value_sq: f64,
}

/// Describes clouds. Keeps its memory: once warm, nothing allocates.
#[derive(Debug, Clone)]
pub struct Describer {
    profile: Profile,
    config: DescriberConfig,
    bins: Vec<u16>,
    counts: Vec<u32>,
    greatest: Vec<f32>,
    sums: Vec<Sums>,
    weighted: Vec<Sums>,
}

impl Describer {
    /// A describer for one database.
    pub fn new(profile: Profile, config: DescriberConfig) -> Self {
        Self {
            profile,
            config,
            bins: Vec::new(),
            counts: Vec::new(),
            greatest: Vec::new(),
            sums: Vec::new(),
            weighted: Vec::new(),
        }
    }

    /// Its grid.
    pub fn profile(&self) -> &Profile {
        &self.profile
    }

    /// Its configuration.
    pub fn config(&self) -> &DescriberConfig {
        &self.config
    }

    /// What its descriptors have in common.
    pub fn layout(&self) -> Layout {
        Layout {
            profile: self.profile,
            kind: self.config.kind,
            formula: self.config.formula,
        }
    }

    /// Describes the place around the origin. Points that are not finite or beyond the profile's
    /// reach are left out.
    pub fn describe(&mut self, points: &[[f32; 4]], out: &mut Descriptor) {
        self.describe_from(points, 0.0, out);
    }

    /// Describes the place as it would look from `lateral_m` to the left of the origin.
    pub fn describe_from(&mut self, points: &[[f32; 4]], lateral_m: f32, out: &mut Descriptor) {
        out.layout = self.layout();
        out.lateral_m = lateral_m;
        out.values.clear();
        out.values.resize(self.profile.bins(), 0.0);
        polar::bins(&self.profile, points, lateral_m, &mut self.bins);
        match self.config.kind {
            Kind::ScanContext => self.greatest_heights(points, &mut out.values),
            Kind::GscHeight => {
                self.add_up(points, |p| p[2]);
                self.spreads(&self.sums, true, &mut out.values);
            }
            Kind::GscHuber => {
                self.add_up(points, |p| p[2]);
                self.add_up_weighted(points);
                self.spreads(&self.weighted, false, &mut out.values);
            }
            Kind::GscIntensity => {
                let light = |p: &[f32; 4]| if p[3].is_nan() { 0.0 } else { p[3] };
                self.add_up(points, |p| light(p).clamp(0.0, MAX_INTENSITY));
                self.spreads(&self.sums, true, &mut out.values);
            }
        }
    }

    /// Describes the place as seen from the origin and from the profile's sideways positions: what
    /// to ask a database with, so that another lane or the other side of a corridor is recognised.
    /// The first is the one to insert.
    pub fn describe_views(&mut self, points: &[[f32; 4]], out: &mut Vec<Descriptor>) {
        let views = self.profile.laterals().count();
        out.resize_with(views, Descriptor::default);
        for (lateral_m, view) in self.profile.laterals().zip(out) {
            self.describe_from(points, lateral_m, view);
        }
    }

    /// How many points a bin needs not to be empty.
    fn enough(&self) -> u32 {
        let inside = self.bins.iter().filter(|bin| **bin != OUTSIDE).count();
        let mean = inside as f32 / self.profile.bins() as f32;
        let share = (self.config.min_share * mean).ceil() as u32; // saturates; NaN is 0
        self.config.min_points.max(share).max(1)
    }

    /// A height within what a bin can hold.
    #[inline(always)]
    fn height(&self, z: f32) -> f32 {
        let lowest = (LOWEST_SHARE - 1.0) * self.profile.ground_offset_m();
        z.max(lowest).min(self.profile.max_range_m())
    }

    fn greatest_heights(&mut self, points: &[[f32; 4]], out: &mut [f32]) {
        self.counts.clear();
        self.counts.resize(out.len(), 0);
        self.greatest.clear();
        self.greatest.resize(out.len(), f32::NEG_INFINITY);
        for (point, &bin) in points.iter().zip(&self.bins) {
            if bin != OUTSIDE {
                let bin = usize::from(bin);
                self.counts[bin] += 1;
                self.greatest[bin] = self.greatest[bin].max(point[2]);
            }
        }
        let enough = self.enough();
        for ((out, &count), &z) in out.iter_mut().zip(&self.counts).zip(&self.greatest) {
            if count >= enough {
                *out = self.height(z) + self.profile.ground_offset_m();
            }
        }
    }

    fn add_up(&mut self, points: &[[f32; 4]], value: impl Fn(&[f32; 4]) -> f32) {
        let heights = self.config.kind != Kind::GscIntensity;
        self.sums.clear();
        self.sums.resize(self.profile.bins(), Sums::default());
        for (point, &bin) in points.iter().zip(&self.bins) {
            if bin == OUTSIDE {
                continue;
            }
            let value = value(point);
            let value = f64::from(if heights { self.height(value) } else { value });
            let sums = &mut self.sums[usize::from(bin)];
            sums.weight += 1.0;
            sums.x += f64::from(point[0]);
            sums.y += f64::from(point[1]);
            sums.value += value;
            sums.value_sq += value * value;
        }
    }

    /// Heights again, each weighing `1` within `delta` of its bin's mean and `delta / r` beyond.
    fn add_up_weighted(&mut self, points: &[[f32; 4]]) {
        let delta = self.config.delta_m;
        self.weighted.clear();
        self.weighted.resize(self.profile.bins(), Sums::default());
        for (point, &bin) in points.iter().zip(&self.bins) {
            if bin == OUTSIDE {
                continue;
            }
            let bin = usize::from(bin);
            let z = self.height(point[2]);
            let plain = &self.sums[bin];
            let mean = [plain.x, plain.y, plain.value].map(|sum| (sum / plain.weight) as f32);
            let [dx, dy, dz] = [point[0] - mean[0], point[1] - mean[1], z - mean[2]];
            let r = (dx * dx + dy * dy + dz * dz).sqrt();
            let weight = f64::from(if r <= delta { 1.0 } else { delta / r });
            let value = f64::from(z);
            let sums = &mut self.weighted[bin];
            sums.weight += weight;
            sums.value += weight * value;
            sums.value_sq += weight * value * value;
        }
    }

    /// `mean + alpha * spread` of every bin with enough points.
    fn spreads(&self, sums: &[Sums], unbiased: bool, out: &mut [f32]) {
        let heights = self.config.kind != Kind::GscIntensity;
        let (offset, least) = if heights {
            let offset = self.profile.ground_offset_m();
            (offset, LOWEST_SHARE * offset)
        } else {
            (0.0, f32::MIN_POSITIVE)
        };
        let enough = f64::from(self.enough());
        for ((out, sums), plain) in out.iter_mut().zip(sums).zip(&self.sums) {
            if plain.weight < enough {
                continue;
            }
            let mean = sums.value / sums.weight;
            let squares = (sums.value_sq - sums.weight * mean * mean).max(0.0);
            let variance = match unbiased {
                true if sums.weight > 1.0 => squares / (sums.weight - 1.0),
                true => 0.0,
                false => squares / sums.weight,
            };
            let spread = match self.config.formula {
                Formula::Variance => variance,
                Formula::Deviation => variance.sqrt(),
            };
            let value = (mean + f64::from(self.config.alpha) * spread) as f32 + offset;
            *out = value.max(least).min(GREATEST); // NaN, of a hostile alpha, is the least
        }
    }
}
