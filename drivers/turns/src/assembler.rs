//! Cuts the points of packets into turns, from one passage of the cut angle to the next.
//!
//! The first turn of a stream usually begins in the middle and the last one ends there: both are
//! kept and marked. A gap in the packets that spans the cut angle ends the turn there; one that
//! spans a whole turn leaves a marked end and a marked beginning.

use alloc::vec::Vec;

use hachi_hal::{Completeness, Point};

/// Longest time from a turn's first point to its last, ns: a point's offset has 32 bits. The
/// slowest rotor decoded takes 0.2 s.
const MAX_TURN_NS: i64 = 4_000_000_000;

/// Nearer than this past the cut angle a stream that begins there begins a whole turn, degrees.
/// The rotor turns by 0.1° to 0.8° from one block of a packet to the next.
const AT_CUT_DEG: f32 = 0.3;

/// The azimuth at which one turn ends and the next begins.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CutAngle {
    degrees: f32,
}

impl CutAngle {
    /// A cut at any angle, degrees; brought into `[0, 360)`. Not a number counts as 0.
    pub fn new(degrees: f32) -> Self {
        let degrees = if degrees.is_finite() { degrees } else { 0.0 };
        Self {
            degrees: into_turn(degrees % 360.0),
        }
    }

    /// How far an azimuth in `[0, 360)` lies past the cut, degrees in `[0, 360)`.
    pub fn past(self, azimuth_deg: f32) -> f32 {
        into_turn(azimuth_deg - self.degrees)
    }
}

/// Brings an angle in `[-360, 720)` into `[0, 360)`.
fn into_turn(degrees: f32) -> f32 {
    let degrees = if degrees < 0.0 {
        degrees + 360.0
    } else {
        degrees
    };
    // Also where a tiny negative angle was rounded up to a whole turn.
    if degrees >= 360.0 {
        degrees - 360.0
    } else {
        degrees
    }
}

/// The points of one packet and what is known of the shots around them.
#[derive(Debug, Clone, Copy)]
pub struct PacketPoints<'a> {
    /// The points, oldest first; their time offsets count from `start_ns`.
    pub points: &'a [Point],
    /// Time of the packet's first shot on the sensor's clock, ns. One that lies before the last shot
    /// of the packet before is moved up to it: stamps are rounded and jitter by microseconds, and
    /// points must not go back in time.
    pub start_ns: i64,
    /// From the first shot to the last, ns.
    pub last_shot_ns: u32,
    /// Azimuth of the first shot, degrees in `[0, 360)`.
    pub first_azimuth_deg: f32,
    /// Azimuth of the last shot, degrees in `[0, 360)`.
    pub last_azimuth_deg: f32,
    /// How fast the rotor turns, degrees per second.
    pub rate_deg_per_s: f32,
    /// How many of the points lie before the cut angle, if the packet passes it.
    pub cut_at: Option<usize>,
}

/// A turn that ended. Its points are [`TurnAssembler::points`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Turn {
    /// Time of the first point (of the first shot, if nothing was hit), sensor's clock, ns.
    pub start_ns: i64,
    /// Time of the last point (of the last shot, if nothing was hit), sensor's clock, ns.
    pub end_ns: i64,
    /// Whether its beginning or end is missing.
    pub completeness: Completeness,
}

/// The turn that points are being added to.
#[derive(Debug, Clone, Copy)]
struct Open {
    /// Time of the first point, or of the first shot until there is one.
    start_ns: i64,
    /// Time of the last point, or of the last shot until there is one.
    end_ns: i64,
    whole_start: bool,
}

/// Where the stream stood after the last packet.
#[derive(Debug, Clone, Copy)]
struct Last {
    azimuth_deg: f32,
    time_ns: i64,
}

/// A packet that is being added.
#[derive(Debug, Clone, Copy, Default)]
struct Loading {
    /// Points already added.
    done: usize,
    /// The turn before the packet has to end first, whole or not.
    close_first: Option<bool>,
    cut_at: Option<usize>,
    /// The packet's start, not before what came before it.
    start_ns: i64,
    active: bool,
}

/// Collects points into turns, in one buffer that is used again.
#[derive(Debug)]
pub struct TurnAssembler {
    cut: CutAngle,
    points: Vec<Point>,
    max_points: usize,
    open: Option<Open>,
    last: Option<Last>,
    loading: Loading,
    /// Whether the next turn to open begins at the cut angle.
    next_is_whole: bool,
    /// The points belong to a turn that was handed out.
    handed_out: bool,
    broken: bool,
    too_long: u64,
}

impl TurnAssembler {
    /// Turns from `cut` to `cut` of at most `max_points` points; one with more is divided.
    ///
    /// Memory for all `max_points` points is taken once, here.
    pub fn new(cut: CutAngle, max_points: usize) -> Self {
        Self {
            cut,
            points: Vec::with_capacity(max_points),
            max_points,
            open: None,
            last: None,
            loading: Loading::default(),
            next_is_whole: false,
            handed_out: false,
            broken: false,
            too_long: 0,
        }
    }

    /// The angle at which turns are cut.
    pub fn cut(&self) -> CutAngle {
        self.cut
    }

    /// Turns that never passed the cut angle and were divided.
    pub fn too_long(&self) -> u64 {
        self.too_long
    }

    /// The points of the turn that [`Self::advance`] or [`Self::finish`] last returned.
    pub fn points(&self) -> &[Point] {
        if self.handed_out { &self.points } else { &[] }
    }

    /// Those points, to be changed.
    pub fn points_mut(&mut self) -> &mut [Point] {
        if self.handed_out {
            &mut self.points
        } else {
            &mut []
        }
    }

    /// What comes next does not continue what came before: the sensor's clock jumped.
    pub fn break_stream(&mut self) {
        self.broken = true;
    }

    /// Begins to add a packet. Then [`Self::advance`] is called with it until it returns `None`.
    pub fn load(&mut self, packet: &PacketPoints<'_>) {
        let earliest_ns = match self.last {
            Some(last) if !self.broken => last.time_ns,
            _ => i64::MIN,
        };
        self.loading = Loading {
            done: 0,
            close_first: self.ends_before(packet),
            cut_at: packet.cut_at,
            start_ns: packet.start_ns.max(earliest_ns),
            active: true,
        };
        self.broken = false;
    }

    /// Whether the open turn ended between the last packet and this one, and if so whether its end
    /// (and the beginning of the next turn) is only short of packets, not missing altogether.
    fn ends_before(&self, packet: &PacketPoints<'_>) -> Option<bool> {
        let last = self.last?;
        if self.broken {
            return Some(false);
        }
        let elapsed_s = (packet.start_ns - last.time_ns) as f64 * 1e-9;
        let expected_deg = elapsed_s * f64::from(packet.rate_deg_per_s);
        let seen_deg = f64::from(packet.first_azimuth_deg) - f64::from(last.azimuth_deg);
        // The azimuth is known up to whole turns; time says how many there were.
        let turns = round((expected_deg - seen_deg) / 360.0);
        let turned_deg = seen_deg + 360.0 * turns;
        let passed = f64::from(self.cut.past(last.azimuth_deg)) + turned_deg >= 360.0;
        passed.then_some(turned_deg < 360.0)
    }

    /// Adds as much of the loaded packet as belongs to one turn. Returns that turn if it ended;
    /// `None` once the whole packet was added.
    pub fn advance(&mut self, packet: &PacketPoints<'_>) -> Option<Turn> {
        self.forget_handed_out();
        if !self.loading.active {
            return None;
        }
        if let Some(whole) = self.loading.close_first.take() {
            let turn = self.close(whole);
            self.next_is_whole = whole;
            if turn.is_some() {
                return turn;
            }
        }
        let shot_end_ns = self.loading.start_ns + i64::from(packet.last_shot_ns);
        let open = match self.open {
            Some(open) => open,
            None => self.open_turn(packet),
        };
        let stop = self.loading.cut_at.unwrap_or(packet.points.len());
        let part = &packet.points[self.loading.done.min(stop)..stop];
        let room = self.max_points - self.points.len();
        let overlong = shot_end_ns - open.start_ns > MAX_TURN_NS;
        if (part.len() > room || overlong) && !self.points.is_empty() {
            self.too_long += 1;
            self.next_is_whole = false;
            return self.close(false);
        }
        self.append(packet, &part[..part.len().min(room)], open);
        self.loading.done = stop;
        if self.loading.cut_at.take().is_some() {
            let turn = self.close(true);
            self.next_is_whole = true;
            if turn.is_some() {
                return turn;
            }
            return self.advance(packet);
        }
        self.loading.active = false;
        self.last = Some(Last {
            azimuth_deg: packet.last_azimuth_deg,
            time_ns: shot_end_ns,
        });
        None
    }

    fn open_turn(&mut self, packet: &PacketPoints<'_>) -> Open {
        let at_cut = self.cut.past(packet.first_azimuth_deg) < AT_CUT_DEG && self.last.is_none();
        let offset_ns = match packet.points.get(self.loading.done) {
            Some(point) => point.time_offset_ns,
            // Nothing was hit after the cut: the exact shot does not matter.
            None if self.loading.done > 0 => packet.last_shot_ns,
            None => 0,
        };
        let start_ns = self.loading.start_ns + i64::from(offset_ns);
        let open = Open {
            start_ns,
            end_ns: start_ns,
            whole_start: self.next_is_whole || at_cut,
        };
        self.open = Some(open);
        open
    }

    fn append(&mut self, packet: &PacketPoints<'_>, part: &[Point], mut open: Open) {
        match (part.first(), part.last()) {
            (Some(first), Some(last)) => {
                if self.points.is_empty() {
                    open.start_ns = self.loading.start_ns + i64::from(first.time_offset_ns);
                }
                // Both below `MAX_TURN_NS` and, since packets do not go back in time, not negative.
                let base_ns = self.loading.start_ns - open.start_ns;
                self.points.extend(part.iter().map(|point| Point {
                    time_offset_ns: (base_ns + i64::from(point.time_offset_ns)) as u32,
                    ..*point
                }));
                open.end_ns = self.loading.start_ns + i64::from(last.time_offset_ns);
            }
            _ if self.points.is_empty() => {
                open.end_ns = self.loading.start_ns + i64::from(packet.last_shot_ns);
            }
            _ => {}
        }
        self.open = Some(open);
    }

    /// Ends the stream: the turn that was open, if it has points.
    pub fn finish(&mut self) -> Option<Turn> {
        self.forget_handed_out();
        let whole = self
            .last
            .is_some_and(|last| 360.0 - self.cut.past(last.azimuth_deg) < AT_CUT_DEG);
        if self.points.is_empty() {
            self.open = None;
        }
        self.last = None;
        self.next_is_whole = false;
        self.close(whole)
    }

    fn close(&mut self, whole_end: bool) -> Option<Turn> {
        let open = self.open.take()?;
        let completeness = match (open.whole_start, whole_end) {
            (true, true) => Completeness::Complete,
            (true, false) => Completeness::PartialLast,
            (false, true) => Completeness::PartialFirst,
            (false, false) => Completeness::PartialBoth,
        };
        // A piece of a turn in which nothing was hit tells nobody anything.
        if self.points.is_empty() && completeness != Completeness::Complete {
            return None;
        }
        self.handed_out = true;
        Some(Turn {
            start_ns: open.start_ns,
            end_ns: open.end_ns,
            completeness,
        })
    }

    fn forget_handed_out(&mut self) {
        if core::mem::take(&mut self.handed_out) {
            self.points.clear();
        }
    }
}

/// To the nearest whole number, halves away from zero; `core` has no `f64::round`.
fn round(value: f64) -> f64 {
    let half = if value < 0.0 { -0.5 } else { 0.5 };
    (value + half) as i64 as f64
}
