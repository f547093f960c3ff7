//! `hachi map info`: what is in a map.

use std::collections::BTreeMap;

use hachi_slam::LoopCounts;
use hachi_slam::saved::SavedMap;
use serde::Serialize;

use crate::cli::map::MapInfoArguments;
use crate::exit::Failure;
use crate::{output, saved_maps};

/// What is in a map.
#[derive(Debug, Serialize)]
struct Info {
    platform: String,
    sensor: String,
    nodes: usize,
    sessions: u32,
    /// Parts that hang on each other by nothing.
    pieces: usize,
    edges: usize,
    loops: crate::report::LoopCounts,
    /// Length of the way through all sessions until their last nodes, metres.
    path_length_m: f64,
    /// Extent of the nodes' places, metres: x, y, z.
    size_m: [f64; 3],
    file_bytes: u64,
}

/// Runs the command.
///
/// # Errors
/// The map can't be read.
pub fn run(arguments: &MapInfoArguments) -> Result<(), Failure> {
    let (file, saved) = saved_maps::read(&arguments.map)?;
    let identity = file.identity();
    let info = Info {
        platform: identity.platform.clone(),
        sensor: identity.sensor.clone(),
        nodes: saved.nodes.len(),
        sessions: saved.sessions(),
        pieces: pieces(&saved),
        edges: saved.edges.len(),
        loops: LoopCounts::of(&saved.ledger).into(),
        path_length_m: path_length_m(&saved),
        size_m: size_m(&saved),
        file_bytes: std::fs::metadata(&arguments.map).map_or(0, |about| about.len()),
    };
    if arguments.json {
        return output::json(&info);
    }
    let [x, y, z] = info.size_m;
    output::text(&format!(
        "{} nodes of {} sessions in {} pieces, {:.1} m long, {x:.1} x {y:.1} x {z:.1} m in extent\n\
         {} loops closed of {} candidates\n\
         {:.1} MB",
        info.nodes,
        info.sessions,
        info.pieces,
        info.path_length_m,
        info.loops.accepted,
        info.loops.candidates,
        info.file_bytes as f64 / 1e6,
    ))
}

fn pieces(saved: &SavedMap) -> usize {
    let mut pieces: Vec<_> = saved.nodes.iter().map(|n| n.piece).collect();
    pieces.sort_unstable();
    pieces.dedup();
    pieces.len()
}

fn path_length_m(saved: &SavedMap) -> f64 {
    // Where the map was known already, the robot made no nodes, and counted its way all the same.
    let mut longest: BTreeMap<u32, f64> = BTreeMap::new();
    for node in &saved.nodes {
        let way_m = longest.entry(node.session).or_default();
        *way_m = way_m.max(node.path_m);
    }
    longest.values().sum()
}

fn size_m(saved: &SavedMap) -> [f64; 3] {
    let along = |axis: usize| {
        let all = saved
            .nodes
            .iter()
            .map(|n| n.map_from_node.translation.vector[axis]);
        let low = all.clone().fold(f64::INFINITY, f64::min);
        let high = all.fold(f64::NEG_INFINITY, f64::max);
        (high - low).max(0.0)
    };
    std::array::from_fn(along)
}
