//! `PointCloud2` messages in every dialect: any bytes are a scan or an error.
#![no_main]
use hachi_bridge::message::{Body, CloudReader, Encoding, MessageKind, decode};
use hachi_hal::Stamp;

libfuzzer_sys::fuzz_target!(|data: &[u8]| {
    for encoding in [Encoding::Cdr, Encoding::Ros1] {
        let Ok(Body::PointCloud(cloud)) = decode(MessageKind::PointCloud, encoding, data) else {
            continue;
        };
        let mut points = Vec::new();
        let (header, info) = CloudReader::default().read(&cloud, Stamp::default(), &mut points);
        assert_eq!((info.points, cloud.len()), (points.len(), points.len()));
        assert!(header.start <= header.end);
        assert!(points.is_sorted_by_key(|point| point.time_offset_ns));
    }
});
