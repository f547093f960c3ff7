//! Somebody in a scene, told step by step what to do.

use crate::person::{Outfit, Person, Visit};

/// Somebody who turns on the spot does so over this, metres.
const TURN_M: f64 = 0.001;

/// Somebody, and where they have got to.
pub(super) struct Actor {
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
        let path: Vec<_> = std::iter::once(self.at)
            .chain(places.iter().copied())
            .collect();
        if let [.., from, to] = path[..] {
            let [dx, dy] = [to[0] - from[0], to[1] - from[1]];
            let length = dx.hypot(dy).max(TURN_M);
            (self.at, self.facing) = (to, [dx / length, dy / length]);
        }
        self.visit(path, 0.0)
    }

    /// Stands still for so many seconds.
    pub fn stands(&mut self, seconds: f64) -> &mut Self {
        let [x, y] = self.at;
        let before = [x - TURN_M * self.facing[0], y - TURN_M * self.facing[1]];
        self.visit(vec![before, self.at], seconds.max(0.0))
    }

    /// Stands still until so many seconds after the scene's beginning.
    pub fn waits_until(&mut self, time_s: f64) -> &mut Self {
        self.stands(time_s - self.now_s)
    }

    /// Turns to the robot.
    pub fn turns_to_robot(&mut self) -> &mut Self {
        let length = self.at[0].hypot(self.at[1]).max(TURN_M);
        self.facing = self.at.map(|v| -v / length);
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

    /// What they wear now.
    pub fn outfit(&self) -> Outfit {
        self.outfit
    }

    /// Stays where they are until every scene is over.
    pub fn done(mut self) -> Person {
        self.stands(super::hall::LONGEST_S);
        self.person
    }

    fn visit(&mut self, path: Vec<[f64; 2]>, stays_s: f64) -> &mut Self {
        let visit = Visit {
            begins_s: self.now_s,
            path,
            speed_m_s: self.speed_m_s,
            stays_s,
            outfit: self.outfit,
        };
        self.now_s = visit.ends_s();
        self.person.visits.push(visit);
        self
    }
}
