//! Which HighCmd is in force: the last command while it lives, standing still otherwise.

use hachi_hal::{
    BaseAction, BaseCommand, BaseStatus, BodyPosture, BodyVelocity, CommandFault, DeviceError,
    FaultKind, Stamp,
};

use super::ladder::{Mode, ModeLadder, Rung};
use super::limits::{CommandLimits, GaitKind, VelocityLimits};
use crate::frame::{CheckForm, HighCmd, LEVEL_HIGH, Model};
use crate::robot::Quadruped;

/// How a robot is to walk, and how its firmware wants to be spoken to.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CommanderConfig {
    /// Gait.
    pub gait: GaitKind,
    /// Height of lifted feet against the usual one, m.
    pub foot_raise_height_m: f64,
    /// Form of the check value. Plain for the editions with an interface; some others are said to
    /// want it transformed.
    pub check_form: CheckForm,
    /// Level flag: [`LEVEL_HIGH`]; zero for the lesser editions of a Go1.
    pub level: u8,
}

impl Default for CommanderConfig {
    fn default() -> Self {
        Self {
            gait: GaitKind::Trot,
            foot_raise_height_m: 0.0,
            check_form: CheckForm::Plain,
            level: LEVEL_HIGH,
        }
    }
}

/// Why a command was not taken. What was in force before goes on dying at its own time.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum CommandRefused {
    /// No base may take it.
    #[error(transparent)]
    Faulty(#[from] CommandFault),
    /// A robot that does not stand can't walk or hold a posture.
    #[error("the robot is not standing but {0:?}: send StandUp first")]
    NotStanding(Rung),
    /// The robot has not said yet what it does.
    #[error("the robot has not reported its mode yet")]
    Unheard,
    /// The robot is not known to have this gait.
    #[error("a {} has no gait {gait:?}", model.name())]
    NoSuchGait {
        /// The robot.
        model: Model,
        /// The gait.
        gait: GaitKind,
    },
}

impl DeviceError for CommandRefused {
    fn kind(&self) -> FaultKind {
        match self {
            Self::NoSuchGait { .. } => FaultKind::FixConfig,
            _ => FaultKind::ReadAgain,
        }
    }
}

/// What the robot is told at one moment.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Told {
    /// The frame's contents.
    pub command: HighCmd,
    /// What that means.
    pub status: BaseStatus,
    /// Where on the ladder of modes it is; `None` before the robot reported anything.
    pub rung: Option<Rung>,
}

/// A trot that is asked for no velocity has come to rest after this long, ns. Only then does the
/// robot leave the walking mode.
const TROT_OUT_NS: i64 = 500_000_000;

/// Holds the command in force for one robot.
#[derive(Debug, Clone)]
pub struct Commander {
    model: Model,
    limits: CommandLimits,
    speeds: VelocityLimits,
    config: CommanderConfig,
    ladder: ModeLadder,
    reported: Option<Mode>,
    command: Option<BaseCommand>,
    posture: BodyPosture,
    still_since: Option<Stamp>,
}

impl Commander {
    /// A commander that tells the robot nothing yet.
    ///
    /// # Errors
    /// The robot has no such gait.
    pub fn new(robot: &Quadruped, config: CommanderConfig) -> Result<Self, CommandRefused> {
        let model = robot.layout.model;
        let gait = config.gait;
        let speeds = robot.limits.of_gait(gait);
        Ok(Self {
            model,
            limits: robot.limits,
            speeds: speeds.ok_or(CommandRefused::NoSuchGait { model, gait })?,
            config,
            ladder: ModeLadder::default(),
            reported: None,
            command: None,
            posture: BodyPosture::default(),
            still_since: None,
        })
    }

    /// Takes in the mode byte of a state.
    pub fn reported(&mut self, mode: u8, now: Stamp) {
        let mode = Mode::of_byte(self.model, mode);
        self.reported = Some(mode);
        self.ladder.reported(mode, now);
    }

    /// The mode that the robot reported last.
    pub fn reported_mode(&self) -> Option<Mode> {
        self.reported
    }

    /// Where on the ladder of modes the robot is told to be.
    pub fn rung(&self) -> Option<Rung> {
        self.ladder.rung()
    }

    /// Lets the command in force die at once: zero velocity from now on.
    pub fn halt(&mut self) {
        if let Some(command) = &mut self.command {
            command.time_to_live_ns = 0;
        }
    }

    /// Form of the check value for this robot.
    pub fn check_form(&self) -> CheckForm {
        self.config.check_form
    }

    /// Takes a command at `now`.
    ///
    /// # Errors
    /// It is not in order, or the robot can't do it from where it is; nothing changes.
    pub fn command(&mut self, command: &BaseCommand, now: Stamp) -> Result<(), CommandRefused> {
        command.check(now)?;
        let moves = matches!(&command.action, BaseAction::Move(v) if !v.is_zero());
        let needs_feet = moves || matches!(command.action, BaseAction::Pose(_));
        match self.ladder.rung() {
            None if needs_feet => return Err(CommandRefused::Unheard),
            Some(rung) if needs_feet && rung < Rung::Standing => {
                return Err(CommandRefused::NotStanding(rung));
            }
            _ => {}
        }
        match command.action {
            BaseAction::Move(_) if moves => self.ladder.head_for(Rung::Walking),
            BaseAction::Pose(posture) => {
                (self.posture, _) = self.limits.posture(&posture);
                self.ladder.head_for(Rung::Standing);
            }
            BaseAction::StandUp => {
                self.posture = BodyPosture::default();
                self.ladder.head_for(Rung::Standing);
            }
            BaseAction::LieDown => self.ladder.head_for(Rung::Lying),
            _ => {}
        }
        self.command = Some(*command);
        Ok(())
    }

    /// What the robot is told at `now`. Never a velocity of a command that is dead, and none in
    /// any mode but walking.
    pub fn told(&mut self, now: Stamp) -> Told {
        let alive = self.command.filter(|command| command.is_alive(now));
        let asked = match alive.map(|command| command.action) {
            Some(BaseAction::Move(velocity)) => velocity,
            _ => BodyVelocity::ZERO,
        };
        let (granted, saturated) = self.speeds.velocity(&asked);
        let rested = self.rests(granted.is_zero(), now);
        if rested && self.ladder.goal() == Some(Rung::Walking) {
            // It stands rather than trot on the spot.
            self.ladder.head_for(Rung::Standing);
        }
        let walks = self.ladder.rung() == Some(Rung::Walking);
        let rung = if walks && !rested {
            Some(Rung::Walking)
        } else {
            self.ladder.step(now)
        };
        let velocity = match rung {
            Some(Rung::Walking) => granted,
            _ => BodyVelocity::ZERO,
        };
        let posed = match alive.map(|command| command.action) {
            Some(BaseAction::Pose(posture)) => self.limits.posture(&posture).1,
            _ => false,
        };
        Told {
            command: self.high_cmd(rung, &velocity),
            status: BaseStatus {
                stamp: now,
                velocity,
                expired: self.command.is_some() && alive.is_none(),
                saturated: saturated || posed,
            },
            rung,
        }
    }

    /// Whether no velocity has been asked for long enough that the body has come to rest.
    fn rests(&mut self, still: bool, now: Stamp) -> bool {
        if !still {
            self.still_since = None;
            return false;
        }
        let since = *self.still_since.get_or_insert(now);
        now.nanos_since(since) >= TROT_OUT_NS
    }

    fn high_cmd(&self, rung: Option<Rung>, velocity: &BodyVelocity) -> HighCmd {
        let mode = match rung {
            // One that stands by itself and was told nothing is left so.
            Some(Rung::Standing) if self.ladder.goal().is_none() => Mode::Idle,
            Some(rung) => rung.mode(),
            None => Mode::Idle,
        };
        let mut command = HighCmd {
            mode: mode.byte(self.model),
            ..HighCmd::default()
        };
        command.header.level = self.config.level;
        match mode {
            Mode::Walk => {
                command.gait = self.config.gait as u8;
                command.velocity = [velocity.forward as f32, velocity.left as f32];
                command.yaw_speed = velocity.yaw_rate as f32;
                let lift = self.limits.foot_raise_height;
                command.foot_raise_height = lift.clamp(self.config.foot_raise_height_m) as f32;
            }
            Mode::Stand => {
                let BodyPosture {
                    roll,
                    pitch,
                    yaw,
                    height_change_m,
                } = self.posture;
                command.euler = [roll as f32, pitch as f32, yaw as f32];
                command.body_height = height_change_m as f32;
            }
            _ => {}
        }
        command
    }
}
