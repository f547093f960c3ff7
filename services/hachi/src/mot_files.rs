//! MOTChallenge files as the commands open them.

use std::fs::File;
use std::io::BufReader;
use std::path::Path;

use hachi_people::mot::{self, MotError, MotLine};

use crate::exit::Failure;

/// The boxes in a file.
///
/// # Errors
/// It can't be read, or is no MOTChallenge text.
pub fn read(path: &Path) -> Result<Vec<MotLine>, Failure> {
    let unread = |error: MotError| {
        let next_step = match error {
            MotError::Io(_) => "check the name and that you may read it",
            MotError::TooMany => "split the file",
            _ => "mend that line, or give a file in MOTChallenge format",
        };
        Failure::new(format_args!("{}: {error}", path.display()), next_step)
    };
    let file = File::open(path).map_err(|error| unread(error.into()))?;
    mot::read(BufReader::new(file)).map_err(unread)
}

/// The rate that `seqinfo.ini` states, in the folder or in one of the two above it.
pub fn stated_frames_per_second(near: &Path) -> Option<f64> {
    near.ancestors().take(3).find_map(|folder| {
        let text = std::fs::read_to_string(folder.join("seqinfo.ini")).ok()?;
        let value = text.lines().find_map(|line| {
            let (key, value) = line.split_once('=')?;
            (key.trim() == "frameRate").then(|| value.trim().parse::<f64>())
        });
        value?.ok().filter(|rate| (0.01..=1000.0).contains(rate))
    })
}
