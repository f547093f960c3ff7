//! A Unitree robot as the gate's body.

use hachi_behaviour::Body;
use hachi_hal::{BaseCommand, BaseDrive, BaseStatus, BatterySample, Stamp, StopSample};
use hachi_unitree::BodySample;
use hachi_unitree::device::{ClientError, HighClient, RobotLink};

/// What the robot reports at one moment.
#[derive(Debug, Clone, Copy)]
pub struct RobotReport {
    /// When the state came.
    pub stamp: Stamp,
    /// Legs and body, where their numbers can be.
    pub body: Option<BodySample>,
    /// The remote control's stop keys.
    pub stop: Option<StopSample>,
    /// The battery.
    pub battery: Option<BatterySample>,
}

/// The robot.
#[derive(Debug)]
pub struct UnitreeBody<L>(pub HighClient<L>);

impl<L: RobotLink> BaseDrive for UnitreeBody<L> {
    type Error = ClientError;

    fn command(&mut self, command: &BaseCommand, now: Stamp) -> Result<(), ClientError> {
        self.0.command(command, now)
    }

    fn service(&mut self, now: Stamp) -> Result<BaseStatus, ClientError> {
        self.0.service(now)
    }
}

impl<L: RobotLink> Body for UnitreeBody<L> {
    type Report = RobotReport;

    fn listen(&mut self, now: Stamp) -> Result<Option<RobotReport>, ClientError> {
        if !self.0.exchange(now)? {
            return Ok(None);
        }
        let stamp = self.0.state().map_or(now, |(_, stamp)| *stamp);
        Ok(Some(RobotReport {
            stamp,
            body: self.0.next_body(),
            stop: self.0.last_stop(),
            battery: self.0.last_battery(),
        }))
    }
}
