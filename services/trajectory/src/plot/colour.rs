//! Colours.

use plotters::style::RGBColor;

/// The reference's line.
pub(super) const REFERENCE: RGBColor = RGBColor(150, 150, 150);
/// The estimate's line where no errors colour it.
pub(super) const ESTIMATE: RGBColor = RGBColor(33, 102, 172);
/// Lines between places that were recognised.
pub(super) const LINK: RGBColor = RGBColor(230, 120, 20);
/// Text.
pub(super) const TEXT: RGBColor = RGBColor(40, 40, 40);
/// Grid lines.
pub(super) const GRID: RGBColor = RGBColor(228, 228, 228);
/// The start of the path: a filled circle.
pub(super) const START: RGBColor = RGBColor(26, 152, 80);
/// The end of the path: a filled square.
pub(super) const END: RGBColor = RGBColor(178, 24, 43);

/// Small to large errors, in steps: from blue over green and orange to red, dark enough on white
/// for thin lines, and growing in redness so that print in grey still orders them.
const ERROR_STOPS: [(u8, u8, u8); 5] = [
    (33, 102, 172),
    (26, 150, 140),
    (120, 170, 40),
    (230, 140, 20),
    (190, 20, 40),
];

/// How many colours errors are sorted into. More can't be told apart, and each change of colour
/// begins a new line in the file.
pub(super) const ERROR_STEPS: usize = 20;

/// The step of an error between 0 and `largest`.
pub(super) fn error_step(error: f64, largest: f64) -> usize {
    let share = if largest > 0.0 { error / largest } else { 0.0 };
    let step = (share.clamp(0.0, 1.0) * ERROR_STEPS as f64) as usize; // saturates; NaN is 0
    step.min(ERROR_STEPS - 1)
}

/// The colour of a step.
pub(super) fn of_step(step: usize) -> RGBColor {
    let place = step as f64 / (ERROR_STEPS - 1) as f64 * (ERROR_STOPS.len() - 1) as f64;
    let below = (place as usize).min(ERROR_STOPS.len() - 2);
    let share = place - below as f64;
    let (a, b) = (ERROR_STOPS[below], ERROR_STOPS[below + 1]);
    let mix = |a: u8, b: u8| (f64::from(a) + (f64::from(b) - f64::from(a)) * share).round() as u8;
    RGBColor(mix(a.0, b.0), mix(a.1, b.1), mix(a.2, b.2))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_error_and_the_largest_have_the_ends_of_the_scale() {
        assert_eq!(of_step(error_step(0.0, 2.0)), RGBColor(33, 102, 172));
        assert_eq!(of_step(error_step(2.0, 2.0)), RGBColor(190, 20, 40));
        assert_eq!(error_step(f64::NAN, 2.0), 0);
        assert_eq!(error_step(1.0, 0.0), 0);
    }
}
