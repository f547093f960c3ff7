//! The files of a run: trajectory, picture, map, report.

use std::path::{Path, PathBuf};

use hachi_bridge::{AtomicFile, write_file};
use hachi_trajectory::{Trajectory, plot::Plot, write};

use crate::exit::Failure;
use crate::map_builder::MapBuilder;
use crate::map_picture;
use crate::report::Report;
use crate::slam_stage::{LEDGER_HEADING, SlamStage};

/// The folder of a run.
#[derive(Debug)]
pub struct Results {
    folder: PathBuf,
}

impl Results {
    /// Makes the folder. Files of an earlier run in it are replaced one by one.
    ///
    /// # Errors
    /// The folder can't be made, or takes no files: better said now than after an hour's work.
    pub fn create(folder: &Path) -> Result<Self, Failure> {
        std::fs::create_dir_all(folder).map_err(|error| Failure::writing(folder, &error))?;
        // Gone again as soon as it is there.
        AtomicFile::create(folder.join("report.json")).map_err(|e| Failure::unwritten(&e))?;
        Ok(Self {
            folder: folder.to_owned(),
        })
    }

    /// As [`create`](Self::create), for results of what is read from `input`.
    ///
    /// # Errors
    /// As there; also where results would land among the scans they are made from.
    pub fn create_for(input: &Path, folder: &Path) -> Result<Self, Failure> {
        let same = |a: &Path, b: &Path| Some(a.canonicalize().ok()? == b.canonicalize().ok()?);
        if same(input, folder) == Some(true) {
            return Err(Failure::new(
                format_args!("--out {} is the recording itself", folder.display()),
                "choose another folder for the results",
            ));
        }
        Self::create(folder)
    }

    /// The folder itself.
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// The path of a file in the folder.
    pub fn path(&self, name: &str) -> PathBuf {
        self.folder.join(name)
    }

    /// A trajectory as TUM.
    ///
    /// # Errors
    /// The file can't be written.
    pub fn trajectory(&self, name: &str, trajectory: &Trajectory) -> Result<(), Failure> {
        let mut lines = Vec::new();
        write::tum(trajectory, &mut lines)
            .map_err(|error| Failure::writing(&self.path(name), &error))?;
        self.write(name, &lines)
    }

    /// The picture of a trajectory, beside a reference if there is one.
    ///
    /// # Errors
    /// The file can't be written.
    pub fn picture(&self, plot: &Plot<'_>) -> Result<(), Failure> {
        match plot.to_svg() {
            Ok(svg) => self.write("trajectory.svg", svg.as_bytes()),
            // An empty run has no picture, and that is no failure of its own.
            Err(error) => {
                tracing::warn!(%error, "no picture");
                Ok(())
            }
        }
    }

    /// The map, and its picture from above with the path through it.
    ///
    /// # Errors
    /// A file can't be written.
    pub fn map(&self, map: &MapBuilder, trajectory: &Trajectory) -> Result<(), Failure> {
        map.write(&self.path("map.ply"))?;
        map_picture::write(&self.path("map.png"), map, trajectory)
    }

    /// The ledger of loops. Odometry alone closes none: then only the heading is written.
    ///
    /// # Errors
    /// The file can't be written.
    pub fn loops(&self, slam: Option<&SlamStage>) -> Result<(), Failure> {
        let table = slam.map_or_else(|| LEDGER_HEADING.to_owned(), SlamStage::ledger_csv);
        self.write("loops.csv", table.as_bytes())
    }

    /// The report.
    ///
    /// # Errors
    /// The file can't be written.
    pub fn report(&self, report: &Report) -> Result<(), Failure> {
        report.write(&self.path("report.json"))
    }

    /// A file with this content, whole or not at all.
    ///
    /// # Errors
    /// It can't be written.
    pub fn write(&self, name: &str, content: &[u8]) -> Result<(), Failure> {
        write_file(self.path(name), content).map_err(|error| Failure::unwritten(&error))
    }
}
