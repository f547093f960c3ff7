//! What is new, repeated, late, silent, frozen.

use hachi_hal::Stamp;
use hachi_unitree::fresh::{ContentWatch, LinkHealth, TickVerdict, TickWatch};

#[test]
fn ticks_that_repeat_or_come_late_are_told_from_new_ones() {
    let mut watch = TickWatch::default();
    let mut judge = |tick| watch.judge(tick);
    assert_eq!(judge(1_000), TickVerdict::New { after_ms: 0 });
    assert_eq!(judge(1_001), TickVerdict::New { after_ms: 1 });
    assert_eq!(judge(1_001), TickVerdict::Repeated);
    assert_eq!(judge(1_051), TickVerdict::New { after_ms: 50 });
    assert_eq!(judge(1_040), TickVerdict::Late { by_ms: 11 });
    // The late one did not set the clock back.
    assert_eq!(judge(1_052), TickVerdict::New { after_ms: 1 });
}

#[test]
fn a_counter_that_wraps_is_no_step_back_and_a_restart_is_one() {
    let mut watch = TickWatch::default();
    watch.judge(u32::MAX - 1);
    assert_eq!(watch.judge(3), TickVerdict::New { after_ms: 5 });
    watch.judge(3_600_000);
    assert_eq!(watch.judge(12), TickVerdict::Restarted);
    assert_eq!(watch.judge(13), TickVerdict::New { after_ms: 1 });
}

#[test]
fn a_robot_that_falls_silent_or_repeats_itself_is_noticed() {
    const MS: i64 = 1_000_000;
    let at = |ms: i64| Stamp::from_nanos(ms * MS);
    let mut watch = ContentWatch::default();
    let health = |watch: &ContentWatch, ms| watch.health(at(ms), 100 * MS, 200 * MS);
    assert_eq!(health(&watch, 0), LinkHealth::Unheard);
    assert!(watch.is_new(&[1, 2, 3], at(0)));
    assert_eq!(health(&watch, 100), LinkHealth::Alive);
    assert_eq!(health(&watch, 101), LinkHealth::Silent { for_ns: 101 * MS });
    for ms in (10..=210).step_by(10) {
        assert!(!watch.is_new(&[1, 2, 3], at(ms)));
    }
    assert_eq!(health(&watch, 210), LinkHealth::Frozen { for_ns: 210 * MS });
    assert!(watch.is_new(&[1, 2, 4], at(220)));
    assert!(watch.is_new(&[1, 2], at(221)));
    assert_eq!(health(&watch, 230), LinkHealth::Alive);
}
