//! Real models on every back end that is there: the same answers, and wrong files refused.
#![allow(clippy::print_stderr, reason = "a test that does not run says so")]

use std::path::{Path, PathBuf};

use hachi_inference::{BackEnd, LoadError, LoadOptions, Manifest, ManifestError, Tensor, load};

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

/// A field with a length, of a message in an ONNX file.
fn field(number: u8, content: &[u8]) -> Vec<u8> {
    let length = content.len();
    let length = [(length & 0x7F) as u8 | 0x80, (length >> 7) as u8];
    [&[number << 3 | 2], &length[..], content].concat()
}

/// A network of two nodes: an operation on the input x [1, 3, 1, 1], flattened to z [1, 3].
fn operation(name: &str) -> Vec<u8> {
    let node = |input: &[u8], output: &[u8], kind: &str| {
        let ports = [field(1, input), field(2, output)].concat();
        field(1, &[ports, field(4, kind.as_bytes())].concat())
    };
    let port = |number: u8, name: &[u8], sizes: &[u8]| {
        let sizes: Vec<_> = sizes.iter().flat_map(|s| field(1, &[0x08, *s])).collect();
        let tensor = [vec![0x08, 1], field(2, &sizes)].concat();
        let named = [field(1, name), field(2, &field(1, &tensor))].concat();
        field(number, &named)
    };
    let graph = [
        node(b"x", b"y", name),
        node(b"y", b"z", "Flatten"),
        field(2, b"graph"),
        port(11, b"x", &[1, 3, 1, 1]),
        port(12, b"z", &[1, 3]),
    ];
    let graph = field(7, &graph.concat());
    [vec![0x08, 8], field(8, &[0x10, 13]), graph].concat()
}

#[test]
fn a_model_whose_answer_is_no_number_is_refused() {
    let scratch = tempfile::tempdir().unwrap();
    let path = scratch.path().join("model.onnx");
    let known = hachi_inference::known::manifest("osnet_x0_25_msmt17").unwrap();
    let manifest = known
        .replace("\"input\"", "\"x\"")
        .replace("width = 128", "width = 1")
        .replace("height = 256", "height = 1")
        .replace("many = true", "many = false")
        .replace("length = 512", "length = 3");
    std::fs::write(path.with_extension("toml"), manifest).unwrap();
    for back_end in back_ends() {
        let options = LoadOptions {
            back_end: Some(back_end),
            ..LoadOptions::default()
        };
        // The trial's input is noughts: the exponential is 1, the logarithm minus infinity.
        std::fs::write(&path, operation("Exp")).unwrap();
        let mut sound = load(&path, &options).unwrap();
        let mut outputs = Vec::new();
        let input = Tensor::zeros(&[1, 3, 1, 1]);
        sound.model.run(&input, &mut outputs).unwrap();
        assert_eq!(outputs[0].values(), [1.0; 3]);
        std::fs::write(&path, operation("Log")).unwrap();
        let error = load(&path, &options).unwrap_err();
        assert!(matches!(error, LoadError::Trial { .. }), "{error:?}");
        let said = "output \"z\" is not all finite numbers";
        assert!(error.to_string().ends_with(said), "{error}");
    }
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
        let error = Manifest::from_toml(&known.replace(from, to)).unwrap_err();
        assert!(error.to_string().contains(said), "{error}");
        let named = matches!(error, ManifestError::Toml(_) | ManifestError::Value { .. });
        assert!(named, "{error:?}");
    }
}

/// YOLACT's published network for 550 pixels, by its `Config` of five levels.
const YOLACT: &str = r#"
about = "yolact_base"
[input]
name = "image"
width = 550
height = 550
layout = "nchw"
channels = "rgb"
fit = "stretch"
[decoder]
kind = "yolact"
classes = 80
person = 0
even_score = 0.3
coefficients = 32
scales = [[24.0], [48.0], [96.0], [192.0], [384.0]]
square = true
"#;

#[test]
fn a_yolact_network_has_the_anchors_of_its_scales() {
    let manifest = Manifest::from_toml(YOLACT).unwrap();
    // The published network has 19248.
    assert_eq!(manifest.check_output(0, 1, &[1, 19248, 4]), Ok(()));
    let error = manifest.check_output(1, 1, &[1, 19247, 81]).unwrap_err();
    let said = error.to_string();
    assert!(said.contains("[1, 19248, 81]"), "{said}");
    // 69 x 69 cells of the first level, three ratios, 71 scales: 1014093.
    let many = format!("[24.0{}]", ", 24.0".repeat(70));
    for (from, to) in [
        ("[24.0]", many.as_str()),
        ("square", "aspect_ratios = []\nsquare"),
    ] {
        let error = Manifest::from_toml(&YOLACT.replace(from, to));
        let error = error.unwrap_err().to_string();
        let named = error.contains("decoder.scales") && error.contains("1000000 anchors");
        assert!(named, "{error}");
    }
}

#[test]
fn every_known_manifest_is_sound() {
    for (name, text) in hachi_inference::known::KNOWN {
        Manifest::from_toml(text).unwrap_or_else(|e| panic!("{name}: {e}"));
    }
}
