//! The checks accept devices that keep their promises and name how the others break them.
#![cfg(all(feature = "mock", feature = "conformance"))]

use std::cell::Cell;

use hachi_hal::conformance::{
    Violation, check_imu, check_lidar_scans, check_packet_source, check_refuses_to_cut,
    check_rgbd_camera,
};
use hachi_hal::mock::{MockCamera, MockImu, MockLidar, MockPackets, Packet, Scan, Shot, Step};
use hachi_hal::{
    Clock, Distortion, FaultKind, ImuSample, Intrinsics, PacketSource, Point, Pose, Received,
    RgbdGeometry, RgbdHeader, ScanHeader, Stamp, Vector3,
};

/// A clock that moves by a fixed amount each time it is read.
struct Ticking {
    now: Cell<i64>,
    step_ns: i64,
}

impl Clock for Ticking {
    fn now(&self) -> Stamp {
        self.now.set(self.now.get() + self.step_ns);
        Stamp::from_nanos(self.now.get())
    }
}

fn clock(step_ns: i64) -> Ticking {
    Ticking {
        now: Cell::new(0),
        step_ns,
    }
}

fn timed_point(offset_ns: u32) -> Point {
    Point {
        time_offset_ns: offset_ns,
        ..Point::at(1.0, 2.0, 3.0)
    }
}

fn header(sequence: u32, start: i64, end: i64) -> ScanHeader {
    ScanHeader {
        sequence,
        start: Stamp::from_nanos(start),
        end: Stamp::from_nanos(end),
        has_point_times: true,
        ..ScanHeader::default()
    }
}

fn check(script: &[Step<Scan<'_>>]) -> Result<hachi_hal::conformance::Tally, Violation> {
    let mut lidar = MockLidar::script(script);
    let mut sink = heapless::Vec::<Point, 8>::new();
    check_lidar_scans(&mut lidar, &clock(1), &mut sink, 10, 1_000)
}

#[test]
fn a_lidar_that_keeps_its_promise_is_tallied() {
    let points = [timed_point(0), timed_point(40), timed_point(100)];
    let scan = |sequence, start| {
        Step::Batch(Scan {
            header: header(sequence, start, start + 100),
            points: &points,
        })
    };
    let tally = check(&[
        scan(0, 1_000),
        Step::Fault(FaultKind::ReadAgain),
        Step::Nothing,
        scan(1, 1_100),
    ])
    .unwrap();
    assert_eq!((tally.items, tally.contents), (2, 6));
    assert_eq!(tally.faults, 1);
}

#[test]
fn a_point_that_goes_back_in_time_is_named_by_index() {
    let points = [timed_point(0), timed_point(50), timed_point(49)];
    let script = [Step::Batch(Scan {
        header: header(0, 0, 49),
        points: &points,
    })];
    let expected = Violation::PointBackwards {
        index: 2,
        before_ns: 50,
        offset_ns: 49,
    };
    assert_eq!(check(&script), Err(expected));
}

#[test]
fn a_last_point_away_from_the_end_is_refused() {
    let points = [timed_point(0), timed_point(50)];
    let script = [Step::Batch(Scan {
        header: header(0, 0, 51),
        points: &points,
    })];
    let expected = Violation::LastOffset {
        offset_ns: 50,
        duration_ns: 51,
    };
    assert_eq!(check(&script), Err(expected));
}

#[test]
fn scans_that_overlap_are_refused() {
    let points = [timed_point(0), timed_point(100)];
    let scan = |sequence, start| {
        Step::Batch(Scan {
            header: header(sequence, start, start + 100),
            points: &points,
        })
    };
    let expected = Violation::ScansOverlap {
        previous_end: Stamp::from_nanos(100),
        start: Stamp::from_nanos(99),
    };
    assert_eq!(check(&[scan(0, 0), scan(1, 99)]), Err(expected));
}

#[test]
fn nan_points_and_skipped_sequence_numbers_are_refused() {
    let nan = [Point::at(f32::NAN, 0.0, 0.0)];
    let script = [Step::Batch(Scan {
        header: header(0, 0, 0),
        points: &nan,
    })];
    assert_eq!(check(&script), Err(Violation::NotFinite { index: 0 }));
    let scan = |sequence| {
        Step::Batch(Scan {
            header: header(sequence, 0, 0),
            points: &[],
        })
    };
    let expected = Violation::Sequence {
        expected: 1,
        got: 2,
    };
    assert_eq!(check(&[scan(0), scan(2)]), Err(expected));
}

#[test]
fn a_source_that_is_late_is_told_by_how_much() {
    let mut source = MockPackets::script([Step::Nothing]);
    let result = check_packet_source(&mut source, &clock(2_000_000_000), &mut [0; 4], 1, 1_000);
    let expected = Violation::Late {
        deadline: Stamp::from_nanos(2_000_001_000),
        returned: Stamp::from_nanos(4_000_000_000),
    };
    assert_eq!(result, Err(expected));
}

#[test]
fn scripted_packets_arrive_in_order_and_faults_do_not_end_the_script() {
    let packet = |byte: &'static [u8], at| {
        Step::Batch(Packet {
            payload: byte,
            stamp: Stamp::from_nanos(at),
            port: 2368,
        })
    };
    let mut source = MockPackets::script([
        packet(&[7], 1),
        Step::Fault(FaultKind::Reopen),
        packet(&[8, 9], 2),
    ]);
    let mut buffer = [0; 2];
    let tally = check_packet_source(&mut source, &clock(1), &mut buffer, 4, 10).unwrap();
    assert_eq!((tally.items, tally.contents, tally.faults), (2, 3, 1));
    assert_eq!(buffer, [8, 9]);
    source.assert_done();
    assert!(source.at_end());
}

#[test]
#[should_panic(expected = "2 of 2 scripted steps were not played")]
fn an_unread_script_is_noticed() {
    let script: [Step<Packet<'_>>; 2] = [Step::Nothing, Step::Nothing];
    MockPackets::script(script).assert_done();
}

#[test]
fn a_source_that_cuts_datagrams_is_found_out() {
    struct Cutting;
    impl PacketSource for Cutting {
        type Error = core::convert::Infallible;
        fn receive(
            &mut self,
            buffer: &mut [u8],
            _: Stamp,
        ) -> Result<Option<Received>, Self::Error> {
            Ok(Some(Received {
                len: buffer.len(),
                stamp: Stamp::default(),
                port: 0,
            }))
        }
        fn at_end(&self) -> bool {
            false
        }
    }
    let result = check_refuses_to_cut(&mut Cutting, &mut [0; 4], 10, Stamp::default());
    assert_eq!(result, Err(Violation::CutDatagram { len: 4, sent: 10 }));

    let mut honest = MockPackets::script([Step::Batch(Packet {
        payload: &[0; 10],
        stamp: Stamp::default(),
        port: 1,
    })]);
    let result = check_refuses_to_cut(&mut honest, &mut [0; 4], 10, Stamp::default());
    assert!(matches!(result, Ok(Some(_))), "{result:?}");
}

#[test]
fn imu_stamps_that_repeat_and_values_that_are_not_finite_are_refused() {
    let sample = |at, x| {
        Step::Batch(ImuSample {
            stamp: Stamp::from_nanos(at),
            angular_velocity: Vector3::new(x, 0.0, 0.0),
            specific_force: Vector3::new(0.0, 0.0, 9.81),
        })
    };
    let run = |script: &[Step<ImuSample>]| check_imu(&mut MockImu::script(script), &clock(1), 4, 9);
    assert_eq!(run(&[sample(1, 0.0), sample(2, 0.1)]).unwrap().items, 2);
    let repeated = Violation::StampNotIncreasing {
        before: Stamp::from_nanos(1),
        stamp: Stamp::from_nanos(1),
    };
    assert_eq!(run(&[sample(1, 0.0), sample(1, 0.1)]), Err(repeated));
    let not_finite = Violation::SampleNotFinite {
        stamp: Stamp::from_nanos(5),
    };
    assert_eq!(run(&[sample(5, f64::NAN)]), Err(not_finite));
}

fn small_camera() -> RgbdGeometry {
    let pixels = |width, height| Intrinsics {
        width,
        height,
        focal: [2.0, 2.0],
        centre: [0.5, 0.5],
        distortion: Distortion::None,
    };
    RgbdGeometry {
        depth: pixels(2, 2),
        color: pixels(2, 1),
        color_from_depth: Pose::translation(0.05, 0.0, 0.0),
        depth_unit_m: 0.001,
    }
}

fn shot(sequence: u32, nanos: i64) -> Step<Shot<'static>> {
    Step::Batch(Shot {
        header: RgbdHeader {
            sequence,
            stamp: Stamp::from_nanos(nanos),
            ..RgbdHeader::default()
        },
        depth: &[1, 2, 3, 4],
        color: &[1, 2, 3, 4, 5, 6],
    })
}

fn check_camera(
    geometry: RgbdGeometry,
    script: &[Step<Shot<'static>>],
    room: [usize; 2],
) -> Result<hachi_hal::conformance::Tally, Violation> {
    let mut camera = MockCamera::script(geometry, script);
    let (mut depth, mut color) = ([0; 8], [0; 8]);
    let images = (&mut depth[..room[0]], &mut color[..room[1]]);
    let tally = check_rgbd_camera(&mut camera, &clock(1), images, script.len(), 1_000)?;
    camera.assert_done();
    Ok(tally)
}

#[test]
fn a_camera_that_keeps_its_promise_is_tallied() {
    // The second shot is spent on the refusal to cut it.
    let script = [
        shot(0, 10),
        shot(0, 10),
        Step::Nothing,
        shot(1, 20),
        Step::Fault(FaultKind::Reopen),
        shot(2, 21),
    ];
    let tally = check_camera(small_camera(), &script, [4, 6]).unwrap();
    assert_eq!((tally.items, tally.faults, tally.nothing), (3, 2, 1));
}

#[test]
fn broken_promises_of_cameras_are_named() {
    let skipped = check_camera(
        small_camera(),
        &[shot(0, 10), shot(0, 0), shot(2, 20)],
        [4, 6],
    );
    assert_eq!(
        skipped,
        Err(Violation::Sequence {
            expected: 1,
            got: 2
        })
    );
    let stamp = Stamp::from_nanos(10);
    let still = check_camera(
        small_camera(),
        &[shot(0, 10), shot(0, 0), shot(1, 10)],
        [4, 6],
    );
    assert_eq!(
        still,
        Err(Violation::StampNotIncreasing {
            before: stamp,
            stamp
        })
    );
    let mut blind = small_camera();
    blind.depth.focal[0] = f64::NAN;
    let blind = check_camera(blind, &[shot(7, 10)], [4, 6]);
    assert_eq!(blind, Err(Violation::NoGeometry { sequence: 7 }));
    let mut large = small_camera();
    large.depth.width = 3;
    let cut = check_camera(large, &[shot(0, 10)], [4, 6]);
    assert_eq!(cut, Err(Violation::CutFrame { room: [4, 6] }));
    // One that delivers into images without room, whatever went wrong before.
    let mut cut = shot(1, 20);
    if let Step::Batch(shot) = &mut cut {
        shot.depth = &[];
    }
    let fault = Step::Fault(FaultKind::Reopen);
    for script in [
        vec![shot(0, 10), cut],
        vec![fault, shot(0, 10), cut],
        vec![shot(0, 10), fault, cut],
    ] {
        let cut = check_camera(small_camera(), &script, [4, 6]);
        assert_eq!(cut, Err(Violation::CutFrame { room: [0, 6] }));
    }
}
