//! People in an office: one who walks ahead of the robot and goes into rooms on the way, one who goes
//! the same way further ahead, and others who come towards it.
//!
//! In: the ring of corridor, the doors that stand open, where the robot's patrol leads and when, who
//! plays. Out: people with their visits. A robot that is driven keeps its patrol's times only roughly;
//! nobody relies on more.

use std::ops::Range;

use super::Side;
use super::ring::Ring;
use super::rooms::FREE_M;
use crate::actor::Actor;
use crate::cast::Cast;
use crate::person::Person;
use crate::trajectory::Trajectory;

/// How far ahead of the robot its person walks, and whoever goes the same way, metres.
const AHEAD_M: f64 = 3.4;
const FURTHER_AHEAD_M: f64 = 7.0;
/// To the left of the corridor's middle: the two of them, and those who pass the robot by, metres.
const ASIDE_M: f64 = 0.45;
const FURTHER_ASIDE_M: f64 = 0.05;
const PASSING_M: f64 = -0.62;
/// The person goes to a door when the robot is so far before it, metres, and comes out again when the
/// robot is this near: from there it can't look at who stands behind the wall yet.
const LEAVES_M: f64 = 8.0;
const RETURNS_M: f64 = 3.4;
/// From where the robot begins to the first door, and from one door to the next, metres.
const FIRST_DOOR_M: f64 = 9.0;
const NEXT_DOOR_M: f64 = 12.0;
/// Where in a room the person waits: beside the door's leaf, metres along the wall from the door's
/// middle and into the room.
const WAITS_AT: [f64; 2] = [0.3, FREE_M - 0.45];
/// Somebody who does not keep up with a robot walks so fast, m/s.
const SPEED_M_S: f64 = 1.3;
/// Who comes out of a room is ahead of the robot again after this, seconds.
const CATCHES_UP_S: f64 = 3.0;
/// People are about for so long, seconds.
const LASTS_S: f64 = 900.0;
/// The robot's way is looked at this often, seconds.
const STEP_S: f64 = 0.5;
/// Who moves less in a step stands, metres.
const STANDS_M: f64 = 0.12;

/// A door that stands open.
#[derive(Debug, Clone, Copy)]
pub(super) struct Door {
    /// The wall that it is in.
    pub side: Side,
    /// Its middle, metres along that.
    pub at: f64,
}

/// The robot's person first, then who goes the same way, then the others.
pub(super) fn people(
    ring: &Ring,
    doors: &[Door],
    robot: &Trajectory,
    cast: &mut Cast,
) -> Vec<Person> {
    let way = Way::of(ring, robot);
    let mut people = vec![ahead(&way, doors, cast), further_ahead(&way, cast)];
    for (from_m, speed_m_s) in [(22.0, 1.0), (34.0, 0.7)] {
        let from_m = from_m + cast.between(-1.0, 1.0);
        people.push(towards(ring, from_m, speed_m_s, cast));
    }
    people
}

/// Somebody who walks ahead of the robot, round corners, waits where it looks into a room, and goes
/// into rooms by open doors until it has come nearer.
fn ahead(way: &Way<'_>, doors: &[Door], cast: &mut Cast) -> Person {
    let mut person = way.actor(cast, AHEAD_M, ASIDE_M);
    let mut step = 0;
    for (door_m, door) in way.doors(doors) {
        let reached = [LEAVES_M, RETURNS_M].map(|before_m| way.reached(door_m - before_m));
        let [Some(leaves), Some(returns)] = reached else {
            break;
        };
        way.keeps_ahead(&mut person, step..leaves, AHEAD_M, ASIDE_M);
        let [middle, inside] = [[0.0, 0.0], WAITS_AT].map(|[u, v]| door.side.place(door.at + u, v));
        let here_m = way.robot_m[leaves] + AHEAD_M;
        let mut path = way.ring.between(here_m, door_m, ASIDE_M);
        path.extend([middle, inside]);
        person
            .walks(&path)
            .turns_to(middle)
            .waits_until(returns as f64 * STEP_S)
            .walks(&[middle, way.ring.place(door_m, ASIDE_M)]);
        let abreast_s = person.now_s() + CATCHES_UP_S;
        step = ((abreast_s / STEP_S).ceil() as usize).min(way.last());
        let path = way
            .ring
            .between(door_m, way.robot_m[step] + AHEAD_M, ASIDE_M);
        person.walks_until(step as f64 * STEP_S, &path);
    }
    way.keeps_ahead(&mut person, step..way.last(), AHEAD_M, ASIDE_M);
    person.done()
}

/// Somebody who goes where the robot goes, before it and its person.
fn further_ahead(way: &Way<'_>, cast: &mut Cast) -> Person {
    let mut person = way.actor(cast, FURTHER_AHEAD_M, FURTHER_ASIDE_M);
    way.keeps_ahead(&mut person, 0..way.last(), FURTHER_AHEAD_M, FURTHER_ASIDE_M);
    person.done()
}

/// Somebody who walks round the other way, again and again.
fn towards(ring: &Ring, from_m: f64, speed_m_s: f64, cast: &mut Cast) -> Person {
    let far_m = LASTS_S * speed_m_s;
    let mut path = ring.between(from_m - far_m, from_m, PASSING_M);
    path.reverse();
    let mut person = Actor::new(cast.person(), path[0], speed_m_s);
    person.walks(&path[1..]);
    person.done()
}

/// How far the robot has come along the corridor, step by step.
struct Way<'a> {
    ring: &'a Ring,
    robot_m: Vec<f64>,
}

impl<'a> Way<'a> {
    fn of(ring: &'a Ring, robot: &Trajectory) -> Self {
        let nearest = |step: usize| {
            let at = robot.map_from_base(step as f64 * STEP_S).translation;
            ring.nearest([at.x, at.y])
        };
        let round_m = ring.round_m();
        let mut robot_m = vec![nearest(0)];
        let mut way_m = robot_m[0];
        for step in 1..=(LASTS_S / STEP_S) as usize {
            let gain = (nearest(step) - way_m).rem_euclid(round_m);
            // Off the ring, in a room, it stays. A step back is nearly a whole round on.
            if gain < round_m / 2.0 {
                way_m += gain;
            }
            robot_m.push(way_m);
        }
        Self { ring, robot_m }
    }

    fn last(&self) -> usize {
        self.robot_m.len() - 1
    }

    /// The step at which the robot has come so far, if it does.
    fn reached(&self, way_m: f64) -> Option<usize> {
        let step = self.robot_m.partition_point(|robot_m| *robot_m < way_m);
        (step <= self.last()).then_some(step)
    }

    /// Doors that the robot passes, far enough from each other, and how far along its way.
    fn doors(&self, doors: &[Door]) -> Vec<(f64, Door)> {
        let along = |door: &Door| (self.ring.nearest(door.side.place(door.at, 0.0)), *door);
        let mut round: Vec<_> = doors.iter().map(along).collect();
        round.sort_by(|a, b| a.0.total_cmp(&b.0));
        let (begin_m, end_m) = (self.robot_m[0], self.robot_m[self.last()]);
        let mut next_m = begin_m + FIRST_DOOR_M;
        let mut chosen = Vec::new();
        let mut offset_m = 0.0;
        while offset_m < end_m {
            for (way_m, door) in &round {
                let way_m = way_m + offset_m;
                if way_m >= next_m {
                    chosen.push((way_m, *door));
                    next_m = way_m + NEXT_DOOR_M;
                }
            }
            offset_m += self.ring.round_m();
        }
        chosen
    }

    /// Somebody who is ahead of the robot at first, and looks where it goes.
    fn actor(&self, cast: &mut Cast, ahead_m: f64, aside_m: f64) -> Actor {
        let at = |ahead_m: f64| self.ring.place(self.robot_m[0] + ahead_m, aside_m);
        let mut actor = Actor::new(cast.person(), at(ahead_m), SPEED_M_S);
        actor.turns_to(at(ahead_m + 1.0));
        actor
    }

    /// Walks when the robot walks and stands when it stands.
    fn keeps_ahead(&self, actor: &mut Actor, steps: Range<usize>, ahead_m: f64, aside_m: f64) {
        let way_m = |step: usize| self.robot_m[step] + ahead_m;
        let walks = |step: usize| way_m(step + 1) - way_m(step) > STANDS_M;
        let mut begin = steps.start;
        while begin < steps.end {
            let walking = walks(begin);
            let end = (begin..steps.end)
                .find(|&step| walks(step) != walking)
                .unwrap_or(steps.end);
            let ends_s = end as f64 * STEP_S;
            match walking {
                true => {
                    let path = self.ring.between(way_m(begin), way_m(end), aside_m);
                    actor.walks_until(ends_s, &path)
                }
                false => actor.waits_until(ends_s),
            };
            begin = end;
        }
    }
}

#[cfg(test)]
mod tests {
    use hachi_hal::Vector3;

    use crate::Preset;
    use crate::preset::World;

    #[test]
    fn people_walk_in_nothing_but_air_and_beside_each_other_and_the_robot() {
        for seed in 1..9 {
            let World {
                scene, trajectory, ..
            } = Preset::Office.world(seed);
            let people = Preset::Office.people(seed);
            assert_eq!(people.len(), 4);
            for step in 0..480 {
                let time_s = 0.25 * f64::from(step);
                let robot = trajectory.map_from_base(time_s).translation.vector;
                let mut others = vec![robot.xy()];
                for person in &people {
                    let here = person.presence(time_s, scene.floor());
                    let here = here.expect("always there").map_from_person;
                    let at = here.translation.vector + Vector3::z() * 1.2;
                    // Nothing but air around the chest.
                    for (x, y) in [(0.2, 0.0), (-0.2, 0.0), (0.0, 0.2), (0.0, -0.2)] {
                        let free = scene.distance(at, Vector3::new(x, y, 0.0).normalize(), 0.2);
                        assert_eq!(free, None, "{seed}: {} at {time_s} s", person.id);
                    }
                    for other in &others {
                        let off = (at.xy() - other).norm();
                        assert!(off > 0.4, "{seed}: {} at {time_s} s: {off}", person.id);
                    }
                    others.push(at.xy());
                }
            }
        }
    }

    /// What a new user sees in half a minute: the robot's person is gone for a while, with somebody
    /// else ahead, and is back.
    #[test]
    fn the_robots_person_goes_out_of_sight_and_comes_back() {
        for seed in 1..4 {
            let World {
                scene, trajectory, ..
            } = Preset::Office.world(seed);
            let people = Preset::Office.people(seed);
            let seen = |id: usize, time_s: f64| {
                let eye = trajectory.map_from_base(time_s).translation.vector;
                let here = people[id].presence(time_s, scene.floor()).unwrap();
                let chest = here.map_from_person.translation.vector + Vector3::z() * 1.2;
                let to = chest - eye;
                scene.distance(eye, to.normalize(), to.norm()).is_none()
            };
            let story: Vec<bool> = (0..120)
                .map(|step| seen(0, 0.25 * f64::from(step)))
                .collect();
            let gone = story.iter().position(|seen| !seen);
            let gone = gone.unwrap_or_else(|| panic!("{seed}: never gone"));
            let away = story[gone..].iter().position(|seen| *seen);
            let away = away.unwrap_or_else(|| panic!("{seed}: never back"));
            // Known for long enough before, and away for longer than a post hides somebody.
            assert!(gone >= 20 && away >= 12, "{seed}: {gone}, {away}");
            let other = (gone..gone + away).filter(|step| seen(1, 0.25 * *step as f64));
            assert!(other.count() >= away / 2, "{seed}");
        }
    }
}
