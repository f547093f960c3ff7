//! Seeded randomness: the same seed and the same stream give the same numbers, whoever asks first.

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// What the numbers are for, so that two uses of one seed do not share them.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Purpose {
    Scene = 1,
    Packets = 2,
    Imu = 3,
    Odometry = 4,
    Strays = 5,
    Legs = 6,
    Camera = 7,
    People = 8,
}

/// A generator of its own for `purpose` and the `index`-th thing of that purpose.
pub(crate) fn generator(seed: u64, purpose: Purpose, index: u64) -> ChaCha8Rng {
    let mut generator = ChaCha8Rng::seed_from_u64(seed);
    generator.set_stream(((purpose as u64) << 56) | (index & 0x00ff_ffff_ffff_ffff));
    generator
}

/// Two numbers in [0, 1), to make [`normals`] from where they are needed.
pub(crate) fn uniform_pair(generator: &mut ChaCha8Rng) -> [f64; 2] {
    [generator.random(), generator.random()]
}

/// Two independent normal deviates from two uniform ones, by Box and Muller's method.
pub(crate) fn normals([u, v]: [f64; 2]) -> [f64; 2] {
    // In (0, 1], so that the logarithm is finite.
    let radius = (-2.0 * (1.0 - u).ln()).sqrt();
    let (sin, cos) = (std::f64::consts::TAU * v).sin_cos();
    [radius * cos, radius * sin]
}

/// Two independent normal deviates.
pub(crate) fn normal_pair(generator: &mut ChaCha8Rng) -> [f64; 2] {
    normals(uniform_pair(generator))
}

/// Three independent normal deviates.
pub(crate) fn normal_vector(generator: &mut ChaCha8Rng) -> hachi_hal::Vector3 {
    let [x, y] = normal_pair(generator);
    let [z, _] = normal_pair(generator);
    hachi_hal::Vector3::new(x, y, z)
}
