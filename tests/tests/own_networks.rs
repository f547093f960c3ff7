//! The networks in the program itself on pictures of the simulated camera, through the driver's
//! bytes: people are found where they truly are, and told apart.

use std::path::Path;

use hachi_inference::{ImageView, LoadOptions, Own, load};
use hachi_people::BoundingBox;
use hachi_people::appearance::{Appearance, Person as Seen};
use hachi_people::detect::{Detector, Found, Wanted};
use hachi_people::gallery;
use hachi_realsense::frame::{Layout, YuyvImage};
use hachi_tests::masks::{mask_overlap, middle_in};
use hachi_world::{
    CameraConfig, CameraFrame, Light, Outfit, Person, Preset, SimulatedCamera, SimulationConfig,
    Visit,
};

const WIDTH: u32 = 640;
const HEIGHT: u32 = 360;
/// An office that the networks were not trained in.
const SEED: u64 = 71;
/// The robot stands in the corridor, and looks along x.
const LOOKS_NS: i64 = 900_000_000;
const STEP_NS: i64 = 500_000_000;

/// Three people who walk up and down before the robot: towards it, away from it, across.
fn people() -> Vec<Person> {
    let person = |id, height_m, skin, hair, outfit, path: &[[f64; 2]]| Person {
        id,
        height_m,
        skin,
        hair,
        visits: vec![Visit {
            begins_s: 0.0,
            path: path.to_vec(),
            speed_m_s: 0.7,
            stays_s: 60.0,
            outfit,
        }],
    };
    let outfit = |top, trousers, shoes| Outfit {
        top,
        trousers,
        shoes,
    };
    let red = outfit([190, 40, 40], [50, 60, 110], [30, 30, 30]);
    let green = outfit([40, 140, 70], [190, 170, 130], [90, 60, 40]);
    let blue = outfit([60, 90, 200], [40, 40, 45], [220, 220, 220]);
    vec![
        person(
            1,
            1.78,
            [220, 180, 150],
            [60, 40, 30],
            red,
            &[[2.6, 0.5], [6.5, 0.4], [3.0, 0.4]],
        ),
        person(
            2,
            1.62,
            [110, 75, 55],
            [25, 20, 20],
            green,
            &[[6.0, -0.5], [2.8, -0.5], [5.0, -0.4]],
        ),
        person(
            3,
            1.85,
            [240, 205, 180],
            [200, 170, 110],
            blue,
            &[[4.4, 0.9], [4.4, -0.9], [4.4, 0.9]],
        ),
    ]
}

/// Looks twelve times, twice a second, in this light.
fn look(light: Light, mut seen: impl FnMut(&CameraFrame, &ImageView<'_>)) {
    let simulation = SimulationConfig {
        people: people().into(),
        ..SimulationConfig::preset(Preset::Office, SEED, 20.0)
    };
    let config = CameraConfig {
        light,
        ..CameraConfig::d455(WIDTH, HEIGHT, 0.2)
    };
    let mut camera = SimulatedCamera::new(&simulation, config);
    let layout = Layout::packed(WIDTH, HEIGHT);
    let mut rgb = vec![0; 3 * layout.pixels()];
    for step in 0..12 {
        camera.skip_to(simulation.start + LOOKS_NS + step * STEP_NS);
        let frame = camera.next_frame().unwrap();
        let image = YuyvImage::new(&frame.color, layout).unwrap();
        image.to_rgb(&mut rgb).unwrap();
        let image = ImageView::new(WIDTH as usize, HEIGHT as usize, &rgb).unwrap();
        seen(frame, &image);
    }
}

fn detector() -> Detector {
    let loaded = load(Path::new(Own::Detector.name()), &LoadOptions::default()).unwrap();
    Detector::new(loaded, Wanted::People).unwrap()
}

fn sure(detector: &mut Detector, image: &ImageView<'_>) -> Vec<Found> {
    let even_score = detector.even_score();
    let mut found = detector.detect(image).unwrap().to_vec();
    found.retain(|found| found.score >= even_score);
    found
}

/// The true boxes of those of whom more than half is seen, 100 pixels high or higher, with their
/// numbers in the mask.
fn well_seen(frame: &CameraFrame) -> Vec<(u8, u32, BoundingBox)> {
    let people = frame.people.iter().zip(1..);
    people
        .filter(|(truth, _)| {
            truth.visible.is_some_and(|b| b.height() >= 100) && truth.visible_share() > 0.5
        })
        .filter_map(|(truth, label)| {
            let bounding_box = BoundingBox::of_edges(truth.visible?.edges());
            Some((label, truth.id, bounding_box))
        })
        .collect()
}

/// Whoever of those found has the box of this person, overlapping by at least half.
fn who_has<'a>(found: &'a [Found], bounding_box: &BoundingBox) -> Option<&'a Found> {
    let overlap = |found: &Found| found.bounding_box.iou(bounding_box);
    let best = found
        .iter()
        .max_by(|a, b| overlap(a).total_cmp(&overlap(b)))?;
    (overlap(best) >= 0.5).then_some(best)
}

#[test]
fn people_are_found_where_they_truly_are() {
    let mut detector = detector();
    let (mut people, mut hits) = (0, 0);
    let mut overlaps = Vec::new();
    look(Light::default(), |frame, image| {
        let found = sure(&mut detector, image);
        for (label, _, truth) in well_seen(frame) {
            people += 1;
            if let Some(hit) = who_has(&found, &truth) {
                let overlap = mask_overlap(hit, label, &frame.masks, WIDTH as usize).unwrap();
                // Found is who has both a box and a mask that are right.
                hits += usize::from(overlap > 0.5);
                overlaps.push(overlap);
            }
        }
        // Everybody who is called sure is somebody, whole or in parts.
        for found in &found {
            let b = &found.bounding_box;
            let shown = frame.masks.iter().enumerate().filter(|(pixel, mask)| {
                **mask > 0 && middle_in(b, *pixel, WIDTH as usize).is_some()
            });
            let share = shown.count() as f64 / (b.width * b.height);
            assert!(share > 0.15, "nobody at {b:?} in {}", frame.sequence);
        }
    });
    assert!(people >= 12, "only {people} people to find");
    // Of people in test pictures who are 16 pixels high or higher 72 % are found (BENCHMARKS): of those
    // who are large and in sight it must be more.
    assert!(hits * 5 >= people * 4, "{hits} of {people}");
    let mean = overlaps.iter().sum::<f64>() / overlaps.len() as f64;
    assert!(mean > 0.75, "masks overlap by {mean}");
}

/// Nine pictures of a person in ten are nearer to one of the same person, in other light, than to any
/// of others.
#[test]
fn people_are_told_apart_in_other_light() {
    let mut detector = detector();
    let loaded = load(Path::new(Own::ReId.name()), &LoadOptions::default()).unwrap();
    let mut appearance = Appearance::new(loaded).unwrap();
    let mut features = |light: Light| {
        let mut of: Vec<(u32, Vec<f32>)> = Vec::new();
        look(light, |frame, image| {
            let found = sure(&mut detector, image);
            for (_, id, truth) in well_seen(frame) {
                let Some(hit) = who_has(&found, &truth) else {
                    continue;
                };
                let crop = Seen {
                    bounding_box: hit.bounding_box,
                    mask: hit.mask.as_ref(),
                };
                of.push((id, appearance.features(image, &[crop]).unwrap().to_vec()));
            }
        });
        of
    };
    let day = features(Light::default());
    let dusk = features(Light {
        level: [0.75, 0.7, 0.65],
        ambient: 0.4,
        towards: [1.0, -1.0, 0.5],
        ..Light::default()
    });
    let pictures = |wanted: &dyn Fn(u32) -> bool| -> Vec<f32> {
        let of = day.iter().filter(|(id, _)| wanted(*id));
        of.flat_map(|(_, feature)| feature.clone()).collect()
    };
    assert!(dusk.len() >= 10, "only {} people to tell apart", dusk.len());
    let right = dusk.iter().filter(|(id, feature)| {
        let same = gallery::distance(&pictures(&|other| other == *id), feature);
        same < gallery::distance(&pictures(&|other| other != *id), feature)
    });
    let right = right.count();
    assert!(right * 10 >= dusk.len() * 9, "{right} of {}", dusk.len());
}
