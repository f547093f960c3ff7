//! Which of several velocities to believe: feet and the inertial prediction vote.
//!
//! In: a velocity with covariance from each foot that stands, and one from the accelerometer. Out:
//! the velocity that most agree on, its covariance, and the feet that were outvoted.

use hachi_hal::{Matrix3, Vector3};

/// What one foot says of the base's velocity.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Candidate {
    /// The velocity if this foot stands still, m/s.
    pub velocity: Vector3,
    /// Its covariance, (m/s)².
    pub covariance: Matrix3,
}

/// What the inertial sensor says.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Prediction {
    /// The base's velocity, m/s.
    pub velocity: Vector3,
    /// Its covariance, (m/s)².
    pub covariance: Matrix3,
    /// Whether it may outvote feet.
    pub is_trusted: bool,
}

/// What the vote ended in.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Verdict {
    /// The velocity.
    pub velocity: Vector3,
    /// Its covariance.
    pub covariance: Matrix3,
    /// Feet that were outvoted.
    pub slips: [bool; 4],
    /// Feet that the velocity rests on.
    pub feet: usize,
}

/// Two velocities agree if their difference is within this of its covariance: the 99.9 % bound of
/// chi-square with three degrees of freedom.
const GATE: f64 = 16.27;

/// Votes of a prediction that is trusted: more than two feet that slip together, fewer than three.
const PREDICTION_VOTES: f64 = 2.5;
/// Votes of one that is not: it breaks ties.
const DOUBTFUL_VOTES: f64 = 0.5;

/// Squared distance of two velocities in units of their covariances.
fn distance(a: &Vector3, a_covariance: &Matrix3, b: &Vector3, b_covariance: &Matrix3) -> f64 {
    let difference = a - b;
    (a_covariance + b_covariance)
        .try_inverse()
        .map_or(f64::INFINITY, |inverse| {
            difference.dot(&(inverse * difference))
        })
}

/// Finds the velocity that most agree on.
pub fn vote(candidates: &[Option<Candidate>; 4], prediction: &Prediction) -> Verdict {
    let predicted = Some(Candidate {
        velocity: prediction.velocity,
        covariance: prediction.covariance,
    });
    let voters: [Option<Candidate>; 5] =
        core::array::from_fn(|i| *candidates.get(i).unwrap_or(&predicted));
    let votes = |i: usize| match (i, prediction.is_trusted) {
        (4, true) => PREDICTION_VOTES,
        (4, false) => DOUBTFUL_VOTES,
        _ => 1.0,
    };
    let agree = |a: &Candidate, b: &Candidate| {
        distance(&a.velocity, &a.covariance, &b.velocity, &b.covariance) < GATE
    };

    // Each voter stands for election; the one most agree with wins, the nearest to all on a tie.
    let mut best: Option<(f64, f64, usize)> = None;
    for (i, candidate) in voters.iter().enumerate() {
        let Some(candidate) = candidate else { continue };
        let (mut support, mut spread) = (0.0, 0.0);
        for (j, other) in voters.iter().enumerate() {
            let Some(other) = other else { continue };
            if agree(candidate, other) {
                support += votes(j);
                spread += (candidate.velocity - other.velocity).norm_squared();
            }
        }
        let wins = best
            .is_none_or(|(most, least, _)| support > most || (support == most && spread < least));
        if wins {
            best = Some((support, spread, i));
        }
    }
    let winner = best.and_then(|(_, _, i)| voters[i]);
    combined(candidates, winner.as_ref(), prediction)
}

/// The weighted mean of the feet that agree with the winner; the prediction where there are none.
fn combined(
    candidates: &[Option<Candidate>; 4],
    winner: Option<&Candidate>,
    prediction: &Prediction,
) -> Verdict {
    let mut verdict = Verdict {
        velocity: prediction.velocity,
        covariance: prediction.covariance,
        slips: [false; 4],
        feet: 0,
    };
    let Some(winner) = winner else { return verdict };
    let (mut information, mut weighted) = (Matrix3::zeros(), Vector3::zeros());
    for (i, candidate) in candidates.iter().enumerate() {
        let Some(c) = candidate else { continue };
        if distance(
            &c.velocity,
            &c.covariance,
            &winner.velocity,
            &winner.covariance,
        ) >= GATE
        {
            verdict.slips[i] = true;
        } else if let Some(inverse) = c.covariance.try_inverse() {
            information += inverse;
            weighted += inverse * c.velocity;
            verdict.feet += 1;
        }
    }
    if let (Some(covariance), 1..) = (information.try_inverse(), verdict.feet) {
        verdict.velocity = covariance * weighted;
        verdict.covariance = covariance * disagreement(candidates, &verdict);
    }
    if verdict.slips.contains(&true) {
        // A foot was wrong and another one nearly was: who is right is not sure.
        let doubt = candidates
            .iter()
            .zip(verdict.slips)
            .filter(|(_, slips)| *slips)
            .filter_map(|(c, _)| c.as_ref())
            .map(|c| (c.velocity - verdict.velocity).norm_squared())
            .fold(0.0, f64::max);
        let share = 1.0 / (1.0 + verdict.feet as f64);
        verdict.covariance += Matrix3::identity() * (doubt * share * share / 3.0);
    }
    verdict
}

/// By how much the feet's spread exceeds what their covariances say, squared; at least 1.
fn disagreement(candidates: &[Option<Candidate>; 4], verdict: &Verdict) -> f64 {
    if verdict.feet < 2 {
        return 1.0;
    }
    let kept = candidates.iter().zip(verdict.slips);
    let chi_square: f64 = kept
        .filter_map(|(c, slips)| c.as_ref().filter(|_| !slips))
        .filter_map(|c| {
            let d = c.velocity - verdict.velocity;
            Some(d.dot(&(c.covariance.try_inverse()? * d)))
        })
        .sum();
    (chi_square / (3.0 * (verdict.feet as f64 - 1.0))).max(1.0)
}
