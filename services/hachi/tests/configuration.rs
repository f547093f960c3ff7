//! `docs/configuration.md` against the program: every key is there, with its default.

use std::collections::BTreeMap;

use hachi::config::{MappingConfig, Settings};

/// Key and default of each table row; a default of "" is one that the file format can't say.
fn documented() -> BTreeMap<String, String> {
    let page = include_str!("../../../docs/configuration.md");
    let code = |cell: &str| cell.trim().trim_matches('`').to_owned();
    page.lines()
        .filter(|line| line.starts_with("| `"))
        .map(|line| {
            let cells: Vec<_> = line.split('|').collect();
            assert_eq!(cells.len(), 6, "{line}");
            assert!(cells[4].trim().len() > 10, "no meaning: {line}");
            (code(cells[1]), code(cells[3]))
        })
        .collect()
}

fn flatten(prefix: &str, value: &toml::Value, keys: &mut BTreeMap<String, String>) {
    match value {
        toml::Value::Table(table) => {
            for (key, value) in table {
                let dot = if prefix.is_empty() { "" } else { "." };
                flatten(&format!("{prefix}{dot}{key}"), value, keys);
            }
        }
        toml::Value::Float(number) => {
            // Single precision, written as such: 0.3, not 0.30000001192092896.
            let short = format!("{:?}", *number as f32);
            keys.insert(prefix.to_owned(), short);
        }
        value => {
            keys.insert(prefix.to_owned(), value.to_string());
        }
    }
}

#[test]
fn every_key_of_the_default_settings_stands_there_with_its_default() {
    let mut known = BTreeMap::new();
    let value = toml::Value::try_from(Settings::default()).unwrap();
    flatten("", &value, &mut known);
    assert!(known.len() > 20, "{known:?}");
    let documented = documented();
    for (key, default) in &known {
        assert_eq!(documented.get(key), Some(default), "{key}");
    }
}

/// A key that is unset by default does not show in the defaults: found by being accepted.
#[test]
fn every_key_that_stands_there_is_understood() {
    for (key, default) in documented() {
        let text = match (key.as_str(), default.as_str()) {
            ("filter.body.min_m" | "filter.body.max_m", "") => {
                "[[filter.body]]\nmin_m = [0.0, 0.0, 0.0]\nmax_m = [1.0, 1.0, 1.0]".to_owned()
            }
            // One without the other is refused.
            ("filter.reject.low" | "filter.reject.high", _) => {
                "filter.reject = { low = 0.0, high = 15.0 }".to_owned()
            }
            ("robot.platform", _) => "robot.platform = \"b1\"".to_owned(),
            ("robot.address", _) => "robot.address = \"10.0.0.1:8082\"".to_owned(),
            ("lidar.source_address", _) => "lidar.source_address = \"10.0.0.2\"".to_owned(),
            ("robot.local_port" | "task.slam.priority" | "task.slam.core", _) => {
                format!("{key} = 1")
            }
            ("imu.bus", _) => "imu.bus = \"/dev/i2c-1\"".to_owned(),
            ("emergency_stop.can", _) => "emergency_stop.can = \"can0\"".to_owned(),
            (
                "camera.serial" | "people.detector" | "people.reid" | "people.store" | "people.key",
                _,
            ) => {
                format!("{key} = \"a\"")
            }
            ("service.map", _) => "service.map = \"a.map\"".to_owned(),
            ("task.slam.overrun", _) => "task.slam.overrun = \"skip\"".to_owned(),
            (key, "") => format!("{key} = 1.0"),
            (key, default) => format!("{key} = {default}"),
        };
        let file = tempfile::NamedTempFile::new().unwrap();
        std::fs::write(file.path(), &text).unwrap();
        Settings::load(None, Some(file.path())).unwrap_or_else(|e| panic!("{text}: {e}"));
    }
}

/// The example at the top of the page, as it stands there.
#[test]
fn the_example_is_understood() {
    let page = include_str!("../../../docs/configuration.md");
    let example = page
        .split("```toml\n")
        .nth(1)
        .unwrap()
        .split("```")
        .next()
        .unwrap();
    let file = tempfile::NamedTempFile::new().unwrap();
    std::fs::write(file.path(), example).unwrap();
    let config = MappingConfig::load(Some("go1"), Some(file.path())).unwrap();
    assert_eq!(config.base_from_lidar.rpy_deg[1], 10.0);
    assert_eq!(config.filter.body.len(), 1);
}
