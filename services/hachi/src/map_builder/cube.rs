//! One cube of the map: what fell into it, in memory and as 32 bytes of a file.

/// Steps along an edge: sums of whole steps are exact, so that it makes no difference whether a
/// cube is collected at once or in parts. A step of a 5 cm cube is 0.8 µm.
const STEPS: f64 = 65_536.0;
/// More points than this move the mean no further, and their sums of steps stay within 32 bits.
const MOST_POINTS: u32 = 65_535;

/// What fell into one cube.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Cube {
    /// Which: the cube's lower corner, in edges.
    pub(super) key: [i32; 3],
    /// Sums over the points, from that corner, in steps.
    sum: [u32; 3],
    /// Sum over the points.
    intensity: f32,
    count: u32,
}

impl Cube {
    /// Bytes of one in a file.
    pub(super) const BYTES: usize = 32;

    /// An empty cube.
    pub(super) fn new(key: [i32; 3]) -> Self {
        Self {
            key,
            sum: [0; 3],
            intensity: 0.0,
            count: 0,
        }
    }

    /// Whether nothing fell into it.
    pub(super) fn is_empty(&self) -> bool {
        self.count == 0
    }

    /// Adds a point, in edges; it lies in this cube.
    pub(super) fn add(&mut self, scaled: [f64; 3], intensity: f32) {
        if self.count >= MOST_POINTS {
            return;
        }
        for ((sum, key), along) in self.sum.iter_mut().zip(self.key).zip(scaled) {
            let steps = (along - f64::from(key)) * STEPS;
            *sum += (steps as u32).min(STEPS as u32 - 1);
        }
        self.intensity += intensity;
        self.count += 1;
    }

    /// Adds what fell into the same cube later.
    pub(super) fn absorb(&mut self, later: &Self) {
        if later.count > MOST_POINTS - self.count {
            return;
        }
        for (sum, later) in self.sum.iter_mut().zip(later.sum) {
            *sum += later;
        }
        self.intensity += later.intensity;
        self.count += later.count;
    }

    /// The mean of its points, metres, and of their intensities.
    pub(super) fn mean(&self, edge_m: f64) -> ([f32; 3], f32) {
        let count = f64::from(self.count.max(1));
        let position = std::array::from_fn(|axis| {
            // Steps were cut off: half of one on the average.
            let share = (f64::from(self.sum[axis]) / count + 0.5) / STEPS;
            ((f64::from(self.key[axis]) + share) * edge_m) as f32
        });
        (position, self.intensity / count as f32)
    }

    pub(super) fn to_bytes(self) -> [u8; Self::BYTES] {
        let [x, y, z] = self.key.map(|k| k as u32);
        let [dx, dy, dz] = self.sum;
        let words = [x, y, z, dx, dy, dz, self.intensity.to_bits(), self.count];
        let mut bytes = [0; Self::BYTES];
        for (slot, word) in bytes.chunks_exact_mut(4).zip(words) {
            slot.copy_from_slice(&word.to_le_bytes());
        }
        bytes
    }

    pub(super) fn from_bytes(bytes: &[u8; Self::BYTES]) -> Self {
        let word = |i: usize| {
            let at = 4 * i;
            u32::from_le_bytes([bytes[at], bytes[at + 1], bytes[at + 2], bytes[at + 3]])
        };
        Self {
            key: [word(0), word(1), word(2)].map(|w| w as i32),
            sum: [word(3), word(4), word(5)],
            intensity: f32::from_bits(word(6)),
            count: word(7).min(MOST_POINTS),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_add_up_to_the_whole_and_come_back_from_a_file() {
        let points = [[-1.0, 4.999, 0.0], [-0.75, 4.25, 0.5], [-0.001, 4.5, 0.999]];
        let mut whole = Cube::new([-1, 4, 0]);
        let (mut first, mut second) = (whole, whole);
        for (i, point) in points.into_iter().enumerate() {
            whole.add(point, 10.0 * i as f32);
            [&mut first, &mut second][i % 2].add(point, 10.0 * i as f32);
        }
        first.absorb(&Cube::from_bytes(&second.to_bytes()));
        assert_eq!(first, whole);
        let (position, intensity) = whole.mean(0.1);
        let mean = [-0.058_367, 0.458_3, 0.049_967];
        for (got, expected) in position.into_iter().zip(mean) {
            assert!((got - expected).abs() < 2e-6, "{position:?}");
        }
        assert_eq!(intensity, 10.0);
    }

    #[test]
    fn a_cube_that_is_seen_for_ever_keeps_its_mean() {
        let mut cube = Cube::new([0; 3]);
        for _ in 0..70_000 {
            cube.add([0.999_999, 0.5, 0.0], 255.0);
        }
        cube.absorb(&cube.clone());
        let (position, intensity) = cube.mean(1.0);
        assert!((position[0] - 1.0).abs() < 1e-4, "{position:?}");
        assert!((position[1] - 0.5).abs() < 1e-4, "{position:?}");
        assert_eq!(intensity, 255.0);
    }
}
