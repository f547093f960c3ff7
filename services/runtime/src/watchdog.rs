//! A watchdog in software: bites when it was not fed in time.
//!
//! One thread feeds it, another looks. What a bite does is for who looks: the service tells the
//! robot to stand still, over a socket that the hanging thread does not hold.

use std::convert::Infallible;
use std::sync::Arc;
use std::sync::atomic::{AtomicI64, Ordering};

use hachi_hal::{Stamp, Watchdog};

/// Not fed yet: it does not wait either.
const ASLEEP: i64 = i64::MIN;

/// The watchdog. Clones are the same one.
#[derive(Debug, Clone)]
pub struct SoftWatchdog {
    fed: Arc<AtomicI64>,
    timeout_ns: i64,
}

impl SoftWatchdog {
    /// Bites when more than `timeout_ns` pass from one feeding to the next.
    pub fn new(timeout_ns: i64) -> Self {
        Self {
            fed: Arc::new(AtomicI64::new(ASLEEP)),
            timeout_ns,
        }
    }

    /// For how long it has been waiting beyond its time, ns; `None` while all is well.
    pub fn bites(&self, now: Stamp) -> Option<i64> {
        let fed = self.fed.load(Ordering::Acquire);
        let late_ns = now.nanos_since(Stamp::from_nanos(fed)) - self.timeout_ns;
        (fed != ASLEEP && late_ns > 0).then_some(late_ns)
    }
}

impl Watchdog for SoftWatchdog {
    type Error = Infallible;

    fn feed(&mut self, now: Stamp) -> Result<(), Infallible> {
        self.fed.store(now.as_nanos(), Ordering::Release);
        Ok(())
    }

    fn timeout_ns(&self) -> i64 {
        self.timeout_ns
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_sleeps_until_it_is_fed_and_bites_when_that_ends() {
        let at = Stamp::from_nanos;
        let mut dog = SoftWatchdog::new(100);
        assert_eq!(dog.bites(at(1_000)), None, "never fed");
        let Ok(()) = dog.feed(at(1_000));
        assert_eq!(dog.bites(at(1_100)), None);
        assert_eq!(dog.bites(at(1_101)), Some(1));
        let Ok(()) = dog.feed(at(1_101));
        assert_eq!(dog.bites(at(1_150)), None);
    }
}
