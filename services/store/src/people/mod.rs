//! The people a robot knows: names, models and pictures, encrypted, and gone when they are forgotten.
//!
//! In: people as they were enrolled, and their models as these are learnt. Out: the same after the
//! next start, or a [`PeopleError`] that says what is wrong and what to do. Elsewhere: learning
//! models (`hachi-people`), decoding pictures (whoever wants to see them).
//!
//! Two files. The store is an SQLite data base as a map is; all that it says of a person (name, model,
//! pictures) is sealed under a key of that person's own (XChaCha20-Poly1305, a fresh nonce each time,
//! the place it belongs to authenticated with it). The keys lie in a key file with mode 0600: a copy of
//! the store alone says nothing of anybody.
//!
//! Several programs may have a store open: each change is one short transaction, and whoever waits too
//! long is told. To forget somebody is to delete their rows, destroy their key, and write the store
//! anew without what SQLite leaves behind; killed in between, the next one to open it finishes.
//!
//! | module | holds |
//! |---|---|
//! | [`file`](mod@file) | [`PeopleFile`]: opening, listing, loading |
//! | `change` | enrolling, saving, renaming |
//! | `erase` | forgetting |
//! | [`person`] | a person as a store takes and gives them |
//! | [`codec`] | people and models as bytes |
//! | `keys` | the key file |
//! | `seal` | sealing and opening bytes |
//! | [`network`] | which network made a model |
//! | [`error`] | what can be wrong |

mod change;
pub mod codec;
mod erase;
pub mod error;
pub mod file;
mod keys;
pub mod network;
pub mod person;
mod seal;
mod tables;

pub use change::check_form_of_name;
pub use error::PeopleError;
pub use file::{PeopleFile, PeoplePaths};
pub use network::NetworkIdentity;
pub use person::{Listing, NewPerson, PersonEntry, StoredId, StoredImages, StoredModel};
