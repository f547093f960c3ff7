//! Saved maps as the commands open them.
//!
//! In: paths, and the platform that the user named. Out: map files with what is in them; failures say
//! what to do. Elsewhere: the file itself (`hachi-store`).

use std::path::Path;

use hachi_slam::saved::SavedMap;
use hachi_store::{Access, Identity, MapError, MapFile};

use crate::exit::Failure;

/// A failure of a map file: its message ends with what to do.
pub fn failure(error: &MapError) -> Failure {
    Failure::said(error)
}

/// Who makes or uses a map: recordings do not name their sensor, so any fits.
pub fn identity(platform: Option<&str>) -> Identity {
    Identity {
        platform: platform.unwrap_or_default().to_owned(),
        sensor: String::new(),
    }
}

/// Opens a map to read it.
///
/// # Errors
/// It is not there, no map, or damaged.
pub fn read(path: &Path) -> Result<(MapFile, SavedMap), Failure> {
    let file = MapFile::open(path, Access::Read).map_err(|e| failure(&e))?;
    let saved = file.load().map_err(|e| failure(&e))?;
    Ok((file, saved))
}

/// Opens a map to go on with it, or makes it.
///
/// # Errors
/// It is no map, damaged, in use, of another robot, or can't be written.
pub fn go_on(path: &Path, platform: Option<&str>) -> Result<(MapFile, SavedMap), Failure> {
    let file =
        MapFile::open_or_create(path, &identity(platform)).map_err(|error| failure(&error))?;
    let saved = file.load().map_err(|error| failure(&error))?;
    Ok((file, saved))
}
