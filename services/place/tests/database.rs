//! What a database finds, and that it finds what looking at every place finds.

mod scenes;

use std::f32::consts::{PI, TAU};

use hachi_place::{
    Comparison, Database, DatabaseConfig, Describer, DescriberConfig, Descriptor, Kind, Match,
    Profile, RingKey, SearchConfig, ShiftSearch,
};
use proptest::prelude::*;
use scenes::{room, seen_from, turned};

fn describer(kind: Kind) -> Describer {
    Describer::new(Profile::OUTDOOR, DescriberConfig::for_kind(kind))
}

fn describe(points: &[[f32; 4]]) -> Descriptor {
    let mut out = Descriptor::default();
    describer(Kind::GscHuber).describe(points, &mut out);
    out
}

fn views(points: &[[f32; 4]]) -> Vec<Descriptor> {
    let mut out = Vec::new();
    describer(Kind::GscHuber).describe_views(points, &mut out);
    out
}

/// A database of rooms, by their seed.
fn rooms(count: u64) -> Database {
    let mut database = Database::default();
    for seed in 0..count {
        database.insert(seed, &describe(&room(seed))).unwrap();
    }
    database
}

fn best(database: &Database, views: &[Descriptor]) -> Option<Match> {
    let mut matches = Vec::new();
    database.query(views, |_| true, 1, &mut matches).unwrap();
    matches.first().copied()
}

fn angle_between(a: f32, b: f32) -> f32 {
    ((a - b + PI).rem_euclid(TAU) - PI).abs()
}

#[test]
fn a_turn_by_whole_sectors_comes_back_as_yaw() {
    for kind in Kind::ALL {
        let mut describer = describer(kind);
        let mut database = Database::new(DatabaseConfig::for_kind(kind));
        let mut d = Descriptor::default();
        for seed in 0..20 {
            describer.describe(&room(seed), &mut d);
            database.insert(seed, &d).unwrap();
        }
        for sectors in [0, 1, 13, 30, 47, 59] {
            let yaw = sectors as f32 * 6f32.to_radians();
            // The robot turned left by `yaw`: the cloud turns right.
            describer.describe(&turned(&room(7), -yaw), &mut d);
            let found = best(&database, std::slice::from_ref(&d)).unwrap();
            assert_eq!(found.id, 7, "{kind:?} {sectors}");
            assert!(found.similarity > 0.95, "{kind:?} {sectors}: {found:?}");
            let error = angle_between(found.yaw_rad, yaw);
            assert!(error < 0.5f32.to_radians(), "{kind:?} {sectors}: {found:?}");
        }
    }
}

#[test]
fn a_reverse_revisit_is_found_with_half_a_turn() {
    let database = rooms(50);
    let back = seen_from(&room(21), 0.3, -0.2, PI + 0.05);
    let found = best(&database, &views(&back)).unwrap();
    assert_eq!(found.id, 21);
    assert!(angle_between(found.yaw_rad, PI + 0.05) < 3f32.to_radians());
}

#[test]
fn a_place_seen_from_the_lane_beside_is_found_with_its_offset() {
    let database = rooms(50);
    let (step, _) = Profile::OUTDOOR.lateral();
    for (place_y, yaw, lateral) in [
        // The robot stands to the left of where it stood: what it knows is to its right.
        (step, 0.0, -step),
        (-step, 0.0, step),
        // In reverse direction left and right change places.
        (step, PI, step),
    ] {
        let found = best(&database, &views(&seen_from(&room(33), 0.0, place_y, yaw))).unwrap();
        assert_eq!((found.id, found.lateral_m), (33, lateral));
        assert!(found.similarity > 0.9, "{found:?}");
        // The pose that the match stands for: the candidate is the room's own frame.
        let candidate_from_query = found.candidate_from_query();
        let at = candidate_from_query.translation.vector;
        assert!(
            (at.y - f64::from(place_y)).abs() < 0.1 && at.x.abs() < 0.1,
            "{at}"
        );
        assert!(angle_between(found.yaw_rad, yaw) < 2f32.to_radians());
    }
}

#[test]
fn only_accepted_ids_match_and_removed_ones_do_not() {
    let mut database = rooms(30);
    let query = views(&room(5));
    let mut matches = Vec::new();
    database
        .query(&query, |id| id != 5, 10, &mut matches)
        .unwrap();
    assert!(matches.iter().all(|m| m.id != 5 && m.similarity < 0.99));
    database.query(&query, |_| true, 1, &mut matches).unwrap();
    assert_eq!(matches[0].id, 5);
    assert!((matches[0].similarity - 1.0).abs() < 1e-6);
    assert!(database.remove(5) && !database.remove(5));
    assert_eq!(database.len(), 29);
    database.query(&query, |_| true, 30, &mut matches).unwrap();
    assert!(matches.iter().all(|m| m.id != 5));
    // An id given again is the new place.
    database.insert(6, &query[0]).unwrap();
    assert_eq!(database.len(), 29);
    database.query(&query, |_| true, 1, &mut matches).unwrap();
    assert_eq!(matches[0].id, 6);
}

#[test]
fn places_without_features_match_nothing() {
    let flat: Vec<[f32; 4]> = (0..3600)
        .map(|i| (i as f32 / 3600.0 * TAU).sin_cos())
        .flat_map(|(sin, cos)| (1..80).map(move |r| [r as f32 * cos, r as f32 * sin, 0.0, 9.0]))
        .collect();
    let one_place = vec![[0.0, 0.0, 0.0, 0.0]; 10_000];
    for comparison in Comparison::ALL {
        let mut database = Database::new(DatabaseConfig {
            comparison,
            ..DatabaseConfig::default()
        });
        database.insert(1, &describe(&[])).unwrap();
        database.insert(2, &describe(&flat)).unwrap();
        database.insert(3, &describe(&one_place)).unwrap();
        database.insert(4, &describe(&room(1))).unwrap();
        for query in [&[][..], &flat, &one_place, &room(1)] {
            let mut matches = Vec::new();
            database
                .query(&views(query), |_| true, 9, &mut matches)
                .unwrap();
            assert!(
                matches
                    .iter()
                    .all(|m| m.similarity.is_finite() && m.yaw_rad.is_finite())
            );
            assert!(matches.iter().all(|m| m.id != 1), "{comparison:?}");
            if query.is_empty() {
                assert!(matches.is_empty());
            }
        }
    }
}

#[test]
fn descriptors_of_another_grid_are_refused() {
    let mut database = rooms(2);
    let mut other = Descriptor::default();
    Describer::new(Profile::INDOOR, DescriberConfig::default()).describe(&room(0), &mut other);
    let refused = database.insert(9, &other).unwrap_err();
    assert_eq!(refused.got.profile, Profile::INDOOR);
    assert_eq!(database.len(), 2);
    assert!(
        database
            .query(&[other], |_| true, 1, &mut Vec::new())
            .is_err()
    );
}

/// All shifts of all places, from the descriptors' own values, in double precision.
fn brute_force(places: &[(u64, Descriptor)], query: &Descriptor) -> (u64, f64, usize) {
    let prepared = |d: &Descriptor| {
        let (rings, sectors) = (20, 60);
        let mut m = vec![vec![0f64; sectors]; rings];
        for (ring, row) in m.iter_mut().enumerate() {
            for (sector, v) in row.iter_mut().enumerate() {
                *v = f64::from(d.value(ring, sector));
            }
        }
        m
    };
    let q = prepared(query);
    let norm = |m: &Vec<Vec<f64>>| m.iter().flatten().map(|v| v * v).sum::<f64>().sqrt();
    let mut best = (u64::MAX, f64::NEG_INFINITY, 0);
    for (id, place) in places {
        let c = prepared(place);
        for shift in 0..60 {
            let dot: f64 = (0..20)
                .flat_map(|r| (0..60).map(move |s| (r, s)))
                .map(|(r, s)| q[r][s] * c[r][(s + shift) % 60])
                .sum();
            let similarity = dot / (norm(&q) * norm(&c));
            if similarity > best.1 {
                best = (*id, similarity, shift);
            }
        }
    }
    best
}

#[test]
fn the_database_finds_what_brute_force_finds() {
    let mut database = Database::new(DatabaseConfig {
        comparison: Comparison::Frobenius,
        ring_key: RingKey::Occupancy,
        search: SearchConfig {
            candidates: usize::MAX,
            shifts: ShiftSearch::Exhaustive,
            min_similarity: -1.0,
        },
    });
    let mut places = Vec::new();
    for seed in 0..150 {
        let d = describe(&room(seed));
        database.insert(seed, &d).unwrap();
        places.push((seed, d));
    }
    for seed in [3, 77, 140, 400, 500] {
        let query = describe(&seen_from(&room(seed), 1.0, -2.0, 2.1));
        let expected = brute_force(&places, &query);
        let found = best(&database, std::slice::from_ref(&query)).unwrap();
        assert_eq!(found.id, expected.0);
        assert!((f64::from(found.similarity) - expected.1).abs() < 2e-4);
        let yaw = expected.2 as f32 * 6f32.to_radians();
        assert!(angle_between(found.yaw_rad, yaw) <= 3.01f32.to_radians());
    }
}

#[test]
fn the_default_search_finds_nearly_always_what_the_exhaustive_one_finds() {
    let mut database = rooms(300);
    let mut agree = 0;
    for seed in 0..60 {
        let query = views(&seen_from(&room(seed * 5), 0.8, 0.5, seed as f32));
        let quick = best(&database, &query);
        database.set_search(SearchConfig {
            candidates: usize::MAX,
            shifts: ShiftSearch::Exhaustive,
            ..SearchConfig::default()
        });
        let thorough = best(&database, &query).unwrap();
        database.set_search(SearchConfig::default());
        agree += usize::from(quick.is_some_and(|q| q.id == thorough.id));
    }
    assert!(agree >= 57, "{agree} of 60");
}

#[test]
fn a_database_saved_loaded_and_grown_answers_as_one_that_was_not() {
    let mut whole = rooms(200);
    let mut half = rooms(100);
    half.remove(40);
    whole.remove(40);
    let mut loaded = Database::from_bytes(&half.to_bytes()).unwrap();
    assert_eq!(loaded.to_bytes(), half.to_bytes());
    assert_eq!(loaded.len(), 99);
    for seed in 100..200 {
        loaded.insert(seed, &describe(&room(seed))).unwrap();
    }
    for seed in (0..200).step_by(9) {
        let query = views(&seen_from(&room(seed), 0.4, 0.4, 1.0));
        let (mut a, mut b) = (Vec::new(), Vec::new());
        whole.query(&query, |_| true, 5, &mut a).unwrap();
        loaded.query(&query, |_| true, 5, &mut b).unwrap();
        assert_eq!(a, b);
    }
}

#[test]
fn broken_files_are_refused_wherever_they_are_cut() {
    let bytes = rooms(3).to_bytes();
    for cut in (0..bytes.len())
        .step_by(7)
        .chain(bytes.len() - 3..bytes.len())
    {
        assert!(Database::from_bytes(&bytes[..cut]).is_err(), "{cut}");
    }
    // A count of four billion places asks for no memory.
    let mut many = bytes.clone();
    let empty =
        Database::with_layout(*rooms(1).layout().unwrap(), DatabaseConfig::default()).to_bytes();
    let count_at = empty.len() - 4;
    many[count_at..count_at + 4].fill(0xff);
    assert!(Database::from_bytes(&many).is_err());
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn damaged_files_never_panic(at in 0usize..9000, value in any::<u8>()) {
        let mut bytes = rooms(3).to_bytes();
        let at = at % bytes.len();
        bytes[at] = value;
        if let Ok(database) = Database::from_bytes(&bytes) {
            let mut matches = Vec::new();
            if database.query(&views(&room(1)), |_| true, 3, &mut matches).is_ok() {
                prop_assert!(matches.iter().all(|m| m.similarity.is_finite()));
            }
        }
    }
}
