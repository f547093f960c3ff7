//! Arguments of the commands about people whom a running service sees.

use std::net::SocketAddr;

use clap::{ArgGroup, Args};

/// Which service is asked.
#[derive(Debug, Clone, Args)]
pub struct ServiceArguments {
    /// The service, as its settings say under service.listen.
    #[arg(long, value_name = "ADDRESS", default_value = "127.0.0.1:9470")]
    pub address: SocketAddr,
}

/// Arguments of `hachi people watch`.
#[derive(Debug, Clone, Args)]
#[command(after_help = "\
Shows everybody in view by the number of their track, with their box in the picture in pixels, and \
everybody whom the robot knows.

Example:
  hachi people watch
  hachi people watch --once --json")]
pub struct PeopleWatchArguments {
    /// Print it once.
    #[arg(long)]
    pub once: bool,
    /// Print one JSON object and end.
    #[arg(long)]
    pub json: bool,
    /// Which service is asked.
    #[command(flatten)]
    pub service: ServiceArguments,
}

/// Arguments of `hachi people pick`.
#[derive(Debug, Clone, Args)]
#[command(group = ArgGroup::new("whom").required(true))]
#[command(after_help = "\
From then on the robot knows this person, whatever becomes of the track; who was its person before is it \
no more. Where the robot is UNSURE which of two people is its own, picking one says so.

Example:
  hachi people pick --track 3
  hachi people pick --at 320,180")]
pub struct PeoplePickArguments {
    /// The number of their track, as `hachi people watch` shows it.
    #[arg(long, value_name = "N", group = "whom")]
    pub track: Option<u64>,
    /// A place in the picture that they cover, pixels from its left upper corner.
    #[arg(long, value_name = "X,Y", value_parser = place, group = "whom")]
    pub at: Option<Place>,
    /// Print one JSON object.
    #[arg(long)]
    pub json: bool,
    /// Which service is asked.
    #[command(flatten)]
    pub service: ServiceArguments,
}

/// Arguments of `hachi people release`.
#[derive(Debug, Clone, Args)]
#[command(after_help = "\
Whoever is in the store stays known; somebody who was only picked is forgotten.

Example:
  hachi people release")]
pub struct PeopleReleaseArguments {
    /// Print one JSON object.
    #[arg(long)]
    pub json: bool,
    /// Which service is asked.
    #[command(flatten)]
    pub service: ServiceArguments,
}

/// A place in a picture, pixels.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Place(pub [f64; 2]);

fn place(text: &str) -> Result<Place, String> {
    let number = |part: &str| part.trim().parse::<f64>().ok();
    let numbers = text
        .split_once(',')
        .and_then(|(x, y)| Some([number(x)?, number(y)?]));
    numbers
        .filter(|numbers| numbers.iter().all(|v| v.is_finite()))
        .map(Place)
        .ok_or_else(|| "expected two numbers of pixels, as 320,180".to_owned())
}
