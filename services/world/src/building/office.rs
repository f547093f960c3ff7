//! An office floor: a ring of corridor with rooms on both sides, some open, and a ramp.

use std::f64::consts::FRAC_PI_4;

use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use super::furniture::{Area, furnish, wall_feature};
use super::ring::Ring;
use super::{DOOR_HEIGHT_M, DOOR_WIDTH_M, Opening, Side, WALL_M};
use crate::floor::RaisedFloor;
use crate::material::Material;
use crate::preset::World;
use crate::scene_builder::SceneBuilder;
use crate::trajectory::{Gait, TrajectoryBuilder};

/// How deep the outer rooms are, metres.
const ROOM_DEPTH_M: f64 = 5.0;
/// How far into a room the robot walks, metres from the corridor's wall.
const VISIT_M: f64 = 2.3;
/// The stretch of the far corridor that the ramp takes, metres from the corner.
const RAMP: RaisedFloor = RaisedFloor {
    start: [0.0, 0.0],
    along: [-1.0, 0.0],
    half_width_m: 0.0,
    ramp_m: 3.5,
    level_m: 2.5,
    height_m: 0.35,
};
/// Where the ramp begins on that side, metres from the corner of the centre line.
const RAMP_AT_M: f64 = 8.0;

/// The office of a seed, with a robot that walks around it and looks into two rooms.
pub(crate) fn office(random: &mut ChaCha8Rng, gait: Gait) -> World {
    // The robot starts at the origin, 4 m along the first side.
    let ring = Ring {
        low: [-4.0, 0.0],
        high: [
            random.random_range(20.0..24.0),
            random.random_range(9.5..11.0),
        ],
        half_width: 1.1,
        ceiling: random.random_range(2.6..2.9),
    };
    let mut builder = SceneBuilder::new();
    ring.floor_and_ceiling(&mut builder, Material::FLOOR, ROOM_DEPTH_M + 8.0);
    let ramp = {
        let [x, y] = ring.corners()[2];
        RaisedFloor {
            start: [x - RAMP_AT_M, y],
            half_width_m: ring.half_width,
            ..RAMP
        }
    };
    let ramp_end = RAMP_AT_M + ramp.length_m();
    builder.raised_floor(ramp, Material::FLOOR);
    let inner_depth = (ring.length(1) - 2.0 * ring.half_width - WALL_M) / 2.0;
    let mut visits = Vec::new();
    for i in 0..4 {
        // Where the ramp is there are no doors: the outer wall begins a half width earlier, the
        // inner one later.
        let closed = |offset: f64| match i {
            2 => Some([RAMP_AT_M + offset - 0.8, ramp_end + offset + 0.8]),
            _ => None,
        };
        let outer = Row {
            side: ring.outer(i),
            span: [0.0, ring.length(i) + 2.0 * ring.half_width],
            depth: ROOM_DEPTH_M,
            closed: closed(ring.half_width),
            visited: i == 0,
            windows: true,
        };
        visits.push(outer.build(&mut builder, ring.ceiling, random));
        let inner = Row {
            side: ring.inner(i),
            span: [0.0, ring.length(i) - 2.0 * ring.half_width],
            depth: inner_depth,
            closed: closed(-ring.half_width),
            visited: i == 2,
            windows: false,
        };
        if i % 2 == 0 {
            visits.push(inner.build(&mut builder, ring.ceiling, random));
        } else {
            inner.plain(&mut builder, ring.ceiling, random);
        }
    }
    exit_signs(&mut builder, &ring);
    let visits: Vec<Visit> = visits.into_iter().flatten().collect();
    let mut patrol = TrajectoryBuilder::new([0.0, 0.0], 0.0, gait).stand(1.0);
    let corners = ring.corners();
    let mut way: Vec<[f64; 2]> = Vec::new();
    for (i, corner) in [(0, corners[1]), (1, corners[2]), (2, corners[3])] {
        for visit in visits.iter().filter(|visit| visit.side == i) {
            let before = nearest_on_ring(&ring, visit);
            way.push(before);
            patrol = patrol
                .walk(&way)
                .walk(&[visit.inside])
                .stand(0.5)
                .walk(&[before]);
            way.clear();
        }
        way.push(corner);
    }
    way.extend([corners[0], [0.0, 0.0]]);
    let scene = builder.build();
    let trajectory = patrol
        .walk(&way)
        .build(scene.floor().clone())
        .expect("the last walk ends at the start, along the first side");
    World { scene, trajectory }
}

/// A room that the robot looks into.
struct Visit {
    /// Which side of the ring its door is on.
    side: usize,
    inside: [f64; 2],
}

fn nearest_on_ring(ring: &Ring, visit: &Visit) -> [f64; 2] {
    let y = if visit.side == 0 {
        ring.low[1]
    } else {
        ring.high[1]
    };
    [visit.inside[0], y]
}

/// A row of rooms behind a corridor's wall.
struct Row {
    side: Side,
    span: [f64; 2],
    depth: f64,
    /// A stretch without doors.
    closed: Option<[f64; 2]>,
    visited: bool,
    windows: bool,
}

impl Row {
    /// Walls, doors, furniture; where the robot goes if it visits one of the rooms.
    fn build(
        &self,
        builder: &mut SceneBuilder,
        ceiling: f64,
        random: &mut ChaCha8Rng,
    ) -> Option<Visit> {
        let rooms = self.rooms(random);
        // The robot visits the last room with a door that lies well ahead of the start.
        let doors: Vec<Option<f64>> = rooms.iter().map(|room| self.door(room, random)).collect();
        let visited = if self.visited {
            doors.iter().rposition(Option::is_some)
        } else {
            None
        };
        let mut openings = Vec::new();
        let mut visit = None;
        for (index, (room, door)) in rooms.iter().zip(&doors).enumerate() {
            let area = Area {
                low: [room[0] + WALL_M, WALL_M],
                high: [room[1], self.depth],
            };
            let mut free = Vec::new();
            if let Some(door) = *door {
                openings.push(Opening::door(door));
                let is_visited = visited == Some(index);
                self.leaf(builder, door, is_visited || random.random_bool(0.5));
                let reach = if is_visited { VISIT_M + 0.9 } else { 1.2 };
                free.push(Area {
                    low: [door - 0.9, 0.0],
                    high: [door + 0.9, reach],
                });
                if is_visited {
                    visit = Some(Visit {
                        side: if self.windows { 0 } else { 2 },
                        inside: self.side.place(door, VISIT_M),
                    });
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
        visit
    }

    /// A wall without doors.
    fn plain(&self, builder: &mut SceneBuilder, ceiling: f64, random: &mut ChaCha8Rng) {
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
        let near_corner = door < from + 2.5 || door > to - 2.5;
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

/// A lit sign over the middle of each side, and a pillar cut at 45 degrees in each outer corner.
fn exit_signs(builder: &mut SceneBuilder, ring: &Ring) {
    for i in 0..4 {
        let side = ring.inner(i);
        let u = ring.length(i) / 2.0;
        let v = -ring.half_width;
        let (low, high) = ([u, v - 0.2, 2.25], [u + 0.03, v + 0.2, 2.4]);
        side.block(builder, low, high, Material::SIGN);
        let outer = ring.outer(i);
        let [x, y] = outer.place(0.0, 0.0);
        let yaw = outer.heading() + FRAC_PI_4;
        let centre = [x, y, ring.ceiling / 2.0];
        builder.cuboid(centre, [0.5, 0.5, ring.ceiling], yaw, Material::CONCRETE);
    }
}
