//! Prints what an ICM-42688-P on an I2C bus of this machine measures, ten times a second:
//! `cargo run --release -p hachi-imu --example imu -- /dev/i2c-1`.
#![allow(clippy::print_stdout, reason = "this is what it is for")]

use std::path::Path;
use std::time::Instant;

use hachi_hal::{Clock, Imu, Stamp};
use hachi_imu::bus::I2C_ADDRESS;
use hachi_imu::system::{Sleep, open_i2c};
use hachi_imu::{Icm42688, ImuConfig};

/// Nanoseconds since the program began.
struct SinceStart(Instant);

impl Clock for SinceStart {
    fn now(&self) -> Stamp {
        Stamp::from_nanos(i64::try_from(self.0.elapsed().as_nanos()).unwrap_or(i64::MAX))
    }
}

const SECOND_NS: i64 = 1_000_000_000;

fn main() -> Result<(), String> {
    let path = std::env::args().nth(1).unwrap_or("/dev/i2c-1".to_owned());
    let registers =
        open_i2c(Path::new(&path), I2C_ADDRESS).map_err(|fault| format!("{path}: {fault:?}"))?;
    let clock = SinceStart(Instant::now());
    let mut imu = Icm42688::start(registers, Sleep, clock, ImuConfig::default())
        .map_err(|error| error.to_string())?;
    let mut next = Stamp::from_nanos(0);
    loop {
        let deadline = next + SECOND_NS;
        match imu.read(deadline) {
            Ok(Some(sample)) if sample.stamp >= next => {
                let (w, f) = (sample.angular_velocity, sample.specific_force);
                println!(
                    "{} rad/s {:7.3} {:7.3} {:7.3}  m/s2 {:7.2} {:7.2} {:7.2}",
                    sample.stamp, w.x, w.y, w.z, f.x, f.y, f.z
                );
                next = sample.stamp + SECOND_NS / 10;
            }
            Ok(_) => {}
            Err(error) => println!("{error}"),
        }
    }
}
