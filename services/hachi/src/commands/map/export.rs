//! `hachi map export`: cloud, occupancy grid, path and ledger of a map.

use hachi_hal::Stamp;
use hachi_slam::grid::{GridConfig, grid_of};
use hachi_slam::{Map, Node};
use hachi_trajectory::Trajectory;
use serde::Serialize;

use crate::cli::map::MapExportArguments;
use crate::exit::Failure;
use crate::map_builder::MapBuilder;
use crate::results::Results;
use crate::slam_stage::{add_submaps, ledger_table};
use crate::{output, saved_maps};

/// What was written.
#[derive(Debug, Serialize)]
struct Exported {
    nodes: usize,
    points: usize,
    grid_width: usize,
    grid_height: usize,
    grid_resolution_m: f64,
    folder: std::path::PathBuf,
}

/// Memory for submaps while they are written: each is read once.
const SUBMAP_MEMORY_BYTES: usize = 8 << 20;

/// Runs the command.
///
/// # Errors
/// The map can't be read, or a file can't be written.
pub fn run(arguments: &MapExportArguments) -> Result<(), Failure> {
    let (file, saved) = saved_maps::read(&arguments.map)?;
    let mut map = Map::resume(saved, Box::new(file), SUBMAP_MEMORY_BYTES)
        .map_err(|error| Failure::new(error, "restore the map from a copy, or map anew"))?;
    let results = Results::create(&arguments.out)?;
    let nodes: Vec<Node> = map.nodes().to_vec();

    let mut cloud = MapBuilder::new(arguments.voxel_m, results.folder());
    add_submaps(&mut map, &mut cloud)?;
    let config = GridConfig {
        resolution_m: arguments.resolution_m,
        lowest_m: arguments.lowest_m as f32,
        highest_m: arguments.highest_m as f32,
    };
    let grid = grid_of(&nodes, &config, |node| map.submap(node.id).ok());
    let path = path(&nodes);

    cloud.write(&results.path("map.ply"))?;
    results.write("grid.pgm", &grid.pgm())?;
    results.write("grid.yaml", grid.yaml("grid.pgm").as_bytes())?;
    results.trajectory("nodes.tum", &path)?;
    results.write("loops.csv", ledger_table(&map, |_| None).as_bytes())?;

    let (grid_width, grid_height) = grid.size();
    let exported = Exported {
        nodes: nodes.len(),
        points: cloud.len(),
        grid_width,
        grid_height,
        grid_resolution_m: grid.resolution_m(),
        folder: arguments.out.clone(),
    };
    if arguments.json {
        return output::json(&exported);
    }
    output::text(&format!(
        "{} points of {} nodes, and a grid of {} x {} squares of {} m, in {}",
        exported.points,
        exported.nodes,
        exported.grid_width,
        exported.grid_height,
        exported.grid_resolution_m,
        results.path("").display(),
    ))
}

/// The nodes in order of time; of two at the same time the earlier session's.
fn path(nodes: &[Node]) -> Trajectory {
    let samples: Vec<(Stamp, hachi_hal::Pose)> =
        nodes.iter().map(|n| (n.stamp, n.map_from_node)).collect();
    Trajectory::from_samples(samples).0
}
