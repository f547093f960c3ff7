//! Pictures of people to train and measure networks on, as the robot's camera sends them, with
//! masks, boxes and identities.
//!
//! ```sh
//! cargo run --release -p hachi-world --example render_people -- scenes FOLDER --seed 1000 --count 70
//! cargo run --release -p hachi-world --example render_people -- portraits FOLDER --seed 1000 --count 700
//! ```
//!
//! Every building, and every person of the portraits, has a seed of its own, counted from `--seed`:
//! sets whose seeds differ share no layout, nobody and no clothes.
#![allow(clippy::print_stdout, reason = "this is what it is for")]

mod people;
mod portraits;
mod scenes;

use std::path::PathBuf;

use clap::{Parser, ValueEnum};

#[derive(Parser)]
struct Arguments {
    /// What to render.
    #[arg(value_enum)]
    what: What,
    /// Where to.
    folder: PathBuf,
    /// Seed of the first building or person; the others count on from it.
    #[arg(long)]
    seed: u64,
    /// Buildings or people.
    #[arg(long)]
    count: u64,
}

#[derive(Clone, Copy, ValueEnum)]
enum What {
    /// Buildings with people, and everybody's mask and box.
    Scenes,
    /// People one by one, cut out.
    Portraits,
}

fn main() -> std::io::Result<()> {
    let arguments = Arguments::parse();
    std::fs::create_dir_all(&arguments.folder)?;
    let render = match arguments.what {
        What::Scenes => scenes::render,
        What::Portraits => portraits::render,
    };
    render(&arguments.folder, arguments.seed, arguments.count)
}
