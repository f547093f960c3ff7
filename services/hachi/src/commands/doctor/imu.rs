//! The inertial sensor that a configuration file names: its bus is opened and the chip asked who it
//! is. It goes on measuring as it did.

use std::path::Path;

use hachi_imu::{ImuError, check_identity};

use super::files::configuration_files;
use super::finding::Finding;
use crate::config::Settings;
use crate::imu;

pub(super) fn check() -> Vec<Finding> {
    configuration_files()
        .iter()
        .filter_map(|file| imu_of(file))
        .collect()
}

fn imu_of(file: &Path) -> Option<Finding> {
    const NAME: &str = "inertial sensor";
    // What is wrong with the file itself is another finding's.
    let settings = Settings::load(None, Some(file)).ok()?;
    let bus = settings.imu.bus()?;
    let identity = imu::open(&bus)
        .map_err(ImuError::Bus)
        .and_then(|mut registers| check_identity(&mut registers));
    Some(match identity {
        Ok(()) => Finding::ok(NAME, format!("{bus}: an ICM-42688-P")),
        Err(error) => Finding::warn(
            NAME,
            format!("{bus}: {error}"),
            format!("mend that, or correct [imu] in {}", file.display()),
        ),
    })
}
