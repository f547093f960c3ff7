//! The networks in the program itself load on every back end that is there, and answer alike.
#![allow(clippy::print_stderr, reason = "a test that does not run says so")]

use std::path::Path;

use hachi_inference::{BackEnd, LoadError, LoadOptions, Own, Tensor, load};

/// Numbers that look like pixels after normalisation, the same everywhere.
fn input(shape: &[usize]) -> Tensor {
    let mut tensor = Tensor::zeros(shape);
    for (i, value) in tensor.values_mut().iter_mut().enumerate() {
        *value = (i * 37 % 101) as f32 / 101.0;
    }
    tensor
}

fn answer(own: Own, back_end: BackEnd) -> Vec<Tensor> {
    let options = LoadOptions {
        back_end: Some(back_end),
        ..LoadOptions::default()
    };
    let mut loaded = load(Path::new(own.name()), &options).unwrap();
    let mut outputs = Vec::new();
    let input = input(&loaded.manifest.input_shape(1));
    loaded.model.run(&input, &mut outputs).unwrap();
    outputs
}

/// First numbers of the first output, by ONNX Runtime 1.32 from Python.
const ANSWERS: [(Own, [f32; 4]); 2] = [
    (Own::Detector, [6.80505, 12.57015, 20.4783, 26.96314]),
    (Own::ReId, [-0.0699, -0.12404, 0.03605, 0.1029]),
];

#[test]
fn every_back_end_answers_as_the_reference_does() {
    let mut back_ends = vec![BackEnd::Embedded];
    match (
        cfg!(feature = "onnxruntime"),
        std::env::var_os("ORT_DYLIB_PATH"),
    ) {
        (true, Some(_)) => back_ends.push(BackEnd::OnnxRuntime),
        (true, None) => eprintln!("ONNX Runtime is not tried: ORT_DYLIB_PATH names no library"),
        (false, _) => {}
    }
    for back_end in back_ends {
        for (own, expected) in ANSWERS {
            let outputs = answer(own, back_end);
            let found = &outputs[0].values()[..4];
            for (found, expected) in found.iter().zip(expected) {
                let close = (found - expected).abs() < 1e-3 * expected.abs().max(1.0);
                assert!(close, "{own:?} on {back_end:?}: {found}, not {expected}");
            }
        }
    }
}

#[test]
fn a_network_of_another_manifest_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let manifest = folder.path().join("other.toml");
    std::fs::write(&manifest, hachi_inference::known::KNOWN[2].1).unwrap();
    let options = LoadOptions {
        manifest: Some(manifest),
        ..LoadOptions::default()
    };
    let refused = load(Path::new(Own::ReId.name()), &options);
    assert!(
        matches!(refused, Err(LoadError::Manifest { .. })),
        "{refused:?}"
    );
}
