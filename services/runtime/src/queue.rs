//! Bounded queues between tasks.
//!
//! In: values of a faster task. Out: the same values, in order, to a slower one. Sending never
//! waits: when the queue is full a value goes, the oldest or the new one, and is counted and given
//! back to the sender, so that its memory is used again. No locks (`crossbeam-queue`).

use std::fmt;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use crossbeam_queue::ArrayQueue;

use crate::bell::Bell;

/// What goes when a queue is full. To wait is no choice: a sensor does not wait.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum WhenFull {
    /// The oldest value makes room: for states, where the newest counts.
    DropOldest,
    /// The new value is refused: for orders, which are worked off in turn.
    DropNewest,
}

struct Shared<T> {
    name: &'static str,
    values: ArrayQueue<T>,
    when_full: WhenFull,
    dropped: AtomicU64,
}

/// The end that values are put in at. Clones send to the same queue.
pub struct Sender<T> {
    shared: Arc<Shared<T>>,
    bell: Bell,
}

/// The end that values are taken out at.
pub struct Receiver<T>(Arc<Shared<T>>);

/// What is told about a queue.
pub trait Gauge: Send + Sync {
    /// Its name.
    fn name(&self) -> &'static str;
    /// Values in it.
    fn len(&self) -> usize;
    /// Whether there are none.
    fn is_empty(&self) -> bool {
        self.len() == 0
    }
    /// Values that fit.
    fn capacity(&self) -> usize;
    /// Values that had to go so far.
    fn dropped(&self) -> u64;
}

/// A queue of at most `capacity` values (at least one), which rings `bell` for each that comes.
pub fn bounded<T>(
    name: &'static str,
    capacity: usize,
    when_full: WhenFull,
    bell: &Bell,
) -> (Sender<T>, Receiver<T>) {
    let shared = Arc::new(Shared {
        name,
        values: ArrayQueue::new(capacity.max(1)),
        when_full,
        dropped: AtomicU64::new(0),
    });
    let sender = Sender {
        shared: Arc::clone(&shared),
        bell: bell.clone(),
    };
    (sender, Receiver(shared))
}

impl<T> Sender<T> {
    /// Puts a value in and wakes the other end. What had to go for it, or could not come in, is
    /// given back.
    pub fn send(&self, value: T) -> Option<T> {
        let values = &self.shared.values;
        let gone = match self.shared.when_full {
            WhenFull::DropOldest => values.force_push(value),
            WhenFull::DropNewest => values.push(value).err(),
        };
        if gone.is_some() {
            self.shared.dropped.fetch_add(1, Ordering::Relaxed);
        }
        self.bell.ring();
        gone
    }
}

impl<T> Receiver<T> {
    /// The oldest value.
    pub fn receive(&self) -> Option<T> {
        self.0.values.pop()
    }

    /// The newest value; older ones are let go. For states, of which only the last counts.
    pub fn newest(&self) -> Option<T> {
        let mut newest = self.0.values.pop()?;
        // At most as many as fit: a sender that goes on meanwhile can't keep us here.
        for _ in 0..self.0.values.capacity() {
            match self.0.values.pop() {
                Some(value) => newest = value,
                None => break,
            }
        }
        Some(newest)
    }

    /// Whether there is nothing to receive.
    pub fn is_empty(&self) -> bool {
        self.0.values.is_empty()
    }
}

impl<T: Send + 'static> Receiver<T> {
    /// What is told about the queue.
    pub fn gauge(&self) -> Arc<dyn Gauge> {
        Arc::clone(&self.0) as Arc<dyn Gauge>
    }
}

impl<T: Send> Gauge for Shared<T> {
    fn name(&self) -> &'static str {
        self.name
    }
    fn len(&self) -> usize {
        self.values.len()
    }
    fn capacity(&self) -> usize {
        self.values.capacity()
    }
    fn dropped(&self) -> u64 {
        self.dropped.load(Ordering::Relaxed)
    }
}

impl<T> Clone for Sender<T> {
    fn clone(&self) -> Self {
        Self {
            shared: Arc::clone(&self.shared),
            bell: self.bell.clone(),
        }
    }
}

impl<T> fmt::Debug for Sender<T> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Sender({})", self.shared.name)
    }
}

impl<T> fmt::Debug for Receiver<T> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Receiver({})", self.0.name)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::clock::{TaskClock, VirtualClock};
    use hachi_hal::Stamp;

    fn bell() -> Bell {
        Bell::new(TaskClock::new(VirtualClock::starting_at(Stamp::default())))
    }

    #[test]
    fn a_full_queue_of_states_lets_the_oldest_go_and_counts_it() {
        let (sender, receiver) = bounded("states", 2, WhenFull::DropOldest, &bell());
        assert_eq!([1, 2, 3].map(|v| sender.send(v)), [None, None, Some(1)]);
        assert_eq!(receiver.gauge().dropped(), 1);
        assert_eq!(receiver.gauge().len(), 2);
        assert_eq!([receiver.receive(), receiver.receive()], [Some(2), Some(3)]);
        assert_eq!(receiver.receive(), None);
    }

    #[test]
    fn a_full_queue_of_orders_refuses_the_new_one() {
        let (sender, receiver) = bounded("orders", 2, WhenFull::DropNewest, &bell());
        assert_eq!([1, 2, 3].map(|v| sender.send(v)), [None, None, Some(3)]);
        assert_eq!([receiver.receive(), receiver.receive()], [Some(1), Some(2)]);
        assert_eq!(receiver.gauge().dropped(), 1);
    }

    #[test]
    fn the_newest_state_is_had_at_once() {
        let (sender, receiver) = bounded("states", 4, WhenFull::DropOldest, &bell());
        for value in 0..9 {
            let _ = sender.send(value);
        }
        assert_eq!(receiver.newest(), Some(8));
        assert!(receiver.is_empty());
    }

    #[test]
    fn every_value_rings_until_it_is_heard() {
        let bell = bell();
        let (sender, _receiver) = bounded("values", 1, WhenFull::DropOldest, &bell);
        assert_eq!(bell.hear(), None);
        let _ = sender.send(1);
        let _ = sender.send(2);
        assert_eq!(bell.hear(), Some(Stamp::default()));
        assert_eq!(bell.hear(), None);
    }
}
