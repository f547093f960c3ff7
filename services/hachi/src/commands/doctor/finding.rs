//! What one check found.

use serde::Serialize;

/// How bad it is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub(super) enum Level {
    /// As it should be, or not needed.
    Ok,
    /// Works, but slower, less safely, or without a part that is not LiDAR mapping.
    Warn,
    /// Live LiDAR mapping does not work.
    Fail,
}

/// What one check found.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(super) struct Finding {
    /// What was looked at, in a word or two.
    pub(super) name: &'static str,
    pub(super) level: Level,
    /// What was seen.
    pub(super) what: String,
    /// What the user can do; absent where nothing needs doing.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) next_step: Option<String>,
}

impl Finding {
    pub(super) fn ok(name: &'static str, what: impl Into<String>) -> Self {
        Self {
            name,
            level: Level::Ok,
            what: what.into(),
            next_step: None,
        }
    }

    pub(super) fn warn(
        name: &'static str,
        what: impl Into<String>,
        next_step: impl Into<String>,
    ) -> Self {
        Self {
            name,
            level: Level::Warn,
            what: what.into(),
            next_step: Some(next_step.into()),
        }
    }

    pub(super) fn fail(
        name: &'static str,
        what: impl Into<String>,
        next_step: impl Into<String>,
    ) -> Self {
        Self {
            level: Level::Fail,
            ..Self::warn(name, what, next_step)
        }
    }
}
