//! The promise of RGB-D cameras.

use super::{Tally, Violation, timed};
use crate::{
    Clock, DeviceError as _, FaultKind, RgbdCamera, RgbdGeometry, RgbdHeader, RgbdImages, Stamp,
};

/// The promise of [`RgbdCamera`] about what is delivered, fed one frame at a time.
#[derive(Debug, Clone, Default)]
pub struct FramePromise {
    previous: Option<(u32, Stamp)>,
}

impl FramePromise {
    /// Checks the next frame of a stream, delivered into images with `room` for so many depth
    /// counts and colour bytes.
    pub fn check(
        &mut self,
        header: &RgbdHeader,
        geometry: Option<&RgbdGeometry>,
        room: [usize; 2],
    ) -> Result<(), Violation> {
        let (sequence, stamp) = (header.sequence, header.stamp);
        let sound = |g: &&RgbdGeometry| {
            g.depth.is_sound()
                && g.color.is_sound()
                && g.depth_unit_m > 0.0
                && g.color_from_depth.translation.vector.norm().is_finite()
        };
        let Some(geometry) = geometry.filter(sound) else {
            return Err(Violation::NoGeometry { sequence });
        };
        if room[0] < geometry.depth.pixels() || room[1] < 3 * geometry.color.pixels() {
            return Err(Violation::CutFrame { room });
        }
        if let Some((before_sequence, before)) = self.previous.replace((sequence, stamp)) {
            let expected = before_sequence.wrapping_add(1);
            if sequence != expected {
                return Err(Violation::Sequence {
                    expected,
                    got: sequence,
                });
            }
            if stamp <= before {
                return Err(Violation::StampNotIncreasing { before, stamp });
            }
        }
        Ok(())
    }
}

/// Reads `calls` times from a camera into `depth` and `color`, each with a deadline `wait_ns` from
/// now on `clock`; after the first frame, into images without room until it refused them, which it
/// must.
pub fn check_rgbd_camera<C: RgbdCamera>(
    camera: &mut C,
    clock: &dyn Clock,
    (depth, color): (&mut [u16], &mut [u8]),
    calls: usize,
    wait_ns: i64,
) -> Result<Tally, Violation> {
    let (mut tally, mut promise) = (Tally::default(), FramePromise::default());
    let mut refused = false;
    for _ in 0..calls {
        let cut = tally.items > 0 && !refused;
        let images = RgbdImages {
            depth: if cut { &mut [] } else { &mut *depth },
            color: &mut *color,
        };
        let room = [images.depth.len(), images.color.len()];
        match timed(clock, wait_ns, |deadline| {
            camera.read_frame(images, deadline)
        })? {
            Ok(Some(header)) => {
                promise.check(&header, camera.geometry(), room)?;
                tally.items += 1;
                tally.contents += (room[0] * 2 + room[1]) as u64;
            }
            Ok(None) => tally.nothing += 1,
            Err(error) => {
                tally.faults += 1;
                refused |= cut && error.kind() == FaultKind::FixConfig;
            }
        }
    }
    Ok(tally)
}
