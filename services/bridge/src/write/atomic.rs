//! Files that appear whole or not at all.
//!
//! What is written goes to a temporary file in the same folder. [`AtomicFile::commit`] brings it to
//! the disk and renames it, so that a reader sees the old file or the new one and a power cut leaves
//! one of them. Dropped without a commit, the temporary file is removed.

use std::fs::{self, File, OpenOptions};
use std::io::{self, BufWriter, Seek, Write};
use std::path::{Path, PathBuf};

use crate::error::WriteError;

/// A file being written.
#[derive(Debug)]
pub struct AtomicFile {
    path: PathBuf,
    temporary: PathBuf,
    /// `None` once committed.
    file: Option<BufWriter<File>>,
}

impl AtomicFile {
    /// Begins a file that will replace `path`.
    ///
    /// # Errors
    /// [`WriteError`] where its folder does not take files.
    pub fn create(path: impl AsRef<Path>) -> Result<Self, WriteError> {
        let path = path.as_ref();
        let problem = |source| WriteError::from_io("create", path, source);
        let name = path
            .file_name()
            .ok_or_else(|| problem(io::ErrorKind::IsADirectory.into()))?;
        // Other writers of the same file, in this process or another, have other names.
        for attempt in 0_u32.. {
            let mut hidden = std::ffi::OsString::from(".");
            hidden.push(name);
            hidden.push(format!(".{}-{attempt}.tmp", std::process::id()));
            let temporary = path.with_file_name(hidden);
            match OpenOptions::new()
                .write(true)
                .create_new(true)
                .open(&temporary)
            {
                Ok(file) => {
                    return Ok(Self {
                        path: path.to_path_buf(),
                        temporary,
                        file: Some(BufWriter::with_capacity(1 << 16, file)),
                    });
                }
                Err(error) if error.kind() == io::ErrorKind::AlreadyExists && attempt < 1000 => {}
                Err(error) => return Err(problem(error)),
            }
        }
        Err(problem(io::ErrorKind::AlreadyExists.into()))
    }

    /// The name it will have.
    pub fn path(&self) -> &Path {
        &self.path
    }

    fn file(&mut self) -> Result<&mut BufWriter<File>, WriteError> {
        // `commit` takes the value itself: nothing is called behind it.
        self.file.as_mut().ok_or_else(|| {
            WriteError::from_io("write", &self.path, io::ErrorKind::NotConnected.into())
        })
    }

    /// Appends bytes.
    ///
    /// # Errors
    /// [`WriteError::NoRoom`] where the disk is full.
    pub fn write(&mut self, bytes: &[u8]) -> Result<(), WriteError> {
        let written = self.file()?.write_all(bytes);
        written.map_err(|source| WriteError::from_io("write", &self.path, source))
    }

    /// Replaces bytes that were written before.
    pub(super) fn write_at(&mut self, at: u64, bytes: &[u8]) -> Result<(), WriteError> {
        let file = self.file()?;
        let written = file
            .seek(io::SeekFrom::Start(at))
            .and_then(|_| file.write_all(bytes));
        written.map_err(|source| WriteError::from_io("write", &self.path, source))
    }

    /// Brings everything to the disk and gives the file its name.
    ///
    /// # Errors
    /// [`WriteError`]; the file under that name is then the one from before.
    pub fn commit(mut self) -> Result<(), WriteError> {
        let problem = |source| WriteError::from_io("write", &self.path, source);
        let Some(mut writer) = self.file.take() else {
            return Ok(());
        };
        let kept = writer
            .flush()
            .and_then(|()| writer.get_ref().sync_all())
            .and_then(|()| fs::rename(&self.temporary, &self.path))
            .map_err(problem);
        // Without its buffer: what did not fit now does not fit on dropping either.
        drop(writer.into_parts());
        if kept.is_err() {
            self.discard();
            return kept;
        }
        // The name itself is on the disk once the folder is. Some file systems refuse to sync
        // folders; the file is complete either way.
        let folder = self
            .path
            .parent()
            .filter(|path| !path.as_os_str().is_empty());
        if let Ok(folder) = File::open(folder.unwrap_or(Path::new("."))) {
            let _ = folder.sync_all();
        }
        Ok(())
    }

    fn discard(&self) {
        // Nothing is left to do if it cannot be removed: it has a hidden name of its own.
        let _ = fs::remove_file(&self.temporary);
    }
}

/// Writes a file whose content is at hand, whole or not at all.
///
/// # Errors
/// As [`AtomicFile::create`] and [`AtomicFile::commit`].
pub fn write_file(path: impl AsRef<Path>, content: &[u8]) -> Result<(), WriteError> {
    let mut file = AtomicFile::create(path)?;
    file.write(content)?;
    file.commit()
}

impl Drop for AtomicFile {
    fn drop(&mut self) {
        if let Some(writer) = self.file.take() {
            drop(writer.into_parts());
            self.discard();
        }
    }
}
