//! The float functions that `core` lacks. With `std` they are single instructions; both ways give
//! the same bits, since a square root is correctly rounded everywhere.

/// Square root.
#[inline(always)]
pub(crate) fn sqrt(x: f32) -> f32 {
    #[cfg(feature = "std")]
    {
        x.sqrt()
    }
    #[cfg(not(feature = "std"))]
    {
        libm::sqrtf(x)
    }
}

/// Length of a vector.
#[inline(always)]
pub(crate) fn norm(v: [f32; 3]) -> f32 {
    sqrt(dot(v, v))
}

/// Scalar product.
#[inline(always)]
pub(crate) fn dot(a: [f32; 3], b: [f32; 3]) -> f32 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// Vector product.
#[inline(always)]
pub(crate) fn cross(a: [f32; 3], b: [f32; 3]) -> [f32; 3] {
    [
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    ]
}

/// Difference `a - b`.
#[inline(always)]
pub(crate) fn sub(a: [f32; 3], b: [f32; 3]) -> [f32; 3] {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

/// `a + s * b`.
#[inline(always)]
pub(crate) fn add_scaled(a: [f32; 3], s: f32, b: [f32; 3]) -> [f32; 3] {
    [a[0] + s * b[0], a[1] + s * b[1], a[2] + s * b[2]]
}

/// The vector at length one, or `None` if it has no usable length.
#[inline(always)]
pub(crate) fn unit(v: [f32; 3]) -> Option<[f32; 3]> {
    let length = norm(v);
    (length.is_finite() && length > 1e-12).then(|| v.map(|c| c / length))
}

/// The largest integer not above `x`, saturating; 0 for NaN.
#[inline(always)]
pub(crate) fn floor_i32(x: f32) -> i32 {
    let truncated = x as i32;
    truncated.saturating_sub(i32::from((truncated as f32) > x))
}
