//! Which of the people in view is the robot's person.
//!
//! In: tracks and features of each frame; a calibration, or the track that the user picked. Out:
//! for each enrolled person where they are, how sure that is, and a stated condition.
//!
//! | module | holds |
//! |---|---|
//! | [`appearance_model`] | mean, deviation and threshold of a person's features, and how they are learnt |
//! | [`calibration`] | FollowMe: a model from pictures taken in front of the robot |
//! | [`carpe`] | CARPE-ID: a model that follows a person's changing looks |
//!
//! After Rollo's FollowMe (2023) and CARPE-ID (2024). Where the publication leaves something open
//! or is misprinted, the place that decides says so.

pub mod appearance_model;
pub mod calibration;
pub mod carpe;
mod others;
mod person;

pub use appearance_model::AppearanceModel;
pub use calibration::{Calibration, CalibrationError};
pub use carpe::{Condition, Identifier, IdentifierConfig, PersonId, Status};
