//! Mirror ghosts in scenes whose truth is known, and the places where there are none.

mod scene;

use hachi_cloud::{GhostFilter, Reason, RejectRange};
use scene::{Finish, Scan, Scene, Truth, standing};

const WALL: Finish = Finish::Solid(60.0);
const FLOOR: Finish = Finish::Solid(5.0);

/// 20 m of corridor, solid on the right with furniture, both ends closed.
fn corridor(left: impl Fn(&mut Scene)) -> Scene {
    let mut scene = Scene::default();
    scene
        .slab([-10.0, -1.2], [10.0, 1.2], 0.0, FLOOR)
        .wall([-10.0, -1.2], [10.0, -1.2], 0.0, 2.7, WALL)
        .wall([10.0, -1.2], [10.0, 1.2], 0.0, 2.7, WALL)
        .wall([-10.0, -1.2], [-10.0, 1.2], 0.0, 2.7, WALL)
        .cuboid([2.0, -1.2], [3.0, -0.8], 0.0, 1.0, WALL)
        .cuboid([-4.5, -1.2], [-4.0, -0.7], 0.0, 1.5, WALL);
    left(&mut scene);
    scene
}

fn label(scan: &Scan) -> (Vec<Reason>, usize) {
    let mut labels = vec![Reason::Kept; scan.points.len()];
    let mut filter = GhostFilter::default();
    let mirrors = filter.label(
        &scan.points,
        &scan.footprint_from_lidar,
        RejectRange::default(),
        &mut labels,
    );
    (labels, mirrors)
}

/// (share of ghosts found, share of real points lost, mirrors)
fn judge(scan: &Scan) -> (f64, f64, usize) {
    let (labels, mirrors) = label(scan);
    (
        scan.share(&labels, Truth::Ghost, Reason::Ghost),
        scan.share(&labels, Truth::Real, Reason::Ghost),
        mirrors,
    )
}

#[test]
fn bright_ghosts_behind_a_glass_wall_go_and_the_corridor_stays() {
    for (name, dust) in [("clean", 0.0), ("dusty", 0.05)] {
        let pane = Finish::Glass { dust, clear: false };
        let scene = corridor(|s| {
            s.wall([-10.0, 1.2], [10.0, 1.2], 0.0, 2.7, pane);
        });
        for (height, roll, pitch) in [(0.6, 0.0, 0.0), (0.5, 6.0, -4.0)] {
            let scan = scene.scan(standing(height, roll, pitch), 16, 1800);
            assert!(scan.count(Truth::Ghost) > 5000);
            let (found, lost, _) = judge(&scan);
            assert!(found > 0.95, "{name} glass, {height} m: {found}");
            assert!(lost < 0.01, "{name} glass, {height} m: {lost}");
        }
    }
}

#[test]
fn glass_on_both_sides_shows_ghosts_of_ghosts_and_they_go_too() {
    let pane = Finish::Glass {
        dust: 0.03,
        clear: false,
    };
    let mut scene = Scene::default();
    scene
        .slab([-10.0, -1.2], [10.0, 1.2], 0.0, FLOOR)
        .wall([10.0, -1.2], [10.0, 1.2], 0.0, 2.7, WALL)
        .wall([-10.0, -1.2], [-10.0, 1.2], 0.0, 2.7, WALL)
        .wall([-10.0, 1.2], [10.0, 1.2], 0.0, 2.7, pane)
        .wall([-10.0, -1.2], [10.0, -1.2], 0.0, 2.7, pane)
        .cuboid([2.0, -0.9], [2.5, -0.5], 0.0, 1.2, WALL)
        .cuboid([-3.0, 0.4], [-2.6, 0.8], 0.0, 1.0, WALL);
    let scan = scene.scan(standing(0.6, 2.0, 1.0), 16, 1800);
    let (found, lost, mirrors) = judge(&scan);
    // The panes' own mirror images may count as mirrors: what lies behind them is as false.
    assert!(mirrors >= 2);
    assert!(found > 0.9 && lost < 0.01, "{found} {lost}");
}

/// Two rooms of the same size and furniture, one mirrored, with an opening in the wall between.
fn mirrored_rooms(wall: Finish, opening: Option<Finish>) -> Scene {
    let mut scene = Scene::default();
    for side in [-1.0, 1.0] {
        let y = |y: f64| 1.2 + side * (1.2 - y);
        scene
            .slab([-4.0, y(-2.0)], [4.0, 1.2], 0.0, FLOOR)
            .wall([-4.0, y(-2.0)], [4.0, y(-2.0)], 0.0, 2.7, WALL)
            .wall([4.0, y(-2.0)], [4.0, 1.2], 0.0, 2.7, WALL)
            .wall([-4.0, y(-2.0)], [-4.0, 1.2], 0.0, 2.7, WALL)
            .cuboid([1.5, y(-1.5)], [2.0, y(-1.0)], 0.0, 1.2, WALL);
    }
    scene
        .wall([-4.0, 1.2], [-0.6, 1.2], 0.0, 2.7, wall)
        .wall([0.4, 1.2], [4.0, 1.2], 0.0, 2.7, wall)
        .wall([-0.6, 1.2], [0.4, 1.2], 2.1, 2.7, wall);
    if let Some(finish) = opening {
        scene.wall([-0.6, 1.2], [0.4, 1.2], 0.0, 2.1, finish);
    }
    scene
}

#[test]
fn an_open_door_between_symmetric_rooms_is_no_mirror() {
    for (name, intensity) in [("painted", 60.0), ("black", 6.0)] {
        for (x, y) in [(0.0, 0.0), (-1.5, 0.0), (1.5, -1.0), (-0.1, 0.7)] {
            let mut sensor = standing(0.6, 1.0, 0.0);
            sensor.translation.x = x;
            sensor.translation.y = y;
            let scan = mirrored_rooms(Finish::Solid(intensity), None).scan(sensor, 16, 1800);
            let behind = (scan.points.iter())
                .filter(|p| (sensor * nalgebra::Point3::new(p.x, p.y, p.z).cast()).y > 1.4);
            assert!(
                behind.count() > 300,
                "nothing seen through the door from {x}, {y}"
            );
            let (_, lost, mirrors) = judge(&scan);
            assert_eq!((lost, mirrors), (0.0, 0), "{name} wall, from {x}, {y}");
        }
    }
}

#[test]
fn the_same_door_closed_with_a_mirroring_pane_shows_ghosts() {
    let pane = Finish::Glass {
        dust: 0.05,
        clear: false,
    };
    let scan = mirrored_rooms(WALL, Some(pane)).scan(standing(0.6, 1.0, 0.0), 16, 1800);
    let (found, lost, mirrors) = judge(&scan);
    assert_eq!(mirrors, 1);
    assert!(found > 0.9 && lost < 0.01, "{found} {lost}");
}

#[test]
fn a_real_room_behind_a_window_stays() {
    let window = Finish::Glass {
        dust: 0.05,
        clear: true,
    };
    let scene = corridor(|s| {
        s.wall([-10.0, 1.2], [10.0, 1.2], 0.0, 2.7, window)
            .slab([-10.0, 1.2], [10.0, 9.0], 0.0, FLOOR)
            .wall([-10.0, 9.0], [10.0, 9.0], 0.0, 2.7, WALL)
            .cuboid([1.0, 5.0], [2.5, 6.0], 0.0, 1.0, WALL);
    });
    let scan = scene.scan(standing(0.6, 0.0, 0.0), 16, 1800);
    let (_, lost, mirrors) = judge(&scan);
    assert_eq!((lost, mirrors), (0.0, 0));
}

#[test]
fn a_polished_floor_shows_walls_below_the_floor_and_they_go() {
    let mut scene = Scene::default();
    scene
        .slab(
            [-8.0, -8.0],
            [8.0, 8.0],
            0.0,
            Finish::Polished { answers: 0.4 },
        )
        .wall([-5.0, 4.0], [5.0, 4.0], 0.0, 3.0, WALL)
        .wall([-5.0, -3.0], [5.0, -3.0], 0.0, 3.0, WALL)
        .wall([5.0, -3.0], [5.0, 4.0], 0.0, 3.0, WALL)
        .wall([-5.0, -3.0], [-5.0, 4.0], 0.0, 3.0, WALL);
    let scan = scene.scan(standing(0.6, 3.0, -5.0), 16, 1800);
    let (labels, mirrors) = label(&scan);
    assert_eq!(mirrors, 1);
    assert!(scan.share(&labels, Truth::Real, Reason::Ghost) < 0.01);
    // What shows within 15 cm of the floor is the foot of a wall, and not told from the floor.
    let deep: Vec<_> = (scan.points.iter().zip(&scan.truth).zip(&labels))
        .filter(|((p, truth), _)| {
            let in_footprint =
                scan.footprint_from_lidar * nalgebra::Point3::new(p.x, p.y, p.z).cast();
            **truth == Truth::Ghost && in_footprint.z < -0.15
        })
        .map(|(_, label)| *label)
        .collect();
    assert!(deep.len() > 2000);
    let found = deep.iter().filter(|l| **l == Reason::Ghost).count();
    assert!(
        found as f64 > 0.98 * deep.len() as f64,
        "{found} of {}",
        deep.len()
    );
}

#[test]
fn what_lies_below_a_landing_is_real() {
    // Stairs down to a hall 1.5 m lower, whose side walls run on from those of the landing.
    let mut scene = Scene::default();
    scene
        .slab([-6.0, -2.0], [3.0, 2.0], 0.0, FLOOR)
        .slab([3.0, -2.0], [12.0, 2.0], -1.5, FLOOR)
        .wall([-6.0, 2.0], [12.0, 2.0], -1.5, 2.7, WALL)
        .wall([-6.0, -2.0], [12.0, -2.0], -1.5, 2.7, WALL)
        .wall([12.0, -2.0], [12.0, 2.0], -1.5, 2.7, WALL)
        .wall([-6.0, -2.0], [-6.0, 2.0], 0.0, 2.7, WALL);
    let scan = scene.scan(standing(0.6, 0.0, 0.0), 16, 1800);
    let (labels, _) = label(&scan);
    let lost = labels.iter().filter(|l| **l == Reason::Ghost).count();
    assert_eq!(lost, 0);
}
