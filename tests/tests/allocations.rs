//! From packet to pose nothing is allocated once everything has been seen at its largest.
#![allow(unsafe_code, reason = "counting allocations takes a global allocator")]

use std::alloc::{GlobalAlloc, Layout, System};
use std::sync::atomic::{AtomicU64, Ordering};

use hachi_cloud::{FilterConfig, Filters, ScanFrames};
use hachi_hal::{LidarScans, PacketSource, Received, Stamp};
use hachi_odometry::{Odometry, OdometryConfig, ScanInput};
use hachi_velodyne::{VelodyneConfig, VelodyneScans};
use hachi_world::{Preset, Simulation, SimulationConfig};

struct Counting;

static ALLOCATIONS: AtomicU64 = AtomicU64::new(0);

// SAFETY: every call is handed to the system's allocator unchanged; counting touches no memory.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        ALLOCATIONS.fetch_add(1, Ordering::Relaxed);
        // SAFETY: the caller's promise is passed on.
        unsafe { System.alloc(layout) }
    }
    unsafe fn dealloc(&self, at: *mut u8, layout: Layout) {
        // SAFETY: the caller's promise is passed on.
        unsafe { System.dealloc(at, layout) }
    }
    unsafe fn realloc(&self, at: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        ALLOCATIONS.fetch_add(1, Ordering::Relaxed);
        // SAFETY: the caller's promise is passed on.
        unsafe { System.realloc(at, layout, size) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

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

#[test]
fn from_packet_to_pose_nothing_is_allocated_once_warm() {
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
            let before = ALLOCATIONS.load(Ordering::Relaxed);
            let Ok(Some(header)) = scans.read_scan(&mut points, Stamp::from_nanos(i64::MAX)) else {
                continue;
            };
            filters.step(&points, &ScanFrames::default(), &mut kept);
            odometry.step(&ScanInput::new(&header, &kept));
            counts.push(ALLOCATIONS.load(Ordering::Relaxed) - before);
        }
        counts
    });
    // Buffers are at their largest after some scans of a walk through one place. The last scan is
    // a partial one, whose end is found differently.
    const WARM: usize = 85;
    let warm = &counts[WARM..counts.len() - 1];
    assert!(warm.len() > 25, "{} scans", counts.len());
    assert_eq!(warm.iter().sum::<u64>(), 0, "{counts:?}");
}
