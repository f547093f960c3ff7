//! Fewer points for the same line.

/// More points than this on one line can't be told apart at the picture's size.
pub(super) const MOST_POINTS: usize = 4000;

/// Indices of at most about [`MOST_POINTS`] of `count` points, evenly spread, first and last
/// among them.
pub(super) fn indices(count: usize) -> impl Iterator<Item = usize> {
    let step = count.div_ceil(MOST_POINTS).max(1);
    let last = count.checked_sub(1);
    let on_step = (0..count).step_by(step);
    on_step.chain(last.filter(move |last| last % step != 0))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_and_the_last_stay() {
        for count in [1, 2, 3999, 4000, 4001, 10_000, 123_457] {
            let kept: Vec<usize> = indices(count).collect();
            assert_eq!(kept.first(), Some(&0));
            assert_eq!(kept.last(), Some(&(count - 1)));
            assert!(kept.len() <= MOST_POINTS + 1);
            assert!(kept.windows(2).all(|w| w[0] < w[1]));
        }
        assert_eq!(indices(0).count(), 0);
    }
}
