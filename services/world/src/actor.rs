//! Somebody who is told step by step what to do, and the visits that come of it.

use crate::person::{Outfit, Person, Visit};

/// Somebody who turns on the spot does so over this, metres.
const TURN_M: f64 = 0.001;
/// Whoever has no more to do stays for so long: nobody looks at people for longer, seconds.
const STAYS_S: f64 = 900.0;

/// Somebody, and where they have got to.
pub(crate) struct Actor {
    person: Person,
    outfit: Outfit,
    at: [f64; 2],
    /// Unit vector.
    facing: [f64; 2],
    speed_m_s: f64,
    now_s: f64,
}

impl Actor {
    /// Somebody who is at a place from the beginning and looks at the robot.
    pub fn new((person, outfit): (Person, Outfit), at: [f64; 2], speed_m_s: f64) -> Self {
        Self {
            person,
            outfit,
            at,
            facing: [-1.0, 0.0],
            speed_m_s,
            now_s: 0.0,
        }
    }

    /// Walks through places.
    pub fn walks(&mut self, places: &[[f64; 2]]) -> &mut Self {
        let path = self.way(places);
        self.visit(path, self.speed_m_s, 0.0)
    }

    /// Walks through places, as fast as it takes to be there at a later time.
    pub fn walks_until(&mut self, time_s: f64, places: &[[f64; 2]]) -> &mut Self {
        let path = self.way(places);
        let legs = path.iter().zip(path.iter().skip(1));
        let length_m: f64 = legs.map(|(a, b)| (b[0] - a[0]).hypot(b[1] - a[1])).sum();
        let speed_m_s = length_m / (time_s - self.now_s);
        self.visit(path, speed_m_s, 0.0)
    }

    /// The way from here through places, at whose end they are from now on.
    fn way(&mut self, places: &[[f64; 2]]) -> Vec<[f64; 2]> {
        let path: Vec<_> = std::iter::once(self.at)
            .chain(places.iter().copied())
            .collect();
        if let [.., from, to] = path[..] {
            let [dx, dy] = [to[0] - from[0], to[1] - from[1]];
            let length = dx.hypot(dy).max(TURN_M);
            (self.at, self.facing) = (to, [dx / length, dy / length]);
        }
        path
    }

    /// Stands still for so many seconds.
    pub fn stands(&mut self, seconds: f64) -> &mut Self {
        let [x, y] = self.at;
        let before = [x - TURN_M * self.facing[0], y - TURN_M * self.facing[1]];
        self.visit(vec![before, self.at], self.speed_m_s, seconds.max(0.0))
    }

    /// Stands still until so many seconds after the beginning.
    pub fn waits_until(&mut self, time_s: f64) -> &mut Self {
        self.stands(time_s - self.now_s)
    }

    /// Turns to where the robot begins.
    pub fn turns_to_robot(&mut self) -> &mut Self {
        self.turns_to([0.0; 2])
    }

    /// Turns to a place.
    pub fn turns_to(&mut self, place: [f64; 2]) -> &mut Self {
        let [dx, dy] = [place[0] - self.at[0], place[1] - self.at[1]];
        let length = dx.hypot(dy).max(TURN_M);
        self.facing = [dx / length, dy / length];
        self
    }

    /// Wears something else from here on.
    pub fn wears(&mut self, outfit: Outfit) -> &mut Self {
        self.outfit = outfit;
        self
    }

    /// Is over there, out of sight, without a way between.
    pub fn appears_at(&mut self, at: [f64; 2]) -> &mut Self {
        self.at = at;
        self
    }

    /// When what they were told so far is done, seconds after the beginning.
    pub fn now_s(&self) -> f64 {
        self.now_s
    }

    /// What they wear now.
    pub fn outfit(&self) -> Outfit {
        self.outfit
    }

    /// Stays where they are until all is over.
    pub fn done(mut self) -> Person {
        self.stands(STAYS_S);
        self.person
    }

    fn visit(&mut self, path: Vec<[f64; 2]>, speed_m_s: f64, stays_s: f64) -> &mut Self {
        let visit = Visit {
            begins_s: self.now_s,
            path,
            speed_m_s,
            stays_s,
            outfit: self.outfit,
        };
        self.now_s = visit.ends_s();
        self.person.visits.push(visit);
        self
    }
}
