//! Progress of long work, on standard error, only when that is a terminal.

use std::io::IsTerminal;
use std::time::Duration;

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

/// Drawn ten times a second: more is lost on the eye and costs time.
const REDRAWS_PER_SECOND: u8 = 10;

/// A bar for work of known size, in bytes, scans or seconds as `unit` says; a counter where
/// `total` is not known. Shows nothing if standard error is no terminal.
pub fn bar(total: Option<u64>, unit: &str) -> ProgressBar {
    let target = if std::io::stderr().is_terminal() {
        ProgressDrawTarget::stderr_with_hz(REDRAWS_PER_SECOND)
    } else {
        ProgressDrawTarget::hidden()
    };
    let bar = ProgressBar::with_draw_target(total, target);
    let count = match (unit, total) {
        ("bytes", Some(_)) => "{bytes}/{total_bytes}".to_owned(),
        ("bytes", None) => "{bytes}".to_owned(),
        (unit, Some(_)) => format!("{{pos}}/{{len}} {unit}"),
        (unit, None) => format!("{{pos}} {unit}"),
    };
    let template = match total {
        Some(_) => format!("{{elapsed_precise}} {{wide_bar}} {count}, {{eta}} left  {{msg}}"),
        None => format!("{{elapsed_precise}} {{spinner}} {count}  {{msg}}"),
    };
    if let Ok(style) = ProgressStyle::with_template(&template) {
        bar.set_style(style);
    }
    bar.enable_steady_tick(Duration::from_millis(250));
    bar
}
