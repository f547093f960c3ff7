//! Turns from a rotor whose every point is known: one shot a millisecond, one degree a shot.

use hachi_hal::conformance::ScanPromise;
use hachi_hal::{Completeness, Point, Stamp};
use hachi_turns::{CutAngle, PacketPoints, Turn, TurnAssembler, TurnStamper, deliver};

const MS: u32 = 1_000_000;
/// Shots in a packet.
const SHOTS: i64 = 10;

/// Runs packets `numbers` of a rotor through an assembler; azimuths and completeness of each turn.
fn turns(
    cut_deg: f32,
    max_points: usize,
    numbers: impl IntoIterator<Item = i64>,
) -> Vec<(Turn, Vec<f32>)> {
    let cut = CutAngle::new(cut_deg);
    let mut assembler = TurnAssembler::new(cut, max_points);
    let mut turns = Vec::new();
    let mut keep = |turn: Turn, assembler: &TurnAssembler| {
        let azimuths = assembler.points().iter().map(|p| p.azimuth_deg).collect();
        let promised = assembler.points();
        assert_eq!(promised.first().map_or(0, |p| p.time_offset_ns), 0);
        turns.push((turn, azimuths));
    };
    for number in numbers {
        let azimuth = |shot: i64| ((number * SHOTS + shot) % 360) as f32;
        let points: Vec<_> = (0..SHOTS)
            .map(|shot| Point {
                azimuth_deg: azimuth(shot),
                time_offset_ns: shot as u32 * MS,
                ..Point::at(1.0, 0.0, 0.0)
            })
            .collect();
        let first = cut.past(azimuth(0));
        let packet = PacketPoints {
            points: &points,
            start_ns: number * SHOTS * i64::from(MS),
            last_shot_ns: (SHOTS - 1) as u32 * MS,
            first_azimuth_deg: azimuth(0),
            last_azimuth_deg: azimuth(SHOTS - 1),
            rate_deg_per_s: 1_000.0,
            cut_at: points.iter().position(|p| cut.past(p.azimuth_deg) < first),
        };
        assembler.load(&packet);
        while let Some(turn) = assembler.advance(&packet) {
            keep(turn, &assembler);
        }
    }
    if let Some(turn) = assembler.finish() {
        keep(turn, &assembler);
    }
    turns
}

fn shape(turns: &[(Turn, Vec<f32>)]) -> Vec<(usize, Completeness)> {
    let shape = |(turn, azimuths): &(Turn, Vec<f32>)| (azimuths.len(), turn.completeness);
    turns.iter().map(shape).collect()
}

use Completeness::{Complete, PartialBoth, PartialFirst, PartialLast};

#[test]
fn turns_are_cut_at_zero_and_partial_ones_are_marked() {
    let turns = turns(0.0, 1_000, 10..100);
    let expected = [(260, PartialFirst), (360, Complete), (280, PartialLast)];
    assert_eq!(shape(&turns), expected);
    assert_eq!(turns[1].1[0], 0.0);
    assert_eq!(turns[1].1[359], 359.0);
    assert_eq!(turns[1].0.start_ns, 360_000_000);
    assert_eq!(turns[1].0.end_ns, 719_000_000);
}

#[test]
fn any_cut_angle_is_kept_to_the_shot() {
    for cut in [5.0, 95.0, 183.0, 359.0, -1.0, 723.0] {
        let turns = turns(cut, 1_000, 0..144);
        let whole: Vec<_> = turns
            .iter()
            .filter(|t| t.0.completeness == Complete)
            .collect();
        assert_eq!(whole.len(), 3, "{cut}");
        for (_, azimuths) in whole {
            assert_eq!(azimuths.len(), 360);
            assert_eq!(azimuths[0], cut.rem_euclid(360.0), "{cut}");
        }
    }
}

#[test]
fn a_stream_that_begins_and_ends_at_the_cut_has_whole_turns_only() {
    // The last shot is at 359°, a whole degree short of the cut: only the stream's end is told by
    // the shot that never came.
    let shape = shape(&turns(0.0, 1_000, 0..72));
    assert_eq!(shape, [(360, Complete), (360, PartialLast)]);
    assert_eq!(turns(0.0, 1_000, 0..1)[0].0.completeness, PartialLast);
    assert_eq!(turns(0.0, 1_000, 5..6)[0].0.completeness, PartialBoth);
}

#[test]
fn lost_packets_across_the_cut_still_end_the_turn_there() {
    // 340° to 39° of the second turn are missing.
    let numbers = (0..34).chain(40..80);
    let shape = shape(&turns(0.0, 1_000, numbers));
    assert_eq!(shape, [(340, Complete), (320, Complete), (80, PartialLast)]);
}

#[test]
fn a_gap_of_more_than_a_turn_is_not_glued_together() {
    // Stops at 179°, comes back at 180° three turns later.
    let numbers = (0..18).chain(18 + 36 * 3..18 + 36 * 3 + 36);
    let shape = shape(&turns(0.0, 1_000, numbers));
    let expected = [(180, PartialLast), (180, PartialFirst), (180, PartialLast)];
    assert_eq!(shape, expected);
}

#[test]
fn a_turn_with_too_many_points_is_divided() {
    let turns = turns(0.0, 100, 0..40);
    let total: usize = turns.iter().map(|(_, azimuths)| azimuths.len()).sum();
    assert_eq!(total, 400);
    assert!(turns.iter().all(|(_, azimuths)| azimuths.len() <= 100));
    assert_eq!(turns[0].0.completeness, PartialLast);
}

#[test]
fn a_falling_offset_is_made_up_gradually_and_turns_never_overlap() {
    let mut stamper = TurnStamper::new();
    let mut promise = ScanPromise::default();
    let mut last_late_ns = i64::MAX;
    for n in 0..40_i64 {
        let turn = Turn {
            start_ns: n * 100_000_000,
            end_ns: n * 100_000_000 + 99_900_000,
            completeness: Complete,
        };
        let mut points = [0, 50_000_000, 99_900_000].map(|time_offset_ns| Point {
            time_offset_ns,
            ..Point::at(1.0, 0.0, 0.0)
        });
        // The first turn is stamped 5 ms late, the others are known better.
        let offset_ns = if n == 0 { 5_000_000 } else { 0 };
        let header = stamper.stamp(&turn, &mut points, offset_ns);
        promise.check(&header, &points).unwrap();
        let late_ns = header.end.as_nanos() - turn.end_ns;
        assert!(late_ns <= last_late_ns);
        last_late_ns = late_ns;
    }
    assert_eq!(last_late_ns, 0);
}

#[test]
fn a_sink_that_fills_up_keeps_the_beginning_and_the_header_says_so() {
    let points: Vec<_> = (0..300)
        .map(|n| Point {
            time_offset_ns: n * MS,
            ..Point::at(1.0, 0.0, 0.0)
        })
        .collect();
    let mut header = hachi_hal::ScanHeader {
        start: Stamp::from_nanos(7),
        end: Stamp::from_nanos(7 + 299 * i64::from(MS)),
        has_point_times: true,
        ..Default::default()
    };
    struct Small(Vec<Point>);
    impl hachi_hal::PointSink for Small {
        fn extend(&mut self, points: &[Point]) -> Result<(), hachi_hal::SinkFull> {
            if self.0.len() + points.len() > 200 {
                return Err(hachi_hal::SinkFull);
            }
            self.0.extend_from_slice(points);
            Ok(())
        }
        fn clear(&mut self) {
            self.0.clear();
        }
        fn points(&self) -> &[Point] {
            &self.0
        }
    }
    let mut sink = Small(Vec::new());
    assert_eq!(deliver(&points, &mut header, &mut sink), 300 - 192);
    assert_eq!(header.end.as_nanos(), 7 + 191 * i64::from(MS));
    ScanPromise::default().check(&header, &sink.0).unwrap();
}
