//! Outliers in scenes of known truth: what is sparse because it is far stays.

mod scene;

use hachi_cloud::{OutlierFilter, Reason};
use hachi_hal::Point;
use scene::{Finish, Scene, chance, standing};

const WALL: Finish = Finish::Solid(60.0);

fn label(points: &[Point]) -> Vec<Reason> {
    let mut labels = vec![Reason::Kept; points.len()];
    OutlierFilter::default().label(points, 3.0, &mut labels);
    labels
}

/// Walls 2 to 40 m away around a 16-beam sensor.
fn yard() -> Scene {
    let mut scene = Scene::default();
    scene
        .slab([-45.0, -45.0], [45.0, 45.0], 0.0, Finish::Solid(20.0))
        .wall([2.0, -3.0], [2.0, 3.0], 0.0, 4.0, WALL)
        .wall([-20.0, 8.0], [20.0, 8.0], 0.0, 6.0, WALL)
        .wall([-40.0, -30.0], [-40.0, 30.0], 0.0, 15.0, WALL);
    scene
}

/// What a limit on metres would remove: mean distance to 6 neighbours above mean plus 3 sigma.
fn removed_by_metres(points: &[Point]) -> Vec<bool> {
    let mut tree = hachi_cloud::KdTree::default();
    let positions: Vec<_> = points.iter().map(Point::position).collect();
    tree.build(&positions);
    let mean_distance = |p: &[f32; 3]| {
        let mut nearest = hachi_cloud::NearestK::<7>::default();
        tree.k_nearest(*p, &mut nearest);
        nearest
            .as_slice()
            .iter()
            .map(|n| n.distance_sq.sqrt())
            .sum::<f32>()
            / 6.0
    };
    let spacing: Vec<_> = positions.iter().map(mean_distance).collect();
    let count = spacing.len() as f32;
    let mean = spacing.iter().sum::<f32>() / count;
    let variance = spacing.iter().map(|s| (s - mean) * (s - mean)).sum::<f32>() / count;
    spacing
        .iter()
        .map(|s| *s > mean + 3.0 * variance.sqrt())
        .collect()
}

#[test]
fn a_far_wall_stays_though_its_points_are_farther_apart_than_dust_near_by() {
    let scan = yard().scan(standing(0.6, 0.0, 0.0), 16, 1800);
    let labels = label(&scan.points);
    let far: Vec<_> = (0..labels.len())
        .filter(|i| scan.points[*i].range_m > 35.0)
        .collect();
    assert!(far.len() > 1000);
    let lost = far.iter().filter(|i| !labels[**i].is_kept()).count();
    assert!(lost * 100 < far.len(), "{lost} of {} far points", far.len());
    let by_metres = removed_by_metres(&scan.points);
    let lost_by_metres = far.iter().filter(|i| by_metres[**i]).count();
    assert!(
        lost_by_metres * 10 > far.len(),
        "metres would do: {lost_by_metres} of {}",
        far.len()
    );
    let all_lost = labels.iter().filter(|l| !l.is_kept()).count();
    assert!(
        all_lost * 50 < labels.len(),
        "{all_lost} of {}",
        labels.len()
    );
}

#[test]
fn single_drops_in_the_air_go() {
    let mut scan = yard().scan(standing(0.6, 0.0, 0.0), 16, 1800);
    let clean = scan.points.len();
    // Every 97th beam ends on something on its way.
    for i in (0..clean).step_by(97) {
        let p = scan.points[i];
        let short = 0.3 + 0.4 * chance(i, 5);
        if p.range_m * short > 0.8 && p.range_m * (1.0 - short) > 0.5 {
            scan.points
                .push(Point::at(p.x * short, p.y * short, p.z * short));
        }
    }
    let labels = label(&scan.points);
    let drops = &labels[clean..];
    let found = drops.iter().filter(|l| **l == Reason::Outlier).count();
    assert!(
        found as f64 > 0.9 * drops.len() as f64,
        "{found} of {}",
        drops.len()
    );
    let lost = labels[..clean].iter().filter(|l| !l.is_kept()).count();
    assert!(lost * 50 < clean, "{lost} of {clean}");
}

#[test]
fn equal_points_and_tiny_clouds_are_left_alone() {
    assert!(
        label(&vec![Point::at(1.0, 2.0, 3.0); 50_000])
            .iter()
            .all(|l| l.is_kept())
    );
    let four = [1.0, 2.0, 30.0, 4.0].map(|x| Point::at(x, 0.0, 0.0));
    assert!(label(&four).iter().all(|l| l.is_kept()));
    assert!(label(&[]).is_empty());
}
