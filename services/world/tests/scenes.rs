//! The scripted scenes keep what they promise: the person is there when the user picks, leaves sight
//! and comes back, and nobody appears in the middle of the picture.

use std::collections::BTreeMap;

use hachi_world::scenes::Script;
use hachi_world::{CameraConfig, SimulatedCamera};

/// Small pictures, twice a second: enough to know who is in sight.
const STEP_NS: i64 = 500_000_000;

fn camera(script: Script, seed: u64) -> (SimulatedCamera, u32, f64) {
    let scene = script.scene(seed);
    let config = CameraConfig {
        period_ns: STEP_NS,
        ..CameraConfig::d455(80, 46, 0.2)
    };
    let camera = SimulatedCamera::new(&scene.simulation, config);
    (camera, scene.target, scene.picked_at_s)
}

/// Nobody walks faster from one frame to the next, metres.
const FARTHEST_M: f64 = 0.5 * 1.25 + 0.05;

#[test]
fn the_person_leaves_sight_and_comes_back_and_nobody_appears_in_the_picture() {
    for script in Script::ALL {
        let name = script.name();
        let lasts_s = script.scene(1).simulation.duration_s;
        assert!((120.0..=180.0).contains(&lasts_s), "{name}");
        let (mut camera, target, picked_at_s) = camera(script, 1);
        let start = camera.next_stamp().unwrap();
        let (mut returns, mut away, mut hidden) = (0, false, 0);
        let mut before: BTreeMap<u32, [f64; 2]> = BTreeMap::new();
        while let Some(frame) = camera.next_color_frame() {
            for person in &frame.people {
                let [x, y] = [0, 1].map(|axis| person.map_from_person.translation.vector[axis]);
                let from = before.insert(person.id, [x, y]);
                let far = from.is_some_and(|[a, b]| (x - a).hypot(y - b) > FARTHEST_M);
                assert!(
                    !far || person.visible.is_none(),
                    "{name}: {} jumps",
                    person.id
                );
            }
            let person = frame.people.iter().find(|person| person.id == target);
            let person = person.expect("the target is in the world from beginning to end");
            let seen = person.visible.is_some() && person.visible_share() > 0.6;
            if frame.stamp.secs_since(start) <= picked_at_s {
                assert!(seen, "{name}");
            }
            hidden += usize::from(!seen);
            if person.visible.is_none() {
                away = true;
            } else if seen && away {
                (away, returns) = (false, returns + 1);
            }
        }
        let least = if script == Script::Crossing { 0 } else { 3 };
        assert!(returns >= least, "{name}: {returns} returns");
        assert!(hidden >= 6, "{name}: hidden in {hidden} frames");
    }
}

#[test]
fn a_seed_gives_the_same_scene_and_another_one_other_people() {
    let people = |seed| Script::Crowd.scene(seed).simulation.people;
    assert_eq!(people(3), people(3));
    assert_ne!(people(3)[0].visits[0].outfit, people(4)[0].visits[0].outfit);
}

#[test]
fn a_twin_wears_the_same_and_somebody_similar_nearly() {
    let clothes =
        |script: Script, who: usize| script.scene(5).simulation.people[who].visits[0].outfit;
    assert_eq!(clothes(Script::Twin, 0), clothes(Script::Twin, 1));
    let [a, b] = [0, 1].map(|who| clothes(Script::Similar, who));
    let off = |a: [u8; 3], b: [u8; 3]| {
        let parts = a.iter().zip(b).map(|(a, b)| f64::from(*a) - f64::from(b));
        parts.map(|d| d * d).sum::<f64>().sqrt()
    };
    assert!((10.0..70.0).contains(&off(a.top, b.top)), "{a:?} {b:?}");
}
