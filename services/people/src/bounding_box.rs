//! A rectangle in an image, in pixels: x to the right, y down.

/// A rectangle with sides along the image's. Its parts may lie outside the image.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct BoundingBox {
    /// Left edge, pixels.
    pub left: f64,
    /// Upper edge, pixels.
    pub top: f64,
    /// Pixels.
    pub width: f64,
    /// Pixels.
    pub height: f64,
}

impl BoundingBox {
    /// A box by its left upper corner and size, pixels.
    pub const fn new(left: f64, top: f64, width: f64, height: f64) -> Self {
        Self {
            left,
            top,
            width,
            height,
        }
    }

    /// A box by its left, upper, right and lower edge, pixels.
    pub const fn of_edges([left, top, right, bottom]: [f64; 4]) -> Self {
        Self::new(left, top, right - left, bottom - top)
    }

    /// A box by its middle and size, pixels.
    pub fn around(middle: [f64; 2], width: f64, height: f64) -> Self {
        Self::new(
            middle[0] - width / 2.0,
            middle[1] - height / 2.0,
            width,
            height,
        )
    }

    /// Its middle, pixels.
    pub fn middle(&self) -> [f64; 2] {
        [self.left + self.width / 2.0, self.top + self.height / 2.0]
    }

    /// Right edge, pixels.
    pub fn right(&self) -> f64 {
        self.left + self.width
    }

    /// Lower edge, pixels.
    pub fn bottom(&self) -> f64 {
        self.top + self.height
    }

    /// Square pixels; none for a box without width or height.
    pub fn area(&self) -> f64 {
        self.width.max(0.0) * self.height.max(0.0)
    }

    /// Whether a place lies in it; its left and upper edge belong to it, the others do not.
    pub fn contains(&self, [x, y]: [f64; 2]) -> bool {
        (self.left..self.right()).contains(&x) && (self.top..self.bottom()).contains(&y)
    }

    /// Whether it is finite and has a width and a height.
    pub fn is_sound(&self) -> bool {
        [self.left, self.top, self.right(), self.bottom()]
            .iter()
            .all(|v| v.is_finite())
            && self.width > 0.0
            && self.height > 0.0
    }

    /// Square pixels that both cover.
    pub fn intersection(&self, other: &Self) -> f64 {
        let width = self.right().min(other.right()) - self.left.max(other.left);
        let height = self.bottom().min(other.bottom()) - self.top.max(other.top);
        width.max(0.0) * height.max(0.0)
    }

    /// Intersection over union, 0 to 1.
    pub fn iou(&self, other: &Self) -> f64 {
        let both = self.intersection(other);
        if both == 0.0 {
            return 0.0;
        }
        both / (self.area() + other.area() - both)
    }

    /// Every side moved outwards by so many pixels.
    pub fn grown(&self, by: [f64; 2]) -> Self {
        Self::new(
            self.left - by[0],
            self.top - by[1],
            self.width + 2.0 * by[0],
            self.height + 2.0 * by[1],
        )
    }

    /// The box at `share` of the way to another one (0: this one, 1: the other).
    pub fn between(&self, other: &Self, share: f64) -> Self {
        let mix = |from: f64, to: f64| from + (to - from) * share;
        Self::new(
            mix(self.left, other.left),
            mix(self.top, other.top),
            mix(self.width, other.width),
            mix(self.height, other.height),
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn boxes_that_share_a_third_of_their_union() {
        let a = BoundingBox::new(0.0, 0.0, 2.0, 2.0);
        let b = BoundingBox::new(1.0, 0.0, 2.0, 2.0);
        assert_eq!(a.iou(&b), 2.0 / 6.0);
        assert_eq!(a.iou(&a), 1.0);
    }

    #[test]
    fn a_box_of_edges_ends_before_the_right_and_the_lower_one() {
        let b = BoundingBox::of_edges([3.0, 10.0, 5.0, 14.0]);
        assert_eq!(b, BoundingBox::new(3.0, 10.0, 2.0, 4.0));
        assert!(b.contains([3.0, 10.0]) && b.contains([4.5, 13.5]));
        assert!(!b.contains([5.0, 12.0]) && !b.contains([4.0, 14.0]) && !b.contains([2.5, 12.0]));
    }

    #[test]
    fn boxes_that_touch_share_nothing() {
        let a = BoundingBox::new(0.0, 0.0, 2.0, 2.0);
        assert_eq!(a.iou(&BoundingBox::new(2.0, 0.0, 2.0, 2.0)), 0.0);
        assert_eq!(a.iou(&BoundingBox::new(0.0, 0.0, 0.0, 2.0)), 0.0);
    }
}
