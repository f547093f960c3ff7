//! From where a path is looked at, and how much of the world is in the picture.

use std::ops::Range;

use hachi_hal::Vector3;

/// The coordinates' names, by index.
pub(super) const NAMES: [&str; 3] = ["x", "y", "z"];

/// A look from above on a bounding box.
pub(super) struct View {
    low: Vector3,
    high: Vector3,
    /// The coordinate that runs to the right.
    pub(super) right: usize,
    /// The coordinate that runs up the page.
    pub(super) page_up: usize,
    /// The coordinate that is looked along: height.
    pub(super) height: usize,
}

/// A world is drawn with y as its vertical if the path's extent in y is below this share of both
/// others: that is a camera's frame (z forward, y down), in which KITTI's poses are given. A
/// robot's frame has z up, and its path is seldom so much narrower than its climb.
const CAMERA_SHARE: f64 = 0.2;

impl View {
    /// The view on all finite positions; `None` if there are none.
    pub(super) fn of<'a>(positions: impl Iterator<Item = &'a Vector3>) -> Option<Self> {
        let mut low = Vector3::repeat(f64::INFINITY);
        let mut high = -low;
        for position in positions.filter(|p| is_finite(p)) {
            low = low.inf(position);
            high = high.sup(position);
        }
        if low.x > high.x {
            return None;
        }
        let extent = high - low;
        let camera = extent.y < CAMERA_SHARE * extent.x.min(extent.z);
        let (page_up, height) = if camera { (2, 1) } else { (1, 2) };
        Some(Self {
            low,
            high,
            right: 0,
            page_up,
            height,
        })
    }

    /// How high a picture `width` pixels wide must be to hold the path, within `bounds`.
    pub(super) fn height_for(&self, width: u32, bounds: Range<u32>) -> u32 {
        let extent = self.high - self.low;
        let share = extent[self.page_up] / extent[self.right].max(f64::MIN_POSITIVE);
        let height = (f64::from(width) * share).min(f64::from(bounds.end)) as u32;
        height.clamp(bounds.start, bounds.end)
    }

    /// Ranges to the right and up the page with the same metres per pixel, for a plotting area of
    /// that many pixels.
    pub(super) fn equal_ranges(&self, width: u32, height: u32) -> (Range<f64>, Range<f64>) {
        /// The picture is at least this wide, metres: a robot that stood still.
        const LEAST_M: f64 = 1.0;
        /// Room around the path.
        const MARGIN: f64 = 1.1;
        let extent = |axis: usize| (self.high[axis] - self.low[axis]) * MARGIN;
        let (width, height) = (f64::from(width.max(1)), f64::from(height.max(1)));
        let metres_per_pixel = (extent(self.right) / width)
            .max(extent(self.page_up) / height)
            .max(LEAST_M / width.min(height));
        let range = |axis: usize, pixels: f64| {
            let middle = (self.low[axis] + self.high[axis]) / 2.0;
            let half = metres_per_pixel * pixels / 2.0;
            middle - half..middle + half
        };
        (range(self.right, width), range(self.page_up, height))
    }

    /// The range of heights, with room, and not so small that noise fills the panel.
    pub(super) fn height_range(&self) -> Range<f64> {
        let (low, high) = (self.low[self.height], self.high[self.height]);
        let half = ((high - low) * 0.55).max(0.25);
        let middle = (low + high) / 2.0;
        middle - half..middle + half
    }

    /// Where a position is on the page, metres; `None` if it is not finite.
    pub(super) fn on_page(&self, position: &Vector3) -> Option<(f64, f64)> {
        is_finite(position).then(|| (position[self.right], position[self.page_up]))
    }
}

pub(super) fn is_finite(position: &Vector3) -> bool {
    position.iter().all(|c| c.is_finite())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_metre_is_as_long_to_the_right_as_up_the_page() {
        let path = [Vector3::zeros(), Vector3::new(30.0, 2.0, 1.0)];
        let view = View::of(path.iter()).unwrap();
        let (x, y) = view.equal_ranges(900, 600);
        assert!(((x.end - x.start) / 900.0 - (y.end - y.start) / 600.0).abs() < 1e-12);
        assert!(x.start < 0.0 && x.end > 30.0 && y.start < 0.0 && y.end > 2.0);
    }

    #[test]
    fn a_camera_path_is_seen_along_its_y_axis() {
        let kitti = [Vector3::zeros(), Vector3::new(500.0, 20.0, 480.0)];
        assert_eq!(View::of(kitti.iter()).unwrap().height, 1);
        let robot = [Vector3::zeros(), Vector3::new(50.0, 20.0, 4.0)];
        assert_eq!(View::of(robot.iter()).unwrap().height, 2);
        let corridor = [Vector3::zeros(), Vector3::new(50.0, 0.2, 0.3)];
        assert_eq!(View::of(corridor.iter()).unwrap().height, 2);
    }
}
