//! `hachi map merge`: two maps of one space become one.

use hachi_slam::merge::{MergeError, merge};
use hachi_slam::{LoopCounts, Map};
use hachi_store::MapFile;
use serde::Serialize;

use crate::cli::map::MapMergeArguments;
use crate::commands::replay::thread_pool;
use crate::config::MappingConfig;
use crate::exit::Failure;
use crate::{output, progress, saved_maps};

/// What became of the two.
#[derive(Debug, Serialize)]
struct Merged {
    nodes: usize,
    /// Nodes that came from the second map.
    added: usize,
    /// Nodes of the second map that were found in the first.
    loops: crate::report::LoopCounts,
    map: std::path::PathBuf,
}

/// Memory for submaps, bytes.
const SUBMAP_MEMORY_BYTES: usize = 64 << 20;

/// Runs the command.
///
/// # Errors
/// A map can't be read or written; they are of different robots; or no place of the second was
/// recognised in the first: then nothing is left behind.
pub fn run(arguments: &MapMergeArguments) -> Result<(), Failure> {
    let (first, saved) = saved_maps::read(&arguments.map)?;
    let (second, other) = saved_maps::read(&arguments.other)?;
    second
        .check_identity(first.identity())
        .map_err(|error| saved_maps::failure(&error))?;
    let out = MapFile::create(&arguments.out, first.identity())
        .map_err(|error| saved_maps::failure(&error))?;
    let damaged = |error| Failure::new(error, "restore the map from a copy, or map anew");
    let mut first = Map::resume(saved, Box::new(first), SUBMAP_MEMORY_BYTES).map_err(damaged)?;
    let mut second = Map::resume(other, Box::new(second), SUBMAP_MEMORY_BYTES).map_err(damaged)?;
    let added = second.nodes().len();
    let bar = progress::bar(Some(added as u64), "nodes");
    let config = MappingConfig::default().slam;
    let merged = thread_pool(None)?.install(|| {
        merge(&mut first, &mut second, Box::new(out), &config, |_| {
            bar.inc(1)
        })
    });
    bar.finish_and_clear();
    let merged = match merged {
        Ok(map) => map,
        Err(error) => {
            remove(&arguments.out);
            let next_step = match error {
                MergeError::Apart => "map the way from one to the other, and merge that too",
                _ => "check both maps with `hachi map info`",
            };
            return Err(Failure::new(error, next_step));
        }
    };
    let report = Merged {
        nodes: merged.nodes().len(),
        added,
        loops: LoopCounts::of(merged.ledger()).into(),
        map: arguments.out.clone(),
    };
    if arguments.json {
        return output::json(&report);
    }
    output::text(&format!(
        "{} nodes, {} of them from {}, held together by {} loops, in {}",
        report.nodes,
        report.added,
        arguments.other.display(),
        report.loops.accepted,
        arguments.out.display(),
    ))
}

/// A map that did not come about, and its log.
fn remove(path: &std::path::Path) {
    let mut log = path.as_os_str().to_owned();
    log.push("-wal");
    for file in [path.as_os_str(), &log] {
        // Not there is as good as gone.
        let _ = std::fs::remove_file(file);
    }
}
