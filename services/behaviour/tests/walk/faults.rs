//! Faults, each injected into a robot at full speed: what stops it, and after how long.

use hachi_behaviour::{Cause, SafetyConfig};
use hachi_hal::{BaseAction, BaseCommand, BodyVelocity, StopSample};

use super::{MS, Walk};

/// A fault with a time to zero velocity.
pub struct Fault {
    /// How its row in `docs/safety.md` begins.
    pub row: &'static str,
    /// What the gate says.
    pub cause: Cause,
    /// Breaks something.
    pub inject: fn(&mut Walk),
}

impl Fault {
    /// Milliseconds from the fault to zero velocity.
    #[track_caller]
    pub fn measure_ms(&self) -> i64 {
        let config = SafetyConfig {
            camera_needed: self.cause == Cause::CameraStale,
            ..SafetyConfig::default()
        };
        let mut walk = Walk::at_full_speed(config);
        (self.inject)(&mut walk);
        walk.stops_after_ms(self.cause)
    }
}

/// The longest that the faults of a row took, ms.
#[track_caller]
pub fn measure_ms(row: &str) -> i64 {
    let faults = FAULTS.iter().filter(|fault| fault.row == row);
    faults.map(Fault::measure_ms).max().expect("a known row")
}

/// All of them, in the order of the page.
pub const FAULTS: &[Fault] = &[
    Fault {
        row: "emergency stop pressed (remote control)",
        cause: Cause::EmergencyStop,
        inject: |walk| {
            walk.sight.emergency_stop = Some(StopSample {
                stamp: walk.now,
                pressed: true,
            });
        },
    },
    Fault {
        row: "emergency stop or its link silent",
        cause: Cause::EmergencyStopSilent,
        inject: |walk| walk.live.stop = false,
    },
    Fault {
        row: "the robot sends nothing new",
        cause: Cause::RobotSilent,
        inject: |walk| walk.live.robot = false,
    },
    Fault {
        row: "a behaviour or remote link dies",
        cause: Cause::NoWish,
        inject: |walk| walk.live.wish = false,
    },
    Fault {
        row: "localisation stale",
        cause: Cause::LocalisationStale,
        inject: |walk| walk.live.localisation = false,
    },
    Fault {
        row: "localisation lost",
        cause: Cause::LocalisationLost,
        inject: |walk| {
            walk.live.localisation = false;
            walk.sight.localisation = Some((walk.now, false));
        },
    },
    Fault {
        row: "LiDAR stale",
        cause: Cause::LidarStale,
        inject: |walk| walk.live.lidar = false,
    },
    Fault {
        row: "camera frozen",
        cause: Cause::CameraStale,
        inject: |walk| walk.live.camera = false,
    },
    Fault {
        row: "event loop hangs",
        cause: Cause::EventLoopStale,
        inject: |walk| walk.live.event_loop = false,
    },
    Fault {
        row: "a task with the policy `stop`",
        cause: Cause::TaskOverrun,
        inject: |walk| walk.sight.task_overrun = true,
    },
    Fault {
        row: "a number that is not finite",
        cause: Cause::NotFinite,
        inject: |walk| {
            walk.action = BaseAction::Move(BodyVelocity {
                forward: f64::NAN,
                ..BodyVelocity::ZERO
            });
        },
    },
    Fault {
        row: "a clock jumps ahead: a behaviour's",
        cause: Cause::FromTheFuture,
        inject: |walk| wish_stamped_later(walk, 60_000 * MS),
    },
    Fault {
        row: "a clock jumps: a sensor's, or back",
        cause: Cause::LocalisationStale,
        inject: |walk| {
            walk.live.localisation = false;
            walk.sight.localisation = Some((walk.now + 60_000 * MS, true));
        },
    },
    Fault {
        row: "a clock jumps: a sensor's, or back",
        cause: Cause::NoWish,
        inject: |walk| wish_stamped_later(walk, -60_000 * MS),
    },
    Fault {
        row: "the followed person is inside",
        cause: Cause::PersonNear,
        inject: |walk| walk.person = Some([0.9, 0.6]),
    },
];

/// The last wish, stamped by so much later.
fn wish_stamped_later(walk: &mut Walk, ns: i64) {
    walk.live.wish = false;
    walk.wish = walk.wish.map(|wish| BaseCommand {
        stamp: wish.stamp + ns,
        ..wish
    });
}
