//! g2o files: what is read, mended, refused by line, and written.

mod common;

use common::{Noise, Walk, grid_walk};
use hachi_posegraph::g2o::{Contents, Document, LineProblem, ReadError, read, write};
use hachi_posegraph::{Dense, FactorKind, Graph, Se2, Se3};
use nalgebra::{Matrix3, Matrix6};

fn plane(text: &str) -> Contents<Se2> {
    match read(text.as_bytes()) {
        Ok(Document::Plane(contents)) => contents,
        other => panic!("{other:?}"),
    }
}

fn space(text: &str) -> Contents<Se3> {
    match read(text.as_bytes()) {
        Ok(Document::Space(contents)) => contents,
        other => panic!("{other:?}"),
    }
}

#[track_caller]
fn refused(text: &str) -> (u64, LineProblem) {
    match read(text.as_bytes()) {
        Err(ReadError::Line { line, problem }) => (line, problem),
        other => panic!("{other:?}"),
    }
}

const EDGE: &str = "EDGE_SE2 0 1 1 0 0 1 0 0 1 0 1";

#[test]
fn every_number_lands_in_its_place() {
    let contents = plane("EDGE_SE2 3 8 1 2 0.5 11 12 13 22 23 33\n");
    let edge = &contents.edges[0];
    assert_eq!((edge.from(), edge.to()), (3, 8));
    assert_eq!(edge.kind(), FactorKind::Loop);
    let expected = Matrix3::new(11.0, 12.0, 13.0, 12.0, 22.0, 23.0, 13.0, 23.0, 33.0);
    assert_eq!(*edge.information(), expected);
    assert_eq!(
        (edge.measured().translation.x, edge.measured().translation.y),
        (1.0, 2.0)
    );
    assert!((edge.measured().theta() - 0.5).abs() < 1e-15);

    let upper: Vec<String> = (0..6)
        .flat_map(|r| {
            (r..6).map(move |c| {
                if r == c {
                    "9".to_owned()
                } else {
                    format!("0.{r}{c}")
                }
            })
        })
        .collect();
    let text = format!(
        "VERTEX_SE3:QUAT 7 1 2 3 0 0 0.6 0.8\nEDGE_SE3:QUAT 7 8 4 5 6 0.6 0 0 0.8 {}\n",
        upper.join(" ")
    );
    let contents = space(&text);
    let (key, pose) = contents.vertices[0];
    assert_eq!((key, pose.translation.z), (7, 3.0));
    // A quaternion (0, 0, 0.6, 0.8) turns about z by 2 asin(0.6).
    let angle = 2.0 * 0.6f64.asin();
    assert!((pose.rotation.angle() - angle).abs() < 1e-15);
    assert!((pose.rotation.scaled_axis().z - angle).abs() < 1e-15);
    let edge = &contents.edges[0];
    assert_eq!(edge.kind(), FactorKind::Between);
    assert!((edge.measured().rotation.scaled_axis().x - angle).abs() < 1e-15);
    assert_eq!(
        (edge.information()[(0, 5)], edge.information()[(4, 3)]),
        (0.05, 0.34)
    );
}

#[test]
fn comments_crlf_blank_lines_and_a_missing_last_end_are_fine() {
    let text = format!(
        "# a graph\r\n\r\nVERTEX_SE2 0 0 0 0 # first\r\n\t VERTEX_SE2 1 1 0 0\r\nFIX 0\r\n{EDGE}"
    );
    let contents = plane(&text);
    assert_eq!((contents.vertices.len(), contents.edges.len()), (2, 1));
    assert_eq!(contents.fixed, [0]);
    assert_eq!(contents.repairs, Default::default());
}

#[test]
fn what_is_mended_is_counted() {
    let text = format!(
        "VERTEX_SE2 0 0 0 0\nVERTEX_SE2 0 5 5 5\nVERTEX_XY 3 1 1\nPARAMS_SE2OFFSET 0 0 0 0\n\
         VERTEX_XY 4 1 1\nFIX 77\n{EDGE}\n{EDGE}\nEDGE_SE2 2 1 1 0 0 1 0 0 1 0 1\n\
         EDGE_SE2 20 21 1 0 0 1 1 0 0.999999999 0 1\n"
    );
    let mut contents = plane(&text);
    let graph = contents.graph().unwrap();
    let repairs = &contents.repairs;
    assert_eq!(repairs.duplicate_vertices, 1);
    assert_eq!(repairs.duplicate_edges, 1);
    assert_eq!(repairs.missing_vertices, 4);
    assert_eq!(repairs.unknown_fixed, 1);
    assert_eq!(repairs.loose_parts, 1);
    assert_eq!(repairs.clipped_information, 1);
    let tags: Vec<_> = repairs
        .unknown_tags
        .iter()
        .map(|(t, n)| (t.as_str(), *n))
        .collect();
    assert_eq!(tags, [("PARAMS_SE2OFFSET", 1), ("VERTEX_XY", 2)]);
    // The first of two poses counts, both of two equal edges do.
    assert_eq!(graph.pose(0).unwrap().translation.x, 0.0);
    assert_eq!(graph.factors().count(), 4);
    // Missing poses follow edges, also backwards: 0 -> 1 <- 2.
    assert!((graph.pose(1).unwrap().translation.x - 1.0).abs() < 1e-12);
    assert!(graph.pose(2).unwrap().translation.x.abs() < 1e-12);
    assert!(graph.is_fixed(0) && graph.is_fixed(20));
}

#[test]
fn a_quaternion_that_is_not_of_length_one_is_scaled() {
    let contents = space(
        "VERTEX_SE3:QUAT 0 0 0 0 0 0 3 4\nVERTEX_SE3:QUAT 1 0 0 0 0 0 1e-200 0\nVERTEX_SE3:QUAT 2 0 0 0 0 0 1e200 0\nVERTEX_SE3:QUAT 3 0 0 0 0 0 0.7071068 0.7071068\n",
    );
    assert_eq!(contents.repairs.scaled_quaternions, 3);
    for (_, pose) in &contents.vertices {
        assert!((pose.rotation.norm() - 1.0).abs() < 1e-15);
    }
}

#[test]
fn a_line_that_can_not_be_understood_is_refused_by_its_number() {
    let count = refused(&format!("{EDGE}\nVERTEX_SE2 0 0 0\n"));
    assert!(matches!(
        count,
        (
            2,
            LineProblem::Count {
                expected: 4,
                got: 3,
                ..
            }
        )
    ));
    assert!(matches!(
        refused("\n# x\nVERTEX_SE2 0 0 nan 0\n"),
        (3, LineProblem::NotFinite { .. })
    ));
    assert!(matches!(
        refused("VERTEX_SE2 0 0 1e999 0\n"),
        (1, LineProblem::NotFinite { .. })
    ));
    assert!(matches!(
        refused("VERTEX_SE2 0 0 x 0\n"),
        (1, LineProblem::NotANumber { .. })
    ));
    for key in ["-1", "1.5", "99999999999999999999", "x"] {
        let text = format!("VERTEX_SE2 {key} 0 0 0\n");
        assert!(matches!(refused(&text), (1, LineProblem::NotAKey { .. })));
    }
    assert!(matches!(
        refused("EDGE_SE2 1 1 0 0 0 1 0 0 1 0 1\n"),
        (1, LineProblem::SelfEdge { key: 1 })
    ));
    assert!(matches!(
        refused("VERTEX_SE3:QUAT 0 0 0 0 0 0 0 0\n"),
        (1, LineProblem::NoRotation)
    ));
    assert!(matches!(
        refused("EDGE_SE2 0 1 1 0 0 1 2 0 1 0 1\n"),
        (1, LineProblem::InformationNotPositive { .. })
    ));
    assert!(matches!(
        refused(&format!("{EDGE}\nVERTEX_SE3:QUAT 0 0 0 0 0 0 0 1\n")),
        (
            2,
            LineProblem::OtherSpace {
                began: "EDGE_SE2",
                ..
            }
        )
    ));
    let long = format!("# {}\n", "x".repeat(100_000));
    assert!(matches!(refused(&long), (1, LineProblem::TooLong { .. })));
    for nothing in ["", "\n\n", "# nothing\nFIX 3\n", "\u{0}\u{1}\n"] {
        assert!(matches!(
            read(nothing.as_bytes()),
            Err(ReadError::Empty { .. })
        ));
    }
}

#[test]
fn many_unknown_tags_cost_no_memory() {
    let text: String = (0..10_000).map(|k| format!("TAG_{k} 1 2 3\n")).collect();
    let contents = plane(&(text + EDGE));
    assert_eq!(contents.repairs.unknown_tags.len(), 33);
    assert_eq!(
        contents.repairs.unknown_tags.values().sum::<usize>(),
        10_000
    );
}

#[test]
fn one_pose_alone_is_a_graph() {
    let mut contents = plane("VERTEX_SE2 5 1 2 3\n");
    let mut graph = contents.graph().unwrap();
    let report = hachi_posegraph::batch::optimize(&mut graph, &Default::default()).unwrap();
    assert_eq!((report.final_error, report.iterations), (0.0, 0));
    assert!(report.converged);
}

fn returns<G: Walk + hachi_posegraph::g2o::Writable>(
    seed: u64,
    information: G::Matrix,
    unpack: fn(Document) -> Contents<G>,
) {
    let mut graph: Graph<G> = grid_walk(60, &mut Noise::new(seed), information);
    graph.fix(0).unwrap();
    let mut text = Vec::new();
    write(&graph, &mut text).unwrap();
    let mut contents = unpack(read(&text[..]).unwrap());
    assert_eq!(contents.repairs, Default::default());
    let again = contents.graph().unwrap();
    assert!(again.is_fixed(0) && !again.is_fixed(1));
    assert_eq!(again.len(), graph.len());
    for ((key, pose), (other, read)) in graph.poses().zip(again.poses()) {
        assert_eq!(key, other);
        let off = pose.local(read);
        assert!(off.numbers().iter().all(|v| v.abs() < 1e-9));
    }
    let edges = graph.factors().map(|(_, f)| f);
    let edges = edges.filter(|f| f.kind() != FactorKind::Prior);
    let mut count = 0;
    for (edge, (_, read)) in edges.zip(again.factors()) {
        assert_eq!((edge.from(), edge.to()), (read.from(), read.to()));
        let off = edge.measured().local(read.measured());
        assert!(off.numbers().iter().all(|v| v.abs() < 1e-9));
        assert_eq!(edge.information(), read.information());
        count += 1;
    }
    assert_eq!(count, again.factors().count());
}

#[test]
fn what_is_written_is_read_again() {
    let unpack = |document| match document {
        Document::Plane(contents) => contents,
        Document::Space(_) => panic!("not in the plane"),
    };
    returns::<Se2>(21, Matrix3::identity() * 123.456, unpack);
    let unpack = |document| match document {
        Document::Space(contents) => contents,
        Document::Plane(_) => panic!("not in space"),
    };
    returns::<Se3>(22, Matrix6::identity() * 1e-7, unpack);
}
