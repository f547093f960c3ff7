//! How well one person was followed: frame by frame against the truth.
//!
//! In: for each frame how long it lasted, how much of the person could be seen, and who was followed.
//! Out: [`Score`]: time in view and followed, time that somebody else was followed, and how often the
//! person had to be recognised again, how often that went right and how long it took. Elsewhere: who
//! somebody followed truly is.
//!
//! After the figures that CARPE-ID was published with (Rollo 2024): tracked over visible time, the
//! share of right re-identifications, and the time from when the person is in view to when they are
//! followed again.

/// How much of a person can be seen.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Sight {
    /// Enough to be asked for.
    Clear,
    /// Some: following them is right, and nobody asks for it.
    Partial,
    /// Nothing.
    None,
}

/// Who is followed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Followed {
    /// The person.
    Right,
    /// Somebody or something else.
    Wrong,
    /// Nobody.
    Nobody,
}

/// Shorter moments out of clear sight, or without being followed, are blinks: of the person behind a
/// post, of a detector.
const BLINK_S: f64 = 0.5;

/// How well a person was followed.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Score {
    /// Time that was looked at, seconds.
    pub watched_s: f64,
    /// Time in clear sight.
    pub visible_s: f64,
    /// Time in clear sight and followed.
    pub tracked_s: f64,
    /// Time that somebody or something else was followed.
    pub wrong_s: f64,
    /// How often the person came into clear sight without being followed, or was lost in it.
    pub needed: u32,
    /// How often they were followed again before they left, and nobody else in between.
    pub right: u32,
    /// How long that took each time, seconds.
    pub delays_s: Vec<f64>,
}

impl Score {
    /// Tracked over visible time; one where there was nothing to see.
    pub fn tracked_share(&self) -> f64 {
        match self.visible_s > 0.0 {
            true => self.tracked_s / self.visible_s,
            false => 1.0,
        }
    }

    /// Seconds an hour that somebody else was followed.
    pub fn wrong_s_per_hour(&self) -> f64 {
        match self.watched_s > 0.0 {
            true => self.wrong_s * 3600.0 / self.watched_s,
            false => 0.0,
        }
    }

    /// Mean time until the person was followed again, seconds; `None` if that never happened.
    pub fn mean_delay_s(&self) -> Option<f64> {
        let count = self.delays_s.len() as f64;
        (count > 0.0).then(|| self.delays_s.iter().sum::<f64>() / count)
    }

    /// Both together.
    pub fn add(&mut self, other: &Self) {
        self.watched_s += other.watched_s;
        self.visible_s += other.visible_s;
        self.tracked_s += other.tracked_s;
        self.wrong_s += other.wrong_s;
        self.needed += other.needed;
        self.right += other.right;
        self.delays_s.extend_from_slice(&other.delays_s);
    }
}

/// The person is in clear sight and nobody follows them.
#[derive(Debug, Clone, Copy)]
struct Search {
    lasts_s: f64,
    /// They came into sight; else they were lost in it.
    came: bool,
    /// Somebody else was followed meanwhile.
    misled: bool,
}

/// Keeps the score.
#[derive(Debug, Clone, Default)]
pub struct ScoreKeeper {
    score: Score,
    search: Option<Search>,
    out_of_sight_s: f64,
}

impl ScoreKeeper {
    /// One for a person who is followed and in clear sight now.
    pub fn new() -> Self {
        Self::default()
    }

    /// Takes in one frame.
    pub fn step(&mut self, lasts_s: f64, sight: Sight, followed: Followed) {
        self.score.watched_s += lasts_s;
        if followed == Followed::Wrong {
            self.score.wrong_s += lasts_s;
            if let Some(search) = &mut self.search {
                search.misled = true;
            }
        }
        if sight != Sight::Clear {
            self.out_of_sight_s += lasts_s;
            // Found before there was enough to be seen: found all the same.
            if followed == Followed::Right {
                self.end_search(true);
            } else if self.out_of_sight_s >= BLINK_S {
                self.end_search(false);
            }
            return;
        }
        let came = std::mem::take(&mut self.out_of_sight_s) >= BLINK_S;
        self.score.visible_s += lasts_s;
        if followed == Followed::Right {
            self.score.tracked_s += lasts_s;
            self.end_search(true);
            return;
        }
        let misled = followed == Followed::Wrong;
        let search = self.search.get_or_insert(Search {
            lasts_s: 0.0,
            came,
            misled,
        });
        search.lasts_s += lasts_s;
    }

    fn end_search(&mut self, found: bool) {
        let Some(search) = self.search.take() else {
            return;
        };
        if !search.came && search.lasts_s < BLINK_S {
            return;
        }
        self.score.needed += 1;
        if found && !search.misled {
            self.score.right += 1;
            self.score.delays_s.push(search.lasts_s);
        }
    }

    /// The score, once all is over.
    pub fn finish(mut self) -> Score {
        self.end_search(false);
        self.score
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Each letter a tenth of a second. Capitals: in clear sight; small: in part; the rest: not at
    /// all. R and r: rightly followed, W, w and !: wrongly, N, n and .: nobody.
    fn score(story: &str) -> Score {
        let mut keeper = ScoreKeeper::new();
        for letter in story.chars() {
            let sight = match letter {
                '.' | '!' => Sight::None,
                letter if letter.is_uppercase() => Sight::Clear,
                _ => Sight::Partial,
            };
            let followed = match letter.to_ascii_lowercase() {
                'r' => Followed::Right,
                'w' | '!' => Followed::Wrong,
                _ => Followed::Nobody,
            };
            keeper.step(0.1, sight, followed);
        }
        keeper.finish()
    }

    #[test]
    fn a_return_is_a_search_and_its_length_the_delay() {
        let score = score("RRRRR......NNNRRR");
        assert_eq!((score.needed, score.right), (1, 1));
        assert!((score.mean_delay_s().unwrap() - 0.3).abs() < 1e-9);
        assert!((score.visible_s - 1.1).abs() < 1e-9 && (score.tracked_s - 0.8).abs() < 1e-9);
        assert_eq!(score.wrong_s, 0.0);
    }

    #[test]
    fn a_blink_is_no_search_and_a_track_that_lives_on_needs_none() {
        assert_eq!(score("RRR..RRRNNRRR").needed, 0);
        assert_eq!(score("RRR......RRR").needed, 0);
        assert_eq!(score("RRRNNNNNNNRRR").right, 1);
    }

    #[test]
    fn whoever_leaves_before_being_found_was_missed() {
        let score = score("RR......NNNN......NNRR");
        assert_eq!((score.needed, score.right), (2, 1));
    }

    #[test]
    fn somebody_else_in_between_is_wrong_whatever_follows() {
        let score = score("RR...!!!NWWRRRww");
        assert_eq!((score.needed, score.right), (1, 0));
        assert!((score.wrong_s - 0.7).abs() < 1e-9);
        // 0.7 s of 1.6 s.
        assert!((score.wrong_s_per_hour() - 1575.0).abs() < 1e-6);
    }

    #[test]
    fn found_before_clear_sight_is_found_at_once() {
        let score = score("RR......nnrrRRR");
        assert_eq!((score.needed, score.right), (0, 0));
        assert_eq!(score.tracked_share(), 1.0);
    }

    #[test]
    fn scores_of_scenes_add_up() {
        let mut all = score("RR......NRR");
        all.add(&score("RR......NNNRR"));
        assert_eq!((all.needed, all.right), (2, 2));
        assert!((all.mean_delay_s().unwrap() - 0.2).abs() < 1e-9);
    }
}
