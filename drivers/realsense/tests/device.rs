//! The driver against a camera that is bytes: buffers, tables and answers as a D455 gives them,
//! with the faults that cameras and kernels have.

mod camera;

use camera::{Act, Camera, Plugged, frame_bytes, metadata_bytes};
use hachi_hal::conformance::check_rgbd_camera;
use hachi_hal::{Clock, DeviceError, FaultKind, RgbdCamera, RgbdHeader, RgbdImages, Stamp};
use hachi_realsense::controls::{DepthSettings, Emitter, Exposure};
use hachi_realsense::device::{Part, Stream};
use hachi_realsense::{CameraError, RealSense, RealSenseConfig};

const MS: i64 = 1_000_000;
/// The robot's clock minus the camera's when nothing is late, ns.
const OFFSET_NS: i64 = 5_000_000 * MS;

struct Harness {
    camera: RealSense<Plugged>,
    depth: Vec<u16>,
    color: Vec<u8>,
}

impl Harness {
    fn new(plugged: Plugged) -> Self {
        Self::with(plugged, RealSenseConfig::default())
    }

    fn with(plugged: Plugged, config: RealSenseConfig) -> Self {
        Self {
            camera: RealSense::new(plugged, config),
            depth: vec![0; camera::PIXELS],
            color: vec![0; 3 * camera::PIXELS],
        }
    }

    fn read(&mut self) -> Result<Option<RgbdHeader>, CameraError> {
        self.read_by(Stamp::from_nanos(i64::MAX))
    }

    fn read_by(&mut self, deadline: Stamp) -> Result<Option<RgbdHeader>, CameraError> {
        let images = RgbdImages {
            depth: &mut self.depth,
            color: &mut self.color,
        };
        self.camera.read_frame(images, deadline)
    }

    /// Everything that comes, until nothing does.
    fn all(&mut self) -> Vec<RgbdHeader> {
        let mut headers = Vec::new();
        while let Some(header) = self.read().unwrap() {
            headers.push(header);
        }
        headers
    }

    fn dropped(&self) -> Vec<(&'static str, u64)> {
        let counters = self.camera.counters();
        counters.dropped().filter(|(_, n)| *n != 0).collect()
    }
}

/// A picture and its metadata, read out at `us` on the camera's clock (before it wraps) and seen by
/// the kernel `late_ns` after that moment on a robot's clock that reads the same.
fn shot(stream: Stream, sequence: u32, us: u64, late_ns: i64) -> [Act; 2] {
    let received = us as i64 * 1_000 + late_ns;
    let act = |part, bytes| Act::Buffer {
        stream,
        part,
        sequence,
        received,
        damaged: false,
        bytes,
    };
    [
        act(Part::Picture, frame_bytes(stream, sequence)),
        act(Part::Metadata, metadata_bytes(stream, sequence, us as u32)),
    ]
}

/// `n` pairs, 33 ms apart, from `us` on; colour is read out 4 ms later and 9 ms late.
fn pairs_at(n: u32, us: u64, offset_ns: i64) -> Vec<Act> {
    (0..n)
        .flat_map(|i| {
            let at = us + u64::from(i) * 33_333;
            let depth = shot(Stream::Depth, i, at, offset_ns);
            let color = shot(Stream::Color, i, at + 4_000, offset_ns + 9 * MS);
            depth.into_iter().chain(color)
        })
        .collect()
}

fn pairs(n: u32, us: u64) -> Vec<Act> {
    pairs_at(n, us, OFFSET_NS)
}

#[test]
fn frames_of_the_same_time_come_together_on_the_robots_clock() {
    let mut harness = Harness::new(Plugged::once(Camera::new(pairs(5, 1_000_000))));
    for n in 0..5 {
        let header = harness.read().unwrap().unwrap();
        let us = 1_000_000 + i64::from(n) * 33_333;
        assert_eq!(header.sequence, n);
        // Reading out is 3 ms after the middle of the exposure, and that is when the kernel sees
        // a depth frame at the earliest.
        assert_eq!(header.depth_sensor_ns, Some(us as u64 * 1_000 - 3_000_000));
        assert_eq!(header.color_sensor_ns, Some(us as u64 * 1_000 + 1_000_000));
        let stamp = us * 1_000 + OFFSET_NS - 3 * MS;
        assert_eq!(header.stamp.as_nanos(), stamp);
        assert_eq!(header.color_stamp.as_nanos(), stamp + 4 * MS);
        assert_eq!(header.depth_exposure_us, Some(6_000));
        assert_eq!(harness.depth[..3], [n as u16 + 1, 1_000, 1_001]);
        assert_eq!(harness.color[..3], [255, 255, 255]);
    }
    assert_eq!(harness.read().unwrap(), None);
    assert_eq!(harness.dropped(), []);
    let counters = harness.camera.counters();
    assert_eq!((counters.pairs, counters.depth.frames), (5, 5));
}

#[test]
fn geometry_and_identity_come_from_the_camera() {
    let mut harness = Harness::new(Plugged::once(Camera::new(pairs(1, 0))));
    assert!(harness.camera.geometry().is_none());
    harness.read().unwrap().unwrap();
    let geometry = harness.camera.geometry().unwrap();
    assert!((geometry.depth.focal[0] - 424.23).abs() < 1e-4);
    assert!((geometry.color.focal[0] - 421.65).abs() < 0.01);
    assert!((geometry.color_from_depth.translation.x + 0.0591).abs() < 1e-6);
    assert_eq!(geometry.depth_unit_m, 0.001);
    let identity = harness.camera.identity().unwrap();
    assert_eq!(identity.info.firmware, [5, 16, 0, 1]);
    assert!(!identity.depth_unit_assumed);
}

#[test]
fn a_camera_that_hides_its_depth_unit_is_taken_at_a_millimetre_and_says_so() {
    let mut camera = Camera::new(pairs(1, 0));
    camera.depth_table = None;
    let mut harness = Harness::new(Plugged::once(camera));
    harness.read().unwrap().unwrap();
    assert!(harness.camera.identity().unwrap().depth_unit_assumed);
    assert_eq!(harness.camera.geometry().unwrap().depth_unit_m, 0.001);
}

#[test]
fn the_cameras_clock_may_wrap() {
    // 32 bits of microseconds end after the second pair.
    let start = u64::from(u32::MAX) - 40_000;
    let mut harness = Harness::new(Plugged::once(Camera::new(pairs(4, start))));
    let headers = harness.all();
    let sensor: Vec<_> = headers.iter().map(|h| h.depth_sensor_ns.unwrap()).collect();
    assert_eq!(sensor.len(), 4);
    for (before, after) in sensor.iter().zip(&sensor[1..]) {
        assert_eq!(after - before, 33_333_000);
    }
    assert_eq!(harness.dropped(), []);
}

#[test]
fn a_frame_whose_partner_was_lost_goes_and_the_rest_stay_together() {
    let mut acts = pairs(6, 1_000_000);
    // The third colour picture and its metadata never come.
    acts.drain(10..12);
    let mut harness = Harness::new(Plugged::once(Camera::new(acts)));
    let headers = harness.all();
    assert_eq!(headers.len(), 5);
    for header in &headers {
        let gap = header.color_sensor_ns.unwrap() - header.depth_sensor_ns.unwrap();
        assert_eq!(gap, 4_000_000);
    }
    assert_eq!(
        harness.dropped(),
        [("depth_unpaired", 1), ("color_lost", 1)]
    );
}

#[test]
fn a_stream_that_is_three_frames_late_finds_its_partners() {
    let of = |stream| move |i: u32| shot(stream, i, 1_000_000 + u64::from(i) * 33_333, OFFSET_NS);
    let depth: Vec<_> = (0..8).flat_map(of(Stream::Depth)).collect();
    let color: Vec<_> = (0..8).flat_map(of(Stream::Color)).collect();
    let mut acts = depth[..6].to_vec();
    for i in 0..5 {
        acts.extend_from_slice(&depth[6 + 2 * i..8 + 2 * i]);
        acts.extend_from_slice(&color[2 * i..2 * i + 2]);
    }
    acts.extend_from_slice(&color[10..]);
    let mut harness = Harness::new(Plugged::once(Camera::new(acts)));
    assert_eq!(harness.all().len(), 8);
    assert_eq!(harness.dropped(), []);
}

#[test]
fn frames_of_different_times_are_never_a_pair() {
    // At 30 a second, 17 ms is more than half a period.
    let acts: Vec<_> = (0..6)
        .flat_map(|i| {
            let at = 1_000_000 + u64::from(i) * 33_333;
            let depth = shot(Stream::Depth, i, at, OFFSET_NS);
            let color = shot(Stream::Color, i, at + 16_700, OFFSET_NS);
            depth.into_iter().chain(color)
        })
        .collect();
    let mut harness = Harness::new(Plugged::once(Camera::new(acts)));
    // Each colour frame is nearer to the depth frame after it: 16.633 ms.
    let headers = harness.all();
    assert_eq!(headers.len(), 5);
    for header in headers {
        let gap = header.depth_sensor_ns.unwrap() - header.color_sensor_ns.unwrap();
        assert_eq!(gap, 16_633_000);
    }
}

#[test]
fn metadata_may_come_before_their_picture_or_never() {
    let mut acts = pairs(4, 1_000_000);
    // First pair: metadata first. Third pair: none for depth.
    acts.swap(0, 1);
    acts.swap(2, 3);
    acts.remove(9);
    let mut harness = Harness::new(Plugged::once(Camera::new(acts)));
    let headers = harness.all();
    assert_eq!(headers.len(), 4);
    assert_eq!(headers[2].depth_sensor_ns, None);
    // The kernel's own stamp is all there is.
    let received = (1_000_000 + 2 * 33_333) * 1_000 + OFFSET_NS;
    assert_eq!(headers[2].stamp.as_nanos(), received);
    assert_eq!(harness.dropped(), [("depth_without_metadata", 1)]);
}

#[test]
fn a_system_without_metadata_pairs_by_the_kernels_stamps() {
    let acts = pairs(3, 1_000_000);
    let pictures: Vec<_> = acts.into_iter().step_by(2).collect();
    let mut camera = Camera::new(pictures);
    camera.has_metadata = false;
    let mut harness = Harness::new(Plugged::once(camera));
    let headers = harness.all();
    assert_eq!(headers.len(), 3);
    assert!(headers.iter().all(|h| h.depth_sensor_ns.is_none()));
    assert_eq!(harness.dropped(), []);
}

#[test]
fn cut_and_damaged_pictures_are_left_out_and_counted() {
    let mut acts = pairs(5, 1_000_000);
    let Act::Buffer { bytes, .. } = &mut acts[4] else {
        unreachable!()
    };
    bytes.pop();
    let Act::Buffer { damaged, .. } = &mut acts[10] else {
        unreachable!()
    };
    *damaged = true;
    let Act::Buffer { bytes, .. } = &mut acts[13] else {
        unreachable!()
    };
    bytes.truncate(5);
    let mut harness = Harness::new(Plugged::once(Camera::new(acts)));
    let headers = harness.all();
    let times: Vec<_> = headers.iter().map(|h| h.stamp.as_nanos()).collect();
    assert_eq!(headers.len(), 3, "{times:?}");
    let dropped = harness.dropped();
    assert!(dropped.contains(&("depth_cut", 1)), "{dropped:?}");
    assert!(dropped.contains(&("color_damaged", 1)), "{dropped:?}");
    assert!(dropped.contains(&("depth_bad_metadata", 1)), "{dropped:?}");
}

#[test]
fn a_camera_that_is_unplugged_comes_back_by_itself() {
    let mut first = pairs(2, 900_000_000);
    first.push(Act::Unplug);
    let plugged = Plugged::script(vec![
        Some(Camera::new(first)),
        None,
        None,
        // Its clock began anew, the robot's went on.
        Some(Camera::new(pairs_at(2, 50_000, OFFSET_NS + 901_000 * MS))),
    ]);
    let mut harness = Harness::new(plugged);
    assert_eq!(harness.read().unwrap().unwrap().sequence, 0);
    let before = harness.read().unwrap().unwrap();
    let gone = harness.read().unwrap_err();
    assert_eq!(gone.kind(), FaultKind::Reopen);
    assert!(gone.to_string().contains("unplugged"), "{gone}");
    for _ in 0..2 {
        let missing = harness.read().unwrap_err();
        assert!(matches!(missing, CameraError::Missing { .. }), "{missing}");
        assert_eq!(missing.kind(), FaultKind::Reopen);
        assert!(!harness.camera.is_open());
    }
    let after = harness.read().unwrap().unwrap();
    assert_eq!(after.sequence, 2, "numbers go on");
    assert!(after.stamp > before.stamp, "and so does time");
    let counters = harness.camera.counters();
    assert_eq!((counters.opened, counters.unplugged), (2, 1));
    assert_eq!(counters.pairs, 3);
    assert_eq!(
        counters.depth.frames, 3,
        "counts of the first session are kept"
    );
}

#[test]
fn a_camera_that_falls_silent_is_opened_anew() {
    let plugged = Plugged::script(vec![
        Some(Camera::new(pairs(1, 1_000_000))),
        Some(Camera::new(pairs(1, 9_000_000))),
    ]);
    let mut harness = Harness::new(plugged);
    let at = |ms: i64| Stamp::from_nanos(OFFSET_NS + ms * MS);
    assert!(harness.read_by(at(1_100)).unwrap().is_some());
    assert!(harness.read_by(at(1_200)).unwrap().is_none());
    assert!(harness.read_by(at(3_100)).unwrap().is_none());
    let stalled = harness.read_by(at(3_200)).unwrap_err();
    assert!(matches!(stalled, CameraError::Stalled { .. }), "{stalled}");
    assert!(harness.read_by(at(9_100)).unwrap().is_some());
    assert_eq!(harness.dropped(), [("stalled", 1)]);
}

/// The colour camera goes on, the depth camera does not: nothing comes out, and that is a stall too.
#[test]
fn a_camera_whose_depth_dies_is_opened_anew() {
    let mut acts = pairs(1, 1_000_000);
    for i in 1..100 {
        let us = 1_004_000 + u64::from(i) * 33_333;
        acts.extend(shot(Stream::Color, i, us, OFFSET_NS));
    }
    let plugged = Plugged::script(vec![
        Some(Camera::new(acts)),
        Some(Camera::new(pairs(1, 9_000_000))),
    ]);
    let mut harness = Harness::new(plugged);
    let at = |ms: i64| Stamp::from_nanos(OFFSET_NS + ms * MS);
    assert!(harness.read_by(at(1_100)).unwrap().is_some());
    for ms in [1_200, 1_700, 2_200, 2_700, 3_100] {
        assert!(harness.read_by(at(ms)).unwrap().is_none(), "{ms}");
    }
    let stalled = harness.read_by(at(3_200)).unwrap_err();
    assert_eq!(stalled.kind(), FaultKind::Reopen);
    assert!(stalled.to_string().contains("both streams"), "{stalled}");
    assert!(harness.read_by(at(9_100)).unwrap().is_some());
    let counters = harness.camera.counters();
    assert_eq!((counters.opened, counters.stalled), (2, 1));
    assert!(counters.color.unpaired > 50, "{counters:?}");
}

#[test]
fn settings_reach_the_camera_in_an_order_that_it_takes() {
    let config = RealSenseConfig {
        depth_settings: DepthSettings {
            exposure: Exposure::Fixed(8_500),
            emitter: Emitter::Off,
            laser_power_mw: Some(300),
        },
        color_exposure: Exposure::Fixed(15_600),
        ..RealSenseConfig::default()
    };
    let camera = Camera::new(pairs(1, 0));
    let log = camera.log();
    let mut harness = Harness::with(Plugged::once(camera), config);
    harness.read().unwrap().unwrap();
    let written = log.borrow().clone();
    let expected = [
        "unit 11 = 0",
        "unit 3 = 8500",
        "unit 2 = 0",
        "unit 4 = 300",
        "colour 0x9a0901 = 1",
        "colour 0x9a0902 = 156",
        "start",
    ];
    assert_eq!(written, expected);
}

#[test]
fn a_setting_beyond_the_cameras_range_names_the_range() {
    let config = RealSenseConfig {
        depth_settings: DepthSettings {
            laser_power_mw: Some(400),
            ..DepthSettings::default()
        },
        ..RealSenseConfig::default()
    };
    let mut harness = Harness::with(Plugged::once(Camera::new(pairs(1, 0))), config);
    let refused = harness.read().unwrap_err();
    assert_eq!(refused.to_string(), "laser power 400 is outside 0 to 360");
    assert_eq!(refused.kind(), FaultKind::FixConfig);
}

#[test]
fn a_camera_with_a_damaged_calibration_is_not_used() {
    let mut camera = Camera::new(pairs(1, 0));
    camera.color_table[100] ^= 4;
    let mut harness = Harness::new(Plugged::once(camera));
    let refused = harness.read().unwrap_err();
    assert_eq!(refused.kind(), FaultKind::FixConfig);
    let said = refused.to_string();
    assert!(
        said.contains("table 32") && said.contains("checksum"),
        "{said}"
    );
}

#[test]
fn images_without_room_are_refused_and_the_frame_is_kept() {
    let mut harness = Harness::new(Plugged::once(Camera::new(pairs(1, 1_000_000))));
    let mut small = vec![0; 10];
    let images = RgbdImages {
        depth: &mut small,
        color: &mut harness.color,
    };
    let refused = harness
        .camera
        .read_frame(images, Stamp::from_nanos(i64::MAX));
    assert_eq!(refused.unwrap_err().kind(), FaultKind::FixConfig);
    assert!(harness.read().unwrap().is_some());
}

#[test]
fn the_driver_keeps_the_promise_of_rgbd_cameras() {
    /// Answers come at once, so any clock will do.
    struct Still;
    impl Clock for Still {
        fn now(&self) -> Stamp {
            Stamp::from_nanos(i64::MAX / 2)
        }
    }
    let mut acts = pairs(20, 1_000_000);
    acts.insert(40, Act::Unplug);
    let mut second = pairs(20, 5_000_000);
    second.drain(20..23);
    let plugged = Plugged::script(vec![Some(Camera::new(acts)), Some(Camera::new(second))]);
    let mut camera = RealSense::new(plugged, RealSenseConfig::default());
    let (mut depth, mut color) = (vec![0; camera::PIXELS], vec![0; 3 * camera::PIXELS]);
    let tally = check_rgbd_camera(&mut camera, &Still, (&mut depth, &mut color), 40, MS).unwrap();
    assert!(tally.items > 20, "{tally:?}");
    assert_eq!(
        tally.faults, 2,
        "one refusal to cut, one unplugging: {tally:?}"
    );
}
