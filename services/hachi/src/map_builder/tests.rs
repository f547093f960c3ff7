//! Small capacities make many runs and merges of few points.

use std::collections::BTreeMap;

use super::*;

fn points(map: &MapBuilder) -> Vec<([f32; 3], f32)> {
    map.points().unwrap().map(Result::unwrap).collect()
}

/// Points of a walk to and fro, as no library's generator changes them: most cubes are seen again
/// and again, some only once.
fn walk(count: u32) -> impl Iterator<Item = ([f64; 3], f32)> {
    let mut state = 1u32;
    let mut draw = move || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        f64::from(state >> 8) / f64::from(1 << 24)
    };
    (0..count).map(move |i| {
        let along = 8.0 * (f64::from(i) * 1e-3).sin();
        let point = [along + draw(), 2.0 * draw() - 1.0, 0.5 * draw()];
        (point, (i % 256) as f32)
    })
}

#[test]
fn a_cube_becomes_the_mean_of_its_points_on_either_side_of_zero() {
    let folder = tempfile::tempdir().unwrap();
    let mut map = MapBuilder::new(0.1, folder.path());
    map.add([-0.02, 0.0, 0.0], 10.0);
    map.add([-0.04, 0.0, 0.0], 30.0);
    map.add([5.01, 0.0, 0.0], 7.0);
    map.add([f64::NAN, 0.0, 0.0], 7.0);
    map.add([f64::INFINITY, 0.0, 0.0], 7.0);
    let points = points(&map);
    assert_eq!(points.len(), 2);
    assert!(
        (points[0].0[0] + 0.03).abs() < 2e-6 && points[0].1 == 20.0,
        "{points:?}"
    );
    assert!((points[1].0[0] - 5.01).abs() < 2e-6, "{points:?}");
}

#[test]
fn what_went_to_the_disk_and_back_is_what_memory_would_have_held() {
    let folder = tempfile::tempdir().unwrap();
    // A few hundred runs: merged on two shelves, and one merge under way at the end.
    let mut map = MapBuilder::with_capacity(0.05, folder.path(), 100);
    let mut expected: BTreeMap<[i32; 3], ([f64; 3], f64, f64)> = BTreeMap::new();
    for (point, intensity) in walk(40_000) {
        map.add(point, intensity);
        let key = point.map(|c| (c / 0.05).floor() as i32);
        let (sum, bright, count) = expected.entry(key).or_default();
        (0..3).for_each(|a| sum[a] += point[a]);
        *bright += f64::from(intensity);
        *count += 1.0;
    }
    let got = points(&map);
    assert_eq!((got.len(), map.len()), (expected.len(), expected.len()));
    for ((position, intensity), (sum, bright, count)) in got.iter().zip(expected.values()) {
        for axis in 0..3 {
            let off = f64::from(position[axis]) - sum[axis] / count;
            assert!(off.abs() < 2e-6, "{position:?} {sum:?} {count}");
        }
        assert!((f64::from(*intensity) - bright / count).abs() < 1e-4);
    }
    assert!(std::fs::read_dir(folder.path()).unwrap().next().is_none());
}

#[test]
fn the_size_of_the_memory_changes_no_bit_of_the_map() {
    let folder = tempfile::tempdir().unwrap();
    let written = |capacity: usize| {
        let mut map = MapBuilder::with_capacity(0.05, folder.path(), capacity);
        walk(20_000).for_each(|(point, intensity)| map.add(point, intensity));
        let path = folder.path().join("map.ply");
        map.write(&path).unwrap();
        std::fs::read(path).unwrap()
    };
    let at_once = written(20_000);
    for capacity in [10, 333, 5_000] {
        assert!(written(capacity) == at_once, "{capacity}");
    }
}

#[test]
fn files_on_the_disk_stay_few() {
    let folder = tempfile::tempdir().unwrap();
    let mut map = MapBuilder::with_capacity(0.05, folder.path(), 50);
    let mut most = 0;
    for (point, intensity) in walk(60_000) {
        map.add(point, intensity);
        most = most.max(map.older.sources().count());
    }
    // Four shelves of up to eight runs and as many that are being merged.
    assert!((20..=64).contains(&most), "{most}");
}

#[test]
fn a_folder_that_is_gone_costs_the_map_and_nothing_else() {
    let folder = tempfile::tempdir().unwrap();
    let gone = folder.path().join("gone");
    let mut map = MapBuilder::with_capacity(0.05, &gone, 50);
    walk(1_000).for_each(|(point, intensity)| map.add(point, intensity));
    let failure = map.write(&folder.path().join("map.ply")).unwrap_err();
    let line = failure.to_string();
    assert!(line.contains("map.ply"), "{line}");
    assert_eq!(map.len(), 0);
    assert!(std::fs::read_dir(folder.path()).unwrap().next().is_none());
}
