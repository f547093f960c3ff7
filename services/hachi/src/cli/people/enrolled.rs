//! Arguments of the commands about the people that the robot knows.

use std::path::PathBuf;

use clap::Args;

use super::NetworkArguments;
use super::live::ServiceArguments;

/// Where people are kept.
#[derive(Debug, Clone, Args)]
pub struct StoreArguments {
    /// The store of people [default: HACHI_PEOPLE, else hachi/people.db in XDG_DATA_HOME, which is
    /// usually ~/.local/share].
    #[arg(long, value_name = "FILE")]
    pub store: Option<PathBuf>,
    /// Its key file [default: beside the store, with the ending .key].
    #[arg(long, value_name = "FILE")]
    pub key: Option<PathBuf>,
}

/// Arguments of `hachi people list`.
#[derive(Debug, Clone, Args)]
#[command(after_help = "Example:\n  hachi people list --json")]
pub struct PeopleListArguments {
    /// Where people are kept.
    #[command(flatten)]
    pub store: StoreArguments,
    /// Print one JSON object.
    #[arg(long)]
    pub json: bool,
}

/// Arguments of `hachi people enrol`.
#[derive(Debug, Clone, Args)]
#[command(after_help = "\
Pictures are JPEG or PNG files, or folders of them: crops of the person (at least 1.4 times as high as \
wide), or frames in which nobody else is. At least 9 are needed, from all sides and in the light of the \
place; two thirds say what the person looks like, one third how much that varies. Pictures that show \
nobody or more than one person are left out and named. Up to 64 are kept, encrypted.

With --live it is the running service (`hachi run`) that takes thirty pictures, of whoever stands alone \
in front of the robot and turns round once, and keeps them in its own store.

Example:
  hachi people enrol Anna anna/*.jpg
  hachi people enrol Anna frames --store /var/lib/hachi/people.db
  hachi people enrol Anna --live")]
pub struct PeopleEnrolArguments {
    /// What to call them.
    #[arg(value_name = "NAME")]
    pub name: String,
    /// Pictures of them, or folders of pictures.
    #[arg(value_name = "IMAGE", required_unless_present = "live")]
    pub images: Vec<PathBuf>,
    /// From the running robot's camera; the store and the networks are the service's.
    #[arg(long, conflicts_with_all = ["images", "store", "key", "models", "detector", "reid"])]
    pub live: bool,
    /// With --live, the service, as its settings say under service.listen.
    #[command(flatten)]
    pub service: ServiceArguments,
    /// Where people are kept.
    #[command(flatten)]
    pub store: StoreArguments,
    /// The networks.
    #[command(flatten)]
    pub networks: NetworkArguments,
    /// Print one JSON object.
    #[arg(long)]
    pub json: bool,
}

/// Arguments of `hachi people rename`.
#[derive(Debug, Clone, Args)]
#[command(after_help = "Example:\n  hachi people rename Anna \"Anna K.\"")]
pub struct PeopleRenameArguments {
    /// What they are called.
    #[arg(value_name = "NAME")]
    pub name: String,
    /// What to call them.
    #[arg(value_name = "NEW_NAME")]
    pub new_name: String,
    /// Where people are kept.
    #[command(flatten)]
    pub store: StoreArguments,
    /// Print one JSON object.
    #[arg(long)]
    pub json: bool,
}

/// Arguments of `hachi people export`.
#[derive(Debug, Clone, Args)]
#[command(after_help = "\
Writes person.json (name, day, network, model) and the pictures, no longer encrypted. A folder that is \
new can be read by its owner alone.

Example:
  hachi people export Anna --out anna")]
pub struct PeopleExportArguments {
    /// Who.
    #[arg(value_name = "NAME")]
    pub name: String,
    /// Folder to write to.
    #[arg(long, value_name = "DIR")]
    pub out: PathBuf,
    /// Where people are kept.
    #[command(flatten)]
    pub store: StoreArguments,
    /// Print one JSON object.
    #[arg(long)]
    pub json: bool,
}

/// Arguments of `hachi people forget`.
#[derive(Debug, Clone, Args)]
#[command(after_help = "\
Name, model and pictures are gone from every file, and the key to copies of them is destroyed. There is \
no way back: export first what should be kept.

Example:
  hachi people forget Anna")]
pub struct PeopleForgetArguments {
    /// Who.
    #[arg(value_name = "NAME", required_unless_present = "unreadable")]
    pub name: Option<String>,
    /// Forget those whose entries are damaged.
    #[arg(long, conflicts_with = "name")]
    pub unreadable: bool,
    /// Where people are kept.
    #[command(flatten)]
    pub store: StoreArguments,
    /// Print one JSON object.
    #[arg(long)]
    pub json: bool,
}
