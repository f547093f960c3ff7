//! Legs of a simulated Go1 and B1, followed by the real code: where the ground is, how far they
//! walked, which feet slip, against the simulation's truth.

#![allow(
    clippy::print_stdout,
    reason = "the figures of BENCHMARKS.md, shown with --nocapture"
)]
mod walk;

use hachi_hal::{Pose, Vector3};
use hachi_unitree::contact::ContactSource;
use hachi_unitree::frame::Model;
use hachi_world::Floor;
use hachi_world::legs::{Footfall, ForceSensors, SlipConfig};
use walk::{Moment, Walk, ramps, robot, swaying, there_and_back};

const BOTH: [Model; 2] = [Model::Go1, Model::B1];

fn level_walk(model: Model, sway_degrees: f64) -> Walk {
    let gait = swaying(&robot(model), sway_degrees);
    let floor = Floor::default();
    Walk::new(model, there_and_back(gait, floor.clone()), floor)
}

fn ramp_walk(model: Model, slope_degrees: f64) -> Walk {
    let gait = swaying(&robot(model), 0.0);
    let floor = ramps(slope_degrees);
    Walk::new(model, there_and_back(gait, floor.clone()), floor)
}

/// By how much a footprint's height (m) and tilt (degrees) differ from a plane's, given as the
/// height of the base over it and its normal in the base frame.
fn off(moment: &Moment<'_>, height_m: f64, normal_in_base: &Vector3) -> (f64, f64) {
    let footprint = moment.estimate.footprint.expect("feet have stood");
    (
        (footprint.height_m() - height_m).abs(),
        normal_in_base
            .angle(&footprint.normal_in_base())
            .to_degrees(),
    )
}

/// The floor under the robot as the world has it.
fn floor_plane(moment: &Moment<'_>) -> (f64, Vector3) {
    let footprint_from_base = moment.map_from_footprint.inverse() * moment.map_from_base;
    let normal = footprint_from_base.rotation.inverse() * Vector3::z();
    (footprint_from_base.translation.z, normal)
}

/// The plane through the soles of four feet whose centres are given: height of the base over it,
/// and its normal in the base frame.
fn sole_plane(map_from_base: &Pose, feet: &[Vector3; 4], radius: f64) -> (f64, Vector3) {
    let middle = feet.iter().sum::<Vector3>() / 4.0;
    let mut scatter = nalgebra::Matrix3::zeros();
    for foot in feet {
        let d = foot - middle;
        scatter += d * d.transpose();
    }
    let eigen = scatter.symmetric_eigen();
    let normal: Vector3 = eigen.eigenvectors.column(eigen.eigenvalues.imin()).into();
    let normal = normal * normal.z.signum();
    let height = normal.dot(&(map_from_base.translation.vector - middle)) + radius;
    (height, map_from_base.rotation.inverse() * normal)
}

#[derive(Debug, Default)]
struct Worst {
    height_m: f64,
    tilt_degrees: f64,
    moments: usize,
}

impl Worst {
    fn take(&mut self, (height_m, tilt_degrees): (f64, f64)) {
        self.height_m = self.height_m.max(height_m);
        self.tilt_degrees = self.tilt_degrees.max(tilt_degrees);
        self.moments += 1;
    }
}

#[test]
fn the_footprint_is_right_under_a_body_that_tilts_by_15_degrees() {
    for model in BOTH {
        for footfall in [Footfall::trot(), Footfall::bare_trot()] {
            let mut walk = level_walk(model, 15.0);
            walk.footfall = footfall;
            let (mut worst, mut most_tilt) = (Worst::default(), 0.0_f64);
            walk.run(40.0, |moment| {
                assert!(moment.tick.truth.reached, "at {}", moment.time_s);
                let (height, normal) = floor_plane(moment);
                most_tilt = most_tilt.max(normal.angle(&Vector3::z()).to_degrees());
                // The first steps of the feet's settling are over.
                if moment.time_s > 0.1 {
                    worst.take(off(moment, height, &normal));
                }
            });
            println!("{model:?}, {footfall:?}: {worst:?}, body tilted by up to {most_tilt:.1}");
            assert!(most_tilt > 15.0);
            assert!(
                worst.height_m < 0.01 && worst.tilt_degrees < 1.0,
                "{worst:?}"
            );
        }
    }
}

/// A foot is believed to stand once it carries its load, a little after it touched.
const CARRIES_AFTER_S: f64 = 0.05;

#[test]
fn the_footprint_lies_on_ramps() {
    for model in BOTH {
        for footfall in [Footfall::trot(), Footfall::bare_trot()] {
            let mut walk = ramp_walk(model, 12.0);
            walk.footfall = footfall;
            let radius = walk.robot.dimensions.foot_radius;
            let mut holds = [Vector3::zeros(); 4];
            let (mut on_plane, mut on_ramp) = (Worst::default(), 0);
            let (mut bent, mut all, mut flat_since) = (Worst::default(), 0, 0.0);
            walk.run(50.0, |moment| {
                let truth = &moment.tick.truth;
                for (hold, (foot, standing)) in holds
                    .iter_mut()
                    .zip(truth.feet_in_map.iter().zip(truth.standing))
                {
                    if standing {
                        *hold = *foot;
                    }
                }
                if moment.time_s < 0.1 {
                    return;
                }
                all += 1;
                let (height, normal) = floor_plane(moment);
                let soles = sole_plane(&moment.map_from_base, &holds, radius);
                // Where the floor bends under the robot there is no one plane: the world's mean
                // slope and the last four places of the feet differ.
                let plane = (soles.0 - height).abs() < 5e-4 && soles.1.angle(&normal) < 2e-3;
                if !plane {
                    flat_since = moment.time_s + CARRIES_AFTER_S;
                }
                if plane && moment.time_s > flat_since {
                    on_plane.take(off(moment, height, &normal));
                    let up = moment.map_from_footprint.rotation * Vector3::z();
                    on_ramp += usize::from(up.angle(&Vector3::z()).to_degrees() > 11.0);
                } else if !plane {
                    bent.take(off(moment, soles.0, &soles.1));
                }
            });
            println!(
                "{model:?}, {footfall:?}: {on_plane:?} of {all}, {on_ramp} on a ramp; where it bends {bent:?}"
            );
            assert!(
                on_ramp > 1_000 && on_plane.moments * 2 > all,
                "{on_ramp} {on_plane:?}"
            );
            assert!(
                on_plane.height_m < 0.01 && on_plane.tilt_degrees < 1.0,
                "{on_plane:?}"
            );
            assert!(bent.height_m < 0.01, "{bent:?}");
        }
    }
}

/// Distance walked, final error, and three standard deviations of it as reported, metres.
fn drift(walk: &Walk, seconds: f64) -> (f64, f64, f64) {
    let (mut distance, mut error, mut said) = (0.0, 0.0, 0.0);
    let mut before: Option<Vector3> = None;
    let base_from_start = walk.trajectory.map_from_base(0.0).inverse();
    walk.run(seconds, |moment| {
        let place = moment.map_from_base.translation.vector;
        distance += before.map_or(0.0, |b| (place - b).xy().norm());
        before = Some(place);
        let motion = &moment.estimate.motion;
        let walked = (base_from_start * moment.map_from_base).translation.vector;
        error = (motion.sample.odom_from_base.translation.vector - walked).norm();
        said = 3.0 * motion.position_covariance.trace().sqrt();
    });
    (distance, error, said)
}

#[test]
fn leg_odometry_drifts_by_less_than_two_per_cent_on_flat_ground() {
    for model in BOTH {
        for seed in [1, 2, 3] {
            let mut walk = level_walk(model, 0.0);
            walk.seed = seed;
            let (distance, error, said) = drift(&walk, 52.0);
            println!("{model:?}: {error:.3} m in {distance:.1} m, bound {said:.3} m");
            assert!(
                distance > 20.0 && error < 0.02 * distance,
                "{error} {distance}"
            );
            assert!(error < said, "{error} {said}");
        }
    }
}

#[test]
fn fifty_new_states_a_second_are_enough_for_leg_odometry() {
    let mut walk = level_walk(Model::Go1, 5.0);
    walk.looked_at_every = 10;
    let (distance, error, _) = drift(&walk, 52.0);
    println!("50 Hz: {error:.3} m in {distance:.1} m");
    assert!(error < 0.02 * distance, "{error} {distance}");
}

#[derive(Debug, Default)]
struct SlipTally {
    slips: usize,
    found: usize,
    false_alarms: usize,
    moments: usize,
}

/// Slips that were said of the right foot while they lasted, and moments at which a foot was said
/// to slip that did not, 30 ms after its last slip and more.
fn slips(walk: &Walk, seconds: f64) -> SlipTally {
    let mut tally = SlipTally::default();
    let mut running = [None::<bool>; 4];
    let mut quiet_since = [0.0; 4];
    walk.run(seconds, |moment| {
        for leg in 0..4 {
            let said = moment.estimate.motion.slip.feet[leg];
            if moment.tick.truth.slip_speeds[leg] > 0.0 {
                running[leg] = Some(running[leg].unwrap_or(false) || said);
                quiet_since[leg] = moment.time_s + 0.03;
            } else if let Some(found) = running[leg].take() {
                tally.slips += 1;
                tally.found += usize::from(found);
            } else if moment.time_s > quiet_since[leg] {
                tally.moments += 1;
                tally.false_alarms += usize::from(said);
            }
        }
    });
    tally
}

#[test]
fn slips_are_seen_and_cost_no_accuracy() {
    for model in BOTH {
        for seed in [1, 2] {
            let mut walk = level_walk(model, 3.0);
            walk.seed = seed;
            walk.slips = SlipConfig {
                share: 0.2,
                speed: [0.25, 1.0],
                lasts_s: [0.05, 0.12],
            };
            let tally = slips(&walk, 52.0);
            let (distance, error, said) = drift(&walk, 52.0);
            println!("{model:?}: {tally:?}, {error:.3} m in {distance:.1} m, bound {said:.3}");
            assert!(tally.slips > 50, "{tally:?}");
            assert!(tally.found * 100 >= tally.slips * 95, "{tally:?}");
            assert!(tally.false_alarms * 1_000 < tally.moments, "{tally:?}");
            assert!(error < 0.02 * distance && error < said, "{error} {said}");
        }
    }
}

/// Share of moments at which each source was used after the first three seconds, and share of feet
/// that were said to stand or not as they do.
fn contact(walk: &Walk, seconds: f64) -> ([f64; 3], f64) {
    let (mut sources, mut right, mut all) = ([0.0; 3], 0.0, 0.0);
    walk.run(seconds, |moment| {
        if moment.time_s < 3.0 {
            return;
        }
        let contacts = &moment.estimate.contacts;
        sources[contacts.source as usize] += 1.0;
        all += 1.0;
        for (said, standing) in contacts.feet.iter().zip(moment.tick.truth.standing) {
            right += f64::from(u8::from(said.standing == standing)) / 4.0;
        }
    });
    (sources.map(|n| n / all), right / all)
}

#[test]
fn the_source_of_contact_is_the_best_there_is_and_is_said() {
    let used = |shares: &[f64; 3], source: ContactSource| shares[source as usize];
    // A Go1's sensors are used once their zeros are learnt.
    let (shares, right) = contact(&level_walk(Model::Go1, 5.0), 20.0);
    assert!(used(&shares, ContactSource::FootForce) > 0.99, "{shares:?}");
    assert!(right > 0.95, "{right}");
    // A B1's are not; nor are a Go1's that show the same number whatever happens.
    let (shares, right) = contact(&level_walk(Model::B1, 5.0), 20.0);
    assert_eq!(used(&shares, ContactSource::Torque), 1.0);
    assert!(right > 0.95, "{right}");
    for counts in [0.0, 24.0, 150.0] {
        let mut walk = level_walk(Model::Go1, 5.0);
        walk.sensors.forces = ForceSensors::Constant(counts);
        let (shares, right) = contact(&walk, 20.0);
        assert!(
            used(&shares, ContactSource::Torque) > 0.95,
            "{counts}: {shares:?}"
        );
        assert!(right > 0.93, "{counts}: {right}");
    }
}

#[test]
fn without_forces_and_torques_the_feet_s_places_have_to_do() {
    for model in BOTH {
        let mut walk = level_walk(model, 5.0);
        walk.sensors.forces = ForceSensors::Constant(0.0);
        walk.without_torques = true;
        let (shares, right) = contact(&walk, 20.0);
        assert_eq!(shares[ContactSource::Kinematics as usize], 1.0);
        assert!(right > 0.85, "{model:?}: {right}");
        let (distance, error, _) = drift(&walk, 52.0);
        println!("{model:?} by places alone: {right:.3} right, {error:.3} m in {distance:.1} m");
        assert!(error < 0.02 * distance, "{error} {distance}");
    }
}
