//! How the image moved because the camera did.
//!
//! In: a homography from the pixels of the last frame to those of this one, found in the images or
//! from the robot's own odometry. Out: where a point went, and how its surroundings turned and grew.

/// Takes pixels of the last frame to this one.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ImageMotion {
    /// Homography, row-major, acts on (x, y, 1).
    pub current_from_previous: [[f64; 3]; 3],
}

/// Pinhole camera, pixels.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pinhole {
    /// Focal length along x.
    pub fx: f64,
    /// Focal length along y.
    pub fy: f64,
    /// Where the optical axis meets the image.
    pub cx: f64,
    /// Where the optical axis meets the image.
    pub cy: f64,
}

/// An image motion around one point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct LocalMotion {
    pub(super) to: [f64; 2],
    pub(super) jacobian: [[f64; 2]; 2],
    /// How lengths change.
    pub(super) scale: f64,
}

impl ImageMotion {
    /// The motion of far things when the camera turns by `current_from_previous`: rotation from
    /// the last optical frame (x right, y down, z forward) to this one, row-major. The infinite
    /// homography `K R K^-1` (Hartley and Zisserman, 13.4). What the robot's travel does to the
    /// image depends on the distance and is left to the filters.
    pub fn from_rotation(camera: &Pinhole, current_from_previous: [[f64; 3]; 3]) -> Self {
        let k = [
            [camera.fx, 0.0, camera.cx],
            [0.0, camera.fy, camera.cy],
            [0.0, 0.0, 1.0],
        ];
        let inverse = [
            [1.0 / camera.fx, 0.0, -camera.cx / camera.fx],
            [0.0, 1.0 / camera.fy, -camera.cy / camera.fy],
            [0.0, 0.0, 1.0],
        ];
        Self {
            current_from_previous: product(&product(&k, &current_from_previous), &inverse),
        }
    }

    /// The motion around a point; none where it would leave the image plane, or is no number.
    pub(super) fn at(&self, [x, y]: [f64; 2]) -> Option<LocalMotion> {
        let h = &self.current_from_previous;
        let row = |r: usize| h[r][0] * x + h[r][1] * y + h[r][2];
        let (u, v, w) = (row(0), row(1), row(2));
        let to = [u / w, v / w];
        let entry = |r: usize, c: usize| (h[r][c] - to[r] * h[2][c]) / w;
        let jacobian = [[entry(0, 0), entry(0, 1)], [entry(1, 0), entry(1, 1)]];
        let determinant = jacobian[0][0] * jacobian[1][1] - jacobian[0][1] * jacobian[1][0];
        let scale = determinant.sqrt();
        let numbers = [to[0], to[1], scale, jacobian[0][0], jacobian[0][1]];
        // A camera that turned by half a circle or zoomed tenfold between two frames did not.
        (w > 0.0 && numbers.iter().all(|n| n.is_finite()) && (0.1..10.0).contains(&scale))
            .then_some(LocalMotion {
                to,
                jacobian,
                scale,
            })
    }
}

fn product(a: &[[f64; 3]; 3], b: &[[f64; 3]; 3]) -> [[f64; 3]; 3] {
    std::array::from_fn(|r| std::array::from_fn(|c| (0..3).map(|k| a[r][k] * b[k][c]).sum()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_turn_moves_a_direction_to_where_the_camera_projects_it() {
        let camera = Pinhole {
            fx: 600.0,
            fy: 620.0,
            cx: 320.0,
            cy: 240.0,
        };
        let project = |p: [f64; 3]| {
            [
                camera.fx * p[0] / p[2] + camera.cx,
                camera.fy * p[1] / p[2] + camera.cy,
            ]
        };
        // The camera turns to the right by 0.1 rad about y (down): things go left.
        let (s, c) = 0.1_f64.sin_cos();
        let rotation = [[c, 0.0, -s], [0.0, 1.0, 0.0], [s, 0.0, c]];
        let point = [0.3, -0.2, 4.0];
        let turned = std::array::from_fn(|r| (0..3).map(|k| rotation[r][k] * point[k]).sum());
        let motion = ImageMotion::from_rotation(&camera, rotation);
        let local = motion.at(project(point)).unwrap();
        let expected = project(turned);
        assert!((local.to[0] - expected[0]).abs() < 1e-9);
        assert!((local.to[1] - expected[1]).abs() < 1e-9);
        assert!(local.to[0] < project(point)[0]);
    }

    #[test]
    fn a_matrix_of_nonsense_moves_nothing() {
        for h in [[[0.0; 3]; 3], [[f64::NAN; 3]; 3]] {
            let motion = ImageMotion {
                current_from_previous: h,
            };
            assert_eq!(motion.at([10.0, 10.0]), None);
        }
    }
}
