//! Draws trajectories as SVG.
//!
//! In: a trajectory, and where there is one a reference and the errors against it. Out: the text
//! of one SVG picture: the path from above with equal axes, the height along the way, the error
//! along the way. Text is left to the viewer's sans-serif font, so no font is needed to draw.
//!
//! However long the trajectory, a picture has at most a few thousand points a line.

mod colour;
mod panels;
mod thin;
mod view;

use hachi_hal::Vector3;
use plotters::prelude::*;

use crate::Trajectory;
use panels::{Along, Canvas};
use view::View;

/// Width of the picture, pixels.
const WIDTH: u32 = 1200;
/// Height of the band with the title and the legend, pixels.
const TITLE_HEIGHT: u32 = 84;
/// Height of the view from above, pixels: less for a path that is wider than high.
const TOP_VIEW_HEIGHT: std::ops::Range<u32> = 440..760;
/// Height of each panel below it, pixels.
const PANEL_HEIGHT: u32 = 210;

/// What to draw.
#[derive(Debug, Clone, Copy)]
pub struct Plot<'a> {
    /// The first line of the picture.
    pub title: &'a str,
    /// The second line: figures, the name of a file. May be empty.
    pub subtitle: &'a str,
    /// The trajectory.
    pub estimate: &'a Trajectory,
    /// What it should have been, in the same frame.
    pub reference: Option<&'a Trajectory>,
    /// The error of each pose of `estimate`, metres: colours its path. Used only if as many.
    pub errors_m: Option<&'a [f64]>,
    /// Places that were recognised: straight lines between two points, in the same frame.
    pub links: &'a [(Vector3, Vector3)],
}

/// Why there is no picture.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum PlotError {
    /// The trajectory has no pose with a finite position.
    #[error("the trajectory has no pose to draw")]
    Empty,
    /// The drawing library gave up.
    #[error("the picture could not be drawn: {0}")]
    Drawing(String),
}

impl Plot<'_> {
    /// Draws it.
    ///
    /// # Errors
    /// [`PlotError`].
    pub fn to_svg(&self) -> Result<String, PlotError> {
        let estimate = positions(self.estimate);
        let reference = self.reference.map(positions).unwrap_or_default();
        let errors = self
            .errors_m
            .filter(|errors| errors.len() == estimate.len());
        let all = || reference.iter().chain(&estimate);
        let view = View::of(all()).ok_or(PlotError::Empty)?;

        let panels = 1 + u32::from(errors.is_some());
        let top_height = view.height_for(WIDTH, TOP_VIEW_HEIGHT);
        let size = (WIDTH, TITLE_HEIGHT + top_height + panels * PANEL_HEIGHT);
        let mut svg = String::new();
        {
            let root = SVGBackend::with_string(&mut svg, size).into_drawing_area();
            root.fill(&WHITE).map_err(drawing)?;
            let (title, rest) = root.split_vertically(TITLE_HEIGHT);
            let (top, rest) = rest.split_vertically(top_height);
            let (height, error) = rest.split_vertically(PANEL_HEIGHT);

            let canvas = Canvas {
                view: &view,
                estimate: &estimate,
                reference: &reference,
                errors,
                links: self.links,
            };
            canvas.title(&title, self.title, self.subtitle)?;
            canvas.top_view(&top)?;
            let along = Along::new(self.estimate, self.reference);
            canvas.height(&height, &along)?;
            if let Some(errors) = errors {
                canvas.errors(&error, &along, errors)?;
            }
            root.present().map_err(drawing)?;
        }
        Ok(svg)
    }
}

fn positions(trajectory: &Trajectory) -> Vec<Vector3> {
    trajectory
        .poses()
        .iter()
        .map(|pose| pose.translation.vector)
        .collect()
}

fn drawing(error: impl std::fmt::Display) -> PlotError {
    PlotError::Drawing(error.to_string())
}

#[cfg(test)]
mod tests {
    use super::*;
    use hachi_hal::{Pose, Stamp};

    fn circle(count: i64, radius: f64) -> Trajectory {
        let mut trajectory = Trajectory::new();
        for i in 0..count {
            let angle = i as f64 / count as f64 * 6.0;
            let pose = Pose::translation(radius * angle.cos(), radius * angle.sin(), 0.1 * angle);
            trajectory
                .push(Stamp::from_nanos(i * 100_000_000), pose)
                .unwrap();
        }
        trajectory
    }

    fn plot<'a>(estimate: &'a Trajectory) -> Plot<'a> {
        Plot {
            title: "A <walk> & back",
            subtitle: "",
            estimate,
            reference: None,
            errors_m: None,
            links: &[],
        }
    }

    #[test]
    fn a_picture_has_its_title_units_and_marks() {
        let (estimate, reference) = (circle(100, 5.0), circle(1000, 5.2));
        let errors = vec![0.2; 100];
        let svg = Plot {
            reference: Some(&reference),
            errors_m: Some(&errors),
            ..plot(&estimate)
        }
        .to_svg()
        .unwrap();
        for text in [
            "A &lt;walk&gt; &amp; back",
            "x (m)",
            "y (m)",
            "z (m)",
            "time (s)",
            "start",
            "end",
            "reference",
            "error (m)",
        ] {
            assert!(svg.contains(text), "{text}");
        }
        assert!(svg.trim_end().ends_with("</svg>"));
    }

    #[test]
    fn a_day_of_poses_is_a_small_picture() {
        let estimate = circle(400_000, 50.0);
        assert!(plot(&estimate).to_svg().unwrap().len() < 400_000);
    }

    #[test]
    fn one_pose_and_one_place_can_be_drawn_and_none_is_refused() {
        let mut one = Trajectory::new();
        assert_eq!(plot(&one).to_svg(), Err(PlotError::Empty));
        one.push(Stamp::from_nanos(0), Pose::translation(1e7, -1e7, 3.0))
            .unwrap();
        plot(&one).to_svg().unwrap();
        plot(&circle(50, 0.0)).to_svg().unwrap();
    }

    #[test]
    fn positions_that_are_not_finite_are_left_out() {
        let mut trajectory = circle(20, 1.0);
        let lost = Pose::translation(f64::NAN, 0.0, f64::INFINITY);
        trajectory.push(Stamp::from_nanos(i64::MAX), lost).unwrap();
        let svg = plot(&trajectory).to_svg().unwrap();
        assert!(!svg.contains("NaN") && !svg.contains("inf"));
    }
}
