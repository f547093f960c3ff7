//! What of a wish may reach the base. Read [`SafetyGate::step`] first.
//!
//! In: a behaviour's wish, and how old and how good what is known is ([`Sight`]). Out: a
//! [`Verdict`]: the command for the base, and why it is not what was wished. The gate holds in every
//! mode and for every behaviour, a person with a joystick included.

use hachi_hal::{BaseAction, BaseCommand, BodyVelocity, CommandFault, Stamp, StopSample};

use crate::cause::{Cause, Causes};
use crate::config::SafetyConfig;
use crate::obstacles::Obstacles;
use crate::swept::{free_share, scaled};

/// A stamp that is this much ahead of the clock is another clock's, or of one that jumped, ns.
const AHEAD_NS: i64 = BaseCommand::FUTURE_SLACK_NS;

/// The longest time between two steps that a velocity is changed for, s: after a pause the robot
/// does not leap.
const LONGEST_STEP_S: f64 = 0.1;

/// What the gate knows of the world and of the program.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Sight {
    /// When the robot's place was last known, and whether it is to be trusted.
    pub localisation: Option<(Stamp, bool)>,
    /// When the last image was taken.
    pub camera: Option<Stamp>,
    /// When the event loop last went round.
    pub event_loop: Option<Stamp>,
    /// When the robot last sent something new.
    pub robot: Option<Stamp>,
    /// The emergency stop, as it was last heard.
    pub emergency_stop: Option<StopSample>,
    /// Where the followed person was last seen, and when: forward and left, m.
    pub person: Option<(Stamp, [f64; 2])>,
    /// A task broke a promise.
    pub task_overrun: bool,
}

/// What the base is told, and why.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Verdict {
    /// The command: alive for as long as the gate lets it.
    pub command: BaseCommand,
    /// Why it is not what was wished, limits aside.
    pub causes: Causes,
    /// Whether the wish was beyond a limit and was cut.
    pub limited: bool,
}

impl Verdict {
    /// The velocity in it.
    pub fn velocity(&self) -> BodyVelocity {
        match self.command.action {
            BaseAction::Move(velocity) => velocity,
            _ => BodyVelocity::ZERO,
        }
    }
}

/// The gate.
#[derive(Debug, Clone)]
pub struct SafetyGate {
    config: SafetyConfig,
    velocity: BodyVelocity,
    stepped: Option<Stamp>,
}

impl SafetyGate {
    /// A gate in front of a base that stands.
    pub fn new(config: SafetyConfig) -> Self {
        Self {
            config,
            velocity: BodyVelocity::ZERO,
            stepped: None,
        }
    }

    /// The limits.
    pub fn config(&self) -> &SafetyConfig {
        &self.config
    }

    /// What the base is told at `now`. A wish that is faulty or dead is none.
    ///
    /// What a person can see and undo (standing up, lying down, a posture) asks for less than going
    /// somewhere: for that the robot must know where it is and what is around.
    pub fn step(
        &mut self,
        now: Stamp,
        wish: Option<&BaseCommand>,
        sight: &Sight,
        obstacles: Option<&Obstacles>,
    ) -> Verdict {
        let mut causes = self.always(now, wish, sight);
        let wish = wish.filter(|wish| wish.check(now).is_ok());
        let wished = match wish.map(|wish| wish.action) {
            Some(BaseAction::Move(velocity)) => velocity,
            Some(action @ (BaseAction::StandUp | BaseAction::LieDown | BaseAction::Pose(_)))
                if causes.is_empty() && self.velocity.is_zero() =>
            {
                self.stepped = Some(now);
                return self.verdict(now, action, causes, false);
            }
            _ => BodyVelocity::ZERO,
        };
        if !wished.is_zero() {
            self.before_going(now, sight, obstacles, &mut causes);
        }
        let (target, limited) = match causes.is_empty() {
            true => self.within_limits(&wished),
            false => (BodyVelocity::ZERO, false),
        };
        let dt_s = self.stepped.map_or(0.0, |last| now.secs_since(last));
        self.stepped = Some(now);
        self.velocity = match causes.is_immediate() {
            true => BodyVelocity::ZERO,
            false => self.towards(&target, dt_s.clamp(0.0, LONGEST_STEP_S)),
        };
        self.mind_obstacles(obstacles, &wished, &mut causes);
        let action = match self.velocity.is_zero() {
            true => BaseAction::Stop,
            false => BaseAction::Move(self.velocity),
        };
        self.verdict(now, action, causes, limited)
    }

    fn verdict(&self, now: Stamp, action: BaseAction, causes: Causes, limited: bool) -> Verdict {
        Verdict {
            command: BaseCommand {
                stamp: now,
                time_to_live_ns: nanos(self.config.command_lives_s),
                action,
            },
            causes,
            limited,
        }
    }

    /// What holds whatever is wished.
    fn always(&self, now: Stamp, wish: Option<&BaseCommand>, sight: &Sight) -> Causes {
        let config = &self.config;
        let mut causes = Causes::default();
        let stop = sight.emergency_stop;
        let heard = fresh(now, stop.map(|s| s.stamp), config.emergency_stop_stale_s);
        causes.add_if(Cause::EmergencyStop, stop.is_some_and(|s| s.pressed));
        causes.add_if(Cause::EmergencyStopSilent, !heard);
        let answers = fresh(now, sight.robot, config.robot_silent_s);
        causes.add_if(Cause::RobotSilent, !answers);
        causes.add_if(Cause::TaskOverrun, sight.task_overrun);
        let loops = fresh(now, sight.event_loop, config.event_loop_stale_s);
        causes.add_if(Cause::EventLoopStale, !loops);
        let fault = wish.map(|wish| wish.check(now));
        causes.add_if(
            Cause::NotFinite,
            fault == Some(Err(CommandFault::NotFinite)),
        );
        let ahead = matches!(fault, Some(Err(CommandFault::FromTheFuture { .. })));
        causes.add_if(Cause::FromTheFuture, ahead);
        let dead = matches!(fault, None | Some(Err(CommandFault::Dead { .. })));
        causes.add_if(Cause::NoWish, dead);
        causes
    }

    /// What must be known to go anywhere.
    fn before_going(
        &self,
        now: Stamp,
        sight: &Sight,
        obstacles: Option<&Obstacles>,
        causes: &mut Causes,
    ) {
        let config = &self.config;
        let place = sight.localisation;
        let known = fresh(now, place.map(|p| p.0), config.localisation_stale_s);
        causes.add_if(Cause::LocalisationStale, !known);
        causes.add_if(Cause::LocalisationLost, place.is_some_and(|p| !p.1));
        let seen = fresh(now, obstacles.map(|o| o.stamp), config.lidar_stale_s);
        causes.add_if(Cause::LidarStale, !seen);
        let image = fresh(now, sight.camera, config.camera_stale_s);
        causes.add_if(Cause::CameraStale, config.camera_needed && !image);
        let near = sight.person.is_some_and(|(seen, [x, y])| {
            let believed = fresh(now, Some(seen), config.person_expires_s);
            let distance = x.hypot(y);
            // Not-a-number is near: whoever says so knows nothing.
            believed && (distance.is_nan() || distance <= config.safety_circle_m())
        });
        causes.add_if(Cause::PersonNear, near);
    }

    fn within_limits(&self, wished: &BodyVelocity) -> (BodyVelocity, bool) {
        let config = &self.config;
        let target = BodyVelocity {
            forward: wished
                .forward
                .clamp(-config.backward_m_per_s, config.forward_m_per_s),
            left: wished
                .left
                .clamp(-config.sideways_m_per_s, config.sideways_m_per_s),
            yaw_rate: wished
                .yaw_rate
                .clamp(-config.turn_rad_per_s, config.turn_rad_per_s),
        };
        (target, target != *wished)
    }

    /// The velocity after `dt_s` on the way to `target`, each component by its own limit.
    fn towards(&self, target: &BodyVelocity, dt_s: f64) -> BodyVelocity {
        let config = &self.config;
        let (faster, slower) = (config.acceleration_m_per_s2, config.braking_m_per_s2);
        let turning = config.turn_acceleration_rad_per_s2;
        let now = &self.velocity;
        BodyVelocity {
            forward: approach(now.forward, target.forward, faster * dt_s, slower * dt_s),
            left: approach(now.left, target.left, faster * dt_s, slower * dt_s),
            yaw_rate: approach(
                now.yaw_rate,
                target.yaw_rate,
                turning * dt_s,
                turning * dt_s,
            ),
        }
    }

    /// Slows down as far as what stands around leaves room to stop. Not by the braking limit: the
    /// room is reckoned with it.
    fn mind_obstacles(
        &mut self,
        obstacles: Option<&Obstacles>,
        wished: &BodyVelocity,
        causes: &mut Causes,
    ) {
        let Some(obstacles) = obstacles.filter(|_| !self.velocity.is_zero()) else {
            return;
        };
        let share = free_share(&self.velocity, obstacles, &self.config);
        causes.add_if(Cause::Obstacle, share < 1.0 && !wished.is_zero());
        self.velocity = scaled(&self.velocity, share);
    }
}

/// Whether something that was known at `stamp` is no older than `limit_s`, nor from the future.
fn fresh(now: Stamp, stamp: Option<Stamp>, limit_s: f64) -> bool {
    stamp.is_some_and(|stamp| (-AHEAD_NS..=nanos(limit_s)).contains(&now.nanos_since(stamp)))
}

fn nanos(seconds: f64) -> i64 {
    (seconds * 1e9) as i64
}

/// From `now` towards `target`, by at most `faster` away from zero and `slower` towards it.
fn approach(now: f64, target: f64, faster: f64, slower: f64) -> f64 {
    if now * target < 0.0 {
        // Through zero, which is where braking ends.
        return approach(now, 0.0, faster, slower);
    }
    let most = match target.abs() > now.abs() {
        true => faster,
        false => slower,
    };
    now + (target - now).clamp(-most, most)
}
