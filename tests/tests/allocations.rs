//! From packet to pose nothing is allocated once everything has been seen at its largest.

use std::alloc::System;

use hachi_cloud::{FilterConfig, Filters, ScanFrames};
use hachi_hal::{LidarScans, PacketSource, Received, Stamp};
use hachi_odometry::{Odometry, OdometryConfig, ScanInput};
use hachi_velodyne::{VelodyneConfig, VelodyneScans};
use hachi_world::{Preset, Simulation, SimulationConfig};
use stats_alloc::{INSTRUMENTED_SYSTEM, StatsAlloc};

#[global_allocator]
static ALLOCATOR: &StatsAlloc<System> = &INSTRUMENTED_SYSTEM;

/// Allocations of the whole process so far, those among them that made a block larger too.
fn allocations() -> usize {
    let stats = ALLOCATOR.stats();
    stats.allocations + stats.reallocations
}

/// Packets from memory, so that making them is not counted.
struct Recorded {
    packets: Vec<(Stamp, u16, Vec<u8>)>,
    next: usize,
}

impl PacketSource for Recorded {
    type Error = std::convert::Infallible;
    fn receive(&mut self, buffer: &mut [u8], _: Stamp) -> Result<Option<Received>, Self::Error> {
        let Some((stamp, port, bytes)) = self.packets.get(self.next) else {
            return Ok(None);
        };
        self.next += 1;
        buffer[..bytes.len()].copy_from_slice(bytes);
        Ok(Some(Received {
            len: bytes.len(),
            stamp: *stamp,
            port: *port,
        }))
    }
    fn at_end(&self) -> bool {
        self.next == self.packets.len()
    }
}

fn main() {
    let mut simulation = Simulation::new(SimulationConfig::preset(Preset::Office, 1, 12.0));
    let mut packets = Vec::new();
    while let Some(packet) = simulation.next_packet() {
        packets.push((packet.stamp, packet.port, packet.bytes.to_vec()));
    }
    let mut scans = VelodyneScans::new(Recorded { packets, next: 0 }, VelodyneConfig::default());
    let mut filters = Filters::new(FilterConfig::default()).unwrap();
    let mut odometry = Odometry::new(OdometryConfig::default());
    let (mut points, mut kept) = (Vec::new(), Vec::new());
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(2)
        .build()
        .unwrap();
    let counts = pool.install(|| {
        let mut counts = Vec::with_capacity(200);
        while !scans.at_end() {
            let before = allocations();
            let Ok(Some(header)) = scans.read_scan(&mut points, Stamp::from_nanos(i64::MAX)) else {
                continue;
            };
            filters.step(&points, &ScanFrames::default(), &mut kept);
            odometry.step(&ScanInput::new(&header, &kept));
            counts.push(allocations() - before);
        }
        counts
    });
    // Buffers are at their largest after some scans of a walk through one place. The last scan is
    // a partial one, whose end is found differently.
    const WARM: usize = 85;
    let warm = &counts[WARM..counts.len() - 1];
    assert!(warm.len() > 25, "{} scans", counts.len());
    assert_eq!(warm.iter().sum::<usize>(), 0, "{counts:?}");
}
