//! Where a packet belongs in the stream, by its stamp.
//!
//! In: the sensor's stamp within the hour, and when the packet arrived. Out: time on a clock that
//! does not wrap, or why the packet is left out. Packets of one stream follow each other at a fixed
//! period, so a gap tells how many are missing.

use hachi_hal::Stamp;

use crate::packet::HOUR_US;

const HOUR: i64 = HOUR_US as i64;
/// A stamp this little before the newest one is a packet that was overtaken, µs. Beyond, the
/// sensor's clock was set back.
const REORDER_US: i64 = 100_000;
/// A stamp this little after the newest one is believed without looking at the arrival, µs.
const GAP_US: i64 = 1_000_000;
/// How well the arrivals must agree with a longer gap, µs, beside a tenth of the gap.
const AGREEMENT_US: i64 = 250_000;
/// Longest silence after which the stream is said to go on, µs: a month. It keeps the sensor's time
/// far from the end of its 64 bits.
const SILENCE_US: i64 = 30 * 24 * HOUR;
/// Stamps remembered to tell repeated packets from overtaken ones.
const REMEMBERED: usize = 16;

/// Where a packet belongs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Arrival {
    /// After all others; the time of its first firing, ns.
    InOrder { start_ns: i64 },
    /// The sensor's clock was set anew; this is the second packet on it.
    NewTime { start_ns: i64 },
    /// It was there before.
    Duplicate,
    /// A later one was there before.
    OutOfOrder,
    /// Its stamp fits nothing. If the next packet follows it, the sensor's clock was set anew.
    Doubtful,
}

#[derive(Debug, Clone, Copy)]
struct Newest {
    hour_us: u32,
    start_ns: i64,
    period_ns: u32,
    received: Stamp,
}

/// Orders the packets of one sensor.
#[derive(Debug, Default)]
pub(super) struct Arrivals {
    newest: Option<Newest>,
    recent: [Option<u32>; REMEMBERED],
    next_slot: usize,
    doubtful: Option<u32>,
    lost: u64,
}

impl Arrivals {
    /// Packets missing between those that came.
    pub(super) fn lost(&self) -> u64 {
        self.lost
    }

    pub(super) fn place(&mut self, hour_us: u32, period_ns: u32, received: Stamp) -> Arrival {
        let doubtful = self.doubtful.take();
        let Some(newest) = self.newest else {
            let start_ns = i64::from(hour_us) * 1_000;
            self.accept(hour_us, start_ns, period_ns, received);
            return Arrival::InOrder { start_ns };
        };
        if self.recent.contains(&Some(hour_us)) {
            return Arrival::Duplicate;
        }
        let step_us = nearest_step(newest.hour_us, hour_us);
        if (-REORDER_US..0).contains(&step_us) {
            // It was counted as missing when the later one came.
            self.lost = self.lost.saturating_sub(1);
            return Arrival::OutOfOrder;
        }
        let waited_us = received.nanos_since(newest.received) / 1_000;
        if let Some(step_us) = believable_step(step_us, waited_us) {
            let start_ns = newest.start_ns.saturating_add(step_us * 1_000);
            let periods =
                (step_us * 1_000 + i64::from(newest.period_ns) / 2) / i64::from(newest.period_ns);
            self.lost += u64::try_from(periods - 1).unwrap_or(0);
            self.accept(hour_us, start_ns, period_ns, received);
            return Arrival::InOrder { start_ns };
        }
        if doubtful.is_some_and(|us| (1..REORDER_US).contains(&nearest_step(us, hour_us))) {
            let start_ns = i64::from(hour_us) * 1_000;
            self.recent = [None; REMEMBERED];
            self.accept(hour_us, start_ns, period_ns, received);
            return Arrival::NewTime { start_ns };
        }
        self.doubtful = Some(hour_us);
        Arrival::Doubtful
    }

    fn accept(&mut self, hour_us: u32, start_ns: i64, period_ns: u32, received: Stamp) {
        self.recent[self.next_slot] = Some(hour_us);
        self.next_slot = (self.next_slot + 1) % REMEMBERED;
        self.newest = Some(Newest {
            hour_us,
            start_ns,
            period_ns,
            received,
        });
    }
}

/// From one stamp within the hour to another by the shorter way, µs.
fn nearest_step(from_us: u32, to_us: u32) -> i64 {
    let forward = (i64::from(to_us) - i64::from(from_us)).rem_euclid(HOUR);
    if forward > HOUR / 2 {
        forward - HOUR
    } else {
        forward
    }
}

/// The true length of a step forward, if there is one: short steps as they are, long ones with as
/// many whole hours as fit the time between the arrivals.
fn believable_step(step_us: i64, waited_us: i64) -> Option<i64> {
    if (0..=GAP_US).contains(&step_us) {
        return Some(step_us);
    }
    let hours = (waited_us.saturating_sub(step_us) + HOUR / 2).div_euclid(HOUR);
    let candidate = step_us + hours * HOUR;
    let agrees = (candidate - waited_us).abs() <= AGREEMENT_US + waited_us / 10;
    (candidate > 0 && candidate < SILENCE_US && agrees).then_some(candidate)
}

#[cfg(test)]
mod tests {
    use std::vec::Vec;

    use super::*;

    const PERIOD_NS: u32 = 1_327_104;

    fn at_us(us: i64) -> Stamp {
        Stamp::from_nanos(us * 1_000)
    }

    /// Places packets given as (stamp, arrival), both in µs.
    fn place(packets: &[(u32, i64)]) -> (Vec<Arrival>, u64) {
        let mut arrivals = Arrivals::default();
        let placed = packets
            .iter()
            .map(|&(us, arrival)| arrivals.place(us, PERIOD_NS, at_us(arrival)))
            .collect();
        (placed, arrivals.lost())
    }

    fn in_order(us: i64) -> Arrival {
        Arrival::InOrder {
            start_ns: us * 1_000,
        }
    }

    #[test]
    fn a_gap_tells_how_many_are_missing() {
        let (placed, lost) = place(&[(1_000, 0), (2_327, 1_327), (6_309, 5_309)]);
        assert_eq!(placed, [in_order(1_000), in_order(2_327), in_order(6_309)]);
        assert_eq!(lost, 2);
    }

    #[test]
    fn repeated_and_overtaken_packets_are_told_apart() {
        let (placed, lost) = place(&[
            (1_000, 0),
            (3_654, 0),
            (2_327, 0),
            (3_654, 0),
            (1_000, 0),
            (4_981, 0),
        ]);
        let expected = [
            in_order(1_000),
            in_order(3_654),
            Arrival::OutOfOrder,
            Arrival::Duplicate,
            Arrival::Duplicate,
            in_order(4_981),
        ];
        assert_eq!(placed, expected);
        assert_eq!(lost, 0);
    }

    #[test]
    fn time_goes_on_over_the_top_of_the_hour() {
        let (placed, lost) = place(&[(3_599_999_500, 0), (827, 1_327)]);
        assert_eq!(placed[1], in_order(3_600_000_827));
        assert_eq!(lost, 0);
    }

    #[test]
    fn a_long_silence_is_loss_and_not_a_new_clock() {
        // 90 minutes: the stamp alone would say 30 minutes either way.
        let silence = 5_400_000_000_i64;
        let (placed, lost) = place(&[(0, 0), (1_800_000_000, silence + 4_000)]);
        assert_eq!(placed[1], in_order(silence));
        assert_eq!(lost, 4_069_010 - 1);
    }

    #[test]
    fn one_wrong_stamp_costs_one_packet() {
        let (placed, lost) = place(&[(1_000, 0), (900_000_000, 1_327), (3_654, 2_654)]);
        assert_eq!(
            placed,
            [in_order(1_000), Arrival::Doubtful, in_order(3_654)]
        );
        assert_eq!(lost, 1);
    }

    #[test]
    fn a_clock_that_was_set_is_followed_from_its_second_packet_on() {
        let (placed, _) = place(&[(1_000, 0), (900_000_000, 1_327), (900_001_327, 2_654)]);
        assert_eq!(placed[1], Arrival::Doubtful);
        let start_ns = 900_001_327_000;
        assert_eq!(placed[2], Arrival::NewTime { start_ns });
    }
}
