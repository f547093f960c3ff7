//! How features of people compare, and how far one lies from the pictures of a person.
//!
//! In: features of any length other than nought. Out: cosine distances, 0 to 2.

/// The least distance (1 - cosine) of a feature from any of a person's pictures, whose features
/// stand one after the other. Infinite if there is none of the same length.
pub fn distance(pictures: &[f32], feature: &[f32]) -> f64 {
    if feature.is_empty() {
        return f64::INFINITY;
    }
    let pictures = pictures.chunks_exact(feature.len());
    let distances = pictures.map(|picture| cosine_distance(picture, feature));
    distances.fold(f64::INFINITY, f64::min)
}

/// One minus the cosine of the angle between two features; 1 where one is nought.
pub(crate) fn cosine_distance(a: &[f32], b: &[f32]) -> f64 {
    let (mut dot, mut a_squared, mut b_squared) = (0.0, 0.0, 0.0);
    for (&a, &b) in a.iter().zip(b) {
        // No square of a single-precision number is too large or too small for double precision.
        let (a, b) = (f64::from(a), f64::from(b));
        dot += a * b;
        a_squared += a * a;
        b_squared += b * b;
    }
    match (a_squared * b_squared).sqrt() {
        0.0 => 1.0,
        lengths => 1.0 - dot / lengths,
    }
}

/// Whether numbers say what somebody looks like: all of them are finite, and not all nought, which
/// stands for nobody seen.
pub(crate) fn is_feature(numbers: &[f32]) -> bool {
    numbers.iter().all(|x| x.is_finite()) && numbers.iter().any(|x| *x != 0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_nearest_picture_counts() {
        let pictures = [1.0, 0.0, 0.0, 1.0];
        assert_eq!(distance(&pictures, &[0.0, 1.0]), 0.0);
        assert!((distance(&pictures, &[0.6, 0.8]) - 0.2).abs() < 1e-6);
        assert_eq!(distance(&[], &[0.6, 0.8]), f64::INFINITY);
    }

    #[test]
    fn the_direction_alone_counts() {
        assert_eq!(distance(&[0.0, 5.0], &[0.0, 3.0]), 0.0);
        assert_eq!(distance(&[0.0, 5.0], &[3e38, 0.0]), 1.0);
        assert_eq!(distance(&[0.0, 5.0], &[0.0, -1e-30]), 2.0);
        assert_eq!(distance(&[0.0, 0.0], &[0.0, 3.0]), 1.0);
    }
}
