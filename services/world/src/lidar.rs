//! The simulated sensor as a source of packets, like a socket or a capture file.

use hachi_hal::{DeviceError, FaultKind, PacketSource, Received, Stamp};

use crate::simulation::Simulation;

/// Why a packet could not be handed over.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum SimulatedLidarError {
    /// The packet is dropped, as a datagram longer than a socket's buffer would be.
    #[error("a packet of {needed} bytes does not fit a buffer of {got}")]
    BufferTooSmall {
        /// Bytes of the packet.
        needed: usize,
        /// Bytes of the buffer.
        got: usize,
    },
}

impl DeviceError for SimulatedLidarError {
    fn kind(&self) -> FaultKind {
        FaultKind::FixConfig
    }
}

/// A simulation as a [`PacketSource`]. Its clock is the packets' own: it never waits, and gives
/// the next packet if that is received by the deadline.
#[derive(Debug)]
pub struct SimulatedLidar {
    simulation: Simulation,
}

impl SimulatedLidar {
    /// A source that sends what the simulation makes.
    pub fn new(simulation: Simulation) -> Self {
        Self { simulation }
    }

    /// The simulation, and the truth with it.
    pub fn simulation(&self) -> &Simulation {
        &self.simulation
    }
}

impl PacketSource for SimulatedLidar {
    type Error = SimulatedLidarError;

    fn receive(
        &mut self,
        buffer: &mut [u8],
        deadline: Stamp,
    ) -> Result<Option<Received>, Self::Error> {
        if self
            .simulation
            .next_stamp()
            .is_none_or(|stamp| stamp > deadline)
        {
            return Ok(None);
        }
        let Some(packet) = self.simulation.next_packet() else {
            return Ok(None);
        };
        let got = buffer.len();
        let needed = packet.bytes.len();
        let room = buffer
            .get_mut(..needed)
            .ok_or(SimulatedLidarError::BufferTooSmall { needed, got })?;
        room.copy_from_slice(packet.bytes);
        Ok(Some(Received {
            len: needed,
            stamp: packet.stamp,
            port: packet.port,
        }))
    }

    fn at_end(&self) -> bool {
        self.simulation.next_stamp().is_none()
    }
}
