//! The map from above, as a picture.
//!
//! In: the map's points and the path through it. Out: a PNG; the more was seen over a pixel the
//! brighter, colour by height, the path on top. What hangs higher than a little above the sensor is
//! left out: a ceiling would hide the rooms. The points pass by twice, once for the bounds and once
//! to be drawn; kept are four bytes a pixel.

mod spread;

use std::io::{self, Write};
use std::path::Path;

use hachi_trajectory::Trajectory;

use crate::exit::Failure;
use crate::map_builder::MapBuilder;
use spread::Spread;

/// Longest side, pixels.
const LONG_SIDE: f64 = 1400.0;
/// Smallest pixel: the map has nothing finer.
const LEAST_PIXEL_M: f64 = 0.03;
/// Points higher than this over the sensor's first place are left out.
const MOST_HEIGHT_M: f32 = 0.8;
/// The height at which colours begin; the floor is below it.
const LEAST_HEIGHT_M: f32 = -1.0;
/// Share of points that may lie outside the picture on each side: stray ones must not shrink it.
const STRAY_SHARE: f64 = 0.002;
/// Room around, metres.
const MARGIN_M: f64 = 0.5;

const BACKGROUND: [u8; 3] = [14, 17, 24];
const PATH: [u8; 3] = [255, 96, 64];

/// Draws the map to a PNG file, whole or not at all. An empty map has no picture.
///
/// # Errors
/// The file can't be written, or the map's temporary ones can't be read.
pub fn write(path: &Path, map: &MapBuilder, trajectory: &Trajectory) -> Result<(), Failure> {
    let pixels = drawn(map, trajectory).map_err(|error| Failure::writing(path, &error))?;
    let Some((view, pixels)) = pixels else {
        return Ok(());
    };
    let bytes = encode(&view, &pixels).map_err(|error| {
        Failure::new(
            format_args!("{} can't be drawn: {error}", path.display()),
            "please report this",
        )
    })?;
    hachi_bridge::write_file(path, &bytes).map_err(|error| Failure::unwritten(&error))
}

fn drawn(map: &MapBuilder, trajectory: &Trajectory) -> io::Result<Option<(View, Vec<Pixel>)>> {
    let Some(view) = View::of(map, trajectory)? else {
        return Ok(None);
    };
    let mut pixels = vec![Pixel::default(); view.width as usize * view.height as usize];
    for point in low_points(map)? {
        let [x, y, z] = point?;
        if let Some(at) = view.pixel(f64::from(x), f64::from(y)) {
            pixels[at].add(z);
        }
    }
    draw_path(&view, &mut pixels, trajectory);
    Ok(Some((view, pixels)))
}

fn low_points(map: &MapBuilder) -> io::Result<impl Iterator<Item = io::Result<[f32; 3]>>> {
    let positions = map.points()?.map(|point| Ok(point?.0));
    Ok(positions.filter(|p| p.as_ref().map_or(true, |p| p[2] < MOST_HEIGHT_M)))
}

/// Which part of the plane the picture shows: x to the right, y up.
#[derive(Debug, Clone, Copy)]
struct View {
    left_m: f64,
    top_m: f64,
    pixel_m: f64,
    width: u32,
    height: u32,
}

impl View {
    fn of(map: &MapBuilder, trajectory: &Trajectory) -> io::Result<Option<Self>> {
        let mut spreads = [Spread::new(), Spread::new()];
        for point in low_points(map)? {
            let [x, y, _] = point?;
            spreads[0].add(f64::from(x));
            spreads[1].add(f64::from(y));
        }
        let along = |axis: usize| {
            let (low, high) = spreads[axis].bounds(STRAY_SHARE)?;
            let path = trajectory
                .poses()
                .iter()
                .map(|p| p.translation.vector[axis]);
            let low = path.clone().fold(low, f64::min) - MARGIN_M;
            let high = path.fold(high, f64::max) + MARGIN_M;
            (low.is_finite() && high.is_finite()).then_some((low, high))
        };
        let (Some((left_m, right_m)), Some((bottom_m, top_m))) = (along(0), along(1)) else {
            return Ok(None);
        };
        let long = (right_m - left_m).max(top_m - bottom_m);
        let pixel_m = (long / LONG_SIDE).max(LEAST_PIXEL_M);
        let side = |metres: f64| ((metres / pixel_m).ceil() as u32).clamp(1, LONG_SIDE as u32 + 1);
        Ok(Some(Self {
            left_m,
            top_m,
            pixel_m,
            width: side(right_m - left_m),
            height: side(top_m - bottom_m),
        }))
    }

    /// Index of the pixel at a place.
    fn pixel(&self, x: f64, y: f64) -> Option<usize> {
        let (column, row) = (
            (x - self.left_m) / self.pixel_m,
            (self.top_m - y) / self.pixel_m,
        );
        let inside = column >= 0.0
            && row >= 0.0
            && column < f64::from(self.width)
            && row < f64::from(self.height);
        inside.then(|| row as usize * self.width as usize + column as usize)
    }
}

/// What was seen over a pixel: how many points in the low 12 bits, the sum of their heights above.
/// A height is one of 256 shades, so the sum of 4095 fits.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
struct Pixel(u32);

impl Pixel {
    const COUNT: u32 = (1 << 12) - 1;
    /// No points add up to this.
    const PATH: Self = Self(u32::MAX);

    fn add(&mut self, height_m: f32) {
        if self.0 & Self::COUNT == Self::COUNT {
            return;
        }
        let share = (height_m - LEAST_HEIGHT_M) / (MOST_HEIGHT_M - LEAST_HEIGHT_M);
        let shade = (share.clamp(0.0, 1.0) * 255.0) as u32;
        self.0 += 1 + (shade << 12);
    }

    /// Floor dim and blue, walls bright: a wall puts many points over one pixel.
    fn colour(self) -> [u8; 3] {
        let count = (self.0 & Self::COUNT) as f32;
        if self == Self::PATH {
            return PATH;
        }
        if count == 0.0 {
            return BACKGROUND;
        }
        let bright = (0.4 + 0.2 * count.ln()).min(1.0);
        let shade = (self.0 >> 12) as f32 / count / 255.0;
        // The upper end is where walls are, a little below the highest points.
        let height = (shade * (MOST_HEIGHT_M - LEAST_HEIGHT_M) / 1.6).min(1.0);
        let low = [70.0, 120.0, 200.0];
        let high = [255.0, 236.0, 180.0];
        std::array::from_fn(|c| (bright * (low[c] + height * (high[c] - low[c]))) as u8)
    }
}

fn draw_path(view: &View, pixels: &mut [Pixel], trajectory: &Trajectory) {
    for pair in trajectory.poses().windows(2) {
        let (a, b) = (pair[0].translation.vector, pair[1].translation.vector);
        let steps = ((b - a).norm() / view.pixel_m * 2.0).ceil().clamp(1.0, 1e4) as usize;
        for i in 0..=steps {
            let p = a.lerp(&b, i as f64 / steps as f64);
            for (dx, dy) in [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0)] {
                if let Some(at) = view.pixel(p.x + dx * view.pixel_m, p.y + dy * view.pixel_m) {
                    pixels[at] = Pixel::PATH;
                }
            }
        }
    }
}

fn encode(view: &View, pixels: &[Pixel]) -> Result<Vec<u8>, png::EncodingError> {
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, view.width, view.height);
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_depth(png::BitDepth::Eight);
    let mut header = encoder.write_header()?;
    let mut writer = header.stream_writer()?;
    let mut row = Vec::with_capacity(3 * view.width as usize);
    for line in pixels.chunks(view.width as usize) {
        row.clear();
        row.extend(line.iter().flat_map(|pixel| pixel.colour()));
        writer.write_all(&row)?;
    }
    writer.finish()?;
    drop(header);
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_wall_is_brighter_than_the_floor_beside_it_and_the_ceiling_is_not_drawn() {
        let folder = tempfile::tempdir().unwrap();
        let mut map = MapBuilder::new(0.05, folder.path());
        for i in 0..100 {
            let x = f64::from(i) * 0.05;
            map.add([x, 1.0, -0.5], 10.0);
            map.add([x, 0.0, 2.0], 10.0);
            for j in 0..20 {
                map.add([x, 2.0, -0.5 + f64::from(j) * 0.05], 10.0);
            }
        }
        let (view, pixels) = drawn(&map, &Trajectory::new()).unwrap().unwrap();
        let at = |y: f64| {
            let sum = |p: Pixel| p.colour().iter().map(|&c| u32::from(c)).sum::<u32>();
            // A place may fall on the edge between two rows.
            (0..200)
                .filter_map(|i| {
                    view.pixel(f64::from(i / 2) * 0.05, y + 0.02 * f64::from(i % 2) - 0.01)
                })
                .map(|i| sum(pixels[i]))
                .max()
                .unwrap()
        };
        assert!(at(2.0) > at(1.0), "{} {}", at(2.0), at(1.0));
        assert!(at(1.0) > at(1.5));
        assert!(
            view.pixel(1.0, 0.0).is_none(),
            "the ceiling widened the picture"
        );
    }

    #[test]
    fn a_pixel_under_which_a_tower_stands_counts_no_further_than_it_can() {
        let mut pixel = Pixel::default();
        for _ in 0..10_000 {
            pixel.add(MOST_HEIGHT_M);
        }
        assert_ne!(pixel, Pixel::PATH);
        assert_eq!(pixel.colour(), [255, 236, 180]);
    }
}
