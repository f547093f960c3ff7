//! A person as a store takes and gives them.

use hachi_people::identify::AppearanceModel;

use super::NetworkIdentity;

/// Pictures of one person; the oldest go first.
pub const MOST_IMAGES: usize = 64;
/// People in one store.
pub const MOST_PEOPLE: usize = 1_000;
/// Bytes of one picture.
pub const MOST_IMAGE_BYTES: usize = 1 << 20;

/// A person's number in a store: drawn at random, and never used again.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct StoredId(pub(super) i64);

/// A person in a list.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct PersonEntry {
    /// Their number.
    pub id: StoredId,
    /// Their name.
    pub name: String,
    /// When they were enrolled, seconds since 1970.
    pub enrolled_unix_s: i64,
    /// How many pictures of them are kept.
    pub images: usize,
}

/// Everybody in a store.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Listing {
    /// By name.
    pub people: Vec<PersonEntry>,
    /// Those whose key or record is not what was written.
    pub unreadable: Vec<StoredId>,
}

/// A person to be kept.
#[derive(Debug, Clone, Copy)]
pub struct NewPerson<'a> {
    /// What to call them.
    pub name: &'a str,
    /// Now, seconds since 1970.
    pub enrolled_unix_s: i64,
    /// The network whose features the model is made of.
    pub network: &'a NetworkIdentity,
    /// What they look like.
    pub model: &'a AppearanceModel,
    /// Pictures of them as files of any kind, oldest first.
    pub images: &'a [Vec<u8>],
}

/// A person's model as it was saved.
#[derive(Debug, Clone, PartialEq)]
pub struct StoredModel {
    /// The network that made it.
    pub network: NetworkIdentity,
    /// The model.
    pub model: AppearanceModel,
}

/// A person's pictures.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct StoredImages {
    /// As they were saved, oldest first.
    pub images: Vec<Vec<u8>>,
    /// How many are damaged, and left out.
    pub damaged: usize,
}
