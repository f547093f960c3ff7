//! Writing g2o files.

use std::io::{self, Write};

use super::line::Stored;
use crate::factor::{Factor, FactorKind};
use crate::graph::Graph;
use crate::group::{Dense, Group, Se2, Se3};

/// A group that g2o files hold: [`Se2`] and [`Se3`].
#[allow(
    private_bounds,
    reason = "how numbers are laid out is no business of callers"
)]
pub trait Writable: Stored {}
impl Writable for Se2 {}
impl Writable for Se3 {}

/// Writes poses, which of them are fixed, and edges, each number with as many digits as it takes to
/// read the same number again. Priors have no line in this format and are left out.
///
/// # Errors
/// Why writing failed.
pub fn write<G: Writable>(graph: &Graph<G>, mut out: impl Write) -> io::Result<()> {
    for (key, pose) in graph.poses() {
        write!(out, "{} {key}", G::VERTEX)?;
        numbers(&mut out, &pose.to_numbers())?;
        writeln!(out)?;
    }
    for (key, _) in graph.poses().filter(|(key, _)| graph.is_fixed(*key)) {
        writeln!(out, "FIX {key}")?;
    }
    let factors = graph.factors().map(|(_, factor)| factor);
    for factor in factors.filter(|factor| factor.kind() != FactorKind::Prior) {
        edge(&mut out, factor)?;
    }
    out.flush()
}

fn edge<G: Writable>(out: &mut impl Write, factor: &Factor<G>) -> io::Result<()> {
    write!(out, "{} {} {}", G::EDGE, factor.from(), factor.to())?;
    numbers(out, &factor.measured().to_numbers())?;
    let information = factor.information().numbers();
    for r in 0..<G as Group>::DIM {
        for c in r..<G as Group>::DIM {
            write!(out, " {:?}", information[c * <G as Group>::DIM + r])?;
        }
    }
    writeln!(out)
}

fn numbers(out: &mut impl Write, numbers: &[f64]) -> io::Result<()> {
    // Debug is Display with an exponent for the very large and very small.
    numbers.iter().try_for_each(|v| write!(out, " {v:?}"))
}
