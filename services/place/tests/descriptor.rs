//! Descriptors worked out by hand, and what must not change them.

mod scenes;

use hachi_place::{Describer, DescriberConfig, Descriptor, Formula, Kind, Profile};
use proptest::prelude::*;
use scenes::{room, turned};

fn describe(kind: Kind, formula: Formula, points: &[[f32; 4]]) -> Descriptor {
    let config = DescriberConfig {
        kind,
        formula,
        min_points: 1,
        min_share: 0.0,
        ..DescriberConfig::for_kind(kind)
    };
    let mut out = Descriptor::default();
    Describer::new(Profile::OUTDOOR, config).describe(points, &mut out);
    out
}

fn close(a: f32, b: f64) -> bool {
    (f64::from(a) - b).abs() < 1e-5 * b.abs().max(1.0)
}

/// Three points in ring 3 (8 to 12 m), sector 1 (0 to 6 degrees); heights 1, 2 and 6 m; one point
/// in ring 1, sector 16 (90 to 96 degrees), height 0.5 m.
const FEW: [[f32; 4]; 4] = [
    [10.0, 0.1, 1.0, 10.0],
    [10.0, 0.1, 2.0, 20.0],
    [10.0, 0.1, 6.0, 60.0],
    [-0.1, 3.0, 0.5, 100.0],
];

/// The ground's own value: heights count from it.
const GROUND: f64 = Profile::OUTDOOR.ground_offset_m() as f64;

#[test]
fn scan_context_holds_the_greatest_height() {
    let d = describe(Kind::ScanContext, Formula::Deviation, &FEW);
    assert!(close(d.value(2, 0), 6.0 + GROUND));
    assert!(close(d.value(0, 15), 0.5 + GROUND));
    assert_eq!(d.values().iter().filter(|v| **v > 0.0).count(), 2);
    let mut ring_key = vec![0; 20];
    (ring_key[0], ring_key[2]) = (1, 1);
    assert_eq!(d.ring_key(), ring_key);
}

#[test]
fn gaussian_heights_are_mean_plus_twice_the_unbiased_spread() {
    // Mean 3; squares 4 + 1 + 9 = 14, over 2: variance 7.
    let d = describe(Kind::GscHeight, Formula::Variance, &FEW);
    assert!(close(d.value(2, 0), 3.0 + 2.0 * 7.0 + GROUND));
    // One point has no spread.
    assert!(close(d.value(0, 15), 0.5 + GROUND));
    let d = describe(Kind::GscHeight, Formula::Deviation, &FEW);
    assert!(close(d.value(2, 0), 3.0 + 2.0 * 7f64.sqrt() + GROUND));
}

#[test]
fn huber_weights_come_from_the_distance_to_the_mean() {
    // The points lie above each other, so the distances to the mean height 3 are 2, 1 and 3 m:
    // weights 1/2, 1 and 1/3. Weighted mean (0.5 + 2 + 2) / (11/6) = 27/11.
    let (weights, heights) = ([0.5, 1.0, 1.0 / 3.0], [1.0, 2.0, 6.0]);
    let total: f64 = weights.iter().sum();
    let mean = 27.0 / 11.0;
    let variance = weights
        .iter()
        .zip(heights)
        .map(|(w, z): (&f64, f64)| w * (z - mean) * (z - mean))
        .sum::<f64>()
        / total;
    let d = describe(Kind::GscHuber, Formula::Variance, &FEW);
    assert!(close(d.value(2, 0), mean + 2.0 * variance + GROUND));
    let d = describe(Kind::GscHuber, Formula::Deviation, &FEW);
    assert!(close(d.value(2, 0), mean + 2.0 * variance.sqrt() + GROUND));
}

#[test]
fn huber_distances_are_in_space_not_in_height() {
    // Two points 4 m apart sideways at one height: each 2 m from the mean, weights 1/2 and 1/2;
    // a third 0 m from it pulls nothing. All at height 1: no spread, whatever the weights.
    let flat = [
        [30.0, 0.2, 1.0, 0.0],
        [34.0, 0.2, 1.0, 0.0],
        [32.0, 0.2, 1.0, 0.0],
    ];
    // Rings of 4 m: 28 to 32, 32 to 36 m. Keep them in one by hand: 32.5, 33.5, 35.5.
    let flat = flat.map(|[x, y, z, i]| [x * 0.5 + 18.0, y, z, i]);
    let d = describe(Kind::GscHuber, Formula::Variance, &flat);
    assert!(close(d.value(8, 0), 1.0 + GROUND));
    // Heights 0 at distance 1.5 m from the mean (weight 2/3) and 3 with weight 1:
    // x 33, 35, 35 and z 0, 0, 3 have mean (103/3, 1): distances below.
    let points = [
        [33.0, 0.2, 0.0, 0.0],
        [35.0, 0.2, 0.0, 0.0],
        [35.0, 0.2, 3.0, 0.0],
    ];
    let mean = [103.0 / 3.0, 1.0];
    let w = points.map(|p| {
        let r = (f64::from(p[0]) - mean[0]).hypot(f64::from(p[2]) - mean[1]);
        if r <= 1.0 { 1.0 } else { 1.0 / r }
    });
    let total: f64 = w.iter().sum();
    let m = 3.0 * w[2] / total;
    let variance = ((w[0] + w[1]) * m * m + w[2] * (3.0 - m) * (3.0 - m)) / total;
    let d = describe(Kind::GscHuber, Formula::Variance, &points);
    assert!(close(d.value(8, 0), m + 2.0 * variance + GROUND));
}

#[test]
fn gaussian_intensities_have_no_ground() {
    // Mean 30; squares 400 + 100 + 900 = 1400, over 2: variance 700.
    let d = describe(Kind::GscIntensity, Formula::Variance, &FEW);
    assert!(close(d.value(2, 0), 30.0 + 2.0 * 700.0));
    assert!(close(d.value(0, 15), 100.0));
}

#[test]
fn bins_with_too_few_points_are_empty() {
    // Nine points in a bin and three in another, and 2,400 in one bin beside: the mean over the
    // 1,200 bins is 2 points, a share of 2 of it is 4.
    let cloud: Vec<[f32; 4]> = [([10.0, 0.1], 9), ([-0.1, 3.0], 3), ([50.0, 50.0], 2388)]
        .into_iter()
        .flat_map(|([x, y], count)| std::iter::repeat_n([x, y, 1.0, 1.0], count))
        .collect();
    for (min_points, min_share, expected) in [
        (1, 0.0, [true, true]),
        (4, 0.0, [true, false]),
        (1, 2.0, [true, false]),
        (10, 2.0, [false, false]),
        (1, 5.0, [false, false]),
    ] {
        let config = DescriberConfig {
            min_points,
            min_share,
            ..DescriberConfig::default()
        };
        let mut d = Descriptor::default();
        Describer::new(Profile::OUTDOOR, config).describe(&cloud, &mut d);
        assert_eq!([d.value(2, 0) > 0.0, d.value(0, 15) > 0.0], expected);
    }
}

#[test]
fn what_lies_below_the_ground_is_more_than_nothing() {
    for kind in [Kind::ScanContext, Kind::GscHeight, Kind::GscHuber] {
        let d = describe(kind, Formula::Deviation, &[[10.0, 0.1, -7.0, 0.0]]);
        assert!(d.value(2, 0) > 0.0, "{kind:?}");
        assert!(f64::from(d.value(2, 0)) < GROUND, "{kind:?}");
    }
}

#[test]
fn clouds_without_a_usable_point_are_empty_and_hostile_ones_stay_finite() {
    let nan = [f32::NAN, 1.0, 1.0, 1.0];
    let infinite = [1.0, 1.0, f32::INFINITY, 1.0];
    let far = [1e30, -1e30, 1.0, 1.0];
    for kind in Kind::ALL {
        for formula in [Formula::Variance, Formula::Deviation] {
            for cloud in [&[][..], &[nan, infinite, far][..]] {
                assert!(describe(kind, formula, cloud).is_empty(), "{kind:?}");
            }
            let wild = [
                [1.0, 1.0, f32::MAX, f32::INFINITY],
                [1.0, 1.0, f32::MIN, f32::NAN],
                [1.0, 1.0, 1.0, -f32::MAX],
            ];
            let d = describe(kind, formula, &wild);
            assert!(d.values().iter().all(|v| v.is_finite()), "{kind:?}");
        }
    }
}

#[test]
fn a_million_equal_points_are_one_bin_without_spread() {
    let cloud = vec![[10.0, 0.1, 1.5, 42.0]; 1_000_000];
    for (kind, expected) in [
        (Kind::ScanContext, 1.5 + GROUND),
        (Kind::GscHeight, 1.5 + GROUND),
        (Kind::GscHuber, 1.5 + GROUND),
        (Kind::GscIntensity, 42.0),
    ] {
        let d = describe(kind, Formula::Deviation, &cloud);
        assert!(
            close(d.value(2, 0), expected),
            "{kind:?}: {}",
            d.value(2, 0)
        );
        assert_eq!(d.values().iter().filter(|v| **v > 0.0).count(), 1);
    }
}

#[test]
fn turning_by_whole_sectors_rotates_the_columns() {
    let cloud = room(1);
    let plain = describe(Kind::GscHuber, Formula::Deviation, &cloud);
    let moved = describe(
        Kind::GscHuber,
        Formula::Deviation,
        &turned(&cloud, 7.0 * 6f32.to_radians()),
    );
    // Rounding puts a few points of a bin's edge into its neighbour.
    let same = (0..20 * 60)
        .filter(|i| {
            let (ring, sector) = (i % 20, i / 20);
            let (a, b) = (
                plain.value(ring, sector),
                moved.value(ring, (sector + 7) % 60),
            );
            (a - b).abs() < 0.05
        })
        .count();
    assert!(same > 1150, "{same} of 1200");
}

#[test]
fn bytes_give_the_descriptor_back_and_broken_ones_an_error() {
    let d = describe(Kind::GscHuber, Formula::Deviation, &room(2));
    let bytes = d.to_bytes();
    assert_eq!(Descriptor::from_bytes(&bytes).as_ref(), Ok(&d));
    for cut in 0..bytes.len() {
        assert!(Descriptor::from_bytes(&bytes[..cut]).is_err(), "{cut}");
    }
    let mut longer = bytes.clone();
    longer.push(0);
    assert!(Descriptor::from_bytes(&longer).is_err());
    let mut nan = bytes;
    let end = nan.len();
    nan[end - 4..].copy_from_slice(&f32::NAN.to_le_bytes());
    assert!(Descriptor::from_bytes(&nan).is_err());
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(32))]

    #[test]
    fn the_order_of_points_does_not_matter(seed in 0u64..1000, swap in 1usize..97) {
        let cloud = room(seed);
        let mut shuffled: Vec<[f32; 4]> = Vec::with_capacity(cloud.len());
        for start in 0..swap {
            shuffled.extend(cloud.iter().skip(start).step_by(swap));
        }
        for kind in Kind::ALL {
            let a = describe(kind, Formula::Deviation, &cloud);
            let b = describe(kind, Formula::Deviation, &shuffled);
            for (a, b) in a.values().iter().zip(b.values()) {
                prop_assert!((a - b).abs() <= 1e-4 * a.abs().max(1.0), "{kind:?}: {a} and {b}");
            }
        }
    }

    #[test]
    fn any_bytes_are_read_or_refused(bytes in prop::collection::vec(any::<u8>(), 0..200)) {
        let _ = Descriptor::from_bytes(&bytes);
        let mut with_magic = b"HPD1".to_vec();
        with_magic.extend(bytes);
        let _ = Descriptor::from_bytes(&with_magic);
    }
}
