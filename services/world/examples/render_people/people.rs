//! People and light to draw from.

use hachi_world::{Light, Outfit, Person, Visit};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;

/// Dawn to noon, white to a little coloured, from everywhere to mostly from one side.
pub fn light(random: &mut ChaCha8Rng) -> Light {
    let level = random.random_range(-0.6..0.3f64).exp();
    Light {
        level: [0; 3].map(|_| level * random.random_range(0.88..1.12)),
        ambient: random.random_range(0.3..0.9),
        towards: [
            random.random_range(-1.0..1.0),
            random.random_range(-1.0..1.0),
            random.random_range(0.2..1.0),
        ],
        swing: random.random_range(0.0..0.3),
        period_s: 11.0,
    }
}

/// Somebody who has not come yet. One in four wears the jacket of the one before.
pub fn person(id: u32, before: Option<&Person>, random: &mut ChaCha8Rng) -> Person {
    let shared = before
        .filter(|_| random.random_bool(0.25))
        .map(|person| person.visits[0].outfit.top);
    let outfit = Outfit {
        top: shared.unwrap_or_else(|| jacket(random)),
        trousers: cloth(random, 0.35),
        shoes: cloth(random, 0.3),
    };
    const HAIR: [[u8; 3]; 6] = [
        [25, 20, 20],
        [60, 40, 30],
        [110, 75, 45],
        [200, 170, 110],
        [150, 150, 150],
        [140, 60, 30],
    ];
    let (light, dark): ([f64; 3], [f64; 3]) = ([245.0, 212.0, 188.0], [75.0, 48.0, 34.0]);
    let share: f64 = random.random();
    let near = |color: [u8; 3], random: &mut ChaCha8Rng| {
        color.map(|c| c.saturating_add_signed(random.random_range(-15..=15)))
    };
    Person {
        id,
        height_m: random.random_range(1.5..1.98),
        skin: std::array::from_fn(|c| (light[c] + share * (dark[c] - light[c])) as u8),
        hair: near(HAIR[random.random_range(0..HAIR.len())], random),
        visits: vec![Visit {
            begins_s: 0.0,
            path: Vec::new(),
            speed_m_s: 0.0,
            stays_s: 0.0,
            outfit,
        }],
    }
}

/// Something to wear above the trousers.
pub fn jacket(random: &mut ChaCha8Rng) -> [u8; 3] {
    cloth(random, 0.7)
}

/// A colour of cloth: coloured with this chance, else grey, dark blue or beige.
fn cloth(random: &mut ChaCha8Rng, colored: f64) -> [u8; 3] {
    let (hue, saturation, value): (f64, f64, f64) = if random.random_bool(colored) {
        let saturation = random.random_range(0.25..1.0f64).sqrt();
        (random.random(), saturation, random.random_range(0.2..1.0))
    } else {
        match random.random_range(0..4) {
            0 => (
                0.62,
                random.random_range(0.3..0.7),
                random.random_range(0.15..0.5),
            ),
            1 => (
                0.1,
                random.random_range(0.15..0.4),
                random.random_range(0.4..0.9),
            ),
            _ => (0.0, 0.0, random.random_range(0.06..0.95)),
        }
    };
    // Hue is a turn around the circle of colours: red, green and blue a third of it apart.
    [0.0, 1.0, 2.0].map(|third: f64| {
        let from_peak = ((hue - third / 3.0 + 1.5).rem_euclid(1.0) - 0.5).abs() * 6.0;
        let share = (2.0 - from_peak).clamp(0.0, 1.0);
        (255.0 * value * (1.0 - saturation + saturation * share)) as u8
    })
}
