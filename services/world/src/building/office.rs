//! An office floor: a ring of corridor with rooms on both sides, some open, and a ramp.

use std::f64::consts::FRAC_PI_4;

use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use super::passers::Door;
use super::ring::Ring;
use super::rooms::{CORNER_M, Rooms, Row, Visit};
use super::{Side, WALL_M, passers};
use crate::cast::Cast;
use crate::floor::RaisedFloor;
use crate::material::Material;
use crate::person::Person;
use crate::preset::World;
use crate::scene_builder::SceneBuilder;
use crate::trajectory::{Gait, TrajectoryBuilder};

/// How deep the outer rooms are, metres.
const ROOM_DEPTH_M: f64 = 5.0;
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

/// The corridor, by the first numbers that are drawn.
fn ring(random: &mut ChaCha8Rng) -> Ring {
    // The robot starts at the origin, 4 m along the first side.
    Ring {
        low: [-4.0, 0.0],
        high: [
            random.random_range(20.0..24.0),
            random.random_range(9.5..11.0),
        ],
        half_width: 1.1,
        ceiling: random.random_range(2.6..2.9),
    }
}

/// Who walks in the office of `random`, while the robot patrols it.
pub(crate) fn office_people(random: &mut ChaCha8Rng, gait: Gait, cast: &mut Cast) -> Vec<Person> {
    let (world, ring, doors) = build(random, gait);
    passers::people(&ring, &doors, &world.trajectory, cast)
}

/// The office of a seed, with a robot that walks around it and looks into two rooms.
pub(crate) fn office(random: &mut ChaCha8Rng, gait: Gait) -> World {
    build(random, gait).0
}

/// The office, its corridor, and the open doors of rooms that the robot does not look into.
fn build(random: &mut ChaCha8Rng, gait: Gait) -> (World, Ring, Vec<Door>) {
    let ring = ring(random);
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
    let (mut visits, mut doors) = (Vec::new(), Vec::new());
    let mut keep = |side: Side, rooms: Rooms| {
        visits.extend(rooms.visit);
        doors.extend(rooms.open.into_iter().map(|at| Door { side, at }));
    };
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
            corner_m: CORNER_M,
            visited: i == 0,
            windows: true,
        };
        keep(outer.side, outer.build(&mut builder, ring.ceiling, random));
        let inner = Row {
            side: ring.inner(i),
            span: [0.0, ring.length(i) - 2.0 * ring.half_width],
            depth: inner_depth,
            closed: closed(-ring.half_width),
            corner_m: CORNER_M,
            visited: i == 2,
            windows: false,
        };
        if i % 2 == 0 {
            keep(inner.side, inner.build(&mut builder, ring.ceiling, random));
        } else {
            inner.plain(&mut builder, ring.ceiling, random);
        }
    }
    exit_signs(&mut builder, &ring);
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
    (World { scene, trajectory }, ring, doors)
}

fn nearest_on_ring(ring: &Ring, visit: &Visit) -> [f64; 2] {
    let y = if visit.side == 0 {
        ring.low[1]
    } else {
        ring.high[1]
    };
    [visit.inside[0], y]
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
