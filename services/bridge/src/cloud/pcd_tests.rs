//! Expected values are written out by hand beside the bytes.

use hachi_hal::Point;

use super::super::{CloudDecoder, CloudFormat, CloudInfo, PointTimes, read_cloud_bytes};
use super::*;

fn read_all(bytes: &[u8]) -> Result<(Vec<Point>, CloudInfo), CloudError> {
    let mut points = Vec::new();
    let mut decoder = CloudDecoder::default();
    let info = read_cloud_bytes(CloudFormat::Pcd, bytes, &mut decoder, &mut points)?;
    Ok((points, info))
}

fn file(header: &str, body: &[u8]) -> Vec<u8> {
    [header.as_bytes(), body].concat()
}

#[test]
fn ascii_with_fields_in_odd_order_and_a_counted_one_is_read() {
    let header = "# .PCD v0.7\r\nVERSION 0.7\nFIELDS ring z normal intensity y x\nSIZE 2 4 4 1 4 8\n\
                  TYPE U F F U F F\nCOUNT 1 1 3 1 1 1\nWIDTH 2\nHEIGHT 1\nPOINTS 2\nDATA ascii\n";
    let (points, info) = read_all(&file(
        header,
        b"7 3.5 0 0 1 200 -2 1.25\r\n\n8 nan 0 0 1 10 0 -1e1\n",
    ))
    .unwrap();
    assert_eq!((points.len(), info.non_finite), (2, 1));
    assert_eq!(points[0].position(), [1.25, -2.0, 3.5]);
    assert_eq!((points[0].ring, points[0].intensity), (7, 200.0));
    assert_eq!((points[1].x, points[1].ring), (-10.0, 8));
    assert!(points[1].z.is_nan());
}

#[test]
fn binary_with_width_zero_takes_its_count_from_points() {
    let header = "FIELDS x y z _ time\nSIZE 4 4 4 1 4\nTYPE F F F U U\nCOUNT 1 1 1 4 1\nWIDTH 0\n\
                  HEIGHT 1\nPOINTS 2\nDATA binary\n";
    let mut body = Vec::new();
    for (x, time) in [(2.0_f32, 50_000_000_u32), (1.0, 0)] {
        for value in [x, 0.0, 0.0] {
            body.extend_from_slice(&value.to_le_bytes());
        }
        body.extend_from_slice(&[0xff; 4]);
        body.extend_from_slice(&time.to_le_bytes());
    }
    let (points, info) = read_all(&file(header, &body)).unwrap();
    // Oldest first, whatever order the file has.
    assert_eq!((points[0].x, points[1].x), (1.0, 2.0));
    assert_eq!(points[1].time_offset_ns, 50_000_000);
    assert_eq!(info.times, PointTimes::Relative(0, 50_000_000));
}

#[test]
fn binary_compressed_holds_one_column_after_another() {
    let header = "FIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\nWIDTH 2\nHEIGHT 1\nPOINTS 2\n\
                  DATA binary_compressed\n";
    // x: 1 2, y: 0 0, z: 0 0. 1.0f is 00 00 80 3f, 2.0f is 00 00 00 40. Eight literals, one zero
    // literal, then fifteen bytes from a distance of one: 7 in the length bits, 6 more, plus two.
    let stream = [7, 0, 0, 0x80, 0x3f, 0, 0, 0, 0x40, 0, 0, 0xe0, 6, 0];
    let mut body = vec![stream.len() as u8, 0, 0, 0, 24, 0, 0, 0];
    body.extend_from_slice(&stream);
    let (points, _) = read_all(&file(header, &body)).unwrap();
    assert_eq!(points[0].position(), [1.0, 0.0, 0.0]);
    assert_eq!(points[1].position(), [2.0, 0.0, 0.0]);
    // The same bytes, cut anywhere, are refused.
    for cut in 0..body.len() {
        assert!(read_all(&file(header, &body[..cut])).is_err(), "{cut}");
    }
}

#[test]
fn headers_that_lie_are_refused_with_what_they_said() {
    let with = |change: (&str, &str)| {
        let header = "FIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\nWIDTH 1\nHEIGHT 1\n\
                      POINTS 1\nDATA binary\n";
        read_all(&file(&header.replace(change.0, change.1), &[0; 12]))
    };
    assert!(with(("", "")).is_ok());
    let refused = |from, to| with((from, to)).unwrap_err();
    assert!(matches!(
        refused("POINTS 1", "POINTS 18446744073709551615"),
        CloudError::TooLarge { .. }
    ));
    assert!(matches!(
        refused("POINTS 1", "POINTS 2"),
        CloudError::Truncated {
            points: 2,
            needed: 24,
            got: 12
        }
    ));
    // No POINTS line: the product of the two others, which must not overflow.
    let wide = "WIDTH 9223372036854775807\nHEIGHT 4\n# ";
    assert!(matches!(
        refused("WIDTH 1\nHEIGHT 1\n", wide),
        CloudError::TooLarge { .. } | CloudError::Truncated { .. }
    ));
    assert!(matches!(
        refused("COUNT 1 1 1", "COUNT 1 1 99999999999"),
        CloudError::TooLarge { .. }
    ));
    assert!(matches!(
        refused("SIZE 4 4 4", "SIZE 4 4"),
        CloudError::Header { .. }
    ));
    assert!(matches!(
        refused("TYPE F F F", "TYPE F F Q"),
        CloudError::FieldType { .. }
    ));
    assert!(matches!(
        refused("x y z", "x y w"),
        CloudError::NoField { missing: "z", .. }
    ));
    assert!(matches!(
        refused("WIDTH 1", "WIDTH -1"),
        CloudError::Header { line: 5, .. }
    ));
    assert!(matches!(
        refused("DATA binary", "DATA zip"),
        CloudError::Header { .. }
    ));
    assert!(matches!(
        read_all(b"FIELDS x y"),
        Err(CloudError::HeaderEnd { .. })
    ));
}

#[test]
fn a_text_body_cut_short_is_refused_and_so_is_a_word_in_it() {
    let header = "FIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nWIDTH 2\nHEIGHT 1\nPOINTS 2\nDATA ascii\n";
    assert!(matches!(
        read_all(&file(header, b"1 2 3\n")),
        Err(CloudError::Truncated { points: 2, .. })
    ));
    assert_eq!(
        read_all(&file(header, b"1 2 3\n1 two 3\n")).unwrap_err(),
        CloudError::Text {
            line: 9,
            seen: "1 two 3".into(),
            expected: 3
        }
    );
}

#[test]
fn zero_points_are_a_cloud() {
    let header = "FIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nWIDTH 0\nHEIGHT 1\nPOINTS 0\nDATA binary\n";
    let (points, info) = read_all(header.as_bytes()).unwrap();
    assert!(points.is_empty());
    assert_eq!(info.times, PointTimes::None);
}

#[test]
fn intensities_in_zero_to_one_are_scaled_and_the_scale_stays() {
    let header = "FIELDS x y z intensity\nSIZE 4 4 4 4\nTYPE F F F F\nWIDTH 1\nHEIGHT 1\nPOINTS 1\n\
                  DATA ascii\n";
    let mut points = Vec::new();
    let mut decoder = CloudDecoder::default();
    for (text, intensity, scale) in [
        ("0 0 1 0\n", 0.0, None),
        ("0 0 1 0.5\n", 127.5, Some(255.0)),
        ("0 0 1 2\n", 510.0, Some(255.0)),
    ] {
        let bytes = file(header, text.as_bytes());
        read_cloud_bytes(CloudFormat::Pcd, &bytes, &mut decoder, &mut points).unwrap();
        assert_eq!(points[0].intensity, intensity);
        assert_eq!(decoder.intensity_scale(), scale);
    }
}
