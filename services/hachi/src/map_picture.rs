//! The map from above, as a picture.
//!
//! In: the map's points and the path through it. Out: a PNG; the more was seen over a pixel the
//! brighter, colour by height, the path on top. What hangs higher than a little above the sensor is
//! left out: a ceiling would hide the rooms.

use std::path::Path;

use hachi_trajectory::Trajectory;

use crate::exit::Failure;
use crate::map_builder::MapBuilder;

/// Longest side, pixels.
const LONG_SIDE: f64 = 1400.0;
/// Smallest pixel: the map has nothing finer.
const LEAST_PIXEL_M: f64 = 0.03;
/// Points higher than this over the sensor's first place are left out.
const MOST_HEIGHT_M: f32 = 0.8;
/// Share of points that may lie outside the picture on each side: stray ones must not shrink it.
const STRAY_SHARE: f64 = 0.002;
/// Room around, metres.
const MARGIN_M: f64 = 0.5;

const BACKGROUND: [u8; 3] = [14, 17, 24];
const PATH: [u8; 3] = [255, 96, 64];

/// Draws the map to a PNG file, whole or not at all. An empty map has no picture.
///
/// # Errors
/// The file can't be written.
pub fn write(path: &Path, map: &MapBuilder, trajectory: &Trajectory) -> Result<(), Failure> {
    let points: Vec<[f32; 3]> = map
        .points()
        .into_iter()
        .map(|(p, _)| p)
        .filter(|p| p[2] < MOST_HEIGHT_M)
        .collect();
    let Some(view) = View::of(&points, trajectory) else {
        return Ok(());
    };
    let pixels = draw(&view, &points, trajectory);
    let bytes = encode(&view, &pixels).map_err(|error| {
        Failure::new(
            format_args!("{} can't be drawn: {error}", path.display()),
            "please report this",
        )
    })?;
    hachi_bridge::write_file(path, &bytes).map_err(|error| Failure::unwritten(&error))
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
    fn of(points: &[[f32; 3]], trajectory: &Trajectory) -> Option<Self> {
        let along = |axis: usize| {
            let mut all: Vec<f32> = points.iter().map(|p| p[axis]).collect();
            all.sort_by(f32::total_cmp);
            let stray = (all.len() as f64 * STRAY_SHARE) as usize;
            let (low, high) = (
                *all.get(stray)?,
                *all.get(all.len().checked_sub(1 + stray)?)?,
            );
            let path = trajectory
                .poses()
                .iter()
                .map(|p| p.translation.vector[axis]);
            let low = path.clone().fold(f64::from(low), f64::min) - MARGIN_M;
            let high = path.fold(f64::from(high), f64::max) + MARGIN_M;
            (low.is_finite() && high.is_finite()).then_some((low, high))
        };
        let ((left_m, right_m), (bottom_m, top_m)) = (along(0)?, along(1)?);
        let long = (right_m - left_m).max(top_m - bottom_m);
        let pixel_m = (long / LONG_SIDE).max(LEAST_PIXEL_M);
        let side = |metres: f64| ((metres / pixel_m).ceil() as u32).clamp(1, LONG_SIDE as u32 + 1);
        Some(Self {
            left_m,
            top_m,
            pixel_m,
            width: side(right_m - left_m),
            height: side(top_m - bottom_m),
        })
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

fn draw(view: &View, points: &[[f32; 3]], trajectory: &Trajectory) -> Vec<[u8; 3]> {
    let size = view.width as usize * view.height as usize;
    let mut seen = vec![(0u32, 0.0f32); size];
    for &[x, y, z] in points {
        if let Some(at) = view.pixel(f64::from(x), f64::from(y)) {
            seen[at].0 += 1;
            seen[at].1 += z;
        }
    }
    let mut pixels: Vec<[u8; 3]> = seen.iter().map(|&(n, z)| colour(n, z)).collect();
    for pair in trajectory.poses().windows(2) {
        let (a, b) = (pair[0].translation.vector, pair[1].translation.vector);
        let steps = ((b - a).norm() / view.pixel_m * 2.0).ceil().clamp(1.0, 1e4) as usize;
        for i in 0..=steps {
            let p = a.lerp(&b, i as f64 / steps as f64);
            for (dx, dy) in [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0)] {
                if let Some(at) = view.pixel(p.x + dx * view.pixel_m, p.y + dy * view.pixel_m) {
                    pixels[at] = PATH;
                }
            }
        }
    }
    pixels
}

/// Floor dim and blue, walls bright: a wall puts many points over one pixel.
fn colour(count: u32, height_sum: f32) -> [u8; 3] {
    if count == 0 {
        return BACKGROUND;
    }
    let bright = (0.4 + 0.2 * (count as f32).ln()).min(1.0);
    let height = ((height_sum / count as f32 + 1.0) / 1.6).clamp(0.0, 1.0);
    let low = [70.0, 120.0, 200.0];
    let high = [255.0, 236.0, 180.0];
    std::array::from_fn(|c| (bright * (low[c] + height * (high[c] - low[c]))) as u8)
}

fn encode(view: &View, pixels: &[[u8; 3]]) -> Result<Vec<u8>, png::EncodingError> {
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, view.width, view.height);
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_depth(png::BitDepth::Eight);
    let mut writer = encoder.write_header()?;
    writer.write_image_data(pixels.as_flattened())?;
    writer.finish()?;
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_wall_is_brighter_than_the_floor_beside_it_and_the_ceiling_is_not_drawn() {
        let mut map = MapBuilder::new(0.05);
        for i in 0..100 {
            let x = f64::from(i) * 0.05;
            map.add([x, 1.0, -0.5], 10.0);
            map.add([x, 0.0, 2.0], 10.0);
            for j in 0..20 {
                map.add([x, 2.0, -0.5 + f64::from(j) * 0.05], 10.0);
            }
        }
        let points: Vec<[f32; 3]> = map
            .points()
            .into_iter()
            .map(|(p, _)| p)
            .filter(|p| p[2] < MOST_HEIGHT_M)
            .collect();
        let view = View::of(&points, &Trajectory::new()).unwrap();
        let pixels = draw(&view, &points, &Trajectory::new());
        let at = |y: f64| {
            let sum = |p: [u8; 3]| p.iter().map(|&c| u32::from(c)).sum::<u32>();
            (0..100)
                .filter_map(|i| view.pixel(f64::from(i) * 0.05 + 0.025, y))
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
}
