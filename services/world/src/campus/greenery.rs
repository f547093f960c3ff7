//! Trees, bushes and hedges.

use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use super::site::Site;
use crate::material::Material;

const BARK: Material = Material::rough(0.30);
/// Leaves are bright in the near infrared.
const LEAVES: Material = Material::rough(0.45);

/// A tree with a round crown.
pub(super) fn tree(site: &mut Site<'_>, at: [f64; 2], random: &mut ChaCha8Rng) {
    let height = random.random_range(4.5..9.5);
    let clear = height * random.random_range(0.3..0.42);
    let radius = random.random_range(0.12..0.28);
    site.pole(at, radius, 0.0, clear + 0.6, BARK);
    let spread = (height - clear) / 2.0;
    let balls = random.random_range(4..8);
    for ball in 0..balls {
        let angle = std::f64::consts::TAU * (f64::from(ball) + random.random::<f64>() * 0.6)
            / f64::from(balls);
        let away = spread * random.random_range(0.25..0.6);
        let size = spread * random.random_range(0.4..0.62);
        // The lowest leaves stay over the heads of those who pass.
        let rise = random.random_range(0.2..1.0) * (height - clear - 2.0 * size).max(0.0);
        let aside = [away * angle.cos(), away * angle.sin()];
        site.ball(at, aside, clear + size + rise, size, LEAVES);
    }
}

/// A conifer: three drums, each narrower than the one below.
pub(super) fn conifer(site: &mut Site<'_>, at: [f64; 2], random: &mut ChaCha8Rng) {
    let height = random.random_range(5.0..11.0);
    let radius = height * random.random_range(0.12..0.18);
    site.pole(at, 0.16, 0.0, height * 0.3, BARK);
    for (from, to, share) in [(0.16, 0.45, 1.0), (0.45, 0.74, 0.68), (0.74, 1.0, 0.35)] {
        site.pole(at, radius * share, height * from, height * to, LEAVES);
    }
}

/// A bush of two or three balls.
pub(super) fn bush(site: &mut Site<'_>, at: [f64; 2], random: &mut ChaCha8Rng) {
    for _ in 0..random.random_range(2..4) {
        let size = random.random_range(0.35..0.75);
        let aside = [
            random.random_range(-0.5..0.5),
            random.random_range(-0.5..0.5),
        ];
        site.ball(at, aside, size * 0.6, size, LEAVES);
    }
}

/// A hedge from place to place.
pub(super) fn hedge(site: &mut Site<'_>, from: [f64; 2], to: [f64; 2], random: &mut ChaCha8Rng) {
    let width = random.random_range(0.5..0.9);
    let top = random.random_range(0.8..1.8);
    site.strip(from, to, width, [0.0, top], LEAVES);
}
