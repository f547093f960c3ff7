//! `docs/safety.md` against the code: every cause has its row, every row a test that exists.

use hachi_behaviour::Cause;

const PAGE: &str = include_str!("../../../docs/safety.md");

/// Where the tests are that the page names.
const TESTS: &[&str] = &[
    include_str!("gate.rs"),
    include_str!("../../hachi/tests/service.rs"),
    include_str!("../../hachi/tests/process.rs"),
    include_str!("../../hachi/tests/emergency_stop.rs"),
    include_str!("../../hachi/tests/eyes.rs"),
];

fn rows() -> Vec<Vec<&'static str>> {
    PAGE.lines()
        .filter(|line| line.starts_with("| ") && !line.starts_with("| cause"))
        .map(|line| line.trim_matches('|').split('|').map(str::trim).collect())
        .collect()
}

#[test]
fn every_cause_has_a_row_with_its_line_in_the_log() {
    let rows = rows();
    for cause in Cause::ALL {
        let line = format!("`{}`", cause.line());
        assert!(rows.iter().any(|row| row[4] == line), "{line} has no row");
    }
}

#[test]
fn every_row_names_a_test_that_exists() {
    let rows = rows();
    assert!(rows.len() > Cause::ALL.len());
    for row in rows {
        assert_eq!(row.len(), 6, "{row:?}");
        for name in row[5].split(", ").map(|name| name.trim_matches('`')) {
            let test = format!("fn {name}()");
            assert!(
                TESTS.iter().any(|file| file.contains(&test)),
                "no test {name}"
            );
        }
    }
}
