//! Where a packet belongs in the stream, by its counter and its stamp.
//!
//! In: the packet's counter, its time on the sensor's clock, and when it arrived. Out: whether it
//! comes next, or why it is left out. A step of the counter tells how many are missing; a time that
//! does not go with it is doubtful until the next packet confirms it.

use hachi_hal::Stamp;

/// A counter this little before the newest one is a packet that was overtaken.
const REORDER: i64 = 64;
/// A time this little after the newest one is believed without looking at the arrival, ns.
const GAP_NS: i64 = 1_000_000_000;
/// How well the arrivals must agree with a longer gap, ns, beside a tenth of the gap.
const AGREEMENT_NS: i64 = 250_000_000;
/// Most packets in a second: twice those of dual return in the manual.
const MAX_PACKETS_PER_GAP: i64 = 6_000;
/// Longest silence after which the stream is said to go on, ns: a month.
const SILENCE_NS: i64 = 30 * 24 * 3_600 * 1_000_000_000;
/// Counters remembered to tell repeated packets from overtaken ones.
const REMEMBERED: usize = 16;

/// Where a packet belongs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Arrival {
    /// After all others. If it is the very next one, the time since the one before it, ns.
    InOrder { period_ns: Option<i64> },
    /// The sensor's clock or counter was set anew; this is the second packet since.
    NewTime,
    /// It was there before.
    Duplicate,
    /// A later one was there before.
    OutOfOrder,
    /// It fits nothing. If the next packet follows it, the sensor began anew.
    Doubtful,
}

#[derive(Debug, Clone, Copy)]
struct Packet {
    counter: u32,
    time_ns: i64,
    received: Stamp,
}

impl Packet {
    /// How many packets `self` comes after `earlier`, the counter's wrap taken into account.
    fn steps_after(&self, earlier: &Self) -> i64 {
        i64::from(self.counter.wrapping_sub(earlier.counter).cast_signed())
    }

    /// Whether `self` can be a later packet of the stream that `earlier` is of.
    fn follows(&self, earlier: &Self) -> bool {
        let steps = self.steps_after(earlier);
        let elapsed_ns = self.time_ns - earlier.time_ns;
        if steps <= 0 || elapsed_ns <= 0 {
            return false;
        }
        if elapsed_ns <= GAP_NS {
            return steps <= MAX_PACKETS_PER_GAP;
        }
        let waited_ns = self.received.nanos_since(earlier.received);
        let difference_ns = (i128::from(elapsed_ns) - i128::from(waited_ns)).abs();
        elapsed_ns < SILENCE_NS && difference_ns <= i128::from(AGREEMENT_NS + elapsed_ns / 10)
    }
}

/// Orders the packets of one sensor.
#[derive(Debug, Default)]
pub(super) struct Arrivals {
    newest: Option<Packet>,
    recent: [Option<u32>; REMEMBERED],
    next_slot: usize,
    doubtful: Option<Packet>,
    lost: u64,
}

impl Arrivals {
    /// Packets missing between those that came.
    pub(super) fn lost(&self) -> u64 {
        self.lost
    }

    pub(super) fn place(&mut self, counter: u32, time_ns: i64, received: Stamp) -> Arrival {
        let doubtful = self.doubtful.take();
        let packet = Packet {
            counter,
            time_ns,
            received,
        };
        let Some(newest) = self.newest else {
            self.accept(packet);
            return Arrival::InOrder { period_ns: None };
        };
        if self.recent.contains(&Some(counter)) {
            return Arrival::Duplicate;
        }
        let steps = packet.steps_after(&newest);
        if (-REORDER..0).contains(&steps) && packet.time_ns < newest.time_ns {
            // It was counted as missing when the later one came.
            self.lost = self.lost.saturating_sub(1);
            return Arrival::OutOfOrder;
        }
        if packet.follows(&newest) {
            self.lost += u64::try_from(steps - 1).unwrap_or(0);
            self.accept(packet);
            let period_ns = (steps == 1).then_some(time_ns - newest.time_ns);
            return Arrival::InOrder { period_ns };
        }
        if doubtful.is_some_and(|before| packet.follows(&before)) {
            self.recent = [None; REMEMBERED];
            self.accept(packet);
            return Arrival::NewTime;
        }
        self.doubtful = Some(packet);
        Arrival::Doubtful
    }

    fn accept(&mut self, packet: Packet) {
        self.recent[self.next_slot] = Some(packet.counter);
        self.next_slot = (self.next_slot + 1) % REMEMBERED;
        self.newest = Some(packet);
    }
}

#[cfg(test)]
mod tests {
    use std::vec::Vec;

    use super::*;

    /// Places packets given as (counter, ms).
    fn place(packets: &[(u32, i64)]) -> (Vec<Arrival>, u64) {
        let mut arrivals = Arrivals::default();
        let placed = packets
            .iter()
            .map(|&(counter, ms)| arrivals.place(counter, ms * 1_000_000, Stamp::default()))
            .collect();
        (placed, arrivals.lost())
    }

    const JUST_ARRIVED: Arrival = Arrival::InOrder { period_ns: None };

    #[test]
    fn the_counter_tells_what_is_missing_also_where_it_wraps() {
        let (placed, lost) = place(&[(u32::MAX - 1, 10), (u32::MAX, 11), (2, 14)]);
        let next = Arrival::InOrder {
            period_ns: Some(1_000_000),
        };
        assert_eq!(placed, [JUST_ARRIVED, next, JUST_ARRIVED]);
        assert_eq!(lost, 2);
    }

    #[test]
    fn repeated_and_overtaken_packets_are_told_apart() {
        let (placed, lost) = place(&[(5, 5), (7, 7), (6, 6), (7, 7), (5, 5)]);
        let expected = [
            JUST_ARRIVED,
            JUST_ARRIVED,
            Arrival::OutOfOrder,
            Arrival::Duplicate,
            Arrival::Duplicate,
        ];
        assert_eq!(placed, expected);
        assert_eq!(lost, 0);
    }

    #[test]
    fn a_clock_that_was_set_is_followed_from_its_second_packet_on() {
        let (placed, lost) = place(&[(1, 1), (2, 1_000_002), (3, 1_000_003)]);
        assert_eq!(placed[1..], [Arrival::Doubtful, Arrival::NewTime]);
        assert_eq!(lost, 0);
    }

    #[test]
    fn one_wrong_counter_costs_one_packet() {
        let (placed, lost) = place(&[(1, 1), (70_000, 2), (3, 3)]);
        assert_eq!(placed, [JUST_ARRIVED, Arrival::Doubtful, JUST_ARRIVED]);
        assert_eq!(lost, 1);
    }
}
