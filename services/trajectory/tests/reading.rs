//! What is read from text, and what is refused, by line.

use hachi_hal::{Pose, Rotation, Stamp, Vector3};
use hachi_trajectory::read::{Format, Loaded, ReadError, from_reader};
use hachi_trajectory::{Trajectory, write};
use proptest::prelude::*;

fn read(text: &str) -> Result<Loaded, ReadError> {
    from_reader(text.as_bytes())
}

fn refusal(text: &str) -> String {
    read(text).unwrap_err().to_string()
}

/// 90° about z: w = z = sqrt(1/2).
const QUARTER_TURN: &str = "0 0 0.70710678 0.70710678";

fn assert_quarter_turn(loaded: &Loaded) {
    let pose = loaded.trajectory.poses()[0];
    assert!((pose.translation.vector - Vector3::new(1.0, 2.0, 3.0)).norm() < 1e-12);
    // A quarter turn to the left takes x to y.
    assert!((pose.rotation * Vector3::x() - Vector3::y()).norm() < 1e-6);
}

#[test]
fn tum_is_recognised_with_comments_tabs_and_crlf() {
    let text = format!("\u{feff}# time x y z qx qy qz qw\r\n\r\n0.5\t1  2 3 {QUARTER_TURN} \r\n");
    let loaded = read(&text).unwrap();
    assert_eq!(loaded.format, Format::Tum);
    assert_eq!(
        loaded.trajectory.stamps(),
        Some(&[Stamp::from_nanos(500_000_000)][..])
    );
    assert_quarter_turn(&loaded);
}

#[test]
fn kitti_is_recognised_and_has_no_times() {
    let loaded = read("0 -1 0 1 1 0 0 2 0 0 1 3\n").unwrap();
    assert_eq!(loaded.format, Format::Kitti);
    assert_eq!(loaded.trajectory.stamps(), None);
    assert_quarter_turn(&loaded);
}

#[test]
fn euroc_has_nanoseconds_and_w_first() {
    let text = "#timestamp, p_RS_R_x [m], p_RS_R_y [m], p_RS_R_z [m], q_RS_w [], q_RS_x [], q_RS_y [], q_RS_z []\n\
                1403636580838555648,1,2,3,0.70710678,0,0,0.70710678,0.1,0.2,0.3,0,0,0,0,0,0\n";
    let loaded = read(text).unwrap();
    assert_eq!(loaded.format, Format::Euroc);
    assert_eq!(
        loaded.trajectory.stamps(),
        Some(&[Stamp::from_nanos(1403636580838555648)][..])
    );
    assert_quarter_turn(&loaded);
}

#[test]
fn a_header_without_a_comment_mark_is_skipped() {
    let text = "timestamp,x,y,z,qw,qx,qy,qz\n100,1,2,3,0.70710678,0,0,0.70710678\n";
    let loaded = read(text).unwrap();
    assert_eq!(loaded.format, Format::Euroc);
    assert_quarter_turn(&loaded);
}

#[test]
fn seconds_with_commas_are_tum_in_a_csv() {
    let loaded = read("t,x,y,z,qx,qy,qz,qw\n0.25,1,2,3,0,0,0.70710678,0.70710678\n").unwrap();
    assert_eq!(loaded.format, Format::Tum);
    assert_eq!(
        loaded.trajectory.stamps(),
        Some(&[Stamp::from_nanos(250_000_000)][..])
    );
    assert_quarter_turn(&loaded);
}

#[test]
fn errors_name_the_line() {
    let good = "0 0 0 0 0 0 0 1\n";
    let cases = [
        (
            format!("{good}1 0 0 0 0 0 0\n"),
            "line 2: 7 numbers, expected 8 (TUM)",
        ),
        (
            format!("{good}# x\n1 nan 0 0 0 0 0 1\n"),
            "line 3: field 2 is \"nan\"",
        ),
        (format!("{good}1 0 1e300 0 0 0 0 1\n"), "line 2: field 3"),
        (
            format!("{good}1 0 0 zero 0 0 0 1\n"),
            "line 2: field 4 is \"zero\"",
        ),
        (
            format!("{good}1 0 0 0 0 0 0 0\n"),
            "line 2: the orientation is no rotation",
        ),
        ("1403636580838555648 0 0 0 0 0 0 1\n".into(), "line 1: time"),
        ("1 2 3\n".into(), "line 1: 3 numbers fit no known format"),
        ("1 0 0 0 0 2 0 0 0 0 1 0\n".into(), "not orthonormal"),
        ("1 0 0 0 0 1 0 0 0 0 -1 0\n".into(), "a reflection"),
        (
            "a b c\nd e f\n".into(),
            "line 2: 3 numbers fit no known format",
        ),
    ];
    for (text, expected) in cases {
        let got = refusal(&text);
        assert!(got.contains(expected), "{text:?} gave {got:?}");
    }
}

#[test]
fn files_without_poses_are_refused() {
    for text in ["", "\n\n", "# only a comment\n", "x y z\n"] {
        assert!(matches!(read(text), Err(ReadError::Empty)), "{text:?}");
    }
}

#[test]
fn an_endless_line_and_bytes_that_are_no_text_are_refused() {
    let endless = vec![b'1'; 1 << 20];
    assert!(matches!(
        from_reader(endless.as_slice()),
        Err(ReadError::LineTooLong { line: 1 })
    ));
    assert!(matches!(
        from_reader(&b"0 0 0 0 0 0 0 1\n\xff\xfe\n"[..]),
        Err(ReadError::NotText { line: 2 })
    ));
}

#[test]
fn quaternions_of_other_lengths_are_normalised_and_counted() {
    let loaded = read("0 1 2 3 0 0 2 2\n1 1 2 3 0 0 0 1.000001\n").unwrap();
    assert_eq!(loaded.repairs.normalised, 1);
    assert_quarter_turn(&loaded);
}

#[test]
fn unsorted_and_repeated_times_are_put_right_and_counted() {
    let loaded = read("2 2 0 0 0 0 0 1\n1 1 0 0 0 0 0 1\n2 9 0 0 0 0 0 1\n").unwrap();
    let xs: Vec<f64> = loaded
        .trajectory
        .poses()
        .iter()
        .map(|p| p.translation.x)
        .collect();
    assert_eq!(xs, [1.0, 9.0]);
    assert_eq!((loaded.repairs.reordered, loaded.repairs.repeated), (1, 1));
}

fn any_trajectory() -> impl Strategy<Value = Trajectory> {
    let sample = (
        -4_000_000_000_000_000_000i64..4_000_000_000_000_000_000,
        prop::array::uniform3(-1e5f64..1e5),
        prop::array::uniform3(-3.0f64..3.0),
    );
    prop::collection::vec(sample, 1..40).prop_map(|samples| {
        let samples = samples
            .into_iter()
            .map(|(stamp, position, axis)| {
                let rotation = Rotation::new(axis.into());
                (
                    Stamp::from_nanos(stamp),
                    Pose::from_parts(Vector3::from(position).into(), rotation),
                )
            })
            .collect();
        Trajectory::from_samples(samples).0
    })
}

proptest! {
    #[test]
    fn what_is_written_is_read_back(trajectory in any_trajectory()) {
        let mut text = Vec::new();
        write::tum(&trajectory, &mut text).unwrap();
        let loaded = from_reader(text.as_slice()).unwrap();
        prop_assert!(loaded.repairs.is_none());
        prop_assert_eq!(loaded.trajectory.stamps(), trajectory.stamps());

        let mut matrices = Vec::new();
        write::kitti(&trajectory, &mut matrices).unwrap();
        let untimed = from_reader(matrices.as_slice()).unwrap();
        prop_assert_eq!(untimed.format, Format::Kitti);

        for copy in [&loaded.trajectory, &untimed.trajectory] {
            prop_assert_eq!(copy.len(), trajectory.len());
            for (got, given) in copy.poses().iter().zip(trajectory.poses()) {
                // Nine digits of up to 1e5 m.
                prop_assert!((got.translation.vector - given.translation.vector).norm() < 2e-4);
                prop_assert!(got.rotation.angle_to(&given.rotation) < 1e-7);
            }
        }
    }

    #[test]
    fn any_bytes_are_answered(bytes in prop::collection::vec(any::<u8>(), 0..400)) {
        let _ = from_reader(bytes.as_slice());
    }

    #[test]
    fn lines_of_any_numbers_are_answered(text in "([-+0-9.e, ;#\n]|nan|inf){0,300}") {
        let _ = read(&text);
    }
}
