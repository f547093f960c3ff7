//! Masks of people against what a simulated picture truly shows.
//!
//! In: who was found, and for each pixel of the picture, row by row, whom it shows. Out: overlaps.

use hachi_people::BoundingBox;
use hachi_people::detect::Found;

/// The middle of a pixel, counted row by row in a picture of so many columns, if it lies in the box.
pub fn middle_in(bounding_box: &BoundingBox, pixel: usize, columns: usize) -> Option<[f64; 2]> {
    let middle = [pixel % columns, pixel / columns].map(|p| p as f64 + 0.5);
    bounding_box.contains(middle).then_some(middle)
}

/// Intersection over union, 0 to 1, of the mask of who was found and the pixels that show the person
/// with this label; `None` without a mask, or if both are empty.
pub fn mask_overlap(found: &Found, label: u8, shown: &[u8], columns: usize) -> Option<f64> {
    let mask = found.mask.as_ref()?;
    let (mut both, mut either) = (0_u32, 0_u32);
    for (pixel, shows) in shown.iter().enumerate() {
        let middle = middle_in(&found.bounding_box, pixel, columns);
        let covers = middle.is_some_and(|middle| mask.covers(middle));
        both += u32::from(covers && *shows == label);
        either += u32::from(covers || *shows == label);
    }
    (either > 0).then(|| f64::from(both) / f64::from(either))
}
