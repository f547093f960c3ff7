//! The parts of the picture.

use std::ops::Range;

use hachi_hal::{Stamp, Vector3};
use plotters::chart::ChartContext;
use plotters::coord::Shift;
use plotters::coord::types::RangedCoordf64;
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

use super::view::{NAMES, View, is_finite};
use super::{PlotError, colour, drawing, thin};
use crate::Trajectory;

type Area<'b> = DrawingArea<SVGBackend<'b>, Shift>;
type Chart<'a, 'b> = ChartContext<'a, SVGBackend<'b>, Cartesian2d<RangedCoordf64, RangedCoordf64>>;

/// Room left of everything, pixels: the names of the upright axes stand at its edge.
const MARGIN_LEFT: u32 = 12;
/// Room for the numbers left of a chart, pixels.
const LEFT: u32 = 76;
/// Room right of it: the colour scale, pixels.
const RIGHT: u32 = 110;
/// Room for the numbers below it, pixels.
const BELOW: u32 = 48;

/// What all panels draw from.
pub(super) struct Canvas<'a> {
    pub(super) view: &'a View,
    pub(super) estimate: &'a [Vector3],
    pub(super) reference: &'a [Vector3],
    pub(super) errors: Option<&'a [f64]>,
    pub(super) links: &'a [(Vector3, Vector3)],
}

/// What the panels along the way have to the right: seconds since the start, or poses.
pub(super) struct Along {
    label: &'static str,
    estimate: Vec<f64>,
    reference: Vec<f64>,
    range: Range<f64>,
}

impl Along {
    pub(super) fn new(estimate: &Trajectory, reference: Option<&Trajectory>) -> Self {
        let timed = reference.is_none_or(|r| r.stamps().is_some());
        let stamps = estimate.stamps().filter(|_| timed);
        let index = |count: usize| (0..count).map(|i| i as f64).collect::<Vec<f64>>();
        let (label, estimate, reference) = match stamps {
            Some(stamps) => {
                let start = stamps.first().copied().unwrap_or_default();
                let seconds =
                    |s: &[Stamp]| s.iter().map(|t| t.secs_since(start)).collect::<Vec<f64>>();
                let reference = reference.and_then(Trajectory::stamps).unwrap_or_default();
                ("time (s)", seconds(stamps), seconds(reference))
            }
            None => {
                let reference = index(reference.map_or(0, Trajectory::len));
                ("pose", index(estimate.len()), reference)
            }
        };
        // The panels show the time of the estimate; a reference may last for hours around it.
        let first = estimate.first().copied().unwrap_or(0.0);
        let last = estimate.last().copied().unwrap_or(0.0);
        Self {
            label,
            range: first..last.max(first + 1e-3),
            estimate,
            reference,
        }
    }
}

impl Canvas<'_> {
    /// Title, figures, and what the lines mean.
    pub(super) fn title(
        &self,
        area: &Area<'_>,
        title: &str,
        subtitle: &str,
    ) -> Result<(), PlotError> {
        let left = (MARGIN_LEFT + LEFT) as i32;
        text(area, title, (left, 14), 24, HPos::Left)?;
        text(area, subtitle, (left, 46), 15, HPos::Left)?;

        let mut x = left;
        let mut entry = |name: &str, colour: RGBColor| -> Result<(), PlotError> {
            let sample = PathElement::new([(x, 76), (x + 28, 76)], colour.stroke_width(3));
            area.draw(&sample).map_err(drawing)?;
            text(area, name, (x + 36, 69), 15, HPos::Left)?;
            x += 60 + 9 * name.len() as i32; // about the width of a letter at this size
            Ok(())
        };
        if !self.reference.is_empty() {
            entry("reference", colour::REFERENCE)?;
        }
        entry(
            if self.errors.is_some() {
                "estimate, coloured by error"
            } else {
                "estimate"
            },
            colour::ESTIMATE,
        )?;
        if !self.links.is_empty() {
            entry("loops", colour::LINK)?;
        }
        Ok(())
    }

    /// The path from above.
    pub(super) fn top_view(&self, area: &Area<'_>) -> Result<(), PlotError> {
        let (width, height) = area.dim_in_pixel();
        let (x, y) = self.view.equal_ranges(
            width.saturating_sub(MARGIN_LEFT + LEFT + RIGHT),
            height.saturating_sub(BELOW + 10),
        );
        let names = (NAMES[self.view.right], NAMES[self.view.page_up]);
        let mut chart = chart(area, x, y)?;
        mesh(
            &mut chart,
            &format!("{} (m)", names.0),
            &format!("{} (m)", names.1),
        )?;

        self.line(&mut chart, self.reference, colour::REFERENCE)?;
        match self.errors {
            Some(errors) => self.coloured_line(&mut chart, errors)?,
            None => self.line(&mut chart, self.estimate, colour::ESTIMATE)?,
        }
        self.links(&mut chart)?;
        self.marks(&mut chart)?;
        match self.errors {
            Some(errors) => colour_scale(area, largest(errors)),
            None => Ok(()),
        }
    }

    /// Height along the way.
    pub(super) fn height(&self, area: &Area<'_>, along: &Along) -> Result<(), PlotError> {
        let axis = self.view.height;
        let mut chart = chart(area, along.range.clone(), self.view.height_range())?;
        mesh(&mut chart, along.label, &format!("{} (m)", NAMES[axis]))?;
        let lines = [
            (&along.reference, self.reference, colour::REFERENCE),
            (&along.estimate, self.estimate, colour::ESTIMATE),
        ];
        for (xs, positions, colour) in lines {
            let inside = |x: &f64| along.range.start <= *x && *x <= along.range.end;
            let shown: Vec<(f64, f64)> = xs
                .iter()
                .zip(positions)
                .filter(|(x, p)| inside(x) && is_finite(p))
                .map(|(x, p)| (*x, p[axis]))
                .collect();
            polyline(&mut chart, &shown, colour)?;
        }
        Ok(())
    }

    /// The error along the way.
    pub(super) fn errors(
        &self,
        area: &Area<'_>,
        along: &Along,
        errors: &[f64],
    ) -> Result<(), PlotError> {
        let top = (largest(errors) * 1.1).max(1e-3);
        let mut chart = chart(area, along.range.clone(), 0.0..top)?;
        mesh(&mut chart, along.label, "error (m)")?;
        let shown: Vec<(f64, f64)> = along
            .estimate
            .iter()
            .copied()
            .zip(errors.iter().copied())
            .filter(|(_, error)| error.is_finite())
            .collect();
        polyline(&mut chart, &shown, colour::END)
    }

    fn line(
        &self,
        chart: &mut Chart<'_, '_>,
        positions: &[Vector3],
        colour: RGBColor,
    ) -> Result<(), PlotError> {
        let shown: Vec<_> = positions
            .iter()
            .filter_map(|p| self.view.on_page(p))
            .collect();
        polyline(chart, &shown, colour)
    }

    /// The estimate in pieces of one colour. Each piece ends where the next begins.
    fn coloured_line(&self, chart: &mut Chart<'_, '_>, errors: &[f64]) -> Result<(), PlotError> {
        let largest = largest(errors);
        let points: Vec<((f64, f64), usize)> = thin::indices(self.estimate.len())
            .filter_map(|i| {
                let place = self.view.on_page(self.estimate.get(i)?)?;
                Some((place, colour::error_step(*errors.get(i)?, largest)))
            })
            .collect();
        let mut begin = 0;
        while begin + 1 < points.len() {
            let step = points[begin].1;
            let same = points[begin..].iter().take_while(|p| p.1 == step).count();
            let end = (begin + same).min(points.len() - 1);
            let piece: Vec<(f64, f64)> = points[begin..=end].iter().map(|p| p.0).collect();
            polyline(chart, &piece, colour::of_step(step))?;
            begin = end;
        }
        Ok(())
    }

    /// Places that were recognised.
    fn links(&self, chart: &mut Chart<'_, '_>) -> Result<(), PlotError> {
        let kept = thin::indices(self.links.len()).map(|i| self.links[i]);
        for (from, to) in kept {
            if let (Some(from), Some(to)) = (self.view.on_page(&from), self.view.on_page(&to)) {
                let line = PathElement::new([from, to], colour::LINK.stroke_width(1));
                chart.plotting_area().draw(&line).map_err(drawing)?;
            }
        }
        Ok(())
    }

    /// Where the estimate starts and ends.
    fn marks(&self, chart: &mut Chart<'_, '_>) -> Result<(), PlotError> {
        let mut shown = self.estimate.iter().filter_map(|p| self.view.on_page(p));
        let Some(start) = shown.next() else {
            return Ok(());
        };
        let end = shown.next_back().unwrap_or(start);
        let area = chart.plotting_area();
        let style = |colour: &RGBColor| ("sans-serif", 16).into_font().color(colour);
        let start_mark = EmptyElement::at(start)
            + Circle::new((0, 0), 7, colour::START.filled())
            + Text::new("start", (10, -22), style(&colour::START));
        let end_mark = EmptyElement::at(end)
            + Rectangle::new([(-6, -6), (6, 6)], colour::END.filled())
            + Text::new("end", (10, 6), style(&colour::END));
        area.draw(&start_mark).map_err(drawing)?;
        area.draw(&end_mark).map_err(drawing)
    }
}

fn largest(errors: &[f64]) -> f64 {
    let finite = errors.iter().copied().filter(|e| e.is_finite());
    finite.fold(0.0, f64::max)
}

fn chart<'a, 'b>(
    area: &'a Area<'b>,
    x: Range<f64>,
    y: Range<f64>,
) -> Result<Chart<'a, 'b>, PlotError> {
    ChartBuilder::on(area)
        .margin_top(10)
        .margin_left(MARGIN_LEFT)
        .margin_right(RIGHT)
        .set_label_area_size(LabelAreaPosition::Left, LEFT)
        .set_label_area_size(LabelAreaPosition::Bottom, BELOW)
        .build_cartesian_2d(x, y)
        .map_err(drawing)
}

fn mesh(chart: &mut Chart<'_, '_>, x: &str, y: &str) -> Result<(), PlotError> {
    let tall = chart.plotting_area().dim_in_pixel().1 > 300;
    chart
        .configure_mesh()
        .x_desc(x)
        .y_desc(y)
        .y_labels(if tall { 10 } else { 5 })
        .light_line_style(TRANSPARENT)
        .bold_line_style(colour::GRID)
        .label_style(("sans-serif", 15).into_font().color(&colour::TEXT))
        .axis_desc_style(("sans-serif", 16).into_font().color(&colour::TEXT))
        .x_label_formatter(&|v| tick(*v))
        .y_label_formatter(&|v| tick(*v))
        .draw()
        .map_err(drawing)
}

/// A number beside an axis: no more digits than it needs, no minus before a zero.
fn tick(value: f64) -> String {
    let rounded = (value * 1e4).round() / 1e4;
    format!("{}", if rounded == 0.0 { 0.0 } else { rounded })
}

fn polyline(
    chart: &mut Chart<'_, '_>,
    points: &[(f64, f64)],
    colour: RGBColor,
) -> Result<(), PlotError> {
    let kept = thin::indices(points.len()).map(|i| points[i]);
    chart
        .draw_series(LineSeries::new(kept, colour.stroke_width(2)))
        .map_err(drawing)?;
    Ok(())
}

fn text(
    area: &Area<'_>,
    text: &str,
    at: (i32, i32),
    size: u32,
    side: HPos,
) -> Result<(), PlotError> {
    let style = ("sans-serif", size).into_font().color(&colour::TEXT);
    let style = style.pos(Pos::new(side, VPos::Top));
    area.draw_text(text, &style, at).map_err(drawing)
}

/// What the colours mean, at the right edge.
fn colour_scale(area: &Area<'_>, largest: f64) -> Result<(), PlotError> {
    /// Height of one colour, pixels.
    const STEP: i32 = 14;
    let (width, _) = area.dim_in_pixel();
    let (left, top) = (width as i32 - RIGHT as i32 + 22, 44);
    text(area, "error (m)", (left - 4, top - 26), 15, HPos::Left)?;
    for step in 0..colour::ERROR_STEPS {
        let y = top + (colour::ERROR_STEPS - 1 - step) as i32 * STEP;
        let patch = Rectangle::new(
            [(left, y), (left + 20, y + STEP)],
            colour::of_step(step).filled(),
        );
        area.draw(&patch).map_err(drawing)?;
    }
    let bottom = top + colour::ERROR_STEPS as i32 * STEP;
    let label = |share: f64| format!("{:.3}", largest * share);
    text(area, &label(1.0), (left + 28, top - 6), 14, HPos::Left)?;
    text(
        area,
        &label(0.5),
        (left + 28, (top + bottom) / 2 - 7),
        14,
        HPos::Left,
    )?;
    text(area, "0", (left + 28, bottom - 10), 14, HPos::Left)
}
