//! `hachi eval registration`: GICP on two clouds.

use std::path::Path;
use std::time::Instant;

use hachi_hal::{Point, Pose, Rotation};
use hachi_registration::{Aligner, AlignerConfig, Preparer, Registration, SurfaceCloud};
use nalgebra::Matrix4;
use serde::Serialize;

use crate::cli::mapping::EvalRegistrationArguments;
use crate::exit::Failure;
use crate::output;

/// Voxels both clouds are reduced to: a quarter metre, as the peers are measured with.
const VOXEL_M: f32 = 0.25;

#[derive(Debug, Serialize)]
struct Outcome {
    target_from_source: [f64; 16],
    converged: bool,
    iterations: usize,
    inlier_share: f64,
    residual_m: f64,
    open_directions: usize,
    time_ms: f64,
}

/// Runs the command.
///
/// # Errors
/// A cloud or the guess can't be read, or a cloud has too few points.
pub fn run(arguments: &EvalRegistrationArguments) -> Result<(), Failure> {
    let source = load(&arguments.source)?;
    let target = load(&arguments.target)?;
    let guess = match &arguments.guess {
        Some(path) => read_guess(path)?,
        None => Pose::identity(),
    };
    let start = Instant::now();
    let registration = register(&source, &target, &guess);
    let time_ms = start.elapsed().as_secs_f64() * 1e3;
    if registration.pairs == 0 {
        return Err(Failure::new(
            "the clouds do not touch from there",
            "give a better start with --guess",
        ));
    }
    let matrix = registration.target_from_source.to_homogeneous();
    let outcome = Outcome {
        target_from_source: std::array::from_fn(|i| matrix[(i / 4, i % 4)]),
        converged: registration.converged,
        iterations: registration.iterations,
        inlier_share: registration.inlier_share,
        residual_m: registration.residual_m,
        open_directions: registration.degeneracy.translations + registration.degeneracy.rotations,
        time_ms,
    };
    if arguments.json {
        output::json(&outcome)
    } else {
        output::text(&text(&outcome))
    }
}

fn register(source: &[Point], target: &[Point], guess: &Pose) -> Registration {
    let positions = |points: &[Point]| {
        points
            .iter()
            .map(|p| (p.position(), 0.0))
            .collect::<Vec<_>>()
    };
    let (from, onto) = (positions(source), positions(target));
    let prepare = |points: Vec<([f32; 3], f32)>| {
        let mut cloud = SurfaceCloud::default();
        Preparer::default().prepare(points.into_iter(), VOXEL_M, &mut cloud);
        cloud
    };
    let (source, target) = rayon::join(|| prepare(from), || prepare(onto));
    let config = AlignerConfig {
        degeneracy_threshold: 0.01,
        ..AlignerConfig::default()
    };
    Aligner::default().align(&source.points, &target, guess, None, &config)
}

fn load(path: &Path) -> Result<Vec<Point>, Failure> {
    /// Fewer points than this have no surface to speak of.
    const LEAST: usize = 10;
    let mut points = Vec::new();
    hachi_bridge::read_cloud(path, &mut points)
        .map_err(|error| Failure::new(error, "give a .bin, .pcd or .ply cloud"))?;
    points.retain(Point::is_finite);
    if points.len() < LEAST {
        return Err(Failure::new(
            format_args!("{} has only {} usable points", path.display(), points.len()),
            "give a cloud with more",
        ));
    }
    Ok(points)
}

fn read_guess(path: &Path) -> Result<Pose, Failure> {
    let wrong = |why: &dyn std::fmt::Display| {
        Failure::new(
            format_args!("{} is no transform: {why}", path.display()),
            "give 16 numbers: the 4x4 matrix target_from_source, row by row",
        )
    };
    let text = std::fs::read_to_string(path).map_err(|e| wrong(&e))?;
    let numbers: Vec<f64> = text
        .split(|c: char| c.is_whitespace() || c == ',')
        .filter(|t| !t.is_empty())
        .map(|t| {
            t.parse()
                .map_err(|_| wrong(&format_args!("{t:?} is no number")))
        })
        .collect::<Result<_, _>>()?;
    if numbers.len() != 16 || !numbers.iter().all(|n| n.is_finite()) {
        return Err(wrong(&format_args!("{} numbers", numbers.len())));
    }
    let matrix = Matrix4::from_row_slice(&numbers);
    let block = matrix.fixed_view::<3, 3>(0, 0).into_owned();
    if (block * block.transpose() - nalgebra::Matrix3::identity()).amax() > 1e-2
        || block.determinant() < 0.0
    {
        return Err(wrong(&"its upper left 3x3 block is no rotation"));
    }
    let rotation = Rotation::from_matrix(&block);
    Ok(Pose::from_parts(
        matrix.fixed_view::<3, 1>(0, 3).into_owned().into(),
        rotation,
    ))
}

fn text(outcome: &Outcome) -> String {
    let row = |r: usize| {
        let v = &outcome.target_from_source[4 * r..4 * r + 4];
        format!("{:12.8} {:12.8} {:12.8} {:12.6}", v[0], v[1], v[2], v[3])
    };
    format!(
        "target_from_source\n{}\n{}\n{}\n{}\n{} after {} iterations, {:.1} % of points paired, \
         {:.3} m off their surfaces, {:.1} ms",
        row(0),
        row(1),
        row(2),
        row(3),
        if outcome.converged {
            "converged"
        } else {
            "NOT converged"
        },
        outcome.iterations,
        outcome.inlier_share * 100.0,
        outcome.residual_m,
        outcome.time_ms,
    )
}
