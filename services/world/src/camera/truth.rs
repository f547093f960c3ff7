//! What is true of the people in a picture: counted from its pixels, not computed beside them.

use hachi_hal::{Pose, Vector3};

use crate::person::{Outfit, Person, Presence};

/// A box of pixels; the first column and row belong to it, the ends do not.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct PixelBox {
    /// First column.
    pub left: u32,
    /// First row.
    pub top: u32,
    /// Column behind the last.
    pub right: u32,
    /// Row behind the last.
    pub bottom: u32,
}

impl PixelBox {
    fn of(column: u32, row: u32) -> Self {
        Self {
            left: column,
            top: row,
            right: column + 1,
            bottom: row + 1,
        }
    }

    /// With another pixel in it.
    pub(super) fn grown(before: Option<Self>, column: u32, row: u32) -> Self {
        before.map_or_else(
            || Self::of(column, row),
            |b| Self {
                left: b.left.min(column),
                top: b.top.min(row),
                right: b.right.max(column + 1),
                bottom: b.bottom.max(row + 1),
            },
        )
    }

    /// Left, upper, right and lower edge, in pixels from the picture's corner.
    pub fn edges(&self) -> [f64; 4] {
        [self.left, self.top, self.right, self.bottom].map(f64::from)
    }

    /// Columns.
    pub const fn width(&self) -> u32 {
        self.right - self.left
    }

    /// Rows.
    pub const fn height(&self) -> u32 {
        self.bottom - self.top
    }
}

/// What is true of one person in one frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PersonTruth {
    /// Who it is.
    pub id: u32,
    /// Which visit, and so which clothes.
    pub visit: usize,
    /// The clothes.
    pub outfit: Outfit,
    /// On the floor between the feet, x ahead.
    pub map_from_person: Pose,
    /// The middle of the body in the colour camera's frame, metres.
    pub middle_in_color: Vector3,
    /// Pixels that show the person.
    pub visible_pixels: u32,
    /// The box around them.
    pub visible: Option<PixelBox>,
    /// Pixels within the picture that would if nothing were in the way.
    pub whole_pixels: u32,
    /// The box around those.
    pub whole: Option<PixelBox>,
}

impl PersonTruth {
    pub(super) fn new(person: &Person, presence: &Presence, map_from_color: &Pose) -> Self {
        let middle =
            presence.map_from_person * nalgebra::Point3::new(0.0, 0.0, person.height_m / 2.0);
        Self {
            id: person.id,
            visit: presence.visit,
            outfit: person.visits[presence.visit].outfit,
            map_from_person: presence.map_from_person,
            middle_in_color: map_from_color.inverse_transform_point(&middle).coords,
            visible_pixels: 0,
            visible: None,
            whole_pixels: 0,
            whole: None,
        }
    }

    /// How much of what lies within the picture is seen, 0 to 1.
    pub fn visible_share(&self) -> f64 {
        f64::from(self.visible_pixels) / f64::from(self.whole_pixels.max(1))
    }

    pub(super) fn set_whole(&mut self, (pixels, whole): (u32, Option<PixelBox>)) {
        (self.whole_pixels, self.whole) = (pixels, whole);
    }
}

/// Counts each person's pixels and boxes them.
pub(super) fn find_visible(masks: &[u8], width: u32, people: &mut [PersonTruth]) {
    for (row, line) in masks.chunks_exact(width.max(1) as usize).enumerate() {
        for (column, &mask) in line.iter().enumerate() {
            let number = usize::from(mask).checked_sub(1);
            if let Some(person) = number.and_then(|n| people.get_mut(n)) {
                person.visible_pixels += 1;
                let grown = PixelBox::grown(person.visible, column as u32, row as u32);
                person.visible = Some(grown);
            }
        }
    }
}
