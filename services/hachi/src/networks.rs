//! Which networks people are found and told apart with.
//!
//! Named on the command line, or taken from a folder of models: `--models`, else `HACHI_MODELS`,
//! else `models` in `HACHI_DATA`. In a folder the first model of each kind is taken, published ones
//! (`hachi_inference::known`) before others; one whose manifest can't be read is left out and said
//! in the log.

use std::path::{Path, PathBuf};

use hachi_inference::load::manifest_of;
use hachi_inference::{Decoder, LoadError, LoadOptions, Loaded, ManifestError, Own, known, load};
use hachi_people::appearance::Appearance;
use hachi_people::detect::{Detector, Wanted};
use hachi_people::observe::Observer;
use hachi_store::people::NetworkIdentity;

use crate::cli::people::NetworkArguments;
use crate::exit::Failure;

/// The files of the networks.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Chosen {
    /// Finds people.
    pub detector: PathBuf,
    /// Tells them apart.
    pub appearance: Option<PathBuf>,
}

/// A detector of people and, where there is one, a network that tells them apart.
///
/// # Errors
/// There is no detector, or a model can't be used.
pub fn observer(arguments: &NetworkArguments) -> Result<Observer, Failure> {
    chosen(arguments)?.open()
}

/// Which files the networks are in.
///
/// # Errors
/// There is no detector, or the folder can't be read.
pub fn chosen(arguments: &NetworkArguments) -> Result<Chosen, Failure> {
    let folder = folder(arguments);
    let is_detector = |decoder: &Decoder| !matches!(decoder, Decoder::Appearance { .. });
    let detector = find(
        arguments.detector.as_deref(),
        folder.as_deref(),
        is_detector,
    )?;
    let tells_apart = |decoder: &Decoder| matches!(decoder, Decoder::Appearance { .. });
    Ok(Chosen {
        detector: detector.ok_or_else(|| missing("detector", folder.as_deref()))?,
        appearance: find(arguments.reid.as_deref(), folder.as_deref(), tells_apart)?,
    })
}

impl Chosen {
    /// Loads them.
    ///
    /// # Errors
    /// A model can't be used.
    pub fn open(&self) -> Result<Observer, Failure> {
        let detector = Detector::new(open(&self.detector)?, Wanted::People)
            .map_err(|error| Failure::new(error, "give a detector with --detector"))?;
        let appearance = self.appearance.as_deref().map(|path| {
            Appearance::new(open(path)?).map_err(|error| {
                Failure::new(error, "give a re-identification network with --reid")
            })
        });
        Ok(Observer::new(detector, appearance.transpose()?))
    }

    /// Which network tells people apart, by its content.
    ///
    /// # Errors
    /// There is none, or it can't be read.
    pub fn identity(&self) -> Result<NetworkIdentity, Failure> {
        let path = self.appearance.as_deref().ok_or_else(no_appearance)?;
        if let Some(own) = Own::from_name(path) {
            return Ok(NetworkIdentity::of_bytes(own.name(), own.bytes()));
        }
        NetworkIdentity::of_file(path).map_err(|error| {
            Failure::new(
                format_args!("{} can't be read: {error}", path.display()),
                "check the name and that you may read it",
            )
        })
    }
}

/// There is no network that tells people apart.
pub fn no_appearance() -> Failure {
    Failure::new(
        "there is no network that tells people apart",
        "name one with --reid",
    )
}

fn folder(arguments: &NetworkArguments) -> Option<PathBuf> {
    let named = |variable: &str| std::env::var_os(variable).map(PathBuf::from);
    arguments
        .models
        .clone()
        .or_else(|| named("HACHI_MODELS"))
        .or_else(|| named("HACHI_DATA").map(|data| data.join("models")))
}

/// The model that was named, or the first in the folder whose answers are of the right kind.
fn find(
    named: Option<&Path>,
    folder: Option<&Path>,
    right: impl Fn(&Decoder) -> bool,
) -> Result<Option<PathBuf>, Failure> {
    if let Some(path) = named {
        return Ok(Some(path.to_owned()));
    }
    let Some(folder) = folder else {
        return Ok(None);
    };
    let unread = |error: std::io::Error| {
        Failure::new(
            format_args!("{} can't be read: {error}", folder.display()),
            "give a folder of models with --models",
        )
    };
    let mut models = Vec::new();
    for entry in std::fs::read_dir(folder).map_err(unread)? {
        let path = entry.map_err(unread)?.path();
        if path
            .extension()
            .is_some_and(|extension| extension == "onnx")
        {
            models.push(path);
        }
    }
    let order = |path: &PathBuf| {
        let stem = path.file_stem().and_then(|stem| stem.to_str());
        let known = known::KNOWN
            .iter()
            .position(|(name, _)| Some(*name) == stem);
        known.unwrap_or(known::KNOWN.len())
    };
    models.sort_by(|a, b| order(a).cmp(&order(b)).then(a.cmp(b)));
    let fits = |path: &PathBuf| match manifest_of(path, &LoadOptions::default()) {
        Ok(manifest) => right(&manifest.decoder),
        Err(LoadError::NoManifest { .. }) => false,
        Err(error) => {
            tracing::warn!(%error, "model left out");
            false
        }
    };
    Ok(models.into_iter().find(fits))
}

fn missing(what: &str, folder: Option<&Path>) -> Failure {
    match folder {
        Some(folder) => Failure::new(
            format_args!("{} holds no {what} with a manifest", folder.display()),
            format_args!("put one there, or name it with --{what}"),
        ),
        None => Failure::new(
            format_args!("there is no {what}"),
            "name a folder of ONNX models with --models or HACHI_MODELS",
        ),
    }
}

fn open(path: &Path) -> Result<Loaded, Failure> {
    load(path, &LoadOptions::default()).map_err(|error| unloaded(&error))
}

/// A model that can't be used, with what to do.
pub fn unloaded(error: &LoadError) -> Failure {
    let next_step = match error {
        LoadError::Io { .. } => "check the name and that you may read it",
        LoadError::NoManifest { .. } => {
            "describe the model in a file of that name (docs/models.md)"
        }
        LoadError::Manifest {
            source: ManifestError::Mismatch { .. },
            ..
        } => "mend the manifest, or give the model it describes",
        LoadError::Manifest { .. } => "mend the manifest (docs/models.md)",
        LoadError::Unavailable { .. } => "set ORT_DYLIB_PATH, or leave the back end to the program",
        _ => "give a model in ONNX format",
    };
    Failure::new(error, next_step)
}
