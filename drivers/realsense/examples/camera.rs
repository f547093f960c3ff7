//! Streams from the camera that is plugged in and says what came, once a second:
//! `cargo run --release -p hachi-realsense --features v4l2 --example camera [SERIAL]`.
//!
//! Unplug the camera and plug it in again to see it come back.
#![allow(clippy::print_stdout, reason = "this is what it is for")]

#[cfg(not(all(target_os = "linux", target_pointer_width = "64")))]
fn main() {
    println!("cameras are read on 64-bit Linux only");
}

#[cfg(all(target_os = "linux", target_pointer_width = "64"))]
fn main() {
    use std::time::Instant;

    use hachi_hal::{Clock, RgbdCamera, RgbdImages, Stamp};
    use hachi_realsense::device::v4l2::V4l2Port;
    use hachi_realsense::{RealSense, RealSenseConfig};

    /// Nanoseconds since the program began.
    #[derive(Clone)]
    struct SinceStart(Instant);
    impl Clock for SinceStart {
        fn now(&self) -> Stamp {
            Stamp::from_nanos(i64::try_from(self.0.elapsed().as_nanos()).unwrap_or(i64::MAX))
        }
    }

    const SECOND_NS: i64 = 1_000_000_000;
    let clock = SinceStart(Instant::now());
    let config = RealSenseConfig {
        serial: std::env::args().nth(1),
        ..RealSenseConfig::default()
    };
    let pixels = (config.depth.width * config.depth.height) as usize;
    let mut camera = RealSense::new(V4l2Port::new(clock.clone()), config);
    let (mut depth, mut color) = (vec![0; pixels], vec![0; 3 * pixels]);
    loop {
        let (end, mut frames, mut oldest_ns) = (clock.now() + SECOND_NS, 0, 0);
        while clock.now() < end {
            let images = RgbdImages {
                depth: &mut depth,
                color: &mut color,
            };
            match camera.read_frame(images, end) {
                Ok(Some(header)) => {
                    frames += 1;
                    oldest_ns = oldest_ns.max(clock.now().nanos_since(header.stamp));
                }
                Ok(None) => {}
                Err(error) => println!("{error}"),
            }
        }
        let measured = depth.iter().filter(|&&count| count != 0).count() * 100 / pixels;
        let dropped = camera.counters();
        let dropped: Vec<_> = dropped.dropped().filter(|(_, n)| *n != 0).collect();
        println!(
            "{frames} frames, at most {} ms after their exposure, {measured} % measured, left out: \
             {dropped:?}",
            oldest_ns / 1_000_000
        );
    }
}
