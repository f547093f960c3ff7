//! Drawing into a picture. Letters, frames and pictures in pictures are `embedded-graphics`', for
//! which [`Rgb`] is a display; tinting what a mask covers, which it lacks, is here. What lies outside
//! the picture is not drawn.

use std::convert::Infallible;

use embedded_graphics::mono_font::ascii::{FONT_6X10, FONT_9X15, FONT_10X20};
use embedded_graphics::mono_font::{MonoFont, MonoTextStyleBuilder};
use embedded_graphics::pixelcolor::Rgb888;
use embedded_graphics::prelude::*;
use embedded_graphics::primitives::{PrimitiveStyleBuilder, Rectangle, StrokeAlignment};
use embedded_graphics::text::{Baseline, Text};
use hachi_people::BoundingBox;

use crate::images::Rgb;

/// How much of a tint covers what is below it.
const TINT: f32 = 0.45;
/// What letters stand on.
const GROUND: Rgb888 = Rgb888::new(20, 20, 20);

/// Letters that are read and hide little in a picture of so many rows.
const fn font(rows: usize) -> &'static MonoFont<'static> {
    match rows {
        ..480 => &FONT_6X10,
        480..960 => &FONT_9X15,
        _ => &FONT_10X20,
    }
}

impl OriginDimensions for Rgb {
    fn size(&self) -> Size {
        Size::new(self.width as u32, self.height as u32)
    }
}

impl DrawTarget for Rgb {
    type Color = Rgb888;
    type Error = Infallible;

    fn draw_iter<I: IntoIterator<Item = Pixel<Rgb888>>>(
        &mut self,
        pixels: I,
    ) -> Result<(), Infallible> {
        for Pixel(at, color) in pixels {
            if let Some(pixel) = pixel(self, at) {
                pixel.copy_from_slice(&[color.r(), color.g(), color.b()]);
            }
        }
        Ok(())
    }
}

fn pixel(picture: &mut Rgb, at: Point) -> Option<&mut [u8]> {
    let x = usize::try_from(at.x).ok().filter(|&x| x < picture.width)?;
    let y = usize::try_from(at.y).ok().filter(|&y| y < picture.height)?;
    picture.pixels[3 * (y * picture.width + x)..].get_mut(..3)
}

pub(super) fn blank([width, height]: [usize; 2], color: Rgb888) -> Rgb {
    Rgb {
        width,
        height,
        pixels: [color.r(), color.g(), color.b()].repeat(width * height),
    }
}

/// Tints what a mask covers within a box.
pub(super) fn tint(
    picture: &mut Rgb,
    b: &BoundingBox,
    color: Rgb888,
    covers: impl Fn([f64; 2]) -> bool,
) {
    let tint = [color.r(), color.g(), color.b()];
    let within = area(picture, b).points();
    for at in within.filter(|at| covers([at.x, at.y].map(|v| f64::from(v) + 0.5))) {
        for (channel, tint) in pixel(picture, at).into_iter().flatten().zip(tint) {
            *channel = (f32::from(*channel) * (1.0 - TINT) + f32::from(tint) * TINT) as u8;
        }
    }
}

/// The edge of a box, so many pixels wide, inside it.
pub(super) fn frame(picture: &mut Rgb, b: &BoundingBox, color: Rgb888, wide: u32) {
    let style = PrimitiveStyleBuilder::new()
        .stroke_color(color)
        .stroke_width(wide)
        .stroke_alignment(StrokeAlignment::Inside)
        .build();
    let Ok(()) = area(picture, b).into_styled(style).draw(picture);
}

/// A word above a place, on dark ground.
pub(super) fn label(picture: &mut Rgb, [left, top]: [f64; 2], text: &str, color: Rgb888) {
    let style = MonoTextStyleBuilder::new()
        .font(font(picture.height))
        .text_color(color)
        .background_color(GROUND)
        .build();
    let text = Text::with_baseline(text, Point::zero(), style, Baseline::Top);
    let room = picture.size().saturating_sub(text.bounding_box().size);
    // Casts saturate.
    let x = (left as i32).clamp(0, room.width as i32);
    let y = (top as i32)
        .saturating_sub_unsigned(text.bounding_box().size.height)
        .max(0);
    let Ok(_) = text.translate(Point::new(x, y)).draw(picture);
}

/// The pixels of a box that lie in the picture.
fn area(picture: &Rgb, b: &BoundingBox) -> Rectangle {
    // What is no number is nought.
    let within = |edge: f64, most: usize| edge.round().clamp(0.0, most as f64) as u32;
    let [left, right] = [b.left, b.right()].map(|x| within(x, picture.width));
    let [top, bottom] = [b.top, b.bottom()].map(|y| within(y, picture.height));
    let size = Size::new(right.saturating_sub(left), bottom.saturating_sub(top));
    Rectangle::new(Point::new(left as i32, top as i32), size)
}
