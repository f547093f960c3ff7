//! Groups and factors: laws, and Jacobians against numeric differentiation.

mod common;

use common::Noise;
use hachi_posegraph::{Dense, Factor, Group, Se2, Se3};
use nalgebra::{Isometry2, Isometry3, Matrix4, SMatrix, UnitQuaternion, Vector3, Vector6};

fn tangent<G: Group>(noise: &mut Noise, angle: f64) -> G::Tangent {
    let mut step = G::Tangent::zeros();
    let translation = if G::DIM == 3 { 2 } else { 3 };
    let numbers = step.numbers_mut();
    for v in &mut numbers[..translation] {
        *v = 3.0 * noise.normal();
    }
    let turn: Vec<f64> = (translation..G::DIM).map(|_| noise.normal()).collect();
    let length = turn.iter().map(|v| v * v).sum::<f64>().sqrt();
    for (v, t) in numbers[translation..].iter_mut().zip(&turn) {
        *v = angle * t / length;
    }
    step
}

/// From next to nothing to half a turn.
const ANGLES: [f64; 11] = [
    0.0, 1e-9, 1e-4, 9e-4, 1.1e-3, 0.0099, 0.0101, 0.3, 1.6, 3.0, 3.13,
];

fn close<D: Dense>(a: &D, b: &D, tolerance: f64) {
    let pairs = a.numbers().iter().zip(b.numbers());
    for (a, b) in pairs {
        assert!((a - b).abs() < tolerance, "{a} {b}");
    }
}

fn laws<G: Group>() {
    let mut noise = Noise::new(11);
    for angle in ANGLES {
        let a = G::identity().retract(&tangent::<G>(&mut noise, 2.0));
        let step = tangent::<G>(&mut noise, angle);
        let b = a.retract(&step);
        close(&a.local(&b), &step, 1e-9);
        close(
            &a.compose(&a.between(&b)).local(&b),
            &G::Tangent::zeros(),
            1e-12,
        );
        close(
            &a.compose(&a.inverse()).local(&G::identity()),
            &G::Tangent::zeros(),
            1e-12,
        );
        // a Exp(d) = Exp(Ad d) a.
        let small = tangent::<G>(&mut noise, 0.1);
        let left = G::identity().retract(&(a.adjoint() * small)).compose(&a);
        close(&left.local(&a.retract(&small)), &G::Tangent::zeros(), 1e-11);
    }
}

#[test]
fn steps_inverses_and_adjoints_keep_the_laws_of_a_group() {
    laws::<Se2>();
    laws::<Se3>();
}

/// Residual Jacobians of a factor by central differences, against the blocks it sums.
fn jacobians<G: Group>(information: G::Matrix) {
    let mut noise = Noise::new(12);
    for angle in ANGLES {
        let a = G::identity().retract(&tangent::<G>(&mut noise, 1.0));
        let measured = G::identity().retract(&tangent::<G>(&mut noise, 2.5));
        let error = tangent::<G>(&mut noise, angle.min(3.1));
        let b = a.compose(&measured).retract(&error);
        let (r, analytic) = measured.local_with_jacobian(&a.between(&b));
        close(&r, &error, 1e-8);
        let factor = Factor::between(0, 1, measured, information);
        let h = 1e-6;
        for k in 0..G::DIM {
            let moved = |by: f64| {
                let mut step = G::Tangent::zeros();
                step.numbers_mut()[k] = by;
                factor.residual(&a, &b.retract(&step))
            };
            let (plus, minus) = (moved(h), moved(-h));
            for i in 0..G::DIM {
                let numeric = (plus.numbers()[i] - minus.numbers()[i]) / (2.0 * h);
                let got = analytic.numbers()[k * G::DIM + i];
                assert!(
                    (numeric - got).abs() < 2e-7 * (1.0 + numeric.abs()),
                    "angle {angle}, row {i}, column {k}: {numeric} {got}"
                );
            }
        }
    }
}

#[test]
fn analytic_jacobians_equal_numeric_ones_up_to_half_a_turn() {
    jacobians::<Se2>(SMatrix::identity());
    jacobians::<Se3>(SMatrix::identity());
}

/// The exponential against the power series of the twist's 4x4 matrix.
#[test]
fn the_exponential_is_the_matrix_exponential() {
    let mut noise = Noise::new(13);
    for angle in ANGLES {
        let twist: Vector6<f64> = tangent::<Se3>(&mut noise, angle);
        let mut matrix = Matrix4::zeros();
        let phi = Vector3::new(twist[3], twist[4], twist[5]);
        matrix
            .fixed_view_mut::<3, 3>(0, 0)
            .copy_from(&phi.cross_matrix());
        matrix
            .fixed_view_mut::<3, 1>(0, 3)
            .copy_from(&twist.fixed_rows::<3>(0));
        let (mut sum, mut term) = (Matrix4::identity(), Matrix4::identity());
        for k in 1..60 {
            term = term * matrix / f64::from(k);
            sum += term;
        }
        let pose = Isometry3::from(Se3::exp(&twist));
        assert!((pose.to_homogeneous() - sum).amax() < 1e-11, "{angle}");

        let flat = Vector3::new(twist[0], twist[1], angle);
        let turned = Vector6::new(flat.x, flat.y, 0.0, 0.0, 0.0, flat.z);
        let pose = Isometry3::from(Se3::exp(&turned));
        let plane = Isometry2::from(Se2::exp(&flat));
        let got = plane.translation.vector;
        assert!((got.x - pose.translation.x).abs() < 1e-12);
        assert!((got.y - pose.translation.y).abs() < 1e-12);
        assert!((plane.rotation.angle() - angle).abs() < 1e-12);
    }
}

/// GTSAM 4.3: `Pose2().localCoordinates(Pose2(1, 0, 0.5))`, `Pose2().retract([1, 0, 0.5])`.
#[test]
fn steps_in_the_plane_are_those_of_gtsam() {
    let local = Se2::identity().local(&Se2::new(1.0, 0.0, 0.5));
    assert!((local - Vector3::new(0.979_079_34, -0.25, 0.5)).amax() < 1e-8);
    let pose = Se2::identity().retract(&Vector3::new(1.0, 0.0, 0.5));
    assert!((pose.translation.x - 0.958_851).abs() < 1e-6);
    assert!((pose.translation.y - 0.244_835).abs() < 1e-6);
}

#[test]
fn a_quaternion_and_its_negative_are_one_rotation() {
    let q = UnitQuaternion::from_euler_angles(0.3, -0.2, 1.0);
    let a = Se3::new(Vector3::zeros(), q);
    let b = Se3::new(
        Vector3::zeros(),
        UnitQuaternion::new_unchecked(-q.into_inner()),
    );
    assert!(a.local(&b).amax() < 1e-12);
}

#[test]
fn a_million_steps_leave_a_rotation_a_rotation() {
    let step = Se3::exp(&Vector6::new(0.1, 0.0, 0.02, 0.01, -0.02, 0.3));
    let turn = Se2::exp(&Vector3::new(0.1, 0.0, 0.3));
    let (mut a, mut b) = (Se3::identity(), Se2::identity());
    for _ in 0..1_000_000 {
        a = a.compose(&step);
        b = b.compose(&turn);
    }
    assert!((a.rotation.norm() - 1.0).abs() < 1e-14);
    assert!((b.rotation.norm() - 1.0).abs() < 1e-14);
}
