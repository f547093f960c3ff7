//! The folder that `ros2 bag record` makes: `metadata.yaml` and the files it lists, in order.

use std::fs;
use std::path::{Path, PathBuf};

use crate::error::BagError;
use crate::scans::names::sort_naturally;

/// A metadata file lists topics with their quality of service; it stays below some hundred kB.
const METADATA_LIMIT: u64 = 16 << 20;

/// The recording's files in the order of `metadata.yaml`, or of their names where it is missing
/// or lists none.
pub(super) fn files(folder: &Path) -> Result<Vec<PathBuf>, BagError> {
    let io = |doing, path: &Path| {
        let path = path.to_path_buf();
        move |source| BagError::Io {
            doing,
            path,
            source,
        }
    };
    let metadata = folder.join("metadata.yaml");
    if let Ok(about) = fs::metadata(&metadata)
        && about.len() <= METADATA_LIMIT
    {
        let bytes = fs::read(&metadata).map_err(io("read", &metadata))?;
        let listed = relative_file_paths(&String::from_utf8_lossy(&bytes));
        if !listed.is_empty() {
            // Only the name counts: early versions wrote the folder's name in front, and nothing
            // outside the folder is part of the recording.
            let name = |path: &String| Path::new(path).file_name().map(|name| folder.join(name));
            return Ok(listed.iter().filter_map(name).collect());
        }
    }
    let mut found = Vec::new();
    for entry in fs::read_dir(folder).map_err(io("list", folder))? {
        let path = entry.map_err(io("list", folder))?.path();
        let is = |wanted: &str| {
            path.extension()
                .is_some_and(|e| e.eq_ignore_ascii_case(wanted))
        };
        if is("db3") || is("mcap") {
            found.push(path);
        }
    }
    sort_naturally(&mut found);
    if found.is_empty() {
        return Err(BagError::Container {
            path: folder.to_path_buf(),
            problem: "metadata.yaml lists no files and no .db3 or .mcap file is there".into(),
        });
    }
    Ok(found)
}

/// The list under `relative_file_paths:`. That list of plain names is all that is needed of the
/// file, and its writer is always the same program, so no YAML reader is drawn in.
fn relative_file_paths(yaml: &str) -> Vec<String> {
    let mut lines = yaml
        .lines()
        .skip_while(|line| line.trim() != "relative_file_paths:");
    lines.next();
    lines
        .map_while(|line| line.trim_start().strip_prefix("- "))
        .map(|item| item.trim().trim_matches(['"', '\'']).to_owned())
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_list_of_files_is_found_in_the_metadata() {
        let yaml = "rosbag2_bagfile_information:\n  version: 5\n  relative_file_paths:\n    \
                    - walk_0.db3\n    - \"walk/walk_1.db3\"\n  duration:\n    nanoseconds: 7\n";
        assert_eq!(relative_file_paths(yaml), ["walk_0.db3", "walk/walk_1.db3"]);
        assert!(relative_file_paths("version: 5").is_empty());
    }

    #[test]
    fn files_outside_the_folder_are_never_named() {
        let folder = tempfile::tempdir().unwrap();
        fs::write(
            folder.path().join("metadata.yaml"),
            "relative_file_paths:\n- ../../etc/passwd\n- /dev/zero\n- ..\n",
        )
        .unwrap();
        let found = files(folder.path()).unwrap();
        let wanted: Vec<_> = ["passwd", "zero"]
            .map(|name| folder.path().join(name))
            .into();
        assert_eq!(found, wanted);
    }
}
