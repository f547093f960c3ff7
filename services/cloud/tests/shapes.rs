//! Normals and the ceiling, in scenes of known truth.

mod scene;

use hachi_cloud::{CeilingFilter, Normals, Reason};
use hachi_hal::Vector3;
use nalgebra::Point3;
use scene::{Finish, Scan, Scene, chance, standing};

const WALL: Finish = Finish::Solid(60.0);
const FLOOR: Finish = Finish::Solid(20.0);

fn room(ceiling: Option<f64>) -> Scene {
    let mut scene = Scene::default();
    scene
        .slab([-12.0, -3.0], [12.0, 3.0], 0.0, FLOOR)
        .wall([-12.0, -3.0], [12.0, -3.0], 0.0, 6.0, WALL)
        .wall([-12.0, 3.0], [12.0, 3.0], 0.0, 6.0, WALL)
        .wall([12.0, -3.0], [12.0, 3.0], 0.0, 6.0, WALL)
        .wall([-12.0, -3.0], [-12.0, 3.0], 0.0, 6.0, WALL);
    if let Some(height) = ceiling {
        scene.slab([-12.0, -3.0], [12.0, 3.0], height, WALL);
    }
    scene
}

fn in_footprint(scan: &Scan, index: usize) -> Point3<f64> {
    let p = scan.points[index];
    scan.footprint_from_lidar * Point3::new(p.x, p.y, p.z).cast()
}

#[test]
fn normals_of_floor_and_walls_point_to_the_sensor_though_rings_are_far_apart() {
    let scan = room(None).scan(standing(0.6, 10.0, -5.0), 16, 1800);
    let labels = vec![Reason::Kept; scan.points.len()];
    let mut normals = Vec::new();
    Normals::default().compute(&scan.points, &labels, &mut normals);
    assert_eq!(normals.len(), scan.points.len());
    let (mut judged, mut right) = (0, 0);
    for (index, normal) in normals.iter().enumerate() {
        let p = in_footprint(&scan, index);
        // Away from edges and near enough for neighbouring rings.
        let truth = if p.z < 0.02 && p.y.abs() < 2.3 && p.x.abs() < 3.0 {
            Vector3::z()
        } else if p.y > 2.9 && p.z > 0.6 && p.x.abs() < 6.0 {
            -Vector3::y()
        } else {
            continue;
        };
        let Some(normal) = normal else { continue };
        let point = scan.points[index].position();
        assert!((0..3).map(|a| normal[a] * point[a]).sum::<f32>() <= 0.0);
        let turned = scan.footprint_from_lidar.rotation * Vector3::from(normal.map(f64::from));
        judged += 1;
        right += usize::from(turned.dot(&truth) > 15f64.to_radians().cos());
    }
    assert!(judged > 5000, "{judged}");
    assert!(right as f64 > 0.95 * judged as f64, "{right} of {judged}");
}

#[test]
fn a_line_of_points_has_no_normal() {
    let points: Vec<_> = (0..200)
        .map(|i| hachi_hal::Point::at(2.0, i as f32 * 0.1 - 10.0, 0.0))
        .collect();
    let mut normals = Vec::new();
    Normals::default().compute(&points, &[Reason::Kept; 200], &mut normals);
    assert!(normals.iter().all(Option::is_none));
}

#[test]
fn the_ceiling_goes_and_nothing_lower_does() {
    for height in [2.4, 2.75, 3.3] {
        let scan = room(Some(height)).scan(standing(0.6, 4.0, -3.0), 16, 1800);
        let mut labels = vec![Reason::Kept; scan.points.len()];
        let found = CeilingFilter::default()
            .label(&scan.points, &scan.footprint_from_lidar, &mut labels)
            .unwrap_or_else(|| panic!("the ceiling at {height} m"));
        assert!(
            (f64::from(found) - height).abs() < 0.1,
            "{found} for {height}"
        );
        for (index, label) in labels.iter().enumerate() {
            let z = in_footprint(&scan, index).z;
            if z > height - 0.03 {
                assert_eq!(*label, Reason::Ceiling);
            } else if z < height - 0.3 {
                assert_eq!(*label, Reason::Kept, "at {z} m of {height}");
            }
        }
    }
}

#[test]
fn outdoors_there_is_no_ceiling() {
    // Houses, a road, and crowns of trees from 2.5 to 6 m.
    let mut scene = room(None);
    scene.slab([-40.0, -40.0], [40.0, 40.0], 0.0, FLOOR);
    for tree in 0..60 {
        let (x, y) = (chance(tree, 1) * 40.0 - 20.0, chance(tree, 2) * 5.0 - 2.5);
        let (x, y, z) = (
            f64::from(x),
            f64::from(y),
            f64::from(chance(tree, 3)) * 3.0 + 2.5,
        );
        scene.wall([x, y], [x + 0.8, y + 0.5], z, z + 0.8, WALL);
    }
    let scan = scene.scan(standing(0.6, 0.0, 0.0), 16, 1800);
    let mut labels = vec![Reason::Kept; scan.points.len()];
    let found =
        CeilingFilter::default().label(&scan.points, &scan.footprint_from_lidar, &mut labels);
    assert_eq!(found, None);
    assert!(labels.iter().all(|l| l.is_kept()));
}
