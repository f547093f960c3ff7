//! Who plays: people of all heights, skins and hair, in clothes that differ, by chance.

use rand::RngExt;
use rand::seq::SliceRandom;
use rand_chacha::ChaCha8Rng;

use crate::person::{Outfit, Person, Rgb};

/// Colours of shirts and jackets as shops have them.
const TOPS: [Rgb; 12] = [
    [176, 38, 42],
    [38, 74, 158],
    [44, 122, 62],
    [224, 196, 60],
    [218, 218, 214],
    [40, 40, 44],
    [226, 120, 40],
    [112, 58, 132],
    [104, 168, 206],
    [150, 150, 154],
    [118, 84, 54],
    [214, 130, 160],
];
/// And of trousers.
const TROUSERS: [Rgb; 6] = [
    [44, 56, 98],
    [34, 34, 38],
    [150, 128, 92],
    [100, 102, 106],
    [84, 92, 60],
    [92, 116, 156],
];
const SHOES: [Rgb; 4] = [[28, 28, 30], [212, 210, 206], [104, 68, 42], [70, 74, 84]];
const SKINS: [Rgb; 4] = [
    [234, 196, 170],
    [206, 160, 126],
    [154, 108, 78],
    [92, 64, 48],
];
const HAIR: [Rgb; 5] = [
    [32, 26, 24],
    [78, 54, 36],
    [140, 100, 60],
    [196, 166, 110],
    [150, 148, 146],
];
/// Two cloths of one colour differ by so much in a channel.
const SHADE: i32 = 10;
/// Clothes that one could take for each other differ by so much in a channel.
const SIMILAR: i32 = 34;

/// Hands out people.
pub(crate) struct Cast {
    random: ChaCha8Rng,
    tops: Vec<Rgb>,
    people: u32,
}

impl Cast {
    pub fn new(mut random: ChaCha8Rng) -> Self {
        let mut tops = TOPS.to_vec();
        tops.shuffle(&mut random);
        Self {
            random,
            tops,
            people: 0,
        }
    }

    /// Somebody in clothes of their own: no two wear the same colour above, as long as there are
    /// others.
    pub fn person(&mut self) -> (Person, Outfit) {
        let outfit = self.outfit();
        (self.body(), outfit)
    }

    /// Somebody else in these clothes.
    pub fn body(&mut self) -> Person {
        self.people += 1;
        Person {
            id: self.people,
            height_m: self.between(1.58, 1.92),
            skin: self.choice(&SKINS),
            hair: self.choice(&HAIR),
            visits: Vec::new(),
        }
    }

    /// Clothes that nobody wears yet.
    pub fn outfit(&mut self) -> Outfit {
        let top = self.tops.pop().unwrap_or(TOPS[0]);
        Outfit {
            top: self.shade(top, SHADE),
            trousers: self.choice(&TROUSERS),
            shoes: self.choice(&SHOES),
        }
    }

    /// Clothes that one could take for these.
    pub fn similar(&mut self, outfit: &Outfit) -> Outfit {
        Outfit {
            top: self.shade(outfit.top, SIMILAR),
            trousers: self.shade(outfit.trousers, SIMILAR),
            shoes: self.choice(&SHOES),
        }
    }

    /// How fast somebody walks, m/s.
    pub fn speed(&mut self) -> f64 {
        self.between(0.8, 1.25)
    }

    pub fn between(&mut self, low: f64, high: f64) -> f64 {
        self.random.random_range(low..high)
    }

    /// A place about there.
    pub fn about(&mut self, [x, y]: [f64; 2]) -> [f64; 2] {
        [x + self.between(-0.25, 0.25), y + self.between(-0.25, 0.25)]
    }

    fn choice(&mut self, colors: &[Rgb]) -> Rgb {
        let color = colors[self.random.random_range(0..colors.len())];
        self.shade(color, SHADE)
    }

    /// A colour next to this one: away from it by half as much at least.
    fn shade(&mut self, color: Rgb, most: i32) -> Rgb {
        color.map(|channel| {
            let off = self.random.random_range(most / 2..=most);
            let off = if self.random.random_bool(0.5) {
                off
            } else {
                -off
            };
            (i32::from(channel) + off).clamp(8, 247) as u8
        })
    }
}
