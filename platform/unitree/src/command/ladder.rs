//! Modes of the robot, and the prudent way from one to another.
//!
//! Lying limp, lying, getting up, standing and walking are the rungs of a ladder, climbed one at a
//! time: 7 - 5 - 6 - 1 - 2. The maker's examples go 6, 1, 2 and hold 6 for two seconds; damping is
//! entered only from lying, because it lets a standing robot drop.

use hachi_hal::Stamp;

use crate::frame::Model;

/// A mode of the high-level service.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Mode {
    /// 0: stands by itself, takes nothing.
    Idle,
    /// 1: stands, holds a posture.
    Stand,
    /// 2: walks by velocity.
    Walk,
    /// 5: lies down.
    LieDown,
    /// 6: gets up.
    StandUp,
    /// 7: all motors soft.
    Damp,
    /// 8 (Go1) or 9 (B1): gets up from a fall.
    Recover,
    /// Any other: dances, jumps, reserved ones. Never commanded.
    Other(u8),
}

impl Mode {
    /// What a robot's mode byte means.
    pub const fn of_byte(model: Model, byte: u8) -> Self {
        match (byte, model) {
            (0, _) => Self::Idle,
            (1, _) => Self::Stand,
            (2, _) => Self::Walk,
            (5, _) => Self::LieDown,
            (6, _) => Self::StandUp,
            (7, _) => Self::Damp,
            (8, Model::Go1) | (9, Model::B1) => Self::Recover,
            _ => Self::Other(byte),
        }
    }

    /// Its byte.
    pub const fn byte(self, model: Model) -> u8 {
        match (self, model) {
            (Self::Idle, _) => 0,
            (Self::Stand, _) => 1,
            (Self::Walk, _) => 2,
            (Self::LieDown, _) => 5,
            (Self::StandUp, _) => 6,
            (Self::Damp, _) => 7,
            (Self::Recover, Model::Go1) => 8,
            (Self::Recover, Model::B1) => 9,
            (Self::Other(byte), _) => byte,
        }
    }
}

/// A place on the ladder.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[repr(u8)]
pub enum Rung {
    /// Lying, motors soft.
    Damped = 0,
    /// Lying.
    Lying = 1,
    /// Between lying and standing.
    Rising = 2,
    /// Standing.
    Standing = 3,
    /// Walking, or trotting on the spot.
    Walking = 4,
}

impl Rung {
    const ALL: [Self; 5] = [
        Self::Damped,
        Self::Lying,
        Self::Rising,
        Self::Standing,
        Self::Walking,
    ];

    /// The mode that is commanded there.
    pub const fn mode(self) -> Mode {
        match self {
            Self::Damped => Mode::Damp,
            Self::Lying => Mode::LieDown,
            Self::Rising => Mode::StandUp,
            Self::Standing => Mode::Stand,
            Self::Walking => Mode::Walk,
        }
    }

    /// Where a robot in this mode is; `None` for modes that are not on the ladder.
    pub const fn of_mode(mode: Mode) -> Option<Self> {
        match mode {
            Mode::Damp => Some(Self::Damped),
            Mode::LieDown => Some(Self::Lying),
            Mode::StandUp => Some(Self::Rising),
            Mode::Idle | Mode::Stand | Mode::Recover => Some(Self::Standing),
            Mode::Walk => Some(Self::Walking),
            Mode::Other(_) => None,
        }
    }

    /// How long it is held before the next one, coming from `from`, ns. Lying down and getting up
    /// take two seconds (the maker's example), and a body that got up comes to rest before it
    /// walks.
    const fn hold_ns(self, from: Option<Self>) -> i64 {
        match (self, from) {
            (Self::Lying | Self::Rising, _) => 2_000_000_000,
            (Self::Standing, Some(Self::Rising)) => 500_000_000,
            _ => 0,
        }
    }

    fn towards(self, goal: Self) -> Self {
        let at = self as usize;
        let next = match goal.cmp(&self) {
            core::cmp::Ordering::Less => at.saturating_sub(1),
            core::cmp::Ordering::Equal => at,
            core::cmp::Ordering::Greater => at + 1,
        };
        Self::ALL.get(next).copied().unwrap_or(self)
    }
}

/// A robot that has been told otherwise may go on reporting its old mode for this long, ns.
const REPORT_LAG_NS: i64 = 1_000_000_000;

/// Where on the ladder the robot is told to be, and where it shall get to.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct ModeLadder {
    at: Option<Place>,
    goal: Option<Rung>,
}

#[derive(Debug, Clone, Copy, PartialEq)]
struct Place {
    rung: Rung,
    since: Stamp,
    held_until: Stamp,
}

impl Place {
    fn entered(rung: Rung, from: Option<Rung>, now: Stamp) -> Self {
        Self {
            rung,
            since: now,
            held_until: now + rung.hold_ns(from),
        }
    }
}

impl ModeLadder {
    /// Takes in what the robot says it does.
    ///
    /// Before it was told anything it is where it says. Afterwards what it reports lags behind; but
    /// one that lies although it was told to stand (somebody damped it with the remote control, or
    /// it fell) is where it says, and must be told to get up anew.
    pub fn reported(&mut self, mode: Mode, now: Stamp) {
        let Some(rung) = Rung::of_mode(mode) else {
            return;
        };
        let believed = match &self.at {
            None => true,
            Some(place) if self.goal.is_none() => place.rung != rung,
            Some(place) => {
                place.rung >= Rung::Standing
                    && rung <= Rung::Lying
                    && now.nanos_since(place.since) > REPORT_LAG_NS
            }
        };
        if believed {
            self.at = Some(Place::entered(rung, None, now));
            self.goal = None;
        }
    }

    /// Where the robot is told to be; `None` before it reported anything.
    pub fn rung(&self) -> Option<Rung> {
        self.at.map(|place| place.rung)
    }

    /// Where it shall get to.
    pub fn goal(&self) -> Option<Rung> {
        self.goal
    }

    /// Sets where it shall get to.
    pub fn head_for(&mut self, goal: Rung) {
        self.goal = Some(goal);
    }

    /// The rung that is commanded at `now`: one step nearer to the goal once the last was held
    /// long enough. `None` before the robot reported where it is.
    pub fn step(&mut self, now: Stamp) -> Option<Rung> {
        let place = self.at?;
        let next = place.rung.towards(self.goal.unwrap_or(place.rung));
        if next != place.rung && now >= place.held_until {
            self.at = Some(Place::entered(next, Some(place.rung), now));
            return Some(next);
        }
        Some(place.rung)
    }
}
