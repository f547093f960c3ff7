//! Writes trajectories as text.
//!
//! Nine digits after the point: a nanosecond in time, a nanometre in place.

use std::io::{self, Write};

use hachi_hal::{Pose, Stamp};

use crate::Trajectory;

/// Writes `t x y z qx qy qz qw`, one pose a line (seconds, metres).
///
/// Poses without times get their index as time, which is how KITTI files are turned into TUM.
///
/// # Errors
/// Those of `out`.
pub fn tum(trajectory: &Trajectory, mut out: impl Write) -> io::Result<()> {
    let stamps = trajectory.stamps();
    for (index, pose) in trajectory.poses().iter().enumerate() {
        let stamp = match stamps {
            Some(stamps) => stamps[index], // one stamp for each pose by construction
            None => Stamp::from_secs_nanos(index as i64, 0).unwrap_or_default(),
        };
        tum_line(stamp, pose, &mut out)?;
    }
    out.flush()
}

/// Writes one line of a TUM file: for programs that write poses as they come.
///
/// # Errors
/// Those of `out`.
pub fn tum_line(stamp: Stamp, pose: &Pose, mut out: impl Write) -> io::Result<()> {
    let t = pose.translation.vector;
    let q = pose.rotation.coords; // x, y, z, w
    writeln!(
        out,
        "{stamp} {:.9} {:.9} {:.9} {:.9} {:.9} {:.9} {:.9}",
        t.x, t.y, t.z, q.x, q.y, q.z, q.w
    )
}

/// Writes the upper three rows of each pose's matrix, row by row, one pose a line (metres).
/// Times are lost: KITTI keeps them in a file of their own.
///
/// # Errors
/// Those of `out`.
pub fn kitti(trajectory: &Trajectory, mut out: impl Write) -> io::Result<()> {
    for pose in trajectory.poses() {
        let m = pose.to_homogeneous();
        for row in 0..3 {
            for column in 0..4 {
                let gap = if row == 2 && column == 3 { "\n" } else { " " };
                write!(out, "{:.9e}{gap}", m[(row, column)])?;
            }
        }
    }
    out.flush()
}
