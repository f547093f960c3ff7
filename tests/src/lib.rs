//! What the end-to-end tests share: the simulated robot as scans, and errors against its truth; masks
//! of people against theirs.

pub mod masks;

use hachi_hal::{LidarScans, Point, Pose, ScanHeader, Stamp};
use hachi_velodyne::{VelodyneConfig, VelodyneScans};
use hachi_world::{SimulatedLidar, Simulation, SimulationConfig};

/// Scans of the simulated VLP-16, through its packets and the driver.
pub struct SimulatedScans {
    scans: VelodyneScans<SimulatedLidar>,
    /// The points of the last scan.
    pub points: Vec<Point>,
}

impl SimulatedScans {
    /// The scans of one simulation.
    pub fn new(config: SimulationConfig) -> Self {
        let lidar = SimulatedLidar::new(Simulation::new(config));
        Self {
            scans: VelodyneScans::new(lidar, VelodyneConfig::default()),
            points: Vec::new(),
        }
    }

    /// The next scan; its points are in [`SimulatedScans::points`].
    pub fn next_scan(&mut self) -> Option<ScanHeader> {
        loop {
            match self
                .scans
                .read_scan(&mut self.points, Stamp::from_nanos(i64::MAX))
            {
                Ok(Some(header)) => return Some(header),
                Ok(None) if self.scans.at_end() => return None,
                Ok(None) => {}
                Err(error) => panic!("the simulated LiDAR failed: {error}"),
            }
        }
    }
}

/// Error of an estimated pose, both taken from the first: metres and radians.
pub fn error(first: (&Pose, &Pose), now: (&Pose, &Pose)) -> (f64, f64) {
    let (truth, estimate) = (first.0.inv_mul(now.0), first.1.inv_mul(now.1));
    let difference = truth.inv_mul(&estimate);
    (
        difference.translation.vector.norm(),
        difference.rotation.angle(),
    )
}
