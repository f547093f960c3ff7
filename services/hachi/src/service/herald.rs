//! What is said of why the robot stands: each cause once, however it flickers.
//!
//! In: the gate's causes at each command, two hundred times a second. Out: which of them are news, and
//! when there are none any more. Beside a narrow door an obstacle comes and goes twice a second; a cause
//! that comes back within a second never went.

use hachi_behaviour::{Cause, Causes};
use hachi_hal::Stamp;

/// A cause is gone when it was not there for this long, ns.
const GONE_NS: i64 = 1_000_000_000;

/// What was said so far.
#[derive(Debug, Default)]
pub struct Herald {
    /// When each cause that was said was last there, in the order of [`Cause::ALL`].
    there: [Option<Stamp>; Cause::ALL.len()],
}

/// What is to be said.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct News {
    /// Causes that were not there.
    pub come: Causes,
    /// All that was said is over.
    pub over: bool,
}

impl Herald {
    /// Takes in the causes of one command.
    pub fn hear(&mut self, now: Stamp, causes: Causes) -> News {
        let mut come = Causes::default();
        let stood = self.stands();
        for (cause, there) in Cause::ALL.into_iter().zip(&mut self.there) {
            if causes.has(cause) {
                come.add_if(cause, there.is_none());
                *there = Some(now);
            } else if there.is_some_and(|then| now.nanos_since(then) >= GONE_NS) {
                *there = None;
            }
        }
        let over = stood && !self.stands();
        News { come, over }
    }

    fn stands(&self) -> bool {
        self.there.iter().any(Option::is_some)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_flickers_is_said_once_and_what_comes_back_later_once_more() {
        let mut herald = Herald::default();
        let mut obstacle = Causes::default();
        obstacle.add_if(Cause::Obstacle, true);
        let (mut come, mut over) = (Vec::new(), Vec::new());
        // Half a second on and off for ten seconds, three of quiet, and once more.
        for run in 0..2800i64 {
            let now = Stamp::from_nanos(run * 5_000_000);
            let there = (run < 2000 && (run / 100) % 2 == 0) || run >= 2600;
            let causes = if there { obstacle } else { Causes::default() };
            let news = herald.hear(now, causes);
            if !news.come.is_empty() {
                come.push(run);
            }
            if news.over {
                over.push(run);
            }
        }
        assert_eq!(come, [0, 2600]);
        // Last there at run 1899, gone a second later.
        assert_eq!(over, [2099]);
    }

    #[test]
    fn a_graver_cause_is_said_beside_one_that_stays() {
        let mut herald = Herald::default();
        let mut causes = Causes::default();
        causes.add_if(Cause::NoWish, true);
        assert_eq!(herald.hear(Stamp::from_nanos(0), causes).come, causes);
        let mut stop = Causes::default();
        stop.add_if(Cause::EmergencyStop, true);
        causes.add_if(Cause::EmergencyStop, true);
        let news = herald.hear(Stamp::from_nanos(5_000_000), causes);
        assert_eq!((news.come, news.over), (stop, false));
    }
}
