//! From a pulse's echoes to what the sensor reports of it.
//!
//! In: echoes. Out: the strongest, or last and strongest, with noise and rounding, and the
//! truth about it. Elsewhere: where the echoes come from (`optics`).

use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use crate::moment::FIRST_PERSON;
use crate::noise::{Purpose, generator, normals};
use crate::optics::{Echo, MIN_POWER, MIN_RANGE_M, ReturnLabel};
use crate::scene::ObjectId;
use crate::sensor::MAX_RANGE_M;
use crate::simulation::NoiseConfig;

/// The truth about one channel of a data packet.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct ReturnTruth {
    /// What the return is.
    pub label: ReturnLabel,
    /// What scattered the light back; 0 where there is no return or a stray one. People are not
    /// among the scene's objects: see [`ReturnTruth::person`].
    pub object: ObjectId,
    /// Length of the light's path without noise or rounding, metres; 0 where there is no return.
    pub distance_m: f32,
}

impl ReturnTruth {
    /// Who scattered the light back, if it was somebody.
    pub fn person(&self) -> Option<u32> {
        self.object.checked_sub(FIRST_PERSON)
    }
}

/// What the sensor reports of one channel.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(crate) struct Report {
    /// In the sensor's unit; 0 is no return.
    pub distance: u16,
    pub intensity: u8,
}

/// Echoes nearer to each other than this are one to a dual-return sensor (VLP-16 manual), metres.
const DUAL_SEPARATION_M: f32 = 1.0;

/// Stray returns are at most so bright.
const STRAY_INTENSITY: f32 = 25.0;

/// The strongest detectable echo that is apart from `other`.
pub(crate) fn strongest_of(echoes: &[Echo], threshold: f32, other: Option<&Echo>) -> Option<Echo> {
    detectable(echoes, threshold)
        .filter(|e| other.is_none_or(|o| (e.distance - o.distance).abs() > DUAL_SEPARATION_M))
        .fold(None, |best: Option<&Echo>, echo| match best {
            Some(best) if best.power >= echo.power => Some(best),
            _ => Some(echo),
        })
        .copied()
}

fn detectable(echoes: &[Echo], threshold: f32) -> impl Iterator<Item = &Echo> {
    echoes
        .iter()
        .filter(move |echo| echo.distance >= MIN_RANGE_M && echo.power >= threshold)
}

/// The last echo, and the strongest: or the second strongest if the strongest is the last, or the
/// same again if there is no other.
pub(crate) fn dual_of(echoes: &[Echo], threshold: f32) -> (Option<Echo>, Option<Echo>) {
    let strongest = strongest_of(echoes, threshold, None);
    let Some(strong) = strongest else {
        return (None, None);
    };
    let last = detectable(echoes, threshold)
        .filter(|echo| echo.distance > strong.distance + DUAL_SEPARATION_M)
        .fold(strong, |last, echo| {
            if echo.distance > last.distance {
                *echo
            } else {
                last
            }
        });
    if last.distance > strong.distance {
        (Some(last), strongest)
    } else {
        let second = strongest_of(echoes, threshold, strongest.as_ref());
        (strongest, second.or(strongest))
    }
}

/// How this shot's echoes are distorted.
pub(crate) struct Measurement<'a> {
    unit_m: f64,
    noise: &'a NoiseConfig,
    /// Uniform numbers, of which normal ones are made only if there is something to report.
    luck: [f64; 2],
    /// Least power that this shot detects.
    pub threshold: f32,
}

impl<'a> Measurement<'a> {
    pub fn of(unit_m: f64, noise: &'a NoiseConfig, luck: [f64; 2], fading: f32) -> Self {
        Self {
            unit_m,
            noise,
            luck,
            // Around the threshold detection is a matter of luck: half to one and a half.
            threshold: MIN_POWER * (0.5 + fading),
        }
    }

    pub fn report(&self, echo: Option<Echo>) -> (Report, ReturnTruth) {
        let Some(echo) = echo else {
            return Default::default();
        };
        let [range, intensity] = normals(self.luck);
        let range_error_m = self.noise.range_sigma_m * range;
        let intensity_factor = 1.0 + self.noise.intensity_sigma * intensity;
        let counts = (f64::from(echo.distance) + range_error_m) / self.unit_m;
        let intensity = f64::from(echo.intensity) * intensity_factor;
        let report = Report {
            // Both are rounded to the nearest.
            distance: (counts + 0.5).clamp(1.0, 65_535.0) as u16,
            intensity: (intensity + 0.5).clamp(0.0, 255.0) as u8,
        };
        let truth = ReturnTruth {
            label: echo.label,
            object: echo.object,
            distance_m: echo.distance,
        };
        (report, truth)
    }
}

/// Gives the stray returns of a packet, each channel's in its turn. Without any, it draws nothing.
pub(crate) struct Strays {
    share: f64,
    random: Option<ChaCha8Rng>,
}

impl Strays {
    pub fn new(seed: u64, share: f64, packet: u64) -> Self {
        Self {
            share,
            random: (share > 0.0).then(|| generator(seed, Purpose::Strays, packet)),
        }
    }

    /// The stray return, if there is one, that a pulse reports instead of `echo`.
    pub fn instead_of(&mut self, echo: Option<Echo>) -> Option<Echo> {
        let random = self.random.as_mut()?;
        if random.random::<f64>() >= self.share {
            return None;
        }
        let most = echo.map_or(MAX_RANGE_M, |echo| (2.0 * echo.distance).min(MAX_RANGE_M));
        let distance = random.random_range(MIN_RANGE_M..most.max(2.0 * MIN_RANGE_M));
        Some(Echo {
            distance,
            power: MIN_POWER,
            intensity: random.random_range(1.0..STRAY_INTENSITY),
            label: ReturnLabel::Stray,
            object: 0,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn echo(distance: f32, power: f32) -> Echo {
        Echo {
            distance,
            power,
            intensity: 10.0,
            label: ReturnLabel::Direct,
            object: 0,
        }
    }

    #[test]
    fn a_dual_sensor_reports_last_and_strongest_as_the_manual_says() {
        let distances = |echoes: &[Echo]| {
            let (last, strongest) = dual_of(echoes, 0.01);
            (last.map(|e| e.distance), strongest.map(|e| e.distance))
        };
        let (near, far) = (echo(3.0, 1.0), echo(9.0, 0.5));
        assert_eq!(distances(&[near, far]), (Some(9.0), Some(3.0)));
        // The strongest is the last: the other slot has the second strongest.
        assert_eq!(distances(&[echo(3.0, 0.2), far]), (Some(9.0), Some(3.0)));
        // One echo: both alike. Too near to each other: one echo.
        assert_eq!(distances(&[near]), (Some(3.0), Some(3.0)));
        assert_eq!(distances(&[near, echo(3.5, 0.5)]), (Some(3.0), Some(3.0)));
        // Too weak, too near, none.
        assert_eq!(distances(&[echo(3.0, 0.001), echo(0.2, 1.0)]), (None, None));
    }
}
