//! A scripted RGB-D camera.

use super::{MockError, Player, Step};
use crate::{RgbdCamera, RgbdGeometry, RgbdHeader, RgbdImages, Stamp};

/// One scripted frame. Header and images are delivered as they stand, so that broken promises can
/// be scripted too.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Shot<'a> {
    /// What is true of the frame.
    pub header: RgbdHeader,
    /// Its depth counts.
    pub depth: &'a [u16],
    /// Its colours.
    pub color: &'a [u8],
}

/// An RGB-D camera that plays a script.
#[derive(Debug, Clone)]
pub struct MockCamera<'a, S> {
    geometry: RgbdGeometry,
    player: Player<Shot<'a>, S>,
}

impl<'a, S: AsRef<[Step<Shot<'a>>]>> MockCamera<'a, S> {
    /// A camera of one geometry that does `script`, one step per call.
    pub fn script(geometry: RgbdGeometry, script: S) -> Self {
        Self {
            geometry,
            player: Player::new(script),
        }
    }

    /// Panics unless every step was played.
    #[track_caller]
    pub fn assert_done(&self) {
        self.player.assert_done();
    }
}

impl<'a, S: AsRef<[Step<Shot<'a>>]>> RgbdCamera for MockCamera<'a, S> {
    type Error = MockError;

    fn geometry(&self) -> Option<&RgbdGeometry> {
        Some(&self.geometry)
    }

    fn read_frame(
        &mut self,
        images: RgbdImages<'_>,
        _: Stamp,
    ) -> Result<Option<RgbdHeader>, MockError> {
        let Some(shot) = self.player.play()? else {
            return Ok(None);
        };
        let given = [images.depth.len(), images.color.len()];
        let needed = [shot.depth.len(), shot.color.len()];
        let (Some(depth), Some(color)) = (
            images.depth.get_mut(..needed[0]),
            images.color.get_mut(..needed[1]),
        ) else {
            return Err(MockError::SmallImages { needed, given });
        };
        depth.copy_from_slice(shot.depth);
        color.copy_from_slice(shot.color);
        Ok(Some(shot.header))
    }
}
