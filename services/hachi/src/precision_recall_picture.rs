//! Draws precision over recall as SVG.
//!
//! In: a curve. Out: the text of one SVG picture. Text is left to the viewer's sans-serif font.

use hachi_place::precision_recall::{Curve, CurvePoint};
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

const SIZE: (u32, u32) = (800, 720);
const TITLE_HEIGHT: u32 = 84;
const TEXT: RGBColor = RGBColor(40, 40, 40);
const GRID: RGBColor = RGBColor(228, 228, 228);
const LINE: RGBColor = RGBColor(33, 102, 172);
const MARK: RGBColor = RGBColor(178, 24, 43);
/// More points than this on one line can't be told apart at the picture's size.
const MOST_POINTS: usize = 4000;

/// What to draw.
pub struct Picture<'a> {
    /// The first line of the picture.
    pub title: &'a str,
    /// The second line.
    pub subtitle: &'a str,
    /// The curve.
    pub curve: &'a Curve,
}

impl Picture<'_> {
    /// Draws it.
    ///
    /// # Errors
    /// What the drawing library said.
    pub fn to_svg(&self) -> Result<String, String> {
        let mut svg = String::new();
        self.draw(&mut svg)
            .map_err(|error| format!("the picture could not be drawn: {error}"))?;
        Ok(svg)
    }

    fn draw(&self, svg: &mut String) -> Result<(), Box<dyn std::error::Error>> {
        let root = SVGBackend::with_string(svg, SIZE).into_drawing_area();
        root.fill(&WHITE)?;
        let (title, area) = root.split_vertically(TITLE_HEIGHT);
        for (text, y, size) in [(self.title, 14, 24), (self.subtitle, 48, 15)] {
            let style = ("sans-serif", size).into_font().color(&TEXT);
            let style = style.pos(Pos::new(HPos::Left, VPos::Top));
            title.draw_text(text, &style, (76, y))?;
        }
        let mut chart = ChartBuilder::on(&area)
            .margin(12)
            .set_label_area_size(LabelAreaPosition::Left, 64)
            .set_label_area_size(LabelAreaPosition::Bottom, 48)
            .build_cartesian_2d(0f64..1f64, 0f64..1.02f64)?;
        chart
            .configure_mesh()
            .x_desc("recall")
            .y_desc("precision")
            .light_line_style(TRANSPARENT)
            .bold_line_style(GRID)
            .label_style(("sans-serif", 15).into_font().color(&TEXT))
            .axis_desc_style(("sans-serif", 16).into_font().color(&TEXT))
            .x_label_formatter(&|v| format!("{v:.1}"))
            .y_label_formatter(&|v| format!("{v:.1}"))
            .draw()?;
        let place = |point: &CurvePoint| (point.recall(), point.precision());
        let points = self.curve.points();
        let start = points.first().map(|point| (0.0, point.precision()));
        let step = points.len().div_ceil(MOST_POINTS).max(1);
        let kept = points.iter().step_by(step).chain(points.last()).map(place);
        chart.draw_series(LineSeries::new(
            start.into_iter().chain(kept),
            LINE.stroke_width(2),
        ))?;
        if let Some(full) = self.curve.at_full_precision() {
            let style = ("sans-serif", 15).into_font().color(&MARK);
            let mark = EmptyElement::at(place(full))
                + Circle::new((0, 0), 5, MARK.filled())
                + Text::new(format!("threshold {:.3}", full.threshold), (-40, 12), style);
            chart.plotting_area().draw(&mark)?;
        }
        root.present()?;
        Ok(())
    }
}
