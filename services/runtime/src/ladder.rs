//! Down a step after three overruns in a row, up again after many good runs.
//!
//! In: whether each run kept its budget. Out: the step to work at from now on.

/// Overruns in a row that lead a step down: one alone may be a page fault or a neighbour's burst.
pub const OVERRUNS_DOWN: u32 = 3;

/// Good runs in a row that lead a step up: five seconds of a task that runs ten times a second. A
/// climb that fails costs three overruns, so it is not tried more often than that.
pub const GOOD_RUNS_UP: u32 = 50;

/// Where on its ladder a task is.
#[derive(Debug, Clone, Default)]
pub struct Ladder {
    level: usize,
    most: usize,
    overruns: u32,
    good: u32,
}

impl Ladder {
    /// At the top of a ladder of so many steps.
    pub fn of(steps: usize) -> Self {
        Self {
            most: steps,
            ..Self::default()
        }
    }

    /// The step it is at.
    pub fn level(&self) -> usize {
        self.level
    }

    /// Takes in one run; the new step if it changes.
    pub fn judge(&mut self, overran: bool) -> Option<usize> {
        let before = self.level;
        if overran {
            self.good = 0;
            self.overruns += 1;
            if self.overruns >= OVERRUNS_DOWN {
                self.overruns = 0;
                self.level = (self.level + 1).min(self.most);
            }
        } else {
            self.overruns = 0;
            self.good += 1;
            if self.good >= GOOD_RUNS_UP {
                self.good = 0;
                self.level = self.level.saturating_sub(1);
            }
        }
        (self.level != before).then_some(self.level)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn three_overruns_in_a_row_lead_down_and_two_do_not() {
        let mut ladder = Ladder::of(2);
        let runs = [true, true, false, true, true, true];
        let steps: Vec<_> = runs.iter().map(|r| ladder.judge(*r)).collect();
        assert_eq!(steps, [None, None, None, None, None, Some(1)]);
        for _ in 0..30 {
            ladder.judge(true);
        }
        assert_eq!(ladder.level(), 2, "no farther than the ladder goes");
    }

    #[test]
    fn it_climbs_back_one_step_at_a_time() {
        let mut ladder = Ladder::of(3);
        for _ in 0..6 {
            ladder.judge(true);
        }
        assert_eq!(ladder.level(), 2);
        let climbs: Vec<_> = (1..=120)
            .filter_map(|run| ladder.judge(false).map(|level| (run, level)))
            .collect();
        assert_eq!(climbs, [(50, 1), (100, 0)]);
    }

    #[test]
    fn one_overrun_starts_the_count_of_good_runs_anew() {
        let mut ladder = Ladder::of(1);
        for _ in 0..3 {
            ladder.judge(true);
        }
        for _ in 0..49 {
            ladder.judge(false);
        }
        ladder.judge(true);
        assert_eq!((0..49).find_map(|_| ladder.judge(false)), None);
        assert_eq!(ladder.judge(false), Some(0));
    }
}
