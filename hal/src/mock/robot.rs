//! Scripted robots: legs, base, battery, emergency stop, watchdog.
//!
//! Sources play a script as the sensors do. [`MockBase`] keeps the promise of [`BaseDrive`] and
//! remembers what it gave the motors; [`MockWatchdog`] remembers when it was fed.

use super::{MockError, Player, Step};
use crate::{
    BaseAction, BaseCommand, BaseDrive, BaseStatus, Battery, BatterySample, BodyVelocity,
    CommandFault, EmergencyStop, LegState, LegStates, Stamp, StopSample, Watchdog,
};

/// Defines a source that plays a script through one method of one trait.
macro_rules! scripted {
    ($(#[$doc:meta])* $name:ident, $sample:ty, $device:ident, $read:ident) => {
        $(#[$doc])*
        #[derive(Debug, Clone)]
        pub struct $name<S>(Player<$sample, S>);

        impl<S: AsRef<[Step<$sample>]>> $name<S> {
            /// Does `script`, one step per call.
            pub fn script(script: S) -> Self {
                Self(Player::new(script))
            }

            /// Panics unless every step was played.
            #[track_caller]
            pub fn assert_done(&self) {
                self.0.assert_done();
            }
        }

        impl<S: AsRef<[Step<$sample>]>> $device for $name<S> {
            type Error = MockError;

            fn $read(&mut self, _: Stamp) -> Result<Option<$sample>, MockError> {
                self.0.play()
            }
        }
    };
}

scripted!(
    /// Legs that play a script.
    MockLegs, LegState, LegStates, read_legs
);
scripted!(
    /// A battery that plays a script.
    MockBattery, BatterySample, Battery, read_battery
);
scripted!(
    /// An emergency stop that plays a script.
    MockEmergencyStop, StopSample, EmergencyStop, read_stop
);

/// A base without motors: up to 1 m/s and 1 rad/s, with the last `N` moves that it was given.
#[derive(Debug, Clone, Default)]
pub struct MockBase<const N: usize> {
    command: Option<BaseCommand>,
    moves: heapless::Deque<BaseStatus, N>,
}

impl<const N: usize> MockBase<N> {
    /// A base that stands still.
    pub fn new() -> Self {
        Self {
            command: None,
            moves: heapless::Deque::new(),
        }
    }

    /// What was given to the motors, oldest first; the last `N`.
    pub fn moves(&self) -> impl Iterator<Item = &BaseStatus> {
        self.moves.iter()
    }

    /// The last command that was taken.
    pub fn last_command(&self) -> Option<&BaseCommand> {
        self.command.as_ref()
    }
}

impl<const N: usize> BaseDrive for MockBase<N> {
    type Error = CommandFault;

    fn command(&mut self, command: &BaseCommand, now: Stamp) -> Result<(), CommandFault> {
        command.check(now)?;
        self.command = Some(*command);
        Ok(())
    }

    fn service(&mut self, now: Stamp) -> Result<BaseStatus, CommandFault> {
        let alive = self.command.filter(|c| c.is_alive(now));
        let asked = match alive.map(|c| c.action) {
            Some(BaseAction::Move(velocity)) => velocity,
            _ => BodyVelocity::ZERO,
        };
        let velocity = BodyVelocity {
            forward: asked.forward.clamp(-1.0, 1.0),
            left: asked.left.clamp(-1.0, 1.0),
            yaw_rate: asked.yaw_rate.clamp(-1.0, 1.0),
        };
        let status = BaseStatus {
            stamp: now,
            velocity,
            expired: self.command.is_some() && alive.is_none(),
            saturated: velocity != asked,
        };
        if self.moves.is_full() {
            self.moves.pop_front();
        }
        // With no room at all nothing is remembered.
        let _ = self.moves.push_back(status);
        Ok(status)
    }
}

/// A watchdog without teeth.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct MockWatchdog {
    timeout_ns: i64,
    fed: Option<Stamp>,
}

impl MockWatchdog {
    /// Would bite after `timeout_ns` without food.
    pub const fn new(timeout_ns: i64) -> Self {
        Self {
            timeout_ns,
            fed: None,
        }
    }

    /// Whether it would have bitten by `now`. It sleeps until it is first fed.
    pub fn bites(&self, now: Stamp) -> bool {
        self.fed
            .is_some_and(|fed| now.nanos_since(fed) > self.timeout_ns)
    }
}

impl Watchdog for MockWatchdog {
    type Error = core::convert::Infallible;

    fn feed(&mut self, now: Stamp) -> Result<(), Self::Error> {
        self.fed = Some(now);
        Ok(())
    }

    fn timeout_ns(&self) -> i64 {
        self.timeout_ns
    }
}
