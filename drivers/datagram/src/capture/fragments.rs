//! Puts fragmented IP datagrams together, in bounded memory.
//!
//! In: fragments in any order, with repetitions. Out: whole IP payloads. A fixed number of
//! datagrams is kept in progress; when one more comes, or too long after its first fragment, the
//! oldest is given up and counted. The pool's memory is at most [`SLOTS`] x 73 kB.

use std::net::IpAddr;

use hachi_hal::Stamp;

/// Datagrams in progress at once. Sensors send one after the other; a handful of senders may mix.
const SLOTS: usize = 32;
/// How long the fragments of a datagram may be apart, ns. RFC 791 suggests 15 s and more for the
/// Internet of its time; one wire needs milliseconds.
const TIME_OUT_NS: i64 = 2_000_000_000;
/// Fragments start at multiples of this many bytes.
const UNIT: usize = 8;
/// Largest IP payload, bytes.
const MAX_LEN: usize = 65_535;
const MAX_UNITS: usize = MAX_LEN.div_ceil(UNIT);

/// Which datagram a fragment belongs to.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct FragmentKey {
    pub(super) sender: IpAddr,
    pub(super) receiver: IpAddr,
    pub(super) identification: u32,
}

/// One fragment.
#[derive(Debug, Clone, Copy)]
pub(super) struct Fragment<'a> {
    /// Where it starts in the datagram, bytes.
    pub(super) start: usize,
    /// Whether others follow it.
    pub(super) more: bool,
    pub(super) bytes: &'a [u8],
}

/// A fragment that fits in no datagram.
#[derive(Debug, PartialEq, Eq)]
pub(super) struct BadFragment;

#[derive(Debug)]
struct Slot {
    key: FragmentKey,
    since: Stamp,
    bytes: Vec<u8>,
    /// One bit for each unit that came.
    present: [u64; MAX_UNITS.div_ceil(64)],
    units: usize,
    /// Length of the whole, known from its last fragment.
    len: Option<usize>,
}

impl Slot {
    fn begin(&mut self, key: FragmentKey, since: Stamp) {
        self.key = key;
        self.since = since;
        self.bytes.clear();
        self.present = [0; MAX_UNITS.div_ceil(64)];
        self.units = 0;
        self.len = None;
    }

    fn add(&mut self, fragment: Fragment<'_>) -> Result<(), BadFragment> {
        let end = fragment.start + fragment.bytes.len();
        let aligned = !fragment.more || fragment.bytes.len().is_multiple_of(UNIT);
        if end > MAX_LEN || !aligned || fragment.bytes.is_empty() {
            return Err(BadFragment);
        }
        let contradicts = |len| end > len || (!fragment.more && end != len);
        if self.len.is_some_and(contradicts) || (!fragment.more && self.bytes.len() > end) {
            return Err(BadFragment);
        }
        if !fragment.more {
            self.len = Some(end);
        }
        if self.bytes.len() < end {
            self.bytes.resize(end, 0);
        }
        for (index, unit) in fragment.bytes.chunks(UNIT).enumerate() {
            let number = fragment.start / UNIT + index;
            let (word, bit) = (&mut self.present[number / 64], 1 << (number % 64));
            // What came first stays: a repetition changes nothing.
            if *word & bit == 0 {
                *word |= bit;
                self.units += 1;
                let at = number * UNIT;
                self.bytes[at..at + unit.len()].copy_from_slice(unit);
            }
        }
        Ok(())
    }

    fn is_whole(&self) -> bool {
        self.len.is_some_and(|len| self.units == len.div_ceil(UNIT))
    }
}

#[derive(Debug)]
pub(super) struct FragmentPool {
    /// The first `active` are in progress, the others wait with their memory.
    slots: Vec<Slot>,
    active: usize,
    /// Given up to make room, not yet reported.
    evicted: u64,
}

impl FragmentPool {
    pub(super) fn new() -> Self {
        Self {
            slots: Vec::new(),
            active: 0,
            evicted: 0,
        }
    }

    /// Adds a fragment; the payload of its datagram if that is now whole. After an error its
    /// datagram can no longer become whole and will expire.
    pub(super) fn add(
        &mut self,
        key: FragmentKey,
        fragment: Fragment<'_>,
        now: Stamp,
    ) -> Result<Option<&[u8]>, BadFragment> {
        let known = self.slots[..self.active].iter().position(|s| s.key == key);
        let index = known.unwrap_or_else(|| self.begin(key, now));
        self.slots[index].add(fragment)?;
        if !self.slots[index].is_whole() {
            return Ok(None);
        }
        let freed = self.release(index);
        Ok(Some(&self.slots[freed].bytes))
    }

    /// Gives up what has waited too long; how many datagrams that were. Also reports those that
    /// made room for others.
    pub(super) fn expire(&mut self, now: Stamp) -> u64 {
        let mut lost = std::mem::take(&mut self.evicted);
        let mut index = 0;
        while index < self.active {
            if now.nanos_since(self.slots[index].since).abs() > TIME_OUT_NS {
                self.release(index);
                lost += 1;
            } else {
                index += 1;
            }
        }
        lost
    }

    /// Gives up everything; how many datagrams that were.
    pub(super) fn abandon_all(&mut self) -> u64 {
        let lost = self.active as u64 + std::mem::take(&mut self.evicted);
        self.active = 0;
        lost
    }

    fn begin(&mut self, key: FragmentKey, now: Stamp) -> usize {
        if self.active == SLOTS {
            let oldest = (0..SLOTS).min_by_key(|&index| self.slots[index].since);
            self.release(oldest.unwrap_or(0));
            self.evicted += 1;
        }
        let index = self.active;
        if index == self.slots.len() {
            self.slots.push(Slot {
                key,
                since: now,
                bytes: Vec::new(),
                present: [0; MAX_UNITS.div_ceil(64)],
                units: 0,
                len: None,
            });
        } else {
            self.slots[index].begin(key, now);
        }
        self.active += 1;
        index
    }

    /// Takes a slot out of progress; where it stands now, its bytes untouched.
    fn release(&mut self, index: usize) -> usize {
        self.active -= 1;
        self.slots.swap(index, self.active);
        self.active
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn key(identification: u32) -> FragmentKey {
        FragmentKey {
            sender: [192, 168, 1, 201].into(),
            receiver: [255; 4].into(),
            identification,
        }
    }

    fn part(whole: &[u8], start: usize, end: usize) -> Fragment<'_> {
        Fragment {
            start,
            more: end < whole.len(),
            bytes: &whole[start..end],
        }
    }

    fn at_ms(ms: i64) -> Stamp {
        Stamp::from_nanos(ms * 1_000_000)
    }

    fn whole() -> Vec<u8> {
        (0..100).collect()
    }

    #[test]
    fn fragments_in_any_order_and_twice_make_the_datagram() {
        let whole = whole();
        let mut pool = FragmentPool::new();
        for (start, end) in [(64, 100), (0, 32), (64, 100), (0, 32)] {
            let added = pool.add(key(1), part(&whole, start, end), at_ms(0));
            assert_eq!(added, Ok(None));
        }
        let added = pool.add(key(1), part(&whole, 32, 64), at_ms(1));
        assert_eq!(added.unwrap().unwrap(), &whole[..]);
        assert_eq!(pool.abandon_all(), 0);
    }

    #[test]
    fn a_part_that_never_comes_is_given_up_after_the_time_out() {
        let whole = whole();
        let mut pool = FragmentPool::new();
        pool.add(key(1), part(&whole, 0, 32), at_ms(0)).unwrap();
        assert_eq!(pool.expire(at_ms(1_999)), 0);
        assert_eq!(pool.expire(at_ms(2_001)), 1);
        // Its late remainder starts over and stays alone.
        assert_eq!(
            pool.add(key(1), part(&whole, 32, 100), at_ms(2_001)),
            Ok(None)
        );
    }

    #[test]
    fn a_flood_of_beginnings_gives_up_the_oldest() {
        let whole = whole();
        let mut pool = FragmentPool::new();
        for n in 0..100 {
            pool.add(key(n), part(&whole, 0, 32), at_ms(i64::from(n)))
                .unwrap();
        }
        assert_eq!(pool.expire(at_ms(100)), 100 - SLOTS as u64);
        let newest = pool.add(key(99), part(&whole, 32, 100), at_ms(100));
        assert_eq!(newest.unwrap().unwrap(), &whole[..]);
    }

    #[test]
    fn fragments_that_contradict_each_other_are_refused() {
        let whole = whole();
        let mut pool = FragmentPool::new();
        pool.add(key(1), part(&whole, 64, 100), at_ms(0)).unwrap();
        let beyond = Fragment {
            start: 96,
            more: true,
            bytes: &whole[..16],
        };
        assert_eq!(pool.add(key(1), beyond, at_ms(0)), Err(BadFragment));
        let too_long = Fragment {
            start: 65_528,
            more: false,
            bytes: &whole[..16],
        };
        assert_eq!(pool.add(key(2), too_long, at_ms(0)), Err(BadFragment));
        let uneven = Fragment {
            start: 0,
            more: true,
            bytes: &whole[..15],
        };
        assert_eq!(pool.add(key(3), uneven, at_ms(0)), Err(BadFragment));
    }
}
