//! People in the corridor of an office: one who walks ahead of the robot, and others who come towards
//! it.
//!
//! In: the ring of corridor, where the robot's patrol leads and when, who plays. Out: people with their
//! visits. A robot that is driven keeps its patrol's times only roughly; nobody relies on more.

use super::ring::Ring;
use crate::cast::Cast;
use crate::person::{Person, Visit};
use crate::trajectory::Trajectory;

/// How far ahead of the robot its person walks, metres.
const AHEAD_M: f64 = 3.4;
/// From the middle of the corridor: the robot's person, and those who pass the robot by, metres.
const ASIDE_M: f64 = 0.45;
const PASSING_M: f64 = -0.62;
/// People are about for so long, seconds.
const LASTS_S: f64 = 900.0;
/// The robot's way is looked at this often, seconds.
const STEP_S: f64 = 0.5;
/// Who stands has come this way last, metres.
const TURN_M: f64 = 1e-3;
/// Who moves less in a step stands, metres.
const STANDS_M: f64 = 0.12;

/// The robot's person first, then the others.
pub(super) fn people(ring: &Ring, robot: &Trajectory, cast: &mut Cast) -> Vec<Person> {
    let mut people = vec![ahead(ring, robot, cast)];
    for (from_m, speed_m_s) in [(22.0, 1.0), (34.0, 0.7), (52.0, 0.9)] {
        let from_m = from_m + cast.between(-1.0, 1.0);
        people.push(towards(ring, from_m, speed_m_s, cast));
    }
    people
}

/// Somebody who walks ahead of the robot, round corners, and waits where it looks into a room.
fn ahead(ring: &Ring, robot: &Trajectory, cast: &mut Cast) -> Person {
    let (mut person, outfit) = cast.person();
    let mut progress = Progress::at(ring, robot);
    let steps = (LASTS_S / STEP_S) as usize;
    let way: Vec<f64> = (0..=steps)
        .map(|step| progress.advance(ring, robot, step as f64 * STEP_S) + AHEAD_M)
        .collect();
    let walks = |step: usize| way[step + 1] - way[step] > STANDS_M;
    let mut begin = 0;
    while begin < steps {
        let walking = walks(begin);
        let end = (begin..steps)
            .find(|&step| walks(step) != walking)
            .unwrap_or(steps);
        // A little longer than to the next one: nobody is away in between.
        let lasts_s = (end - begin) as f64 * STEP_S + 1e-6;
        let path = match walking {
            true => ring.between(way[begin], way[end], ASIDE_M),
            // The last step's way, so that they look where they went.
            false => ring.between(way[begin] - TURN_M, way[begin], ASIDE_M),
        };
        // Corners are cut on the inside.
        let legs = path.iter().zip(path.iter().skip(1));
        let length_m: f64 = legs.map(|(a, b)| (b[0] - a[0]).hypot(b[1] - a[1])).sum();
        person.visits.push(Visit {
            begins_s: begin as f64 * STEP_S,
            path,
            speed_m_s: if walking { length_m / lasts_s } else { 1.0 },
            stays_s: if walking { 0.0 } else { lasts_s },
            outfit,
        });
        begin = end;
    }
    person
}

/// Somebody who walks round the other way, again and again.
fn towards(ring: &Ring, from_m: f64, speed_m_s: f64, cast: &mut Cast) -> Person {
    let (mut person, outfit) = cast.person();
    let far_m = LASTS_S * speed_m_s;
    let mut path = ring.between(from_m - far_m, from_m, PASSING_M);
    path.reverse();
    person.visits.push(Visit {
        begins_s: 0.0,
        path,
        speed_m_s,
        stays_s: 0.0,
        outfit,
    });
    person
}

/// How far the robot has come along the ring.
struct Progress {
    way_m: f64,
}

impl Progress {
    fn at(ring: &Ring, robot: &Trajectory) -> Self {
        let at = robot.map_from_base(0.0).translation.vector;
        Self {
            way_m: ring.nearest([at.x, at.y]),
        }
    }

    /// The same or further on, at a later time. Off the ring, in a room, it stays.
    fn advance(&mut self, ring: &Ring, robot: &Trajectory, time_s: f64) -> f64 {
        let at = robot.map_from_base(time_s).translation.vector;
        let round_m = ring.round_m();
        let gain = (ring.nearest([at.x, at.y]) - self.way_m).rem_euclid(round_m);
        // A step back is nearly a whole round on.
        if gain < round_m / 2.0 {
            self.way_m += gain;
        }
        self.way_m
    }
}

#[cfg(test)]
mod tests {
    use crate::Preset;
    use crate::preset::World;

    #[test]
    fn people_stay_in_the_corridor_and_one_keeps_ahead_of_the_robot() {
        for seed in 1..4 {
            let World {
                scene, trajectory, ..
            } = Preset::Office.world(seed);
            let people = Preset::Office.people(seed);
            assert_eq!(people.len(), 4);
            for step in 0..240 {
                let time_s = 0.5 * f64::from(step);
                let robot = trajectory.map_from_base(time_s).translation.vector;
                for person in &people {
                    let here = person.presence(time_s, scene.floor());
                    let here = here.expect("always there").map_from_person;
                    let at = here.translation.vector + hachi_hal::Vector3::z() * 1.2;
                    // Nothing but air around the chest.
                    for (x, y) in [(0.2, 0.0), (-0.2, 0.0), (0.0, 0.2), (0.0, -0.2)] {
                        let side = hachi_hal::Vector3::new(x, y, 0.0);
                        let free = scene.distance(at, side.normalize(), 0.2);
                        assert_eq!(free, None, "{} at {time_s} s", person.id);
                    }
                    let off = (at - robot).xy().norm();
                    assert!(off > 0.5, "{} at {time_s} s: {off}", person.id);
                }
            }
        }
    }
}
