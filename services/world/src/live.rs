//! The simulated sensor on a robot whose way is not known beforehand: packets as time goes on.
//!
//! In: the configuration of a simulation, of which the trajectory is not used, and where the base
//! was a moment ago. Out: the packets that were received since the last call.

use hachi_hal::{Pose, Stamp};
use rayon::prelude::*;

use crate::helios;
use crate::sensor::{DataPacket, make_packet_at, make_status, received_ns};
use crate::simulation::SimulationConfig;

/// Packets made at a time.
const BATCH: usize = 16;

/// The sensor.
#[derive(Debug)]
pub struct LiveLidar {
    config: SimulationConfig,
    batch: Vec<DataPacket>,
    next: u64,
    status: [u8; helios::BYTES],
}

impl LiveLidar {
    /// A sensor that begins to turn at the configuration's start.
    pub fn new(config: SimulationConfig) -> Self {
        Self {
            config,
            batch: vec![DataPacket::empty(); BATCH],
            next: 0,
            status: [0; helios::BYTES],
        }
    }

    /// Hands out every packet that is received until `now`, in order: when, to which port, the
    /// payload. `map_from_base` must know the poses since the last call.
    pub fn advance(
        &mut self,
        now: Stamp,
        map_from_base: impl Fn(Stamp) -> Pose + Sync,
        mut each: impl FnMut(Stamp, u16, &[u8]),
    ) {
        let (config, sensor) = (&self.config, self.config.sensor);
        let elapsed_ns = now.nanos_since(config.start);
        let pose_at = |after_ns: i64| map_from_base(config.start + after_ns);
        loop {
            let due =
                |offset: &usize| received_ns(sensor, self.next + *offset as u64) <= elapsed_ns;
            let count = (0..BATCH).take_while(due).count();
            if count == 0 {
                return;
            }
            let first = self.next;
            let packets = &mut self.batch[..count];
            packets
                .par_iter_mut()
                .enumerate()
                .for_each(|(i, packet)| make_packet_at(config, first + i as u64, &pose_at, packet));
            for (i, packet) in packets.iter().enumerate() {
                let index = first + i as u64;
                let received = config.start + received_ns(sensor, index);
                each(received, sensor.data_port(), &packet.bytes[..packet.len]);
                if index.is_multiple_of(sensor.data_per_status()) {
                    let len = make_status(sensor, received, &mut self.status);
                    each(received, sensor.status_port(), &self.status[..len]);
                }
            }
            self.next += count as u64;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Preset, Simulation};

    /// On the way that the other simulation knows beforehand, the bytes are the same.
    #[test]
    fn a_live_sensor_sends_what_the_other_one_sends() {
        let config = SimulationConfig::preset(Preset::Corridor, 3, 2.2);
        let mut simulation = Simulation::new(config.clone());
        simulation.skip_to(config.start + 2_000_000_000);
        let mut live = LiveLidar::new(config.clone());
        live.next = (0..)
            .find(|i| received_ns(config.sensor, *i) >= 2_000_000_000)
            .unwrap();
        let mut sent = Vec::new();
        for ms in (2_000..=2_200).step_by(7) {
            let now = config.start + ms * 1_000_000;
            live.advance(
                now,
                |stamp| config.map_from_base(stamp),
                |_, port, bytes| sent.push((port, bytes.to_vec())),
            );
        }
        assert!(sent.len() > 140, "{}", sent.len());
        for (i, (port, bytes)) in sent.iter().enumerate() {
            let packet = simulation.next_packet().unwrap();
            assert_eq!(packet.port, *port, "packet {i}");
            // Position packets carry the time they are sent at, which differs by microseconds.
            if *port == config.sensor.data_port() {
                assert_eq!(packet.bytes, bytes, "packet {i}");
            }
        }
    }
}
