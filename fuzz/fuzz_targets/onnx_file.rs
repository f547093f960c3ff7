//! Any bytes as an ONNX file, of which the outer structure is checked, and as a network's manifest.
#![no_main]

use hachi_inference::Manifest;
use hachi_inference::onnx_file::check;
use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    if check(bytes).is_ok() {
        let longer = [bytes, &[0]].concat();
        assert!(check(&longer).is_err(), "no field has the number 0");
    }
    let Ok(text) = str::from_utf8(bytes) else {
        return;
    };
    let Ok(manifest) = Manifest::from_toml(text) else {
        return;
    };
    assert_eq!(manifest.input_shape(2)[0], 2);
    for (index, shape) in manifest.output_shapes(2).iter().enumerate() {
        let any: Vec<usize> = shape.iter().map(|size| size.unwrap_or(7)).collect();
        assert_eq!(manifest.check_output(index, 2, &any), Ok(()));
    }
});
