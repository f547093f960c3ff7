//! Arguments of `hachi eval loops`.

use std::path::PathBuf;

use clap::{Args, ValueEnum};
use hachi_place::{Comparison, Formula, Kind, Profile};

use super::metres;

/// Arguments of `hachi eval loops`.
#[derive(Debug, Clone, Args)]
#[command(after_help = "\
INPUT is a folder of .bin, .pcd or .ply scans, or a KITTI sequence folder; every scan is a keyframe. \
Poses are TUM, KITTI or EuRoC csv, recognised by content; as many as scans are taken one for one, \
otherwise by time. A scan's best match among the scans before it, the last --exclude left out, is \
right if the two are within --radius-m of each other.

Example:
  hachi eval loops kitti/sequences/05 --poses kitti/poses/05.txt --descriptor gsc-huber --plot 05.svg")]
pub struct EvalLoopsArguments {
    /// The keyframe scans.
    #[arg(value_name = "INPUT")]
    pub input: PathBuf,
    /// Where each scan was truly taken.
    #[arg(long, value_name = "FILE")]
    pub poses: PathBuf,
    /// What places are described by.
    #[arg(long, value_enum)]
    pub descriptor: DescriptorArgument,
    /// Two scans within this distance are at one place, metres.
    #[arg(long, value_name = "METRES", default_value_t = 5.0, value_parser = metres)]
    pub radius_m: f64,
    /// How many of the latest scans can't be matched.
    #[arg(long, value_name = "SCANS", default_value_t = 50)]
    pub exclude: usize,
    /// Grid: for the surroundings that the first scans show, or given.
    #[arg(long, value_enum, default_value_t = ProfileArgument::Auto)]
    pub profile: ProfileArgument,
    /// How a bin's mean and spread make one value (of no matter to sc).
    #[arg(long, value_enum, default_value_t = FormulaArgument::Deviation)]
    pub formula: FormulaArgument,
    /// How two descriptors are compared [default: frobenius for sc, centred for the others].
    #[arg(long, value_enum)]
    pub comparison: Option<ComparisonArgument>,
    /// Draw precision over recall to this SVG file.
    #[arg(long, value_name = "FILE")]
    pub plot: Option<PathBuf>,
    /// Print one JSON object.
    #[arg(long)]
    pub json: bool,
}

/// What a bin of a descriptor holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum DescriptorArgument {
    /// Greatest height (Scan Context++).
    Sc,
    /// Mean and spread of the heights.
    GscHeight,
    /// Mean and spread of the heights, far-off points weighing less.
    GscHuber,
    /// Mean and spread of the intensities.
    GscIntensity,
}

impl From<DescriptorArgument> for Kind {
    fn from(argument: DescriptorArgument) -> Self {
        match argument {
            DescriptorArgument::Sc => Self::ScanContext,
            DescriptorArgument::GscHeight => Self::GscHeight,
            DescriptorArgument::GscHuber => Self::GscHuber,
            DescriptorArgument::GscIntensity => Self::GscIntensity,
        }
    }
}

/// Which grid.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum ProfileArgument {
    /// Chosen by how far the first scans reach.
    Auto,
    /// Rooms and corridors.
    Indoor,
    /// Streets and yards, to 80 m.
    Outdoor,
}

impl ProfileArgument {
    /// The grid, if it is given.
    pub fn profile(self) -> Option<Profile> {
        match self {
            Self::Auto => None,
            Self::Indoor => Some(Profile::INDOOR),
            Self::Outdoor => Some(Profile::OUTDOOR),
        }
    }
}

/// How a bin's value is made.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum FormulaArgument {
    /// Mean plus twice the variance: the thesis's.
    Variance,
    /// Mean plus twice the standard deviation.
    Deviation,
}

impl From<FormulaArgument> for Formula {
    fn from(argument: FormulaArgument) -> Self {
        match argument {
            FormulaArgument::Variance => Self::Variance,
            FormulaArgument::Deviation => Self::Deviation,
        }
    }
}

/// How two descriptors are compared.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum ComparisonArgument {
    /// Cosine of the whole matrices: the thesis's.
    Frobenius,
    /// Mean cosine of the columns: the original Scan Context's.
    Columns,
    /// Cosine after each ring's mean is taken out.
    Centred,
}

impl From<ComparisonArgument> for Comparison {
    fn from(argument: ComparisonArgument) -> Self {
        match argument {
            ComparisonArgument::Frobenius => Self::Frobenius,
            ComparisonArgument::Columns => Self::Columns,
            ComparisonArgument::Centred => Self::Centred,
        }
    }
}
