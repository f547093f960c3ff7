//! Mirror ghosts: structure seen in glass or in a polished floor, reported behind it.
//!
//! In: the points of one scan by direction, with labels, and `footprint_from_lidar`. Out: labels
//! [`Reason::Ghost`]. For the floor and for each plane where a pane may stand (`panes`):
//!
//! 1. The rays to all points behind the plane are traced to the square of it they went through
//!    (`mirror`). Dusty glass shows itself by weak returns right beside rays that passed, and
//!    extends as far as they do; clean glass by a weak glint around the very foot of the
//!    perpendicular, amid rays that passed, and extends as far as rays pass. An open door shows
//!    neither, and a plane without either is left alone, however symmetric the rooms.
//! 2. Each point behind the pane is reflected back. If it meets measured structure it is a ghost;
//!    if the sensor sees past the place to something farther, it is not.
//! 3. If too few of the points that can be judged are ghosts, the pane is a window on a real room
//!    and nothing is removed; if nearly all are, those that cannot be judged go too.
//!
//! Time is bounded by points times planes (nine at most), and nothing depends on chance.

mod mirror;
mod panes;

use alloc::vec::Vec;

use hachi_hal::{Point, Pose};

use crate::angular::{AngularGrid, LANES, Seen};
use crate::crop::Rows;
use crate::float::{dot, norm, sub};
use crate::intensity::{Height, RejectRange};
use crate::label::Reason;
use mirror::{Mirror, Squares, Surface, Tally};
use panes::PaneSearch;

/// Returns this near the plane are from it: range noise and a bent pane. Wider for the floor,
/// whose plane comes from the legs.
const ON_PANE_M: f32 = 0.1;
const ON_FLOOR_M: f32 = 0.06;
/// Points are behind the plane from here on, plus a share of the distance for its tilt's error.
const BEHIND_PANE_M: f32 = 0.15;
const BELOW_FLOOR_M: f32 = 0.06;
const TILT_ERROR: f32 = 0.01;
/// Head-on, as far as glass glints: 17 degrees; and the ring around it in which it no more does.
const GLINT_COSINE: f32 = 0.956;
const RING_COSINE: f32 = 0.7;
/// Weak returns that make a glint.
const MIN_GLINT: u32 = 8;
/// A glint lies around the foot of the perpendicular, to within these radians; a black box that
/// happens to face the sensor seldom does.
const GLINT_OFF_CENTRE: f32 = 0.06;
/// Reflected points meet structure within range noise and half a step between rings (one degree).
const MEETS_M: f32 = 0.1;
const MEETS_SHARE: f32 = 0.0175;
/// Nearer than this a reflected point lies on the robot itself.
const ROBOT_M: f32 = 0.5;
/// Floor, and what lies on it, meets floor in every mirror and says nothing.
const TELLING_HEIGHT_M: f32 = 0.15;
/// Ghosts among the points that could be judged: fewer is a window, more is a mirror. High, as a
/// street or corridor is symmetric about every plane across it: little may speak against.
const MIN_GHOSTS: u32 = 10;
const WINDOW_SHARE: f32 = 0.8;
/// And among all points behind: a few that meet something by chance are no mirror.
const MET_SHARE: f32 = 0.2;
const MIRROR_SHARE: f32 = 0.9;
/// A pane is thin. A hedge too returns weakly beside rays that pass, but at all depths: in the
/// layer just before the plane, as thick as the pane's own, there may be this share of its returns.
const THIN_SHARE: f32 = 0.3;
/// No floor is a window: if more than a few points below it are real, it ends there, at stairs or
/// a ramp, and the walls that go on down are no mirror images of themselves.
const FLOOR_SHARE: f32 = 0.95;
/// Rays through the whole pane with a weak return beside them. A weak frame around an opening is
/// beside the outermost rays only.
const PANE_SHARE: f32 = 0.4;

/// Points by which planes are judged, at most: as many as a 16-beam sensor gives. Denser scans are
/// thinned evenly; labels go to all their points.
const EVIDENCE: usize = 32_768;
/// Points behind a plane reflected back before it is believed, at most.
const JUDGED: usize = 512;

/// Labels mirror ghosts. Keeps its memory.
#[derive(Debug, Clone, Default)]
pub struct GhostFilter {
    grid: AngularGrid,
    stage: GhostStage,
}

impl GhostFilter {
    /// Labels ghosts among the kept points and returns how many planes mirrored.
    ///
    /// Points with a label are evidence too (the weak returns of a pane are often `Suspect` by
    /// now), but those of [`Reason::NonFinite`], [`Reason::SelfHit`] and [`Reason::Range`].
    /// `weak` tells a pane's own returns.
    pub fn label(
        &mut self,
        points: &[Point],
        footprint_from_lidar: &Pose,
        weak: RejectRange,
        labels: &mut [Reason],
    ) -> usize {
        self.grid.build_where(points, labels, |label| {
            !matches!(label, Reason::NonFinite | Reason::SelfHit | Reason::Range)
        });
        self.stage
            .label(&self.grid, points, footprint_from_lidar, weak, labels)
    }
}

/// As [`GhostFilter`], on a grid built already.
#[derive(Debug, Clone, Default)]
pub(crate) struct GhostStage {
    panes: PaneSearch,
    squares: Squares,
    /// For each cell of the grid, whether a mirror's own return lies in it or beside it.
    beside: Vec<bool>,
    /// What the planes are judged by: an even sample of the scan.
    evidence: Vec<Sighting>,
    /// The evidence behind the plane, and the square its ray went through.
    behind: Vec<(Seen, u32)>,
    ghosts: Vec<u32>,
}

/// A point and whether its return is weak.
#[derive(Debug, Clone, Copy)]
struct Sighting {
    seen: Seen,
    is_weak: bool,
}

/// What became of a point reflected back.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Verdict {
    /// It met measured structure, or the robot.
    Ghost,
    /// The sensor sees past the place: nothing is there.
    Real,
    /// The place is hidden, or outside the field of view.
    Unknown,
}

impl GhostStage {
    pub(crate) fn label(
        &mut self,
        grid: &AngularGrid,
        points: &[Point],
        footprint_from_lidar: &Pose,
        weak: RejectRange,
        labels: &mut [Reason],
    ) -> usize {
        let Some(height) = Height::from_pose(footprint_from_lidar) else {
            return 0;
        };
        let step = grid.sorted().len().div_ceil(EVIDENCE).max(1);
        self.evidence.clear();
        let evidence = grid.sorted().iter().step_by(step);
        self.evidence.extend(evidence.map(|seen| Sighting {
            seen: *seen,
            is_weak: weak.contains(points[seen.index as usize].intensity),
        }));
        self.ghosts.clear();
        let mut mirrors = 0;
        let down = height.up.map(|c| -c);
        if let Some(floor) = Mirror::new(Surface::Floor, down, height.sensor_height_m) {
            mirrors += usize::from(self.collect(grid, &floor, height));
        }
        let upright = Rows::from_pose(footprint_from_lidar);
        self.panes.search(
            (self.evidence.iter())
                .filter(|sighting| sighting.is_weak)
                .map(|sighting| sighting.seen.position)
                .filter(|position| height.of(*position) > TELLING_HEIGHT_M)
                .map(|position| {
                    let [x, y, _] = upright.turn(position);
                    [x, y]
                }),
        );
        for candidate in 0..self.panes.found.len() {
            let line = self.panes.found[candidate];
            let normal = upright.turn_back([line.cos, line.sin, 0.0]);
            if let Some(pane) = Mirror::new(Surface::Pane, normal, line.distance) {
                mirrors += usize::from(self.collect(grid, &pane, height));
            }
        }
        for &index in &self.ghosts {
            let label = &mut labels[index as usize];
            if label.is_kept() {
                *label = Reason::Ghost;
            }
        }
        mirrors
    }

    /// Adds the ghosts in one mirror to `ghosts`; whether the plane is a mirror at all.
    fn collect(&mut self, grid: &AngularGrid, mirror: &Mirror, height: Height) -> bool {
        let Some(enough) = self.trace(grid, mirror, height) else {
            return false;
        };
        let squares = &self.squares;
        let in_mirror = (self.behind.iter())
            .filter(|(_, square)| squares.is_mirror(*square as usize))
            .map(|(seen, _)| seen);
        let count = in_mirror.clone().count();
        let step = count.div_ceil(JUDGED).max(1);
        let (mut judged, mut ghosts, mut real) = (0usize, 0u32, 0u32);
        for seen in in_mirror.step_by(step) {
            let (image, verdict) = judge(grid, mirror, seen);
            let telling = height.of(image) > TELLING_HEIGHT_M;
            judged += 1;
            ghosts += u32::from(telling && verdict == Verdict::Ghost);
            real += u32::from(telling && verdict == Verdict::Real);
        }
        let share = ghosts as f32 / (ghosts + real).max(1) as f32;
        let met = ghosts as f32 / judged.max(1) as f32;
        if ghosts < MIN_GHOSTS || share < enough || met < MET_SHARE {
            return false;
        }
        for seen in grid.sorted() {
            if !is_behind(mirror, seen) {
                continue;
            }
            let square = mirror.square(seen.position);
            if !square.is_some_and(|square| self.squares.is_mirror(square)) {
                continue;
            }
            let goes = match judge(grid, mirror, seen).1 {
                Verdict::Ghost => true,
                Verdict::Real => false,
                Verdict::Unknown => share >= MIRROR_SHARE,
            };
            if goes {
                self.ghosts.push(seen.index);
            }
        }
        true
    }

    /// Whether the weak returns around a pane lie in it, and few in the layer before it; and whether
    /// anything lies behind at all.
    fn is_thin(&self, mirror: &Mirror, height: Height) -> bool {
        let (mut in_plane, mut before, mut behind) = (0u32, 0u32, 0usize);
        for Sighting { seen, is_weak } in &self.evidence {
            let depth = mirror.depth(seen.position);
            behind += usize::from(depth > BEHIND_PANE_M);
            if depth.abs() < 3.0 * ON_PANE_M
                && *is_weak
                && height.of(seen.position) > TELLING_HEIGHT_M
            {
                in_plane += u32::from(depth.abs() < ON_PANE_M);
                before += u32::from(depth <= -ON_PANE_M);
            }
        }
        behind >= MIN_GHOSTS as usize && before as f32 <= THIN_SHARE * in_plane as f32
    }

    /// Finds the points behind the plane and the squares of it that may mirror. Answers with the
    /// share of ghosts that will confirm it; `None` if nothing suggests a mirror.
    fn trace(&mut self, grid: &AngularGrid, mirror: &Mirror, height: Height) -> Option<f32> {
        let is_floor = mirror.surface == Surface::Floor;
        if !is_floor && !self.is_thin(mirror, height) {
            return None;
        }
        self.squares.clear();
        self.behind.clear();
        self.beside.clear();
        self.beside.resize(grid.cells(), false);
        let mut head_on = HeadOn::default();
        let near = if is_floor { ON_FLOOR_M } else { ON_PANE_M };
        for Sighting { seen, is_weak } in &self.evidence {
            let depth = mirror.depth(seen.position);
            if depth <= -near {
                continue;
            }
            if depth.abs() < near {
                let own = is_floor || *is_weak;
                head_on.returned(mirror, seen, own);
                let Some(square) = mirror.square(seen.position) else {
                    continue;
                };
                let tally = self.squares.tally(square);
                let count = if own {
                    &mut tally.own
                } else {
                    &mut tally.solid
                };
                *count = count.saturating_add(1);
                if own && !is_floor {
                    grid.cells_around(seen.position, |cell| self.beside[cell as usize] = true);
                }
            } else if is_behind(mirror, seen) {
                let Some(square) = mirror.square(seen.position) else {
                    continue;
                };
                head_on.passed(mirror.cosine(seen.position, seen.distance));
                self.behind.push((*seen, square as u32));
            }
        }
        if self.behind.len() < MIN_GHOSTS as usize {
            return None;
        }
        for (seen, square) in &self.behind {
            let interleaved = grid
                .cell_of(seen.index as usize)
                .is_some_and(|cell| self.beside[cell as usize]);
            let tally = self.squares.tally(*square as usize);
            tally.passed = tally.passed.saturating_add(1);
            tally.interleaved = tally.interleaved.saturating_add(u16::from(interleaved));
        }
        if mirror.surface == Surface::Floor {
            // The floor is known to be there where it returns anything.
            self.squares.spread(|here, _| here.own >= 3, |_| true);
            return Some(FLOOR_SHARE);
        }
        if head_on.is_glint() {
            self.squares
                .spread(|here, _| here.own > here.solid, |_| true);
            return Some(WINDOW_SHARE);
        }
        self.squares.spread(
            |_, around| is_interleaved(around),
            |next| next.interleaved > 0,
        );
        let (passed, interleaved) = self.squares.passed_through_mirror();
        (interleaved as f32 > PANE_SHARE * passed as f32).then_some(WINDOW_SHARE)
    }
}

/// Weak returns of the plane lie beside most rays that passed it around here.
fn is_interleaved(around: &Tally) -> bool {
    around.passed >= 6 && 2 * around.interleaved >= around.passed
}

/// What happens where the plane is met nearly head-on, and in the ring around.
#[derive(Debug, Clone, Copy, Default)]
struct HeadOn {
    glint: u32,
    /// Sum of the glint's offsets from the foot of the perpendicular, radians.
    off_centre: [f32; 2],
    solid: u32,
    ring_returned: u32,
    ring_passed: u32,
}

impl HeadOn {
    fn returned(&mut self, mirror: &Mirror, seen: &Seen, own: bool) {
        let cosine = mirror.cosine(seen.position, seen.distance);
        if cosine > GLINT_COSINE && own {
            self.glint += 1;
            let offset = mirror.offset(seen.position);
            self.off_centre[0] += offset[0];
            self.off_centre[1] += offset[1];
        } else if cosine > GLINT_COSINE {
            self.solid += 1;
        } else if cosine > RING_COSINE {
            self.ring_returned += 1;
        }
    }

    fn passed(&mut self, cosine: f32) {
        if cosine <= GLINT_COSINE && cosine > RING_COSINE {
            self.ring_passed += 1;
        }
    }

    /// Weak returns head-on, and around them rays that passed.
    fn is_glint(&self) -> bool {
        let limit = GLINT_OFF_CENTRE * self.glint as f32;
        self.glint >= MIN_GLINT
            && self.glint > self.solid
            && self.off_centre.iter().all(|sum| sum.abs() < limit)
            && self.ring_passed > 2 * self.ring_returned
    }
}

/// Whether a point lies behind a plane for certain.
#[inline(always)]
fn is_behind(mirror: &Mirror, seen: &Seen) -> bool {
    let least = match mirror.surface {
        Surface::Floor => BELOW_FLOOR_M,
        Surface::Pane => BEHIND_PANE_M,
    };
    mirror.depth(seen.position) > least + TILT_ERROR * seen.distance
}

/// The image of a point behind the mirror, and whether it meets structure in front of it.
fn judge(grid: &AngularGrid, mirror: &Mirror, seen: &Seen) -> ([f32; 3], Verdict) {
    let image = mirror.reflect(seen.position);
    let distance = norm(image);
    if distance < ROBOT_M {
        return (image, Verdict::Ghost);
    }
    // Not so wide that a point just behind the plane, on a road that sags, meets the surface it
    // lies on.
    let tolerance = MEETS_M + MEETS_SHARE * distance;
    let tolerance = tolerance.min(0.5 * mirror.depth(seen.position));
    let (near_sq, past) = (tolerance * tolerance, distance + tolerance);
    let past_sq = past * past;
    let [xs, ys, zs] = grid.coordinates();
    let (mut offered, mut farther, mut meets) = (0, 0, false);
    grid.spans_around(image, |first, last| {
        if meets {
            return;
        }
        offered += last - first;
        let (mut met, mut passed) = ([false; LANES], [0u32; LANES]);
        for start in (first..last).step_by(LANES) {
            let block = start..start + LANES;
            let (x, y, z) = (&xs[block.clone()], &ys[block.clone()], &zs[block]);
            for lane in 0..LANES {
                let position = [x[lane], y[lane], z[lane]];
                let apart = sub(position, image);
                let is_offered = start + lane < last;
                let in_front = mirror.depth(position) < 0.0;
                met[lane] |= is_offered & in_front & (dot(apart, apart) <= near_sq);
                passed[lane] += u32::from(is_offered & (dot(position, position) > past_sq));
            }
        }
        meets = met != [false; LANES];
        farther += passed.iter().sum::<u32>() as usize;
    });
    let verdict = if meets {
        Verdict::Ghost
    } else if offered > 0 && farther == offered {
        Verdict::Real
    } else {
        Verdict::Unknown
    };
    (image, verdict)
}
