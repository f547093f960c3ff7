//! The camera and the people settings, as what the service is connected to.
//!
//! What can't be had is no reason to stay down: a model that is missing is a state of health, and the
//! rest of the service goes on.

use hachi_datagram::SystemClock;
use hachi_realsense::device::StreamFormat;
use hachi_realsense::device::v4l2::V4l2Port;
use hachi_realsense::{RealSense, RealSenseConfig};
use hachi_store::people::{PeopleFile, PeoplePaths};
use tracing::{error, info, warn};

use super::camera::ColorOf;
use super::keeper::Kept;
use super::settings::{CameraConfig, PeopleConfig};
use super::wiring::{Eyes, Watcher};
use crate::cli::people::NetworkArguments;
use crate::config::Settings;
use crate::exit::Failure;
use crate::networks::{self, Chosen};

/// The RealSense of this computer, and the networks, where the settings ask for them.
pub fn of_this_computer(settings: &Settings, clock: SystemClock) -> Option<Eyes> {
    let needed = settings.people.enabled || settings.safety.camera_needed;
    needed.then(|| {
        let CameraConfig {
            serial,
            width,
            height,
            frames_per_second,
        } = settings.camera.clone();
        let format = StreamFormat::new(width, height, frames_per_second);
        let config = RealSenseConfig {
            serial,
            depth: format,
            color: format,
            ..RealSenseConfig::default()
        };
        let pixels = (width * height) as usize;
        let camera = RealSense::new(V4l2Port::new(clock), config);
        let people = settings.people.enabled.then(|| watcher(&settings.people));
        Eyes {
            camera: Box::new(ColorOf::new(camera, pixels, pixels)),
            model_missing: matches!(people, Some(None)),
            people: people.flatten(),
        }
    })
}

/// The networks, and whom they know; `None` where there are no networks, which is said.
fn watcher(config: &PeopleConfig) -> Option<Watcher> {
    let arguments = NetworkArguments {
        models: None,
        detector: config.detector.clone(),
        reid: config.reid.clone(),
    };
    let chosen = networks::chosen(&arguments);
    let opened = chosen.and_then(|chosen| Ok((chosen.open()?, chosen)));
    let (observer, chosen) = match opened {
        Ok(opened) => opened,
        Err(failure) => {
            error!("nobody is looked for: {failure}");
            return None;
        }
    };
    let kept = config.store.as_deref().and_then(|store| {
        let paths = PeoplePaths::with_key(store, config.key.as_deref());
        let kept = kept(&paths, &chosen);
        kept.map_err(|failure| warn!("nobody is known: {failure}"))
            .ok()
    });
    info!("people are looked for");
    Some(Watcher {
        observer,
        kept,
        audience: None,
    })
}

/// The store of people, and the network whose models in it are of use.
fn kept(paths: &PeoplePaths, chosen: &Chosen) -> Result<Kept, Failure> {
    let network = chosen.identity()?;
    let store = PeopleFile::open_or_create(paths).map_err(Failure::said)?;
    Ok(Kept { store, network })
}
