//! How far a feature lies from the pictures of a person.
//!
//! In: features of unit length. Out: cosine distances, 0 to 2.

/// The least distance (1 - cosine) of a feature from any of a person's pictures, whose features
/// stand one after the other. Infinite if there is none of the same length.
pub fn distance(pictures: &[f32], feature: &[f32]) -> f64 {
    if feature.is_empty() {
        return f64::INFINITY;
    }
    let pictures = pictures.chunks_exact(feature.len());
    let distances = pictures.map(|picture| {
        let cosine: f32 = picture.iter().zip(feature).map(|(a, b)| a * b).sum();
        f64::from(1.0 - cosine)
    });
    distances.fold(f64::INFINITY, f64::min)
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
}
