//! Any numbers as a detector's answer: decoded, suppressed, brought back to the image, masked.
#![no_main]

use hachi_inference::fixed::FixedAnswers;
use hachi_inference::{ImageView, Loaded, Manifest, Signature, Tensor};
use hachi_people::detect::{Detector, Wanted};
use libfuzzer_sys::fuzz_target;

const INPUT: &str = r#"
about = "fuzzed"
[input]
name = "x"
width = 64
height = 32
layout = "nchw"
channels = "rgb"
fit = "letterbox-centre"
"#;

/// Decoders, and the shapes of what they decode.
const KINDS: [(&str, &[&[usize]]); 4] = [
    (
        "kind = 'yolox'\nclasses = 2\nperson = 0\neven_score = 0.5",
        &[&[1, 42, 7]],
    ),
    (
        "kind = 'yolov8'\nclasses = 2\nperson = 1\neven_score = 0.5",
        &[&[1, 6, 42]],
    ),
    (
        "kind = 'yolov8'\nclasses = 2\nperson = 0\neven_score = 0.5\ncoefficients = 3",
        &[&[1, 9, 42], &[1, 3, 8, 16]],
    ),
    (
        "kind = 'yolact'\nclasses = 2\nperson = 0\neven_score = 0.5\ncoefficients = 3\nscales = [[24.0], [48.0]]",
        &[&[1, 120, 4], &[1, 120, 3], &[1, 120, 3], &[1, 8, 16, 3]],
    ),
];

fuzz_target!(|bytes: &[u8]| {
    let [kind, rest @ ..] = bytes else { return };
    let (decoder, shapes) = KINDS[usize::from(*kind) % KINDS.len()];
    let words = rest
        .chunks_exact(4)
        .map(|w| f32::from_le_bytes([w[0], w[1], w[2], w[3]]));
    let mut numbers = words
        .chain(rest.iter().map(|b| f32::from(*b) / 64.0))
        .cycle();
    let answers: Option<Vec<Tensor>> = shapes
        .iter()
        .map(|shape| {
            let values = numbers.by_ref().take(shape.iter().product()).collect();
            Tensor::from_values(shape, values)
        })
        .collect();
    let Some(answers) = answers else { return };
    let manifest = Manifest::from_toml(&format!("{INPUT}[decoder]\n{decoder}"));
    let signature = Signature {
        back_end: "fixed".to_owned(),
        inputs: Vec::new(),
        outputs: Vec::new(),
    };
    let loaded = Loaded {
        manifest: manifest.expect("the manifest is sound"),
        model: Box::new(FixedAnswers::new(signature, [answers])),
    };
    let mut detector = Detector::new(loaded, Wanted::All).expect("the model is a detector");
    let pixels = [100; 3 * 40 * 30];
    let image = ImageView::new(40, 30, &pixels).expect("the image has a size");
    let Ok(found) = detector.detect(&image) else {
        return;
    };
    for thing in found {
        let b = &thing.bounding_box;
        assert!(b.is_sound(), "{b:?}");
        assert!(b.left >= 0.0 && b.top >= 0.0 && b.right() <= 40.01 && b.bottom() <= 30.01);
        if let Some(mask) = &thing.mask {
            mask.covers(b.middle());
            mask.covers([-1e9, 1e9]);
        }
    }
});
