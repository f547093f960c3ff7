//! What is true of the people in a simulated picture, in the terms that following is measured in.
//!
//! In: the world's truth of a frame, a box that somebody is followed in. Out: whose box it is, how much
//! of a person there is to see, where a user would point.

use hachi_people::BoundingBox;
use hachi_people::followed::{Followed, Sight};
use hachi_world::PersonTruth;

/// A person who is less tall in the picture is too far away to be asked for, pixels.
const LEAST_HEIGHT: u32 = 32;
/// Somebody of whom less is seen is hidden.
const LEAST_SHARE: f64 = 0.5;
/// A box that overlaps nobody's so far is nobody's.
const LEAST_OVERLAP: f64 = 0.3;

/// How much of a person is seen in a picture of so many columns.
pub fn sight(person: Option<&PersonTruth>, columns: u32) -> Sight {
    let Some((person, seen)) = person.and_then(|person| Some((person, person.visible?))) else {
        return Sight::None;
    };
    // Half of a body that is cut off by an edge lies in the picture if its middle does.
    let whole = person.whole.unwrap_or(seen);
    let cut = whole.left == 0 || whole.right == columns;
    let narrow = f64::from(whole.width()) < 0.25 * f64::from(whole.height());
    let clear =
        person.visible_share() >= LEAST_SHARE && seen.height() >= LEAST_HEIGHT && !(cut && narrow);
    match clear {
        true => Sight::Clear,
        false => Sight::Partial,
    }
}

/// Whether who is followed in a box is the person.
pub fn followed(bounding_box: Option<BoundingBox>, people: &[PersonTruth], who: u32) -> Followed {
    match bounding_box.map(|b| owner(&b, people)) {
        None => Followed::Nobody,
        Some(Some(id)) if id == who => Followed::Right,
        Some(_) => Followed::Wrong,
    }
}

/// Whose box it is: who is seen in it, or would be if nobody stood before them.
fn owner(bounding_box: &BoundingBox, people: &[PersonTruth]) -> Option<u32> {
    let overlap = |person: &PersonTruth| {
        person.visible?;
        let boxes = [person.visible, person.whole].into_iter().flatten();
        let overlaps = boxes.map(|b| bounding_box.iou(&BoundingBox::of_edges(b.edges())));
        overlaps.max_by(f64::total_cmp)
    };
    let all = people
        .iter()
        .filter_map(|person| Some((person.id, overlap(person)?)));
    let best = all.max_by(|a, b| a.1.total_cmp(&b.1))?;
    (best.1 >= LEAST_OVERLAP).then_some(best.0)
}

/// Where a user who means a person would point: the middle of what is seen of them.
pub fn pointed_at(people: &[PersonTruth], who: u32) -> Option<[f64; 2]> {
    let person = people.iter().find(|person| person.id == who)?;
    let seen = person.visible?;
    Some(BoundingBox::of_edges(seen.edges()).middle())
}

#[cfg(test)]
mod tests {
    use super::*;
    use hachi_world::scenes::Script;
    use hachi_world::{CameraConfig, PixelBox, SimulatedCamera};

    fn person(id: u32, left: u32, width: u32, visible: f64) -> PersonTruth {
        let scene = Script::Return.scene(1);
        let config = CameraConfig::d455(32, 18, 0.0);
        let mut camera = SimulatedCamera::new(&scene.simulation, config);
        let whole = PixelBox {
            left,
            top: 20,
            right: left + width,
            bottom: 120,
        };
        PersonTruth {
            id,
            visible: (visible > 0.0).then_some(whole),
            visible_pixels: (1000.0 * visible) as u32,
            whole: Some(whole),
            whole_pixels: 1000,
            ..camera.next_color_frame().unwrap().people[0]
        }
    }

    #[test]
    fn a_person_is_in_clear_sight_unless_hidden_cut_off_or_far() {
        assert_eq!(sight(None, 400), Sight::None);
        assert_eq!(sight(Some(&person(1, 100, 40, 0.0)), 400), Sight::None);
        assert_eq!(sight(Some(&person(1, 100, 40, 0.4)), 400), Sight::Partial);
        assert_eq!(sight(Some(&person(1, 100, 40, 0.9)), 400), Sight::Clear);
        // Ten columns of the body at the edge.
        assert_eq!(sight(Some(&person(1, 390, 10, 1.0)), 400), Sight::Partial);
    }

    #[test]
    fn a_box_is_whose_it_overlaps_most() {
        let people = [person(1, 100, 40, 1.0), person(2, 200, 40, 1.0)];
        let at = |left: f64| Some(BoundingBox::new(left, 22.0, 38.0, 97.0));
        assert_eq!(followed(at(101.0), &people, 1), Followed::Right);
        assert_eq!(followed(at(195.0), &people, 1), Followed::Wrong);
        assert_eq!(followed(at(300.0), &people, 1), Followed::Wrong);
        assert_eq!(followed(None, &people, 1), Followed::Nobody);
        assert_eq!(pointed_at(&people, 1), Some([120.0, 70.0]));
    }
}
