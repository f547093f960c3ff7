//! Images as inputs of models.

use hachi_inference::manifest::{Channels, Fit, InputLayout, Layout, Resample};
use hachi_inference::{ImageError, ImageView, Preprocessor, Region};

fn layout(fit: Fit) -> InputLayout {
    InputLayout {
        name: "x".to_owned(),
        width: 8,
        height: 8,
        layout: Layout::Nchw,
        channels: Channels::Bgr,
        fit,
        fill: 114,
        resample: Resample::Linear,
        divide_by: 1.0,
        mean: [0.0; 3],
        deviation: [1.0; 3],
        many: false,
    }
}

#[test]
fn a_wide_image_is_letterboxed_and_its_places_come_back() {
    let rgb = [10, 20, 30].repeat(16 * 4);
    let image = ImageView::new(16, 4, &rgb).unwrap();
    let mut slot = vec![0.0; 3 * 64];
    let mut preprocessor = Preprocessor::default();
    let placement = preprocessor
        .fill(&layout(Fit::LetterboxCentre), &image, None, &mut slot)
        .unwrap();
    // Two of eight rows, from the fourth on; blue first.
    assert_eq!(slot[..24], [114.0; 24]);
    assert_eq!(slot[24..40], [30.0; 16]);
    assert_eq!(slot[40..64], [114.0; 24]);
    assert_eq!(slot[128 + 24..128 + 40], [10.0; 16]);
    assert_eq!(placement.to_image([4.0, 4.0]), [8.0, 2.0]);
    assert_eq!(placement.to_input([8.0, 2.0]), [4.0, 4.0]);
}

#[test]
fn channels_last_are_normalised_by_their_own_mean() {
    let rgb = [100, 150, 200].repeat(4);
    let image = ImageView::new(2, 2, &rgb).unwrap();
    let layout = InputLayout {
        width: 2,
        height: 2,
        layout: Layout::Nhwc,
        channels: Channels::Rgb,
        divide_by: 10.0,
        mean: [1.0, 2.0, 3.0],
        deviation: [1.0, 2.0, 4.0],
        ..layout(Fit::Stretch)
    };
    let mut slot = vec![0.0; 12];
    Preprocessor::default()
        .fill(&layout, &image, None, &mut slot)
        .unwrap();
    assert_eq!(slot[..3], [9.0, 6.5, 4.25]);
    assert_eq!(slot[9..], [9.0, 6.5, 4.25]);
}

#[test]
fn a_region_outside_the_image_is_nothing() {
    let rgb = vec![0; 3 * 100];
    let image = ImageView::new(10, 10, &rgb).unwrap();
    let outside = Region {
        left: 10.5,
        top: 0.0,
        width: 5.0,
        height: 5.0,
    };
    let mut slot = vec![0.0; 3 * 64];
    let fill =
        Preprocessor::default().fill(&layout(Fit::Stretch), &image, Some(outside), &mut slot);
    assert_eq!(fill, Err(ImageError::Empty));
    assert!(ImageView::new(10, 10, &rgb[1..]).is_err());
    assert_eq!(ImageView::new(0, 0, &[]).unwrap_err(), ImageError::Empty);
}

#[test]
fn a_picture_that_shrinks_is_averaged_if_it_is_to_be_smooth() {
    // Stripes of one pixel, four to one: alternating 0 and 200.
    let rgb: Vec<u8> = (0..8 * 8)
        .flat_map(|i| [if i % 2 == 0 { 0 } else { 200 }; 3])
        .collect();
    let image = ImageView::new(8, 8, &rgb).unwrap();
    let mut slots = [Resample::Linear, Resample::Smooth].map(|resample| {
        let layout = InputLayout {
            width: 2,
            height: 2,
            resample,
            ..layout(Fit::Stretch)
        };
        let mut slot = vec![0.0; 12];
        Preprocessor::default()
            .fill(&layout, &image, None, &mut slot)
            .unwrap();
        slot
    });
    // Pixel 0 of 2 lies at 1.5: halfway between 200 and 0.
    assert!(
        slots[0].iter().all(|v| (v - 100.0).abs() < 1e-3),
        "{:?}",
        slots[0]
    );
    slots[1].sort_by(f32::total_cmp);
    // A triangle of reach 4 around 1.5, cut at the edge: weights 5/8 at 0, 7/8, 7/8, 5/8, 3/8, 1/8:
    // (7 + 5 + 1) / 28 of 200 in odd pixels, and the same mirrored on the other side.
    let (low, high) = (slots[1][0], slots[1][11]);
    assert_eq!(low, (200.0_f32 * 13.0 / 28.0).round());
    assert_eq!(high, (200.0_f32 * 15.0 / 28.0).round());
}

#[test]
fn a_region_is_all_that_is_looked_at() {
    let mut rgb = vec![0; 3 * 16 * 16];
    for y in 4..8 {
        for x in 8..12 {
            rgb[3 * (16 * y + x)..3 * (16 * y + x) + 3].copy_from_slice(&[90, 90, 90]);
        }
    }
    let image = ImageView::new(16, 16, &rgb).unwrap();
    let region = Region {
        left: 8.0,
        top: 4.0,
        width: 4.0,
        height: 4.0,
    };
    let mut slot = vec![0.0; 3 * 64];
    let mut preprocessor = Preprocessor::default();
    let layout = layout(Fit::Stretch);
    let placement = preprocessor
        .fill(&layout, &image, Some(region), &mut slot)
        .unwrap();
    assert!(slot.iter().all(|v| (v - 90.0).abs() < 1e-3), "{slot:?}");
    assert_eq!(placement.to_image([8.0, 0.0]), [12.0, 4.0]);
}
