//! The camera and the people settings, as what the service is connected to.
//!
//! What can't be had is no reason to stay down: a model that is missing is a state of health, and the
//! rest of the service goes on.

use hachi_datagram::SystemClock;
use hachi_people::identify::AppearanceModel;
use hachi_realsense::device::StreamFormat;
use hachi_realsense::device::v4l2::V4l2Port;
use hachi_realsense::{RealSense, RealSenseConfig};
use hachi_store::people::{NetworkIdentity, PeopleFile, PeoplePaths};
use tracing::{error, info, warn};

use super::camera::ColorOf;
use super::settings::{CameraConfig, PeopleConfig};
use super::wiring::{Eyes, Watcher};
use crate::cli::people::NetworkArguments;
use crate::config::Settings;
use crate::networks;

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
    let known = match (&config.store, &chosen.appearance) {
        (Some(store), Some(network)) => {
            let paths = PeoplePaths::beside(store);
            known(&paths, network).unwrap_or_else(|error| {
                warn!(error, "nobody is known");
                Vec::new()
            })
        }
        _ => Vec::new(),
    };
    info!(known = known.len(), "people are looked for");
    Some(Watcher {
        observer,
        known,
        audience: None,
    })
}

/// Everybody in the store whom this network can know.
fn known(paths: &PeoplePaths, network: &std::path::Path) -> Result<Vec<AppearanceModel>, String> {
    let network = NetworkIdentity::of_file(network).map_err(|error| error.to_string())?;
    let Some(store) = PeopleFile::open_if_there(paths).map_err(|error| error.to_string())? else {
        return Ok(Vec::new());
    };
    let listing = store.list().map_err(|error| error.to_string())?;
    let mut known = Vec::new();
    for person in &listing.people {
        match store.model_of(person, &network) {
            Ok(model) => known.push(model),
            // The error names the person; the log does not.
            Err(_) => warn!("somebody in the store is not known: enrolled with another network?"),
        }
    }
    Ok(known)
}
