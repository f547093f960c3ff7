//! What happens in each scene.
//!
//! The camera sees what lies within 45 degrees to either side. [`LEFT`], [`RIGHT`] and [`BEHIND`] are
//! out of its sight, wherever the robot looks.

use super::Script;
use super::hall::Robot;
use crate::actor::Actor;
use crate::camera::Light;
use crate::cast::Cast;
use crate::person::{Outfit, Person};

/// The identity of the person that the user picks: the first who is cast.
pub(super) const TARGET: u32 = 1;

/// Out of sight, to the left of the robot.
const LEFT: [f64; 2] = [-3.5, 6.2];
/// To its right.
const RIGHT: [f64; 2] = [-3.5, -6.2];
/// Behind the partition at the far end on the left.
const BEHIND: [f64; 2] = [11.0, 5.0];
/// The way to there leads round the partition.
const ROUND: [f64; 2] = [10.4, 1.6];
/// The last places in sight on the ways out.
const TO_LEFT: [f64; 2] = [3.2, 3.0];
const TO_RIGHT: [f64; 2] = [3.2, -3.0];

/// A scene on paper.
pub(super) struct Play {
    pub people: Vec<Person>,
    pub light: Light,
    pub robot: Robot,
    pub lasts_s: f64,
}

impl Play {
    fn new(people: Vec<Person>, lasts_s: f64) -> Self {
        Self {
            people,
            light: Light::default(),
            robot: Robot::Stands,
            lasts_s,
        }
    }
}

pub(super) fn write(script: Script, cast: &mut Cast) -> Play {
    match script {
        Script::Return => comes_back(cast),
        Script::Crossing => crossing(cast),
        Script::Jacket => jacket(cast),
        Script::Wardrobe => wardrobe(cast),
        Script::Similar => similar(cast),
        Script::Twin => twin(cast),
        Script::Light => light(cast),
        Script::Crowd => crowd(cast),
        Script::Far => far(cast),
        Script::Turning => turning(cast),
    }
}

/// The person whom the user picks, in front of the robot until then and a little longer.
fn target(cast: &mut Cast) -> Actor {
    let person = cast.person();
    let (place, speed) = (cast.about([3.4, 0.3]), cast.speed());
    let mut target = Actor::new(person, place, speed);
    target.stands(5.0);
    target
}

/// Somebody who is out of sight.
fn other(cast: &mut Cast, at: [f64; 2]) -> Actor {
    let person = cast.person();
    let speed = cast.speed();
    Actor::new(person, at, speed)
}

/// A walk about the hall, seen from all sides.
fn strolls(actor: &mut Actor, cast: &mut Cast) {
    let places = [[5.0, 1.2], [6.5, -0.6], [4.2, -1.2], [3.4, 0.4]];
    let places = places.map(|place| cast.about(place));
    actor.walks(&places).turns_to_robot().stands(3.0);
}

/// Goes out of sight, waits there, and comes back to the middle on another way.
fn leaves_and_returns(actor: &mut Actor, cast: &mut Cast, way: usize, away_s: f64) {
    let middle = cast.about([3.8, 0.2]);
    match way % 3 {
        0 => actor
            .walks(&[TO_LEFT, LEFT])
            .stands(away_s)
            .appears_at(RIGHT)
            .walks(&[TO_RIGHT, middle]),
        1 => actor
            .walks(&[TO_RIGHT, RIGHT])
            .stands(away_s)
            .walks(&[TO_RIGHT, middle]),
        _ => actor
            .walks(&[ROUND, BEHIND])
            .stands(away_s)
            .walks(&[ROUND, middle]),
    };
    actor.turns_to_robot().stands(2.0);
}

/// Comes from the right, stands about, and goes again, until the scene is over.
fn comes_and_goes(actor: &mut Actor, cast: &mut Cast, from_s: f64, times: usize) {
    actor.waits_until(from_s);
    for _ in 0..times {
        let places = [[5.4, -0.8], [6.6, 1.4]].map(|place| cast.about(place));
        let stays_s = cast.between(3.0, 7.0);
        actor
            .walks(&[TO_RIGHT, places[0], places[1]])
            .stands(stays_s)
            .walks(&[TO_LEFT, LEFT])
            .stands(cast.between(4.0, 9.0))
            .appears_at(RIGHT);
    }
}

fn comes_back(cast: &mut Cast) -> Play {
    let mut person = target(cast);
    strolls(&mut person, cast);
    for way in 0..5 {
        let away_s = cast.between(3.0, 9.0);
        leaves_and_returns(&mut person, cast, way, away_s);
    }
    let mut somebody = other(cast, RIGHT);
    comes_and_goes(&mut somebody, cast, 8.0, 5);
    Play::new(vec![person.done(), somebody.done()], 150.0)
}

fn crossing(cast: &mut Cast) -> Play {
    let mut person = target(cast);
    person.walks(&[[5.2, 0.4]]).turns_to_robot();
    for k in 0..9 {
        let place = cast.about([5.2, if k % 2 == 0 { -1.4 } else { 1.2 }]);
        let stays_s = cast.between(6.0, 12.0);
        person.walks(&[place]).turns_to_robot().stands(stays_s);
    }
    let mut people = vec![person.done()];
    for (k, near) in [2.6, 3.4, 4.2].into_iter().enumerate() {
        let mut walker = other(cast, if k == 1 { RIGHT } else { LEFT });
        walker.waits_until(7.0 + 4.0 * k as f64);
        for round in 0..9 {
            let near = near + cast.between(-0.3, 0.3);
            let [left, right] = [[near, near + 1.0], [near, -near - 1.0]];
            let way = if (k + round) % 2 == 0 {
                [left, right]
            } else {
                [right, left]
            };
            let pause_s = cast.between(1.0, 6.0);
            walker.walks(&way).stands(pause_s);
        }
        people.push(walker.done());
    }
    Play::new(people, 140.0)
}

fn jacket(cast: &mut Cast) -> Play {
    let mut person = target(cast);
    strolls(&mut person, cast);
    for way in 0..4 {
        let outfit = Outfit {
            top: cast.outfit().top,
            ..person.outfit()
        };
        changes_out_of_sight(&mut person, cast, way, outfit);
    }
    let mut somebody = other(cast, RIGHT);
    comes_and_goes(&mut somebody, cast, 9.0, 5);
    Play::new(vec![person.done(), somebody.done()], 160.0)
}

fn changes_out_of_sight(actor: &mut Actor, cast: &mut Cast, way: usize, outfit: Outfit) {
    let middle = cast.about([3.8, 0.0]);
    let (out, hidden) = match way % 2 {
        0 => (TO_LEFT, LEFT),
        _ => (TO_RIGHT, RIGHT),
    };
    actor
        .walks(&[out, hidden])
        .stands(4.0)
        .wears(outfit)
        .stands(2.0)
        .walks(&[out, middle])
        .turns_to_robot()
        .stands(2.0);
    strolls(actor, cast);
}

fn wardrobe(cast: &mut Cast) -> Play {
    let mut person = target(cast);
    strolls(&mut person, cast);
    for way in 0..3 {
        let new = cast.outfit();
        let old = person.outfit();
        // The jacket first, then the trousers, then the shoes.
        let jacket = Outfit {
            top: new.top,
            ..old
        };
        let trousers = Outfit {
            trousers: new.trousers,
            ..jacket
        };
        for outfit in [jacket, trousers, new] {
            person.wears(outfit).stands(4.0);
        }
        strolls(&mut person, cast);
        leaves_and_returns(&mut person, cast, way, 5.0);
    }
    let mut somebody = other(cast, RIGHT);
    comes_and_goes(&mut somebody, cast, 12.0, 6);
    Play::new(vec![person.done(), somebody.done()], 170.0)
}

fn similar(cast: &mut Cast) -> Play {
    let mut person = target(cast);
    let outfit = person.outfit();
    strolls(&mut person, cast);
    for way in 0..5 {
        let away_s = cast.between(6.0, 10.0);
        leaves_and_returns(&mut person, cast, way, away_s);
    }
    let like = cast.similar(&outfit);
    let mut distractor = Actor::new((cast.body(), like), RIGHT, cast.speed());
    comes_and_goes(&mut distractor, cast, 10.0, 6);
    let mut somebody = other(cast, LEFT);
    comes_and_goes(&mut somebody, cast, 16.0, 5);
    let people = [person, distractor, somebody].map(Actor::done);
    Play::new(people.into(), 160.0)
}

fn twin(cast: &mut Cast) -> Play {
    let mut person = target(cast);
    let outfit = person.outfit();
    // Both are seen side by side before the person leaves; the twin stays in sight.
    person.waits_until(18.0);
    strolls(&mut person, cast);
    for way in [1, 0, 1] {
        let away_s = cast.between(5.0, 9.0);
        leaves_and_returns(&mut person, cast, way, away_s);
        person.stands(6.0);
    }
    let mut twin = Actor::new((cast.body(), outfit), RIGHT, cast.speed());
    twin.waits_until(7.0)
        .walks(&[[6.0, -3.4], [6.2, -1.4]])
        .turns_to_robot()
        .stands(8.0);
    for k in 0..12 {
        let place = cast.about([7.0, if k % 2 == 0 { 1.6 } else { -0.6 }]);
        twin.walks(&[place]).turns_to_robot().stands(8.0);
    }
    Play::new(vec![person.done(), twin.done()], 130.0)
}

fn light(cast: &mut Cast) -> Play {
    let mut play = comes_back(cast);
    // Warm lamps that grow dim and bright again.
    play.light = Light {
        level: [0.80, 0.70, 0.56],
        swing: 0.35,
        period_s: 55.0,
        ..Light::default()
    };
    play
}

fn crowd(cast: &mut Cast) -> Play {
    let mut person = target(cast);
    strolls(&mut person, cast);
    for way in 0..4 {
        strolls(&mut person, cast);
        let away_s = cast.between(4.0, 8.0);
        leaves_and_returns(&mut person, cast, way, away_s);
    }
    let mut people = vec![person.done()];
    for k in 0..7 {
        let mut walker = other(cast, if k % 2 == 0 { RIGHT } else { LEFT });
        comes_and_goes(&mut walker, cast, 4.0 + 5.0 * f64::from(k), 6);
        people.push(walker.done());
    }
    Play::new(people, 170.0)
}

fn far(cast: &mut Cast) -> Play {
    let mut person = target(cast);
    for k in 0..4 {
        let [far, near] = [[9.6, -0.8], [3.6, 0.4]].map(|place| cast.about(place));
        person.walks(&[far]).turns_to_robot().stands(4.0);
        let (away_s, way) = (cast.between(4.0, 7.0), if k % 2 == 0 { 2 } else { 0 });
        leaves_and_returns(&mut person, cast, way, away_s);
        person.walks(&[near]).turns_to_robot().stands(2.0);
    }
    let mut somebody = other(cast, RIGHT);
    comes_and_goes(&mut somebody, cast, 8.0, 6);
    Play {
        robot: Robot::Walks(1.2),
        ..Play::new(vec![person.done(), somebody.done()], 170.0)
    }
}

fn turning(cast: &mut Cast) -> Play {
    let mut person = target(cast);
    for _ in 0..8 {
        let places = [[4.4, -1.0], [5.4, 0.8], [3.8, 0.4]].map(|place| cast.about(place));
        person.walks(&places).turns_to_robot().stands(5.0);
    }
    let mut people = vec![person.done()];
    for (side, at) in [(1.0, LEFT), (-1.0, RIGHT)] {
        let mut walker = other(cast, at);
        walker.waits_until(6.0);
        for _ in 0..8 {
            let places = [[4.0, 4.4 * side], [6.2, 1.6 * side]].map(|place| cast.about(place));
            let stays_s = cast.between(3.0, 6.0);
            walker.walks(&places).stands(stays_s);
        }
        people.push(walker.done());
    }
    Play {
        robot: Robot::Turns(1.05),
        ..Play::new(people, 150.0)
    }
}
