//! A plane that may mirror, and the squares of it that are known to.
//!
//! In: a plane in the sensor frame, then for each point of a scan on which side of it the point
//! lies. Out: whether the ray to a point behind the plane went through a part of it that is known
//! to be a mirror.

use alloc::vec::Vec;

use crate::float::{add_scaled, cross, dot, floor_i32, unit};

/// Edge of a square of the plane.
const SQUARE_M: f32 = 0.5;
/// Squares along one side: 32 m each way from the foot of the perpendicular.
const SIDE: usize = 128;
/// A gap of one square, a frame or the space between two rings, does not end a pane.
const GAP: usize = 2;

/// What the plane is made of.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Surface {
    /// The footprint plane.
    Floor,
    /// A vertical plane.
    Pane,
}

/// A plane in the sensor frame that does not go through the sensor.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Mirror {
    pub(crate) surface: Surface,
    /// Unit, pointing away from the sensor.
    normal: [f32; 3],
    /// From the sensor, positive, metres.
    distance: f32,
    across: [f32; 3],
    along: [f32; 3],
}

impl Mirror {
    /// `None` unless the plane has a unit normal and stands clear of the sensor.
    pub(crate) fn new(surface: Surface, normal: [f32; 3], distance: f32) -> Option<Self> {
        let normal = unit(normal)?;
        let helper = if normal[0].abs() < 0.7 {
            [1.0, 0.0, 0.0]
        } else {
            [0.0, 1.0, 0.0]
        };
        let across = unit(cross(normal, helper))?;
        (distance > 0.05 && distance.is_finite()).then_some(Self {
            surface,
            normal,
            distance,
            across,
            along: cross(normal, across),
        })
    }

    /// How far behind the plane a position lies; negative on the sensor's side.
    #[inline(always)]
    pub(crate) fn depth(&self, position: [f32; 3]) -> f32 {
        dot(self.normal, position) - self.distance
    }

    /// The position's mirror image.
    pub(crate) fn reflect(&self, position: [f32; 3]) -> [f32; 3] {
        add_scaled(position, -2.0 * self.depth(position), self.normal)
    }

    /// Cosine of the angle at which the ray to a position meets the plane.
    pub(crate) fn cosine(&self, position: [f32; 3], distance: f32) -> f32 {
        dot(self.normal, position) / distance
    }

    /// Where the ray to a position meets the plane, from the foot of the perpendicular along the
    /// plane's two axes, as tangents of angles.
    pub(crate) fn offset(&self, position: [f32; 3]) -> [f32; 2] {
        let depth = dot(self.normal, position);
        [
            dot(self.across, position) / depth,
            dot(self.along, position) / depth,
        ]
    }

    /// The square in which the ray to a position meets the plane.
    pub(crate) fn square(&self, position: [f32; 3]) -> Option<usize> {
        let index = |tangent: f32| {
            let squares = floor_i32(tangent * self.distance / SQUARE_M);
            let i = squares.saturating_add(SIDE as i32 / 2);
            usize::try_from(i).ok().filter(|i| *i < SIDE)
        };
        let [across, along] = self.offset(position);
        Some(index(across)? * SIDE + index(along)?)
    }
}

/// What a scan says about one square.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Tally {
    /// Returns from the plane that look like a mirror's own: weak, or met head-on.
    pub(crate) own: u16,
    /// Returns from the plane that look like a wall's.
    pub(crate) solid: u16,
    /// Rays that went on to something behind.
    pub(crate) passed: u16,
    /// Those of them with a mirror's own return right beside them.
    pub(crate) interleaved: u16,
}

/// The squares of one plane. Keeps its memory.
#[derive(Debug, Clone, Default)]
pub(crate) struct Squares {
    tallies: Vec<Tally>,
    mirrors: Vec<bool>,
    front: Vec<u32>,
}

impl Squares {
    pub(crate) fn clear(&mut self) {
        self.tallies.clear();
        self.tallies.resize(SIDE * SIDE, Tally::default());
        self.mirrors.clear();
        self.mirrors.resize(SIDE * SIDE, false);
        self.front.clear();
    }

    /// The tally of a square that [`Mirror::square`] named.
    pub(crate) fn tally(&mut self, square: usize) -> &mut Tally {
        &mut self.tallies[square]
    }

    pub(crate) fn is_mirror(&self, square: usize) -> bool {
        self.mirrors[square]
    }

    /// Marks the squares that `is_seed` accepts, given with the tallies around them added up, and
    /// spreads from them through squares that let rays pass and that `is_like` accepts.
    pub(crate) fn spread(
        &mut self,
        is_seed: impl Fn(&Tally, &Tally) -> bool,
        is_like: impl Fn(&Tally) -> bool,
    ) {
        for square in 0..SIDE * SIDE {
            let here = self.tallies[square];
            let is_empty = here.own == 0 && here.passed == 0;
            if !is_empty && is_seed(&here, &self.around(square)) {
                self.mirrors[square] = true;
                self.front.push(square as u32);
            }
        }
        while let Some(square) = self.front.pop() {
            let (row, column) = (square as usize / SIDE, square as usize % SIDE);
            for row in row.saturating_sub(GAP)..=(row + GAP).min(SIDE - 1) {
                for column in column.saturating_sub(GAP)..=(column + GAP).min(SIDE - 1) {
                    let next = row * SIDE + column;
                    let tally = self.tallies[next];
                    let lets_pass = tally.passed > 0 && tally.solid <= tally.passed;
                    if lets_pass && is_like(&tally) && !self.mirrors[next] {
                        self.mirrors[next] = true;
                        self.front.push(next as u32);
                    }
                }
            }
        }
    }

    /// Rays that passed the squares marked as mirror, and those of them that are interleaved.
    pub(crate) fn passed_through_mirror(&self) -> (u32, u32) {
        let marked = self.tallies.iter().zip(&self.mirrors).filter(|(_, m)| **m);
        marked.fold((0, 0), |(passed, interleaved), (tally, _)| {
            (
                passed + u32::from(tally.passed),
                interleaved + u32::from(tally.interleaved),
            )
        })
    }

    fn around(&self, square: usize) -> Tally {
        let (row, column) = (square / SIDE, square % SIDE);
        let mut sum = Tally::default();
        for row in row.saturating_sub(1)..=(row + 1).min(SIDE - 1) {
            for column in column.saturating_sub(1)..=(column + 1).min(SIDE - 1) {
                let tally = self.tallies[row * SIDE + column];
                sum.own = sum.own.saturating_add(tally.own);
                sum.solid = sum.solid.saturating_add(tally.solid);
                sum.passed = sum.passed.saturating_add(tally.passed);
                sum.interleaved = sum.interleaved.saturating_add(tally.interleaved);
            }
        }
        sum
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_mirror_image_is_as_far_behind_as_its_original_is_in_front() {
        // The plane x = 2, seen from the origin: (5, 1, 3) is the image of (-1, 1, 3).
        let mirror = Mirror::new(Surface::Pane, [1.0, 0.0, 0.0], 2.0).expect("a plane");
        assert_eq!(mirror.depth([5.0, 1.0, 3.0]), 3.0);
        assert_eq!(mirror.reflect([5.0, 1.0, 3.0]), [-1.0, 1.0, 3.0]);
        // The ray to (4, 2, 2) meets it at (2, 1, 1), as the ray to (2, 1, 1) itself does.
        assert_eq!(
            mirror.square([4.0, 2.0, 2.0]),
            mirror.square([2.0, 1.0, 1.0])
        );
        assert_ne!(
            mirror.square([4.0, 2.0, 2.0]),
            mirror.square([2.0, 2.1, 1.0])
        );
        assert_eq!(mirror.square([1.0, 1e9, 0.0]), None);
        assert!(Mirror::new(Surface::Pane, [0.0; 3], 2.0).is_none());
        assert!(Mirror::new(Surface::Pane, [1.0, 0.0, 0.0], f32::NAN).is_none());
    }
}
