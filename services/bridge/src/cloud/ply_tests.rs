//! Expected values are written out by hand beside the bytes.

use hachi_hal::Point;

use super::super::{CloudDecoder, CloudFormat, read_cloud_bytes};
use super::*;

fn read_all(bytes: &[u8]) -> Result<Vec<Point>, CloudError> {
    let mut points = Vec::new();
    let mut decoder = CloudDecoder::default();
    read_cloud_bytes(CloudFormat::Ply, bytes, &mut decoder, &mut points)?;
    Ok(points)
}

fn header(format: &str, elements: &str) -> Vec<u8> {
    format!("ply\nformat {format} 1.0\ncomment by hand\n{elements}end_header\n").into_bytes()
}

const VERTEX: &str = "element vertex 2\nproperty double x\nproperty float y\nproperty float z\n\
                      property uchar intensity\n";

#[test]
fn both_byte_orders_give_the_same_points() {
    for big in [false, true] {
        let order = if big {
            "binary_big_endian"
        } else {
            "binary_little_endian"
        };
        let mut bytes = header(order, VERTEX);
        for (x, y, z, intensity) in [(1.5_f64, -2.0_f32, 0.25_f32, 9_u8), (0.0, 1.0, 2.0, 255)] {
            if big {
                bytes.extend(x.to_be_bytes());
                bytes.extend(y.to_be_bytes());
                bytes.extend(z.to_be_bytes());
            } else {
                bytes.extend(x.to_le_bytes());
                bytes.extend(y.to_le_bytes());
                bytes.extend(z.to_le_bytes());
            }
            bytes.push(intensity);
        }
        let points = read_all(&bytes).unwrap();
        assert_eq!(points[0].position(), [1.5, -2.0, 0.25]);
        assert_eq!(points[1].position(), [0.0, 1.0, 2.0]);
        assert_eq!((points[0].intensity, points[1].intensity), (9.0, 255.0));
        let body = bytes.len() - 34;
        for cut in body..bytes.len() {
            assert!(read_all(&bytes[..cut]).is_err(), "{cut}");
        }
    }
}

#[test]
fn text_with_lists_and_other_elements_around_the_vertices_is_read() {
    let elements = "element camera 1\nproperty float fov\nelement vertex 2\nproperty float z\n\
                    property list uchar int seen_by\nproperty float x\nproperty float y\n\
                    property float scalar_Intensity\nelement face 1\n\
                    property list uchar int vertex_indices\n";
    let mut bytes = header("ascii", elements);
    bytes.extend_from_slice(b"0.5\n3 2 7 8 1 2 100\n-3 0 -1 -2 50\n3 0 1 0\n");
    let points = read_all(&bytes).unwrap();
    assert_eq!(points.len(), 2);
    assert_eq!(points[0].position(), [1.0, 2.0, 3.0]);
    assert_eq!(points[1].position(), [-1.0, -2.0, -3.0]);
    assert_eq!(points[0].intensity, 100.0);
}

#[test]
fn lists_in_binary_vertices_and_before_them_are_stepped_over() {
    let elements = "element group 1\nproperty list ushort short members\nelement vertex 1\n\
                    property float x\nproperty list uchar uint seen_by\nproperty float y\n\
                    property float z\n";
    let mut bytes = header("binary_little_endian", elements);
    bytes.extend([2, 0, 9, 9, 9, 9]);
    bytes.extend(1.0_f32.to_le_bytes());
    bytes.extend([1, 9, 9, 9, 9]);
    bytes.extend(2.0_f32.to_le_bytes());
    bytes.extend(3.0_f32.to_le_bytes());
    assert_eq!(read_all(&bytes).unwrap()[0].position(), [1.0, 2.0, 3.0]);
    let body = bytes.len() - 23;
    for cut in body..bytes.len() {
        assert!(read_all(&bytes[..cut]).is_err(), "{cut}");
    }
}

#[test]
fn headers_that_lie_are_refused_with_what_they_said() {
    let refused = |elements: &str| read_all(&header("binary_little_endian", elements)).unwrap_err();
    let many = VERTEX.replace("vertex 2", "vertex 18446744073709551615");
    assert!(matches!(refused(&many), CloudError::TooLarge { .. }));
    let missing = VERTEX.replace("property float z\n", "");
    assert!(matches!(
        refused(&missing),
        CloudError::NoField { missing: "z", .. }
    ));
    assert!(matches!(
        refused("element face 1\n"),
        CloudError::NoField { .. }
    ));
    let odd = VERTEX.replace("uchar", "quad");
    assert!(matches!(refused(&odd), CloudError::Header { line: 8, .. }));
    assert!(matches!(
        refused("property float x\n"),
        CloudError::Header { .. }
    ));
    assert!(matches!(
        read_all(b"plyx\n"),
        Err(CloudError::Header { line: 1, .. })
    ));
    assert!(matches!(
        read_all(b"ply\nelement"),
        Err(CloudError::HeaderEnd { .. })
    ));
    // Elements of nothing, a great many of them, take no time to step over.
    let empty = format!("element nothing 18446744073709551615\n{VERTEX}");
    assert!(matches!(refused(&empty), CloudError::Truncated { .. }));
}
