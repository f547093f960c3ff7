//! A second line to a robot, for when the first one hangs: it can only make it stand still.
//!
//! In: nothing but the robot's address. Out: HighCmds that ask for zero velocity, from a port of its
//! own. Whoever holds it can't move a robot.

use std::io;
use std::net::{IpAddr, SocketAddr, UdpSocket};

use crate::command::Mode;
use crate::frame::{CheckForm, Frame, HighCmd};
use crate::robot::Quadruped;

/// The line.
#[derive(Debug)]
pub struct StopLine {
    socket: UdpSocket,
    robot: SocketAddr,
    stand: Frame,
}

impl StopLine {
    /// Opens a port of its own towards the robot.
    ///
    /// # Errors
    /// The system gives none.
    pub fn open(
        robot: &Quadruped,
        address: SocketAddr,
        local: IpAddr,
        form: CheckForm,
        level: u8,
    ) -> io::Result<Self> {
        let socket = UdpSocket::bind((local, 0))?;
        socket.set_nonblocking(true)?;
        let mut command = HighCmd {
            // One rung below walking: what a robot that walks is told when it shall rest.
            mode: Mode::Stand.byte(robot.layout.model),
            ..HighCmd::default()
        };
        command.header.level = level;
        let stand = command
            .encode(&robot.layout, form)
            .map_err(io::Error::other)?;
        Ok(Self {
            socket,
            robot: address,
            stand,
        })
    }

    /// Tells the robot to stand still.
    ///
    /// # Errors
    /// There is no way to it.
    pub fn stop(&self) -> io::Result<()> {
        let sent = self.socket.send_to(self.stand.as_bytes(), self.robot);
        sent.map(|_| ())
    }
}
