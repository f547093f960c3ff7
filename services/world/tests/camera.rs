//! Pictures of the simulated camera against geometry worked out by hand, and their truth against
//! their pixels.

use std::f64::consts::TAU;

use hachi_hal::{Distortion, Intrinsics, Pose, RgbdGeometry, Stamp, Vector3};
use hachi_world::camera::looking_ahead;
use hachi_world::{
    CameraConfig, CameraFrame, Gait, Material, Outfit, Person, SceneBuilder, SimulatedCamera,
    Simulation, SimulationConfig, TrajectoryBuilder, Visit, preset::World,
};

const WIDTH: u32 = 160;
const HEIGHT: u32 = 90;
const FOCAL: f64 = 80.0;
const RED: Outfit = Outfit {
    top: [200, 30, 30],
    trousers: [30, 30, 160],
    shoes: [20, 20, 20],
};
const GREEN: Outfit = Outfit {
    top: [30, 180, 40],
    ..RED
};

/// A room of 10 m x 8 m x 3 m with the robot, which stands still, in its middle: walls at x = 5 and
/// y = 4 and -4. A pillar of 0.6 m stands at (3, 1.5) if asked for.
fn room(pillar: bool) -> SimulationConfig {
    let mut builder = SceneBuilder::new();
    builder.floor_slab([-5.0, -4.0], [5.0, 4.0], 0.0, Material::FLOOR);
    let mut slab = |centre, size, material| builder.cuboid(centre, size, 0.0, material);
    slab([0.0, 0.0, 3.1], [10.0, 8.0, 0.2], Material::CEILING);
    for side in [-1.0, 1.0] {
        slab([side * 5.1, 0.0, 1.5], [0.2, 8.0, 3.0], Material::WALL);
        slab([0.0, side * 4.1, 1.5], [10.0, 0.2, 3.0], Material::WALL);
    }
    if pillar {
        builder.cuboid([3.0, 1.5, 1.5], [0.6, 0.6, 3.0], 0.0, Material::CONCRETE);
    }
    let scene = builder.build();
    let trajectory = TrajectoryBuilder::new([0.0, 0.0], 0.0, Gait::wheeled(1.0))
        .stand(60.0)
        .build(scene.floor().clone())
        .unwrap();
    SimulationConfig::new(World { scene, trajectory }, 1, 30.0)
}

/// A perfect camera without a lens in the base's origin, both pictures from one place.
fn perfect() -> CameraConfig {
    let optics = Intrinsics {
        width: WIDTH,
        height: HEIGHT,
        focal: [FOCAL, FOCAL],
        centre: [79.5, 44.5],
        distortion: Distortion::None,
    };
    CameraConfig {
        geometry: RgbdGeometry {
            depth: optics,
            color: optics,
            color_from_depth: Pose::identity(),
            depth_unit_m: 0.001,
        },
        base_from_depth: looking_ahead([0.0; 3], 0.0),
        disparity_sigma_px: 0.0,
        luma_sigma: 0.0,
        period_ns: 100_000_000,
        ..CameraConfig::d455(WIDTH, HEIGHT, 0.0)
    }
}

fn standing(id: u32, place: [f64; 2], outfit: Outfit) -> Person {
    Person {
        id,
        height_m: 1.75,
        skin: [220, 180, 150],
        hair: [60, 40, 30],
        visits: vec![Visit {
            begins_s: 0.0,
            path: vec![place],
            speed_m_s: 0.0,
            stays_s: 100.0,
            outfit,
        }],
    }
}

fn with(simulation: &SimulationConfig, people: Vec<Person>) -> SimulationConfig {
    SimulationConfig {
        people: people.into(),
        ..simulation.clone()
    }
}

fn first_frame(
    simulation: &SimulationConfig,
    config: CameraConfig,
    people: Vec<Person>,
) -> CameraFrame {
    let mut camera = SimulatedCamera::new(&with(simulation, people), config);
    camera.next_frame().unwrap().clone()
}

fn counts(frame: &CameraFrame) -> Vec<u16> {
    let pairs = frame.depth.chunks_exact(2);
    pairs.map(|b| u16::from_le_bytes([b[0], b[1]])).collect()
}

/// Red, green, blue of a pixel, by the standard's own formula.
fn rgb(frame: &CameraFrame, column: u32, row: u32) -> [f64; 3] {
    let at = (row * WIDTH + column / 2 * 2) as usize * 2;
    let [y0, u, y1, v] = frame.color[at..at + 4] else {
        unreachable!()
    };
    let y = 1.164 * (f64::from(if column.is_multiple_of(2) { y0 } else { y1 }) - 16.0);
    let (u, v) = (f64::from(u) - 128.0, f64::from(v) - 128.0);
    [y + 1.596 * v, y - 0.392 * u - 0.813 * v, y + 2.017 * u]
}

#[test]
fn depth_is_the_distance_along_the_axis_to_walls_floor_and_ceiling() {
    let simulation = room(false);
    let base = simulation.map_from_base(simulation.start);
    let height = base.translation.z;
    let frame = first_frame(&simulation, perfect(), Vec::new());
    for (index, count) in counts(&frame).into_iter().enumerate() {
        let (column, row) = (index as u32 % WIDTH, index as u32 / WIDTH);
        // Ahead 1, so much to the left and up.
        let left = (79.5 - f64::from(column)) / FOCAL;
        let up = (44.5 - f64::from(row)) / FOCAL;
        let vertical = if up > 0.0 { 3.0 - height } else { -height };
        let expected = 5.0_f64.min(4.0 / left.abs()).min(vertical / up);
        let expected = (expected * 1_000.0).round() as u16;
        assert!(
            count.abs_diff(expected) <= 1,
            "{column} {row}: {count} {expected}"
        );
    }
    assert!(frame.masks.iter().all(|&mask| mask == 0));
}

#[test]
fn a_camera_that_looks_up_sees_more_ceiling() {
    let simulation = room(false);
    let config = CameraConfig {
        base_from_depth: looking_ahead([0.0; 3], 0.5),
        ..perfect()
    };
    let height = simulation.map_from_base(simulation.start).translation.z;
    let frame = first_frame(&simulation, config, Vec::new());
    // The middle looks up by half a radian: the ceiling is hit before the wall at 5 m.
    let expected = (3.0 - height) / 0.5_f64.sin();
    let middle = counts(&frame)[(44 * WIDTH + 79) as usize];
    assert!(
        (f64::from(middle) / 1_000.0 - expected).abs() < 0.08,
        "{middle} {expected}"
    );
}

#[test]
fn somebody_who_stands_free_is_boxed_as_tall_and_as_far_as_they_are() {
    let simulation = room(false);
    let height = simulation.map_from_base(simulation.start).translation.z;
    let config = perfect();
    let frame = first_frame(&simulation, config, vec![standing(7, [4.0, 0.5], RED)]);
    let [person] = frame.people[..] else {
        panic!("{:?}", frame.people)
    };
    assert_eq!((person.id, person.visit, person.outfit), (7, 0, RED));
    let (visible, whole) = (person.visible.unwrap(), person.whole.unwrap());
    assert_eq!(visible, whole);
    assert_eq!(person.visible_share(), 1.0);
    // From 1.75 m over the floor down to it, 4 m away; a little nearer at the bottom: shoes.
    let top = 44.5 - FOCAL * (1.75 - height) / 4.0;
    let bottom = 44.5 + FOCAL * height / 3.95;
    assert!(
        (f64::from(visible.top) - top).abs() <= 1.5,
        "{visible:?} {top}"
    );
    assert!(
        (f64::from(visible.bottom) - bottom).abs() <= 1.5,
        "{visible:?} {bottom}"
    );
    let middle = f64::from(visible.left + visible.right) / 2.0;
    assert!(
        (middle - (80.0 - FOCAL * 0.5 / 4.0)).abs() <= 1.0,
        "{visible:?}"
    );
    // Shoulders and arms: 0.62 m.
    assert!((10..=14).contains(&visible.width()), "{visible:?}");
    let offset = person.middle_in_color - Vector3::new(-0.5, height - 0.875, 4.0);
    assert!(offset.norm() < 1e-6, "{offset}");
    // Pixels, box and depth agree.
    let depth = counts(&frame);
    let of = |mask: &u8| *mask == 1;
    assert_eq!(
        frame.masks.iter().filter(|m| of(m)).count() as u32,
        person.visible_pixels
    );
    for (index, _) in frame.masks.iter().enumerate().filter(|(_, m)| of(m)) {
        let metres = f64::from(depth[index]) / 1_000.0;
        assert!((3.6..4.3).contains(&metres), "{metres}");
    }
}

#[test]
fn clothes_have_their_colours() {
    let frame = first_frame(&room(false), perfect(), vec![standing(1, [3.0, 0.0], RED)]);
    let whole = frame.people[0].whole.unwrap();
    let middle = (whole.left + whole.right) / 2;
    let at = |share: f64| whole.top + (f64::from(whole.height()) * share) as u32;
    let [r, g, b] = rgb(&frame, middle, at(0.30));
    assert!(r > 2.5 * g && r > 2.5 * b, "shirt {r} {g} {b}");
    let leg = (whole.left..whole.right).find(|&c| {
        frame.masks[(at(0.7) * WIDTH + c) as usize] == 1
            && frame.masks[(at(0.7) * WIDTH + c + 1) as usize] == 1
    });
    let [r, g, b] = rgb(&frame, leg.unwrap() + 1, at(0.7));
    assert!(b > 1.5 * r && b > 1.5 * g, "trousers {r} {g} {b}");
}

#[test]
fn what_is_in_the_way_hides() {
    let simulation = room(true);
    // One behind the edge of the pillar, one free, one in front of the free one.
    let people = vec![
        standing(1, [4.2, 1.55], RED),
        standing(2, [4.4, -1.0], RED),
        standing(3, [2.2, -0.35], GREEN),
    ];
    let frame = first_frame(&simulation, perfect(), people);
    let [behind_pillar, behind_person, free] = frame.people[..] else {
        panic!("{:?}", frame.people)
    };
    assert!(behind_pillar.visible_share() < 0.7, "{behind_pillar:?}");
    assert!(behind_person.visible_share() < 1.0, "{behind_person:?}");
    assert_eq!(free.visible_share(), 1.0);
    let whole = behind_pillar.whole.unwrap();
    assert!(whole.width() > behind_pillar.visible.map_or(0, |b| b.width()));
    // Nobody is seen where another is nearer.
    let depth = counts(&frame);
    for (mask, count) in frame.masks.iter().zip(&depth) {
        let expected = match mask {
            1 => 3_900..4_500,
            2 => 4_000..4_700,
            3 => 1_800..2_500,
            _ => continue,
        };
        assert!(expected.contains(count), "{mask} {count}");
    }
}

#[test]
fn people_walk_change_clothes_and_come_back() {
    let visit = |begins_s, path: &[[f64; 2]], outfit| Visit {
        begins_s,
        path: path.to_vec(),
        speed_m_s: 1.0,
        stays_s: 0.5,
        outfit,
    };
    let person = Person {
        visits: vec![
            visit(1.0, &[[4.0, -2.0], [4.0, 2.0]], RED),
            visit(8.0, &[[4.0, 2.0], [2.0, 2.0], [2.0, -2.0]], GREEN),
        ],
        ..standing(9, [0.0, 0.0], RED)
    };
    let simulation = room(false);
    let mut camera = SimulatedCamera::new(&with(&simulation, vec![person]), perfect());
    let mut seen = Vec::new();
    while let Some(frame) = camera.next_frame() {
        let seconds = frame.stamp.secs_since(simulation.start);
        if let Some(person) = frame.people.first() {
            let place = person.map_from_person.translation;
            seen.push((seconds, person.visit, place.x, place.y, person.outfit.top));
        }
        if seconds > 15.5 {
            break;
        }
    }
    let at = |seconds: f64| seen.iter().find(|s| (s.0 - seconds).abs() < 0.01);
    assert!(at(0.9).is_none() && at(5.6).is_none() && at(7.9).is_none());
    assert!(
        at(14.6).is_none(),
        "two metres, four metres and half a second later"
    );
    let close = |s: Option<&(f64, usize, f64, f64, [u8; 3])>, visit, x: f64, y: f64, top| {
        let s = s.unwrap();
        assert_eq!((s.1, s.4), (visit, top));
        assert!((s.2 - x).abs() < 1e-6 && (s.3 - y).abs() < 1e-6, "{s:?}");
    };
    close(at(3.0), 0, 4.0, 0.0, RED.top);
    close(at(5.4), 0, 4.0, 2.0, RED.top);
    close(at(9.0), 1, 3.0, 2.0, GREEN.top);
    close(at(12.0), 1, 2.0, 0.0, GREEN.top);
}

#[test]
fn a_walker_looks_where_they_go_and_swings_their_legs() {
    let person = Person {
        visits: vec![Visit {
            begins_s: 0.0,
            path: vec![[4.0, -3.0], [4.0, 3.0]],
            speed_m_s: 1.4,
            stays_s: 0.0,
            outfit: RED,
        }],
        ..standing(1, [0.0, 0.0], RED)
    };
    let simulation = room(false);
    let mut camera = SimulatedCamera::new(&with(&simulation, vec![person]), perfect());
    let mut widths = Vec::new();
    for _ in 0..40 {
        let frame = camera.next_frame().unwrap();
        let Some(person) = frame.people.first() else {
            break;
        };
        let (_, _, yaw) = person.map_from_person.rotation.euler_angles();
        assert!((yaw - TAU / 4.0).abs() < 1e-9);
        if let Some(whole) = person.whole.filter(|b| b.left > 0 && b.right < WIDTH) {
            widths.push(whole.width());
        }
    }
    // Seen from the side: legs together and a step apart.
    let (least, most) = (widths.iter().min().unwrap(), widths.iter().max().unwrap());
    assert!(most - least >= 6, "{widths:?}");
}

/// A stereo camera cannot see the distance of what its right imager does not see: a strip to the left
/// of everything that stands in front.
#[test]
fn what_one_imager_alone_sees_has_no_depth() {
    let config = CameraConfig {
        disparity_sigma_px: 1e-6,
        baseline_m: 0.3,
        range_m: [0.1, 50.0],
        ..perfect()
    };
    let frame = first_frame(&room(true), config, Vec::new());
    let depth = counts(&frame);
    let row = &depth[(44 * WIDTH) as usize..(45 * WIDTH) as usize];
    // The pillar's near face is 2.7 m away, its left edge at y = 1.8: column 26.
    let edge = (79.5 - FOCAL * 1.8 / 2.7).ceil() as usize;
    assert!((2_600..2_800).contains(&row[edge]), "{row:?}");
    // The wall at 5 m is 4.8 px from its place in the right image, the pillar 8.9 px: 4 px.
    let hidden = (0..edge)
        .rev()
        .take_while(|&column| row[column] == 0)
        .count();
    assert!((3..=5).contains(&hidden), "{hidden}: {row:?}");
    let right = (79.5 - FOCAL * 1.2 / 2.7).ceil() as usize;
    assert_ne!(row[right + 1], 0, "nothing is hidden at the right: {row:?}");
}

#[test]
fn depth_errs_with_the_square_of_the_distance() {
    let spread = |distance_m: f64| {
        let mut builder = SceneBuilder::new();
        builder.floor_slab([-5.0, -4.0], [5.0, 4.0], -9.0, Material::FLOOR);
        builder.cuboid(
            [distance_m + 0.5, 0.0, 0.0],
            [1.0, 40.0, 40.0],
            0.0,
            Material::WALL,
        );
        let scene = builder.build();
        let trajectory = TrajectoryBuilder::new([0.0, 0.0], 0.0, Gait::wheeled(1.0))
            .stand(9.0)
            .build(scene.floor().clone())
            .unwrap();
        let simulation = SimulationConfig::new(World { scene, trajectory }, 3, 1.0);
        let config = CameraConfig {
            disparity_sigma_px: 0.1,
            ..perfect()
        };
        let frame = first_frame(&simulation, config, Vec::new());
        let depth = counts(&frame);
        let errors = depth.iter().map(|&c| f64::from(c) / 1_000.0 - distance_m);
        (errors.map(|e| e * e).sum::<f64>() / depth.len() as f64).sqrt()
    };
    // z^2 / (f B) times the disparity's error: 80 px and 95 mm.
    for distance_m in [1.0, 2.0, 4.0] {
        let expected = distance_m * distance_m / (FOCAL * 0.095) * 0.1;
        let got = spread(distance_m);
        assert!(
            (got / expected - 1.0).abs() < 0.1,
            "{distance_m}: {got} {expected}"
        );
    }
}

#[test]
fn the_same_seed_gives_the_same_bytes_for_any_number_of_threads() {
    let frame = |threads: usize, seed: u64| {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .unwrap();
        pool.install(|| {
            let simulation = SimulationConfig { seed, ..room(true) };
            let config = CameraConfig::d455(WIDTH, HEIGHT, 0.2);
            let people = vec![standing(1, [3.0, 0.5], RED)];
            let mut camera = SimulatedCamera::new(&with(&simulation, people), config);
            camera.skip_to(simulation.start + 1_000_000_000);
            let frame = camera.next_frame().unwrap();
            assert_eq!(frame.sequence, 31, "30 periods end 10 ns before the second");
            (
                frame.depth.clone(),
                frame.color.clone(),
                frame.masks.clone(),
            )
        })
    };
    let one = frame(1, 5);
    assert!(one == frame(3, 5));
    let other = frame(1, 6);
    assert!(one.0 != other.0 && one.1 != other.1 && one.2 == other.2);
}

/// Laser and camera see the same person at the same place.
#[test]
fn the_lidar_sees_the_people_too() {
    let simulation = with(&room(true), vec![standing(7, [3.0, -1.0], RED)]);
    let mut lidar = Simulation::new(simulation.clone());
    let (mut on_person, mut others) = (Vec::new(), 0);
    while let Some(packet) = lidar.next_packet() {
        for truth in packet.truth {
            match truth.person() {
                Some(id) => {
                    assert_eq!(id, 7);
                    on_person.push(f64::from(truth.distance_m));
                }
                None => others += usize::from(truth.distance_m > 0.0),
            }
        }
        if packet.stamp > simulation.start + 200_000_000 {
            break;
        }
    }
    // Two turns of 59 shots (0.6 m at 3 m, 0.2 degrees apart) in the 14 rings between shoes and
    // crown would be 1,650 on a box as wide as the shoulders; a body fills about two thirds of it.
    assert!(
        (800..1_400).contains(&on_person.len()),
        "{}",
        on_person.len()
    );
    assert!(others > 10_000, "{others}");
    let lidar_at = simulation.map_from_lidar(simulation.start).translation;
    let away = (3.0 - lidar_at.x).hypot(-1.0 - lidar_at.y);
    for distance in on_person {
        assert!((distance - away).abs() < 0.6, "{distance} {away}");
    }
}

#[test]
fn frames_end_with_the_simulation() {
    let simulation = SimulationConfig {
        duration_s: 0.25,
        ..room(false)
    };
    let mut camera = SimulatedCamera::new(&simulation, perfect());
    let mut stamps: Vec<Stamp> = Vec::new();
    while let Some(frame) = camera.next_frame() {
        stamps.push(frame.stamp);
    }
    let after = |ns| simulation.start + ns;
    assert_eq!(stamps, [after(0), after(100_000_000), after(200_000_000)]);
}
