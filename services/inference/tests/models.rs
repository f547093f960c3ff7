//! Real models on every back end that is there: the same answers, and wrong files refused.
#![allow(clippy::print_stderr, reason = "a test that does not run says so")]

use std::path::{Path, PathBuf};

use hachi_inference::{BackEnd, LoadError, LoadOptions, ManifestError, Tensor, load};

fn models() -> Option<PathBuf> {
    let folder = std::env::var_os("HACHI_DATA");
    if folder.is_none() {
        eprintln!("skipped: HACHI_DATA names no folder with models");
    }
    Some(Path::new(&folder?).join("models"))
}

/// The back ends of this build, without ONNX Runtime where no library is named.
fn back_ends() -> Vec<BackEnd> {
    let mut there = Vec::new();
    if cfg!(feature = "embedded") {
        there.push(BackEnd::Embedded);
    }
    match (
        cfg!(feature = "onnxruntime"),
        std::env::var_os("ORT_DYLIB_PATH"),
    ) {
        (true, Some(_)) => there.push(BackEnd::OnnxRuntime),
        (true, None) => eprintln!("ONNX Runtime is not tried: ORT_DYLIB_PATH names no library"),
        (false, _) => {}
    }
    there
}

/// Numbers that look like pixels after normalisation, the same everywhere.
fn input(shape: &[usize]) -> Tensor {
    let mut tensor = Tensor::zeros(shape);
    for (i, value) in tensor.values_mut().iter_mut().enumerate() {
        *value = (i * 37 % 101) as f32 / 101.0;
    }
    tensor
}

/// First numbers of the first output on [`input`], by ONNX Runtime 1.32 from Python.
const ANSWERS: [(&str, [f32; 4]); 3] = [
    (
        "yolox_nano_416x416.onnx",
        [0.554_450_15, 1.575_587, 0.363_156_97, 0.992_645_86],
    ),
    (
        "osnet_x0_25_msmt17.onnx",
        [0.0, 0.000_254_782_24, 0.0, 1.937_173_8],
    ),
    (
        "person-reidentification-retail-0288.onnx",
        [-0.400_252_37, 0.260_832_8, 0.362_067_94, -0.118_715],
    ),
];

#[test]
fn every_back_end_answers_as_the_reference_does() {
    let Some(folder) = models() else { return };
    for back_end in back_ends() {
        for (name, expected) in ANSWERS {
            let options = LoadOptions {
                back_end: Some(back_end),
                threads: Some(1),
                ..LoadOptions::default()
            };
            let mut loaded = load(&folder.join(name), &options).unwrap();
            let mut outputs = Vec::new();
            let input = input(&loaded.manifest.input_shape(1));
            loaded.model.run(&input, &mut outputs).unwrap();
            let first = &outputs[0].values()[..4];
            let off = first.iter().zip(expected).map(|(a, b)| (a - b).abs());
            assert!(
                off.fold(0.0, f32::max) < 2e-4,
                "{back_end:?} {name}: {first:?}"
            );
        }
    }
}

#[test]
fn a_model_of_another_shape_is_refused_with_both_shapes() {
    let Some(folder) = models() else { return };
    let scratch = tempfile::tempdir().unwrap();
    let manifest = scratch.path().join("wrong.toml");
    let known = hachi_inference::known::manifest("yolox_nano_416x416").unwrap();
    for (from, to, said) in [
        (
            "width = 416",
            "width = 640",
            ["[1, 3, 416, 640]", "[1, 3, 416, 416]"],
        ),
        (
            "classes = 80",
            "classes = 20",
            ["[1, 3549, 25]", "[1, 3549, 85]"],
        ),
        ("\"images\"", "\"picture\"", ["\"picture\"", "\"images\""]),
    ] {
        std::fs::write(&manifest, known.replace(from, to)).unwrap();
        let options = LoadOptions {
            manifest: Some(manifest.clone()),
            ..LoadOptions::default()
        };
        let error = load(&folder.join("yolox_nano_416x416.onnx"), &options).unwrap_err();
        let text = error.to_string();
        assert!(said.iter().all(|part| text.contains(part)), "{text}");
    }
}

#[test]
fn files_that_are_no_models_are_refused() {
    let scratch = tempfile::tempdir().unwrap();
    let path = scratch.path().join("yolox_nano_416x416.onnx");
    for bytes in [
        &b""[..],
        b"\x08\x07\x12\x04",
        b"not an ONNX file at all",
        &[0xFF; 4000],
    ] {
        std::fs::write(&path, bytes).unwrap();
        for back_end in back_ends() {
            let options = LoadOptions {
                back_end: Some(back_end),
                ..LoadOptions::default()
            };
            assert!(load(&path, &options).is_err(), "{bytes:?}");
        }
    }
    let missing = load(&scratch.path().join("none.onnx"), &LoadOptions::default());
    assert!(matches!(missing, Err(LoadError::Io { .. })));
    let unknown = scratch.path().join("unknown.onnx");
    std::fs::write(&unknown, b"x").unwrap();
    let unknown = load(&unknown, &LoadOptions::default());
    assert!(
        matches!(unknown, Err(LoadError::NoManifest { .. })),
        "{unknown:?}"
    );
}

#[test]
fn half_a_model_is_refused() {
    let Some(folder) = models() else { return };
    let scratch = tempfile::tempdir().unwrap();
    let bytes = std::fs::read(folder.join("osnet_x0_25_msmt17.onnx")).unwrap();
    let path = scratch.path().join("osnet_x0_25_msmt17.onnx");
    for part in [bytes.len() / 2, bytes.len() - 7] {
        std::fs::write(&path, &bytes[..part]).unwrap();
        for back_end in back_ends() {
            let options = LoadOptions {
                back_end: Some(back_end),
                ..LoadOptions::default()
            };
            assert!(load(&path, &options).is_err(), "{part} bytes");
        }
    }
}

#[test]
fn a_manifest_with_a_key_too_many_or_an_impossible_value_is_refused() {
    let known = hachi_inference::known::manifest("osnet_x0_25_msmt17").unwrap();
    for (from, to, said) in [
        ("many = true", "many = true\nmore = 1", "more"),
        ("width = 128", "width = 0", "input.width"),
        ("divide_by = 255.0", "divide_by = 0.0", "divide_by"),
        ("length = 512", "length = 0", "decoder.length"),
    ] {
        let error = hachi_inference::Manifest::from_toml(&known.replace(from, to)).unwrap_err();
        assert!(error.to_string().contains(said), "{error}");
        let named = matches!(error, ManifestError::Toml(_) | ManifestError::Value { .. });
        assert!(named, "{error:?}");
    }
}

#[test]
fn every_known_manifest_is_sound() {
    for (name, text) in hachi_inference::known::KNOWN {
        hachi_inference::Manifest::from_toml(text).unwrap_or_else(|e| panic!("{name}: {e}"));
    }
}
