//! `lidar receive`: what the socket holds, packet by packet, to whole scans.

use hachi_hal::{DeviceError, LidarScans, Stamp};
use hachi_runtime::{Progress, Work};
use tracing::warn;

use super::messages::{Belt, Scan};
use super::signs::SharedSigns;

/// Scans that one run may finish: the rest waits for the next.
const MOST_AT_ONCE: usize = 2;

/// The task.
pub struct LidarReceive<S> {
    /// The driver over its packets.
    pub scans: S,
    /// To the filters.
    pub out: Belt<Scan>,
    /// Where the last scan's end is left.
    pub signs: SharedSigns,
    /// Failures of the source since the last good scan.
    pub failures: u64,
}

impl<S> Work for LidarReceive<S>
where
    S: LidarScans + Send,
    S::Error: DeviceError,
{
    fn run(&mut self, now: Stamp) -> Progress {
        for _ in 0..MOST_AT_ONCE {
            let Some(mut scan) = self.out.empty.receive() else {
                // All boxes wait for the filters; packets wait in the socket.
                return Progress::Done;
            };
            match self.scans.read_scan(&mut scan.points, now) {
                Ok(Some(header)) => {
                    scan.header = header;
                    self.failures = 0;
                    self.signs.scan.set(header.end);
                    self.out.send(scan);
                }
                Ok(None) => {
                    self.out.give_back(scan);
                    return Progress::Done;
                }
                Err(error) => {
                    self.out.give_back(scan);
                    if self.failures == 0 {
                        warn!(%error, "the lidar's packets can't be read");
                    }
                    self.failures += 1;
                }
            }
        }
        Progress::Done
    }
}
