//! Bytes that are ONNX files, and bytes that are none.

use hachi_inference::onnx_file::{NotOnnx, check};

/// ir_version 8, and a graph with one node that has one input named x.
const MODEL: [u8; 9] = [0x08, 8, 0x3A, 5, 0x0A, 3, 0x0A, 1, b'x'];

#[test]
fn a_whole_file_is_taken_and_no_part_of_it() {
    assert_eq!(check(&MODEL), Ok(()));
    for length in 0..MODEL.len() {
        assert!(check(&MODEL[..length]).is_err(), "{length} bytes");
    }
}

#[test]
fn what_is_no_field_is_named() {
    assert_eq!(check(&[0xFF; 40]), Err(NotOnnx::Field { at: 0 }));
    assert_eq!(check(&[0x08, 8, 0x0B]), Err(NotOnnx::Field { at: 2 }));
    assert_eq!(check(&[0x08, 8]), Err(NotOnnx::NoGraph));
}
