//! The incremental solver against the batch solver and against itself.

mod common;

use common::{Noise, grid_walk, step_sizes};
use hachi_posegraph::{
    Error, Factor, FactorId, Graph, Group, Isam2, Isam2Config, Se2, Se3, UpdateOptions, batch,
};
use nalgebra::{DMatrix, Matrix3, Matrix6};

const EVERYTHING: UpdateOptions = UpdateOptions {
    relinearise_threshold: Some(0.0),
    propagate_threshold: Some(0.0),
    unlimited: true,
};

/// One pose at a time, each with its factors to earlier ones.
fn incremental<G: Group>(graph: &Graph<G>, config: Isam2Config) -> (Isam2<G>, Vec<FactorId>) {
    let mut isam = Isam2::new(config);
    let mut ids = Vec::new();
    for (key, &pose) in graph.poses() {
        let factors: Vec<_> = graph
            .factors()
            .map(|(_, f)| *f)
            .filter(|f| f.from().max(f.to()) == key)
            .collect();
        let report = isam.update(&factors, &[(key, pose)], &[]).unwrap();
        ids.extend(report.factor_ids);
    }
    (isam, ids)
}

fn settle<G: Group>(isam: &mut Isam2<G>) {
    for _ in 0..20 {
        isam.update_with(&[], &[], &[], &EVERYTHING).unwrap();
    }
}

fn equals_batch<G: Group>(mut graph: Graph<G>) {
    let (mut isam, _) = incremental(&graph, Isam2Config::default());
    let options = batch::Options {
        relative_tolerance: 1e-15,
        ..batch::Options::default()
    };
    let report = batch::optimize(&mut graph, &options).unwrap();
    assert!(report.converged);
    let before = isam.error();
    assert!(
        before < report.final_error * 1.05 + 1e-9,
        "{before} {report:?}"
    );
    settle(&mut isam);
    let error = isam.error();
    assert!(
        (error - report.final_error).abs() < 1e-9 * error,
        "{error} {report:?}"
    );
    assert!(step_sizes(&isam, &graph) < 1e-6);
}

#[test]
fn it_converges_to_what_the_batch_solver_finds() {
    equals_batch(grid_walk::<Se2>(
        300,
        &mut Noise::new(1),
        Matrix3::identity() * 400.0,
    ));
    equals_batch(grid_walk::<Se3>(
        200,
        &mut Noise::new(2),
        Matrix6::identity() * 400.0,
    ));
}

#[test]
fn marginals_are_blocks_of_the_dense_inverse() {
    let graph = grid_walk::<Se3>(40, &mut Noise::new(3), Matrix6::identity() * 100.0);
    let (mut isam, _) = incremental(&graph, Isam2Config::default());
    settle(&mut isam);
    let dense = common::dense_information(&isam);
    let inverse: DMatrix<f64> = dense.try_inverse().unwrap();
    for key in [0u64, 7, 21, 39] {
        let at = 6 * key as usize;
        let expected = inverse.view((at, at), (6, 6)).into_owned();
        let got = isam.marginal_covariance(key).unwrap();
        let off = (got - Matrix6::from_iterator(expected.iter().copied())).amax();
        assert!(off < 1e-6 * expected.amax(), "{key} {off:e}");
    }
    // Relative: by the chain rule on the dense joint covariance.
    for (a, b) in [(3u64, 30u64), (30, 3), (12, 13)] {
        let pose = |key| isam.estimate(key).unwrap();
        let seen = pose(a).between(&pose(b));
        let mut jacobian = nalgebra::SMatrix::<f64, 6, 12>::zeros();
        jacobian
            .fixed_view_mut::<6, 6>(0, 0)
            .copy_from(&-seen.inverse().adjoint());
        jacobian
            .fixed_view_mut::<6, 6>(0, 6)
            .copy_from(&Matrix6::identity());
        let (i, j) = (6 * a as usize, 6 * b as usize);
        let mut joint = nalgebra::SMatrix::<f64, 12, 12>::zeros();
        for (r, from) in [(0, i), (6, j)] {
            for (c, to) in [(0, i), (6, j)] {
                joint
                    .view_mut((r, c), (6, 6))
                    .copy_from(&inverse.view((from, to), (6, 6)));
            }
        }
        let expected = jacobian * joint * jacobian.transpose();
        let got = isam.relative_covariance(a, b).unwrap();
        assert!((got - expected).amax() < 1e-6 * expected.amax(), "{a} {b}");
    }
}

#[test]
fn a_removed_factor_leaves_no_trace() {
    let graph = grid_walk::<Se3>(120, &mut Noise::new(4), Matrix6::identity() * 400.0);
    let (mut without, _) = incremental(&graph, Isam2Config::default());
    let (mut with, _) = incremental(&graph, Isam2Config::default());
    let wrong = Factor::loop_closure(3, 100, Se3::identity(), Matrix6::identity() * 400.0);
    let id = with.update(&[wrong], &[], &[]).unwrap().factor_ids[0];
    settle(&mut with);
    assert!(with.error() > 10.0 * without.error());
    with.update(&[], &[], &[id]).unwrap();
    assert_eq!(with.factor(id), None);
    settle(&mut with);
    settle(&mut without);
    assert!((with.error() - without.error()).abs() < 1e-9 * without.error());
    for ((_, a), (_, b)) in with.estimates().zip(without.estimates()) {
        assert!(a.local(&b).amax() < 1e-6);
    }
}

#[test]
fn a_pose_that_nothing_holds_is_named_and_the_solver_goes_on() {
    let tight = Matrix3::identity() * 100.0;
    let graph = grid_walk::<Se2>(50, &mut Noise::new(5), tight);
    let (mut isam, ids) = incremental(&graph, Isam2Config::default());
    let before = isam.clone();
    let estimates = |isam: &Isam2<Se2>| isam.estimates().collect::<Vec<_>>();

    // Two poses that hang on each other alone.
    let island = [
        Factor::between(100, 101, Se2::new(1.0, 0.0, 0.0), tight),
        Factor::between(49, 48, Se2::new(1.0, 0.0, 0.0), tight),
    ];
    let poses = [
        (100, Se2::new(0.0, 0.0, 0.0)),
        (101, Se2::new(1.0, 0.0, 0.0)),
    ];
    match isam.update(&island, &poses, &[]) {
        Err(Error::Unconstrained {
            key,
            last_factor: Some(last),
        }) => {
            assert!(key == 100 || key == 101);
            assert_eq!((last.from, last.to), (100, 101));
        }
        other => panic!("{other:?}"),
    }
    // A pose without a factor.
    match isam.update(&[], &[(7_000, Se2::identity())], &[]) {
        Err(Error::Unconstrained {
            key: 7_000,
            last_factor: None,
        }) => {}
        other => panic!("{other:?}"),
    }
    // Without the prior nothing is held.
    assert!(matches!(
        isam.update(&[], &[], &[ids[0]]),
        Err(Error::Unconstrained { .. })
    ));
    // A direction left open.
    let mut open = tight;
    open[(2, 2)] = 0.0;
    let hinge = Factor::between(49, 50, Se2::new(1.0, 0.0, 0.0), open);
    match isam.update(&[hinge], &[(50, Se2::identity())], &[]) {
        Err(Error::Unconstrained { key: 50, .. }) => {}
        other => panic!("{other:?}"),
    }

    assert_eq!(estimates(&isam), estimates(&before));
    let mut other = before;
    let next = Factor::between(49, 50, Se2::new(1.0, 0.0, 0.1), tight);
    let new = [(50, Se2::identity())];
    isam.update(&[next], &new, &[]).unwrap();
    other.update(&[next], &new, &[]).unwrap();
    settle(&mut isam);
    settle(&mut other);
    assert!((isam.error() - other.error()).abs() < 1e-9);
}

#[test]
fn the_same_calls_give_the_same_bits() {
    let graph = grid_walk::<Se3>(100, &mut Noise::new(6), Matrix6::identity() * 100.0);
    let run = || {
        let (isam, _) = incremental(&graph, Isam2Config::default());
        format!("{:?}", isam.estimates().collect::<Vec<_>>())
    };
    assert_eq!(run(), run());
}

#[test]
fn a_work_limit_bounds_each_update_and_nothing_waits_forever() {
    let graph = grid_walk::<Se2>(300, &mut Noise::new(7), Matrix3::identity() * 100.0);
    let config = Isam2Config {
        relinearise_threshold: 0.01,
        work_limit: Some(10),
        ..Isam2Config::default()
    };
    let (mut isam, _) = incremental(&graph, config.clone());
    let (mut free, _) = incremental(
        &graph,
        Isam2Config {
            work_limit: None,
            ..config
        },
    );
    let mut quiet = 0;
    for _ in 0..20_000 {
        let report = isam.update(&[], &[], &[]).unwrap();
        if report.waiting == 0 && report.solved == 0 {
            quiet += 1;
            if quiet > 3 {
                break;
            }
        }
    }
    assert!(quiet > 3, "work is left");
    for _ in 0..50 {
        free.update(&[], &[], &[]).unwrap();
    }
    assert!((isam.error() - free.error()).abs() < 1e-2 * free.error());
}

#[test]
fn bad_calls_are_refused_by_name() {
    let mut isam = Isam2::<Se2>::new(Isam2Config::default());
    let tight = Matrix3::identity();
    let origin = Se2::identity();
    isam.update(&[Factor::prior(0, origin, tight)], &[(0, origin)], &[])
        .unwrap();
    let mut refuse = |factors: &[Factor<Se2>], poses: &[(u64, Se2)]| {
        let error = isam.update(factors, poses, &[]).unwrap_err();
        assert_eq!(isam.len(), 1);
        assert_eq!(isam.factors().count(), 1);
        error
    };
    assert_eq!(refuse(&[], &[(0, origin)]), Error::DuplicateKey { key: 0 });
    assert_eq!(
        refuse(&[], &[(5, origin), (5, origin)]),
        Error::DuplicateKey { key: 5 }
    );
    let to_nowhere = Factor::between(0, 9, origin, tight);
    assert_eq!(refuse(&[to_nowhere], &[]), Error::UnknownKey { key: 9 });
    let nan = Se2::new(f64::NAN, 0.0, 0.0);
    assert_eq!(refuse(&[], &[(1, nan)]), Error::PoseNotFinite { key: 1 });
    let one = [(1, origin)];
    assert!(matches!(
        refuse(&[Factor::between(0, 1, nan, tight)], &one),
        Error::FactorNotFinite { .. }
    ));
    assert!(matches!(
        refuse(&[Factor::between(0, 1, origin, -tight)], &one),
        Error::InformationNotPositive { .. }
    ));
    assert!(matches!(
        refuse(&[Factor::between(0, 0, origin, tight)], &[]),
        Error::SelfEdge { .. }
    ));
    let far = Se2::new(1e300, 0.0, 0.0);
    assert!(matches!(
        refuse(&[Factor::between(0, 1, far, tight * 1e300)], &one),
        Error::Overflow { .. }
    ));
}
