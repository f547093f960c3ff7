//! Rows of rooms along a corridor: their walls, doors, windows and furniture.
//!
//! In: the corridor's wall, the depth of the rooms, a seeded generator. Out: objects in the
//! builder's scene, where the robot goes if it looks into one of the rooms, and the doors that stand
//! open.

use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use super::furniture::{Area, furnish, wall_feature};
use super::{DOOR_HEIGHT_M, DOOR_WIDTH_M, Opening, Side, WALL_M};
use crate::material::Material;
use crate::scene_builder::SceneBuilder;

/// How far into a room the robot walks, metres from the corridor's wall.
const VISIT_M: f64 = 2.3;
/// How far from a row's ends doors usually begin, metres.
pub(super) const CORNER_M: f64 = 2.5;

/// A room that the robot looks into.
pub(super) struct Visit {
    /// Which side of the ring its door is on.
    pub side: usize,
    pub inside: [f64; 2],
}

/// A row of rooms that was built.
#[derive(Default)]
pub(super) struct Rooms {
    /// The room that the robot looks into.
    pub visit: Option<Visit>,
    /// Where doors stand open to the others, metres along the row.
    pub open: Vec<f64>,
}

/// How much of a room is free behind a door: to both sides of its middle and into the room, metres.
const FREE_ASIDE_M: f64 = 0.9;
pub(super) const FREE_M: f64 = 1.2;

/// A row of rooms behind a corridor's wall.
pub(super) struct Row {
    pub side: Side,
    pub span: [f64; 2],
    pub depth: f64,
    /// A stretch without doors.
    pub closed: Option<[f64; 2]>,
    /// How far from its ends it has no doors, metres: corridors meet there.
    pub corner_m: f64,
    pub visited: bool,
    pub windows: bool,
}

impl Row {
    /// Walls, doors, furniture.
    pub fn build(
        &self,
        builder: &mut SceneBuilder,
        ceiling: f64,
        random: &mut ChaCha8Rng,
    ) -> Rooms {
        let rooms = self.rooms(random);
        // The robot visits the last room with a door that lies well ahead of the start.
        let doors: Vec<Option<f64>> = rooms.iter().map(|room| self.door(room, random)).collect();
        let visited = if self.visited {
            doors.iter().rposition(Option::is_some)
        } else {
            None
        };
        let mut openings = Vec::new();
        let mut built = Rooms::default();
        for (index, (room, door)) in rooms.iter().zip(&doors).enumerate() {
            let area = Area {
                low: [room[0] + WALL_M, WALL_M],
                high: [room[1], self.depth],
            };
            let mut free = Vec::new();
            if let Some(door) = *door {
                openings.push(Opening::door(door));
                let is_visited = visited == Some(index);
                let open = is_visited || random.random_bool(0.5);
                self.leaf(builder, door, open);
                let reach = if is_visited { VISIT_M + 0.9 } else { FREE_M };
                free.push(Area {
                    low: [door - FREE_ASIDE_M, 0.0],
                    high: [door + FREE_ASIDE_M, reach],
                });
                if is_visited {
                    built.visit = Some(Visit {
                        side: if self.windows { 0 } else { 2 },
                        inside: self.side.place(door, VISIT_M),
                    });
                } else if open {
                    built.open.push(door);
                }
            }
            furnish(builder, &self.side, area, &free, random);
            let (low, high) = (
                [room[0], WALL_M, 0.0],
                [room[0] + WALL_M, self.depth, ceiling],
            );
            self.side.block(builder, low, high, Material::WALL);
        }
        let end = self.span[1];
        let (low, high) = ([end, WALL_M, 0.0], [end + WALL_M, self.depth, ceiling]);
        self.side.block(builder, low, high, Material::WALL);
        let span = [self.span[0] - WALL_M, end + WALL_M];
        self.side.wall(builder, span, 0.0, ceiling, &openings);
        self.back(builder, &rooms, ceiling, random);
        self.features(builder, &openings, ceiling, random);
        built
    }

    /// A wall without doors.
    pub fn plain(&self, builder: &mut SceneBuilder, ceiling: f64, random: &mut ChaCha8Rng) {
        self.side.wall(builder, self.span, 0.0, ceiling, &[]);
        self.features(builder, &[], ceiling, random);
    }

    fn rooms(&self, random: &mut ChaCha8Rng) -> Vec<[f64; 2]> {
        let [mut at, end] = self.span;
        let mut rooms = Vec::new();
        while end - at > 1e-9 {
            let mut width = random.random_range(3.4..5.6);
            if end - at - width < 3.0 {
                width = end - at;
            }
            rooms.push([at, at + width]);
            at += width;
        }
        rooms
    }

    /// Where a room's door is; not in the closed stretch, nor where corridors meet.
    fn door(&self, room: &[f64; 2], random: &mut ChaCha8Rng) -> Option<f64> {
        let [low, high] = [room[0] + 1.0, room[1] - 0.9];
        if high <= low {
            return None;
        }
        let door = random.random_range(low..high);
        let [from, to] = self.span;
        let near_corner = door < from + self.corner_m || door > to - self.corner_m;
        let on_ramp = self
            .closed
            .is_some_and(|[from, to]| door > from && door < to);
        (!near_corner && !on_ramp).then_some(door)
    }

    /// The leaf of a door, shut or opened into the room.
    fn leaf(&self, builder: &mut SceneBuilder, door: f64, open: bool) {
        let hinge = door - DOOR_WIDTH_M / 2.0;
        let (low, high) = if open {
            (
                [hinge - 0.04, WALL_M, 0.01],
                [hinge, WALL_M + DOOR_WIDTH_M, DOOR_HEIGHT_M],
            )
        } else {
            (
                [hinge, 0.05, 0.01],
                [hinge + DOOR_WIDTH_M, 0.09, DOOR_HEIGHT_M],
            )
        };
        self.side.block(builder, low, high, Material::WOOD);
    }

    fn back(
        &self,
        builder: &mut SceneBuilder,
        rooms: &[[f64; 2]],
        ceiling: f64,
        random: &mut ChaCha8Rng,
    ) {
        let mut windows = Vec::new();
        if self.windows {
            for room in rooms {
                if room[1] - room[0] > 2.5 && random.random_bool(0.6) {
                    let window = Opening {
                        from: room[0] + 0.6,
                        to: room[1] - 0.6,
                        bottom: 0.9,
                        top: 2.2,
                    };
                    windows.push(window);
                    builder.pane(
                        self.side.place(window.from, self.depth + WALL_M / 2.0),
                        self.side.place(window.to, self.depth + WALL_M / 2.0),
                        window.bottom,
                        window.top,
                        Material::CLEAR_GLASS,
                    );
                }
            }
        }
        self.side
            .wall(builder, self.span, self.depth, ceiling, &windows);
    }

    fn features(
        &self,
        builder: &mut SceneBuilder,
        openings: &[Opening],
        ceiling: f64,
        random: &mut ChaCha8Rng,
    ) {
        let mut u = self.span[0] + 2.0;
        while u < self.span[1] - 2.0 {
            let clear = |opening: &Opening| u < opening.from - 0.8 || u > opening.to + 0.8;
            if openings.iter().all(clear) {
                wall_feature(builder, &self.side, u, ceiling, random);
            }
            u += random.random_range(1.8..3.6);
        }
    }
}
