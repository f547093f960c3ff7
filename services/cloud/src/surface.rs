//! The shape of a surface around a point: normal and how flat, from its neighbours' spread.
//!
//! In: a handful of positions. Out: the eigenvectors and eigenvalues of their covariance, by the
//! closed form for symmetric 3x3 matrices (O. K. Smith, "Eigenvalues of a symmetric 3 x 3 matrix",
//! CACM 1961), which has no iteration and so takes the same time for every point.

use crate::voxel::Voxel;

/// Spread of a neighbourhood.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Surface {
    /// Mean of the neighbours, metres.
    pub mean: [f32; 3],
    /// Unit vector of least spread.
    pub normal: [f32; 3],
    /// Variances along the principal directions, m², least first.
    pub variances: [f32; 3],
}

impl Surface {
    /// The surface through `points`; `None` for fewer than three.
    pub fn through(points: impl Iterator<Item = [f32; 3]> + Clone) -> Option<Self> {
        let mut count = 0u32;
        let mut sum = [0.0f32; 3];
        let origin = points.clone().next()?;
        for p in points.clone() {
            count += 1;
            for axis in 0..3 {
                sum[axis] += p[axis] - origin[axis];
            }
        }
        if count < 3 {
            return None;
        }
        let scale = 1.0 / count as f32;
        let mean = sum.map(|s| s * scale);
        let mut c = [0.0f32; 6];
        for p in points {
            let d: [f32; 3] = core::array::from_fn(|a| p[a] - origin[a] - mean[a]);
            c[0] += d[0] * d[0];
            c[1] += d[0] * d[1];
            c[2] += d[0] * d[2];
            c[3] += d[1] * d[1];
            c[4] += d[1] * d[2];
            c[5] += d[2] * d[2];
        }
        let (variances, normal) = least_eigenvector(c.map(|v| f64::from(v * scale)));
        Some(Self {
            mean: core::array::from_fn(|a| origin[a] + mean[a]),
            normal: normal.map(|v| v as f32),
            variances: variances.map(|v| v as f32),
        })
    }

    /// The surface through everything that fell into `voxels`; `None` for fewer than three points.
    ///
    /// A voxel counts for at most `most` points, so that one close to the sensor does not drown
    /// the others.
    pub fn through_voxels(voxels: impl Iterator<Item = Voxel> + Clone, most: f32) -> Option<Self> {
        let origin = voxels.clone().next()?.mean;
        let (mut count, mut sum, mut c) = (0.0f32, [0.0f32; 3], [0.0f32; 6]);
        for v in voxels {
            let w = v.count.min(most);
            let share = w / v.count;
            let d: [f32; 3] = core::array::from_fn(|a| v.mean[a] - origin[a]);
            count += w;
            for axis in 0..3 {
                sum[axis] += w * d[axis];
            }
            let own = [
                d[0] * d[0],
                d[0] * d[1],
                d[0] * d[2],
                d[1] * d[1],
                d[1] * d[2],
                d[2] * d[2],
            ];
            for i in 0..6 {
                c[i] += share * v.scatter[i] + w * own[i];
            }
        }
        if count < 3.0 {
            return None;
        }
        let m = sum.map(|s| s / count);
        let own = [
            m[0] * m[0],
            m[0] * m[1],
            m[0] * m[2],
            m[1] * m[1],
            m[1] * m[2],
            m[2] * m[2],
        ];
        let (variances, normal) =
            least_eigenvector(core::array::from_fn(|i| f64::from(c[i] / count - own[i])));
        Some(Self {
            mean: core::array::from_fn(|a| origin[a] + m[a]),
            normal: normal.map(|v| v as f32),
            variances: variances.map(|v| v as f32),
        })
    }
}

/// Eigenvalues (least first) and the unit eigenvector of the least, of the symmetric matrix whose
/// upper triangle is `[xx, xy, xz, yy, yz, zz]`.
///
/// If two or three eigenvalues coincide the vector is one of the many that fit.
pub fn least_eigenvector(m: [f64; 6]) -> ([f64; 3], [f64; 3]) {
    let scale = m.iter().fold(0.0f64, |s, v| s.max(v.abs()));
    if scale <= f64::MIN_POSITIVE || !scale.is_finite() {
        return ([0.0; 3], [0.0, 0.0, 1.0]);
    }
    let [a, d, f, b, e, c] = m.map(|v| v / scale);
    let q = (a + b + c) / 3.0;
    let off = d * d + e * e + f * f;
    let spread = (a - q) * (a - q) + (b - q) * (b - q) + (c - q) * (c - q) + 2.0 * off;
    let p = libm::sqrt(spread / 6.0);
    if p < 1e-12 {
        return ([q * scale; 3], [0.0, 0.0, 1.0]);
    }
    let (a1, b1, c1) = ((a - q) / p, (b - q) / p, (c - q) / p);
    let (d1, e1, f1) = (d / p, e / p, f / p);
    let determinant =
        a1 * (b1 * c1 - e1 * e1) - d1 * (d1 * c1 - e1 * f1) + f1 * (d1 * e1 - b1 * f1);
    let angle = libm::acos((determinant * 0.5).clamp(-1.0, 1.0)) / 3.0;
    let largest = q + 2.0 * p * libm::cos(angle);
    let least = q + 2.0 * p * libm::cos(angle + 2.0 * core::f64::consts::FRAC_PI_3);
    let middle = 3.0 * q - largest - least;
    // Rows of (M - least I) span the plane across the eigenvector: the longest cross product is it.
    let rows = [[a - least, d, f], [d, b - least, e], [f, e, c - least]];
    let candidates = [
        cross(rows[0], rows[1]),
        cross(rows[0], rows[2]),
        cross(rows[1], rows[2]),
    ];
    let lengths = candidates.map(|v| dot(v, v));
    let best = (0..3).fold(
        0,
        |best, i| if lengths[i] > lengths[best] { i } else { best },
    );
    let vector = if lengths[best] > 1e-24 {
        let scale = 1.0 / libm::sqrt(lengths[best]);
        candidates[best].map(|v| v * scale)
    } else {
        // The two least coincide: anything across the largest direction fits.
        across(rows)
    };
    ([least * scale, middle * scale, largest * scale], vector)
}

/// A unit vector across the longest of `rows`, which are all parallel.
fn across(rows: [[f64; 3]; 3]) -> [f64; 3] {
    let longest = rows
        .iter()
        .fold(rows[0], |b, r| if dot(*r, *r) > dot(b, b) { *r } else { b });
    let helper = if longest[0].abs() < longest[1].abs() {
        [1.0, 0.0, 0.0]
    } else {
        [0.0, 1.0, 0.0]
    };
    let v = cross(longest, helper);
    let length = libm::sqrt(dot(v, v));
    if length > 0.0 {
        v.map(|c| c / length)
    } else {
        [0.0, 0.0, 1.0]
    }
}

fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    ]
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Matrix3;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn agrees_with_the_iterative_eigenvalue_solver(v in prop::array::uniform6(-10.0f64..10.0)) {
            let (values, vector) = least_eigenvector(v);
            let [a, d, f, b, e, c] = v;
            let m = Matrix3::new(a, d, f, d, b, e, f, e, c);
            let mut truth: Vec<f64> = m.symmetric_eigenvalues().iter().copied().collect();
            truth.sort_by(f64::total_cmp);
            for (ours, theirs) in values.iter().zip(&truth) {
                prop_assert!((ours - theirs).abs() < 1e-6, "{values:?} {truth:?}");
            }
            let n = nalgebra::Vector3::from(vector);
            prop_assert!((n.norm() - 1.0).abs() < 1e-9);
            // Close pairs of eigenvalues turn the vector, not the residual.
            prop_assert!((m * n - n * values[0]).norm() < 1e-4);
        }
    }

    #[test]
    fn the_normal_of_a_tilted_plane_is_its_own() {
        let n = nalgebra::Vector3::new(0.3f32, -0.2, 0.93).normalize();
        let u = n.cross(&nalgebra::Vector3::x()).normalize();
        let w = n.cross(&u);
        let points: Vec<[f32; 3]> = (0..25)
            .map(|i| (n * 7.0 + u * (i % 5) as f32 + w * (i / 5) as f32).into())
            .collect();
        let surface = Surface::through(points.iter().copied()).expect("25 points");
        let dot: f32 = (0..3).map(|a| surface.normal[a] * n[a]).sum();
        assert!(dot.abs() > 0.99999, "{surface:?}");
        assert!(surface.variances[0].abs() < 1e-6 && surface.variances[1] > 1.9);
    }

    #[test]
    fn equal_points_and_lines_give_a_unit_normal() {
        for points in [
            vec![[1.0, 1.0, 1.0]; 5],
            (0..5).map(|i| [i as f32, 0.0, 0.0]).collect(),
        ] {
            let s = Surface::through(points.iter().copied()).expect("5 points");
            let length: f32 = s.normal.iter().map(|v| v * v).sum();
            assert!((length - 1.0).abs() < 1e-5, "{s:?}");
        }
        assert!(Surface::through([[0.0; 3]; 2].iter().copied()).is_none());
    }
}
