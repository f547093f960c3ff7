//! Any bytes as a map file: opened, read, its submaps fetched, gone on with.
#![no_main]

use hachi_slam::store::MapChange;
use hachi_slam::{Map, SubmapStore};
use hachi_store::{Access, MapFile};

/// Graphs of more nodes than this are not built: what is fuzzed is the reading.
const MOST_NODES: usize = 64;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let folder = tempfile::tempdir().expect("a folder for temporary files");
    let path = folder.path().join("fuzzed.map");
    std::fs::write(&path, bytes).expect("room for a temporary file");
    let Ok(file) = MapFile::open(&path, Access::Read) else {
        return;
    };
    let Ok(saved) = file.load() else {
        return;
    };
    if saved.nodes.len() <= MOST_NODES
        && let Ok(mut map) = Map::resume(saved, Box::new(file), 1 << 20)
    {
        for node in map.nodes().to_vec() {
            let _ = map.submap(node.id);
        }
    }
    // To write is refused or works; an empty change changes nothing.
    if let Ok(mut file) = MapFile::open(&path, Access::Write) {
        let _ = SubmapStore::commit(&mut file, &MapChange::default());
        let _ = file.load();
    }
});
