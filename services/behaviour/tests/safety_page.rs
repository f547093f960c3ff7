//! `docs/safety.md` against the code: every cause has its row, every row a test that exists.

mod walk;

use hachi_behaviour::Cause;
use walk::faults::{FAULTS, measure_ms};
use walk::page::{LINE, MEASURED, STATED, TESTS, millis, row, rows, time};

/// Where the tests are that the page names.
const FILES: &[&str] = &[
    include_str!("gate.rs"),
    include_str!("../../hachi/tests/service.rs"),
    include_str!("../../hachi/tests/process.rs"),
    include_str!("../../hachi/tests/emergency_stop.rs"),
    include_str!("../../hachi/tests/eyes.rs"),
];

#[test]
fn every_cause_has_a_row_with_its_line_in_the_log() {
    let rows = rows();
    for cause in Cause::ALL {
        let line = format!("`{}`", cause.line());
        assert!(
            rows.iter().any(|row| row[LINE] == line),
            "{line} has no row"
        );
    }
}

#[test]
fn every_row_names_a_test_that_exists() {
    let rows = rows();
    assert!(rows.len() > Cause::ALL.len());
    for row in rows {
        assert_eq!(row.len(), TESTS + 1, "{row:?}");
        for name in row[TESTS].split(", ").map(|name| name.trim_matches('`')) {
            let test = format!("fn {name}()");
            assert!(
                FILES.iter().any(|file| file.contains(&test)),
                "no test {name}"
            );
        }
    }
}

#[test]
fn every_time_that_the_gate_takes_is_the_measured_one_and_within_the_stated_one() {
    for fault in FAULTS {
        let (row, measured_ms) = (row(fault.row), measure_ms(fault.row));
        assert_eq!(row[MEASURED], time(measured_ms), "{}", row[0]);
        assert!(measured_ms <= millis(row[STATED]), "{}", row[0]);
    }
}
