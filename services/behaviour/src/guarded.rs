//! A base that only the gate can reach.
//!
//! In: a robot's body, which goes in and never comes out again, and wishes. Out: what its sensors
//! say, and verdicts. Nobody else holds the body, so that no command passes by the gate.

use hachi_hal::{BaseCommand, BaseDrive, BaseStatus, Stamp};

use crate::gate::{SafetyGate, Sight, Verdict};
use crate::obstacles::Obstacles;

/// A base that also reports: one link for both, as robots have it.
pub trait Body: BaseDrive {
    /// What it reports.
    type Report;

    /// What came since it was last asked; does not wait. `None` where there is nothing.
    ///
    /// # Errors
    /// The link fails.
    fn listen(&mut self, now: Stamp) -> Result<Option<Self::Report>, Self::Error>;
}

/// A base behind the gate.
#[derive(Debug)]
pub struct GuardedBase<D> {
    gate: SafetyGate,
    body: D,
}

/// What became of a step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Moved {
    /// What the gate let pass.
    pub verdict: Verdict,
    /// What the base does.
    pub status: BaseStatus,
}

/// What went wrong at the base, after the gate had spoken.
#[derive(Debug)]
pub struct Unmoved<E> {
    /// What the gate let pass.
    pub verdict: Verdict,
    /// What the base said.
    pub error: E,
}

impl<D: BaseDrive> GuardedBase<D> {
    /// Puts a body behind a gate.
    pub fn new(gate: SafetyGate, body: D) -> Self {
        Self { gate, body }
    }

    /// The limits.
    pub fn gate(&self) -> &SafetyGate {
        &self.gate
    }

    /// Asks the gate, tells the base, and has it send.
    ///
    /// # Errors
    /// The base does not take the command, or can't be reached; what it was told before dies of age.
    pub fn step(
        &mut self,
        now: Stamp,
        wish: Option<&BaseCommand>,
        sight: &Sight,
        obstacles: Option<&Obstacles>,
    ) -> Result<Moved, Unmoved<D::Error>> {
        let verdict = self.gate.step(now, wish, sight, obstacles);
        let taken = self.body.command(&verdict.command, now);
        // It is served in any case: a command that was not taken must not keep an old one alive.
        let served = self.body.service(now);
        match (taken, served) {
            (Ok(()), Ok(status)) => Ok(Moved { verdict, status }),
            (Err(error), _) | (Ok(()), Err(error)) => Err(Unmoved { verdict, error }),
        }
    }
}

impl<D: Body> GuardedBase<D> {
    /// What the body reports.
    ///
    /// # Errors
    /// The link fails.
    pub fn listen(&mut self, now: Stamp) -> Result<Option<D::Report>, D::Error> {
        self.body.listen(now)
    }
}
