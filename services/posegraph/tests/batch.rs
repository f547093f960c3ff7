//! Batch solvers and initialisation on graphs with known truth.

mod common;

use common::{Noise, Walk, grid_walk, truth};
use hachi_posegraph::batch::{Method, Options, optimize};
use hachi_posegraph::initialise::{
    Rigid, Start, optimize_from_best, rotations_first, spanning_tree,
};
use hachi_posegraph::{Dense, Error, Factor, Graph, Group, Kernel, Se2, Se3};
use nalgebra::{Matrix3, Matrix6, Vector3};

fn both() -> [Options; 2] {
    [Method::GaussNewton, Method::LevenbergMarquardt].map(|method| Options {
        method,
        ..Options::default()
    })
}

fn furthest<G: Group>(graph: &Graph<G>, truth: &[G]) -> f64 {
    let off = graph.poses().map(|(key, pose)| {
        let off = pose.local(&truth[key as usize]);
        off.numbers().iter().fold(0.0, |m: f64, v| m.max(v.abs()))
    });
    off.fold(0.0, f64::max)
}

/// A graph whose measurements are exact, with poses that are not.
fn exact<G: Walk>(seed: u64, information: G::Matrix, disturbance: f64) -> (Graph<G>, Vec<G>) {
    let mut noise = Noise::new(seed);
    let (walk, cells) = truth::<G>(150, &mut noise);
    let mut graph = Graph::new();
    for (k, pose) in walk.iter().enumerate() {
        let mut off = G::Tangent::zeros();
        let numbers = off.numbers_mut().iter_mut();
        numbers.for_each(|v| *v = disturbance * noise.normal());
        let pose = if k == 0 { *pose } else { pose.retract(&off) };
        graph.insert(k as u64, pose).unwrap();
    }
    graph.fix(0).unwrap();
    for k in 1..walk.len() {
        let mut edge = |from: usize| {
            let seen = walk[from].between(&walk[k]);
            let factor = match k - from {
                1 => Factor::between(from as u64, k as u64, seen, information),
                _ => Factor::loop_closure(from as u64, k as u64, seen, information),
            };
            graph.add(factor).unwrap();
        };
        edge(k - 1);
        if let Some(before) = (0..k - 1).find(|&b| cells[b] == cells[k]) {
            edge(before);
        }
    }
    (graph, walk)
}

fn finds_the_truth<G: Walk + Rigid>(information: G::Matrix) {
    for options in both() {
        let (mut graph, walk) = exact::<G>(31, information, 0.05);
        let report = optimize(&mut graph, &options).unwrap();
        assert!(report.converged, "{report:?}");
        assert!(report.final_error < 1e-12, "{report:?}");
        assert!(furthest(&graph, &walk) < 1e-6);
    }
    // From nonsense, by either initialisation.
    let (mut graph, walk) = exact::<G>(32, information, 100.0);
    spanning_tree(&mut graph);
    assert!(furthest(&graph, &walk) < 1e-9);
    let (mut graph, walk) = exact::<G>(32, information, 100.0);
    rotations_first(&mut graph).unwrap();
    assert!(furthest(&graph, &walk) < 1e-6);
}

#[test]
fn exact_measurements_give_back_the_truth() {
    let mut odd = Matrix3::new(5.0, 1.0, 0.2, 1.0, 3.0, -0.1, 0.2, -0.1, 40.0);
    finds_the_truth::<Se2>(odd);
    odd *= 0.1;
    let mut information = Matrix6::identity() * 7.0;
    information.fixed_view_mut::<3, 3>(0, 0).copy_from(&odd);
    information
        .fixed_view_mut::<3, 3>(3, 3)
        .copy_from(&(odd * 30.0));
    information[(0, 4)] = 0.3;
    information[(4, 0)] = 0.3;
    finds_the_truth::<Se3>(information);
}

#[test]
fn a_long_corridor_with_a_bad_compass_needs_rotations_first() {
    // Odometry turns by two degrees a step too much for 200 steps; loops at both ends know better.
    let step = Se2::new(1.0, 0.0, 0.0);
    let drifted = Se2::new(1.0, 0.0, 0.035);
    let weak = Matrix3::identity();
    let mut graph = Graph::new();
    for k in 0..200u64 {
        graph.insert(k, Se2::identity()).unwrap();
    }
    graph.fix(0).unwrap();
    for k in 1..200 {
        graph.add(Factor::between(k - 1, k, drifted, weak)).unwrap();
        if k >= 10 && k % 3 == 0 {
            let ten = (0..10).fold(Se2::identity(), |p, _| p.compose(&step));
            let seen = Factor::loop_closure(k - 10, k, ten, weak * 1e4);
            graph.add(seen).unwrap();
        }
    }
    let mut chosen = graph.clone();
    let (start, report) = optimize_from_best(&mut chosen, true, &Options::default()).unwrap();
    assert_eq!(start, Start::Rotations);
    assert!(report.converged);
    let mut tree = graph.clone();
    spanning_tree(&mut tree);
    let other = optimize(&mut tree, &Options::default()).unwrap();
    assert!(report.final_error <= other.final_error * (1.0 + 1e-9));
}

#[test]
fn good_poses_are_kept_as_a_start() {
    let mut graph = grid_walk::<Se2>(200, &mut Noise::new(34), Matrix3::identity() * 100.0);
    let first = optimize(&mut graph, &Options::default()).unwrap();
    let (start, again) = optimize_from_best(&mut graph, true, &Options::default()).unwrap();
    assert_eq!(start, Start::Given);
    assert!((again.initial_error - first.final_error).abs() < 1e-9 * first.final_error);
    assert!(again.final_error <= first.final_error);
}

#[test]
fn a_wrong_loop_bends_the_map_unless_its_kernel_lets_go() {
    let information = Matrix3::identity() * 400.0;
    let clean = {
        let mut graph = grid_walk::<Se2>(200, &mut Noise::new(35), information);
        optimize(&mut graph, &Options::default()).unwrap();
        graph
    };
    let truth: Vec<Se2> = clean.poses().map(|(_, p)| *p).collect();
    let wrong = Factor::loop_closure(10, 150, Se2::new(30.0, -20.0, 2.0), information);
    let bent_by = |kernel| {
        let mut graph = clean.clone();
        graph.add(wrong.with_kernel(kernel)).unwrap();
        let report = optimize(&mut graph, &Options::default()).unwrap();
        assert!(report.final_error <= report.initial_error);
        furthest(&graph, &truth)
    };
    assert!(bent_by(Kernel::Quadratic) > 1.0);
    for kernel in [
        Kernel::DynamicCovarianceScaling { phi: 7.8 },
        Kernel::GemanMcClure { scale: 2.8 },
    ] {
        assert!(bent_by(kernel) < 1e-3, "{kernel:?}");
    }
}

#[test]
fn a_pose_in_a_loose_part_is_named_with_its_last_factor() {
    let tight = Matrix3::identity();
    let mut graph = Graph::new();
    for key in [4, 9, 7, 2] {
        graph.insert(key, Se2::identity()).unwrap();
    }
    graph.fix(4).unwrap();
    let step = Se2::new(1.0, 0.0, 0.0);
    graph.add(Factor::between(4, 2, step, tight)).unwrap();
    graph.add(Factor::between(7, 9, step, tight)).unwrap();
    for options in both() {
        match optimize(&mut graph.clone(), &options) {
            Err(Error::Unconstrained {
                key: 7,
                last_factor: Some(last),
            }) => assert_eq!((last.from, last.to), (7, 9)),
            other => panic!("{other:?}"),
        }
    }
    assert_eq!(graph.hold_loose_parts(), 1);
    assert!(optimize(&mut graph, &Options::default()).unwrap().converged);
}

#[test]
fn fixed_poses_stay_and_priors_pull() {
    let tight = Matrix3::identity();
    let mut graph = Graph::new();
    for key in 0..3 {
        graph.insert(key, Se2::new(key as f64, 0.5, 0.0)).unwrap();
    }
    graph.fix(0).unwrap();
    graph.fix(2).unwrap();
    let step = Se2::new(1.2, 0.0, 0.0);
    graph.add(Factor::between(0, 1, step, tight)).unwrap();
    graph.add(Factor::between(1, 2, step, tight)).unwrap();
    optimize(&mut graph, &Options::default()).unwrap();
    let at = |graph: &Graph<Se2>, key| graph.pose(key).unwrap().translation;
    assert!((at(&graph, 0) - Vector3::new(0.0, 0.5, 0.0).xy()).norm() < 1e-15);
    assert!((at(&graph, 2) - Vector3::new(2.0, 0.5, 0.0).xy()).norm() < 1e-15);
    // In the middle of two equal misfits.
    assert!((at(&graph, 1) - Vector3::new(1.0, 0.5, 0.0).xy()).norm() < 1e-9);
    graph.release(2).unwrap();
    graph
        .add(Factor::prior(2, Se2::new(3.0, 0.5, 0.0), tight))
        .unwrap();
    optimize(&mut graph, &Options::default()).unwrap();
    // Three equal springs in a row: 2.4 against 3.0, each takes a third of 0.6.
    assert!((at(&graph, 2).x - 2.8).abs() < 1e-6, "{:?}", at(&graph, 2));
}

#[test]
fn numbers_too_large_are_an_error_and_the_graph_stays() {
    let mut graph = Graph::new();
    graph.insert(0, Se2::identity()).unwrap();
    graph.insert(1, Se2::new(1e300, 0.0, 0.0)).unwrap();
    graph.fix(0).unwrap();
    let heavy = Matrix3::identity() * 1e300;
    graph
        .add(Factor::between(0, 1, Se2::identity(), heavy))
        .unwrap();
    assert!(matches!(
        optimize(&mut graph, &Options::default()),
        Err(Error::Overflow { .. })
    ));
    assert_eq!(graph.pose(1).unwrap().translation.x, 1e300);
}

#[test]
fn the_same_graph_gives_the_same_bits() {
    let solved = || {
        let mut graph = grid_walk::<Se3>(150, &mut Noise::new(36), Matrix6::identity() * 100.0);
        optimize(&mut graph, &Options::default()).unwrap();
        format!("{:?}", graph.poses().collect::<Vec<_>>())
    };
    let alone = solved();
    assert_eq!(alone, solved());
    // On another thread beside a busy one: nothing is shared.
    std::thread::scope(|scope| {
        let one = scope.spawn(solved);
        let two = scope.spawn(solved);
        assert_eq!(one.join().unwrap(), alone);
        assert_eq!(two.join().unwrap(), alone);
    });
}
