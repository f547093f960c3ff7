//! The table of `docs/safety.md`.

const PAGE: &str = include_str!("../../../../docs/safety.md");

/// Columns of the table.
pub const STATED: usize = 3;
pub const MEASURED: usize = 4;
pub const LINE: usize = 5;
pub const TESTS: usize = 6;

/// Its rows, cell by cell.
pub fn rows() -> Vec<Vec<&'static str>> {
    PAGE.lines()
        .filter(|line| line.starts_with("| ") && !line.starts_with("| cause"))
        .map(|line| line.trim_matches('|').split('|').map(str::trim).collect())
        .collect()
}

/// The row whose cause begins so.
#[track_caller]
pub fn row(cause: &str) -> Vec<&'static str> {
    let mut rows = rows();
    rows.retain(|row| row[0].starts_with(cause));
    assert_eq!(rows.len(), 1, "{cause}: {rows:?}");
    rows.remove(0)
}

/// Milliseconds of a time as the page writes it.
#[track_caller]
pub fn millis(cell: &str) -> i64 {
    let (number, unit) = cell.split_once(' ').unwrap_or((cell, ""));
    let factor = match unit {
        "ms" => 1.0,
        "s" => 1e3,
        _ => panic!("no time: {cell}"),
    };
    let number: f64 = number.parse().unwrap();
    (number * factor).round() as i64
}

/// A time as the page writes it.
pub fn time(ms: i64) -> String {
    match ms {
        ..100 => format!("{ms} ms"),
        _ => format!("{:.2} s", ms as f64 * 1e-3),
    }
}
