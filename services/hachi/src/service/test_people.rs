//! What tests of the tasks behind the camera have the networks see.

use hachi_people::BoundingBox;
use hachi_people::observe::Observation;
use hachi_people::track::{Detection, Features};

/// Somebody 40 by 100 pixels, surely a person.
pub fn person_at(left: f64, top: f64) -> Detection {
    Detection {
        bounding_box: BoundingBox::new(left, top, 40.0, 100.0),
        score: 0.95,
    }
}

/// These people, with what they look like: as many numbers for each.
pub fn observation<'a>(detections: &'a [Detection], looks: &'a [f32]) -> Observation<'a> {
    Observation {
        detections,
        features: Some(Features {
            dimension: looks.len() / detections.len().max(1),
            values: looks,
            same_person_distance: 0.4,
        }),
        columns: None,
    }
}
