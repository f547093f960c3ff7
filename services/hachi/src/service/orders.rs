//! Orders about people: from whoever asks over HTTP to `tracking`, and what became of them.
//!
//! In: an [`Order`] at the desk. Out: its [`Answer`], or that there is none in time. An order waits in a
//! bounded queue; neither end ever waits for the other inside a lock. One that nobody took in time is
//! withdrawn, so that what was said not to be done is not done later: a `Ticket` goes with it, which
//! one of the two ends takes for good.

use std::sync::Arc;
use std::sync::atomic::{AtomicU8, Ordering};
use std::time::{Duration, Instant};

use hachi_people::pointing::{NotPicked, Pointed};
use hachi_runtime::queue::Gauge;
use hachi_runtime::{Bell, Receiver, Sender, WhenFull, bounded};

/// Orders under way.
const WAITING: usize = 4;
/// How often the desk looks whether there is an answer.
const LOOK_UP: Duration = Duration::from_millis(2);
/// A run of tracking that has begun ends in less.
const UNDER_WAY: Duration = Duration::from_millis(200);

/// What is to be done.
#[derive(Debug, Clone, PartialEq)]
pub enum Order {
    /// This is the robot's person.
    Pick(Pointed),
    /// Whoever stands in front of the robot is to be known by this name.
    Enrol(String),
    /// The enrolment is to end.
    Cancel,
    /// The robot has no person any more.
    Release,
}

/// Why an enrolment was not begun.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum NotBegun {
    /// Nobody stands near the middle of the picture.
    Nobody,
    /// So many people do.
    Several(usize),
    /// Another one goes on.
    Busy,
    /// There is no store that they could be kept in.
    NoStore,
}

/// What became of an order.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Answer {
    /// The robot's person.
    Picked {
        /// Their track.
        track: u64,
        /// Their number.
        person: u32,
        /// Whether the robot knew them before.
        known: bool,
    },
    /// Nobody was picked.
    NotPicked(NotPicked),
    /// The enrolment of this number has begun.
    Begun(u32),
    /// It has not.
    NotBegun(NotBegun),
    /// Whether there was an enrolment that could be ended.
    Cancelled(bool),
    /// Who is the robot's person no more, if there was one.
    Released(Option<u32>),
}

/// Why an order has no answer.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum NoAnswer {
    /// As many as fit are waiting.
    Full,
    /// It was withdrawn: no picture came in time.
    Withdrawn,
    /// It was taken, and nothing was heard of it since.
    Unknown,
}

const WAITS: u8 = 0;
const HELD: u8 = 1;
const DONE: u8 = 2;
const WITHDRAWN: u8 = 3;

/// Whose an order is: the desk may withdraw it while nobody holds it.
#[derive(Debug, Clone, Default)]
struct Ticket(Arc<AtomicU8>);

impl Ticket {
    fn goes(&self, from: u8, to: u8) -> bool {
        let exchanged = self
            .0
            .compare_exchange(from, to, Ordering::AcqRel, Ordering::Acquire);
        exchanged.is_ok()
    }
}

struct Ordered {
    number: u64,
    order: Order,
    ticket: Ticket,
}

/// The end that orders are given at.
pub struct Desk {
    orders: Sender<Ordered>,
    answers: Receiver<(u64, Answer)>,
    last: u64,
    /// How long an answer is waited for.
    pub patience: Duration,
}

/// The end that they are carried out at.
pub struct Inbox {
    orders: Receiver<Ordered>,
    answers: Sender<(u64, Answer)>,
    /// The order that is being carried out.
    current: Option<Ordered>,
}

/// Both ends; `to_tracking` wakes the one that carries them out.
pub fn orders(to_tracking: &Bell, nobody: &Bell, patience: Duration) -> (Desk, Inbox) {
    let (orders, taken) = bounded("orders", WAITING, WhenFull::DropNewest, to_tracking);
    let (told, answers) = bounded("answers", WAITING, WhenFull::DropOldest, nobody);
    let desk = Desk {
        orders,
        answers,
        last: 0,
        patience,
    };
    let inbox = Inbox {
        orders: taken,
        answers: told,
        current: None,
    };
    (desk, inbox)
}

impl Desk {
    /// Has an order carried out.
    ///
    /// # Errors
    /// [`NoAnswer`].
    pub fn give(&mut self, order: Order) -> Result<Answer, NoAnswer> {
        self.last += 1;
        let (number, ticket) = (self.last, Ticket::default());
        let ordered = Ordered {
            number,
            order,
            ticket: ticket.clone(),
        };
        if self.orders.send(ordered).is_some() {
            return Err(NoAnswer::Full);
        }
        let mut ends = Instant::now() + self.patience;
        let mut held = false;
        loop {
            // Answers to orders that were given up are let go.
            while let Some((answered, answer)) = self.answers.receive() {
                if answered == number {
                    return Ok(answer);
                }
            }
            if Instant::now() < ends {
                std::thread::sleep(LOOK_UP);
            } else if held {
                return Err(NoAnswer::Unknown);
            } else if ticket.goes(WAITS, WITHDRAWN) {
                return Err(NoAnswer::Withdrawn);
            } else {
                held = true;
                ends += UNDER_WAY;
            }
        }
    }
}

impl Inbox {
    /// The next order, held so that nobody withdraws it meanwhile; none while one is put off. Each hold
    /// ends with [`answer`](Self::answer) or [`later`](Self::later).
    pub fn take(&mut self) -> Option<Order> {
        while self.current.is_none() {
            let ordered = self.orders.receive()?;
            if ordered.ticket.goes(WAITS, HELD) {
                return Some(self.current.insert(ordered).order.clone());
            }
        }
        None
    }

    /// Holds the order that was put off; whether it was withdrawn instead.
    pub fn hold(&mut self) -> bool {
        let withdrawn = |current: &Ordered| !current.ticket.goes(WAITS, HELD);
        self.current.take_if(|current| withdrawn(current)).is_some()
    }

    /// What is told about the queue.
    pub fn gauge(&self) -> Arc<dyn Gauge> {
        self.orders.gauge()
    }

    /// The order that is held, if one is.
    pub fn held(&self) -> Option<&Order> {
        self.current.as_ref().map(|current| &current.order)
    }

    /// The order that is held can't be carried out yet.
    pub fn later(&self) {
        if let Some(current) = &self.current {
            current.ticket.goes(HELD, WAITS);
        }
    }

    /// Says what became of the order that is held.
    pub fn answer(&mut self, answer: Answer) {
        if let Some(current) = self.current.take()
            && current.ticket.goes(HELD, DONE)
        {
            let _ = self.answers.send((current.number, answer));
        }
    }
}

#[cfg(test)]
mod tests {
    use hachi_hal::Stamp;
    use hachi_runtime::{TaskClock, VirtualClock};

    use super::*;

    fn ends(patience_ms: u64) -> (Desk, Inbox) {
        let clock = TaskClock::new(VirtualClock::starting_at(Stamp::default()));
        let bell = Bell::new(clock);
        orders(&bell, &bell, Duration::from_millis(patience_ms))
    }

    #[test]
    fn an_order_that_is_carried_out_is_answered() {
        let (mut desk, mut inbox) = ends(10_000);
        let carrying_out = std::thread::spawn(move || {
            while inbox.take().is_none() {
                std::thread::yield_now();
            }
            // Put off once, as for want of a picture.
            inbox.later();
            assert_eq!(inbox.take(), None);
            assert!(!inbox.hold());
            assert_eq!(inbox.held(), Some(&Order::Release));
            inbox.answer(Answer::Released(Some(7)));
            inbox
        });
        assert_eq!(desk.give(Order::Release), Ok(Answer::Released(Some(7))));
        let mut inbox = carrying_out.join().unwrap();
        assert_eq!(inbox.take(), None);
    }

    #[test]
    fn an_order_that_nobody_takes_is_withdrawn_and_never_carried_out() {
        let (mut desk, mut inbox) = ends(5);
        assert_eq!(desk.give(Order::Release), Err(NoAnswer::Withdrawn));
        assert_eq!(inbox.take(), None);
        // One that was held before and put off, too.
        let (mut desk, mut inbox) = ends(300);
        let waits = std::thread::spawn(move || {
            let outcome = desk.give(Order::Cancel);
            (desk, outcome)
        });
        while inbox.take().is_none() {
            std::thread::yield_now();
        }
        inbox.later();
        let (_, outcome) = waits.join().unwrap();
        assert_eq!(outcome, Err(NoAnswer::Withdrawn));
        assert!(inbox.hold());
        assert_eq!(inbox.held(), None);
        assert_eq!(inbox.take(), None);
    }

    #[test]
    fn orders_that_nobody_carries_out_fill_the_queue_and_the_next_is_refused_at_once() {
        let (mut desk, inbox) = ends(1);
        for _ in 0..WAITING {
            assert_eq!(desk.give(Order::Release), Err(NoAnswer::Withdrawn));
        }
        assert_eq!(desk.give(Order::Release), Err(NoAnswer::Full));
        assert_eq!(inbox.gauge().dropped(), 1);
    }
}
