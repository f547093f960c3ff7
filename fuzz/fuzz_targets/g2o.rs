//! Any bytes as a g2o file: read, made a graph, written and read again.
#![no_main]

use hachi_posegraph::g2o::{Contents, Document, Writable, read, write};
use hachi_posegraph::initialise::{Rigid, spanning_tree};
use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| match read(bytes) {
    Ok(Document::Plane(contents)) => again(contents),
    Ok(Document::Space(contents)) => again(contents),
    Err(_) => {}
});

fn again<G: Rigid + Writable>(mut contents: Contents<G>) {
    let Ok(mut graph) = contents.graph() else {
        return;
    };
    assert_eq!(graph.factors().count(), contents.edges.len());
    spanning_tree(&mut graph);
    if graph.poses().any(|(_, pose)| !pose.is_finite()) {
        return; // edges so long that poses leave what floating point holds
    }
    let mut text = Vec::new();
    write(&graph, &mut text).expect("a Vec takes everything");
    read(&text[..]).expect("what was written can be read");
}
