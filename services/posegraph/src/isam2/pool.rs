//! Buffers of cliques that are gone, for those that come: the root's are large, and new ones are made
//! in every update.

/// Free buffers by size, in classes an eighth of an octave apart.
#[derive(Debug, Clone, Default)]
pub(crate) struct Pool {
    classes: Vec<Vec<Vec<f64>>>,
    /// Numbers that free buffers can hold.
    free: usize,
    /// Numbers that buffers in use can hold.
    used: usize,
}

/// Free buffers may hold as much as those in use, and this many numbers besides (8 MB).
const MOST_IDLE: usize = 1 << 20;
/// A buffer may be so many classes larger than what is asked for: by a third.
const SLACK: usize = 3;

impl Pool {
    /// A buffer of that length with any numbers in it.
    pub fn take(&mut self, len: usize) -> Vec<f64> {
        let class = class_that_holds(len);
        let classes = self.classes.iter_mut().skip(class).take(1 + SLACK);
        let buffer = classes.filter_map(Vec::pop).next();
        let mut buffer = match buffer {
            Some(buffer) => {
                self.free -= buffer.capacity();
                buffer
            }
            None => Vec::with_capacity(size_of_class(class)),
        };
        self.used += buffer.capacity();
        buffer.truncate(len);
        buffer.resize(len, 0.0);
        buffer
    }

    /// Takes a buffer back.
    pub fn give(&mut self, buffer: Vec<f64>) {
        let capacity = buffer.capacity();
        self.used = self.used.saturating_sub(capacity);
        if capacity == 0 || self.free + capacity > self.used + MOST_IDLE {
            return;
        }
        // The class whose requests it surely holds.
        let mut class = class_that_holds(capacity);
        if size_of_class(class) > capacity {
            // A copy of a solver has buffers of their exact length, some below the smallest class.
            let Some(below) = class.checked_sub(1) else {
                return;
            };
            class = below;
        }
        if self.classes.len() <= class {
            self.classes.resize_with(class + 1, Vec::new);
        }
        self.free += capacity;
        self.classes[class].push(buffer);
    }
}

/// Numbers that a buffer of this class holds: 16 * 2^(class / 8), in steps of an eighth.
fn size_of_class(class: usize) -> usize {
    (16 + 2 * (class % 8)) << (class / 8)
}

/// The smallest class that holds so many numbers.
fn class_that_holds(len: usize) -> usize {
    let len = len.max(16);
    let octave = (len / 16).ilog2() as usize;
    let step = 2usize << octave;
    let eighth = (len - (16 << octave)).div_ceil(step);
    octave * 8 + eighth
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_length_has_the_smallest_class_that_holds_it() {
        for len in 0..5000 {
            let class = class_that_holds(len);
            assert!(size_of_class(class) >= len, "{len}");
            assert!(class == 0 || size_of_class(class - 1) < len, "{len}");
            assert!(size_of_class(class) <= len.max(16) * 9 / 8 + 2, "{len}");
        }
    }

    #[test]
    fn buffers_come_back_and_idle_ones_are_bounded() {
        let mut pool = Pool::default();
        let buffer = pool.take(100);
        let capacity = buffer.capacity();
        pool.give(buffer);
        let again = pool.take(90);
        assert_eq!((again.capacity(), again.len()), (capacity, 90));
        for _ in 0..10 {
            let large = pool.take(MOST_IDLE / 2);
            let other = pool.take(MOST_IDLE / 2);
            pool.give(large);
            pool.give(other);
        }
        assert!(pool.free <= pool.used + MOST_IDLE);
    }
}
