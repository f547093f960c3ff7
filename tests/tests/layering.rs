//! Which crate may see which: the arrows of ARCHITECTURE.md, checked on `cargo metadata`.
//!
//! In: the workspace's manifests. Out: a failure that names the arrow that points the wrong way, the
//! crate that has no place yet, or the permission that nobody uses any more.

use std::collections::BTreeSet;

use cargo_metadata::{DependencyKind, Metadata, MetadataCommand, Package};

/// A crate, what it may see, what its tests may see besides, and why not more.
struct Layer {
    name: &'static str,
    sees: &'static [&'static str],
    tests_see: &'static [&'static str],
    /// Printed where an arrow breaks the rule.
    because: &'static str,
}

/// Every crate between `hal` and the program, in the order in which data passes through them.
const LAYERS: &[Layer] = &[
    Layer {
        name: "hachi-hal",
        sees: &[],
        tests_see: &[],
        because: "everything points inward to hal, so hal points nowhere",
    },
    Layer {
        name: "hachi-datagram",
        sees: &["hachi-hal"],
        tests_see: &[],
        because: "where packets come from is no matter of one maker's sensor",
    },
    Layer {
        name: "hachi-turns",
        sees: &["hachi-hal"],
        tests_see: &[],
        because: "what all spinning sensors share names none of them",
    },
    Layer {
        name: "hachi-velodyne",
        sees: &["hachi-hal", "hachi-turns"],
        tests_see: &["hachi-datagram"],
        because: "a driver knows its device: no other maker, no robot, no service; and takes packets \
                  from any source, so only its tests name one",
    },
    Layer {
        name: "hachi-robosense",
        sees: &["hachi-hal", "hachi-turns"],
        tests_see: &["hachi-datagram"],
        because: "a driver knows its device: no other maker, no robot, no service; and takes packets \
                  from any source, so only its tests name one",
    },
    Layer {
        name: "hachi-realsense",
        sees: &["hachi-hal", "hachi-turns"],
        tests_see: &[],
        because: "a driver knows its device: no other maker, no robot, no service; a camera's clock \
                  is moved onto the robot's as a LiDAR's is",
    },
    Layer {
        name: "hachi-robotiq",
        sees: &["hachi-hal"],
        tests_see: &[],
        because: "a driver knows its device: no other maker, no robot, no service",
    },
    Layer {
        name: "hachi-canbus",
        sees: &["hachi-hal"],
        tests_see: &[],
        because: "a driver knows its device: no other maker, no robot, no service",
    },
    Layer {
        name: "hachi-imu",
        sees: &["hachi-hal"],
        tests_see: &[],
        because: "a driver knows its device: no other maker, no robot, no service",
    },
    Layer {
        name: "hachi-unitree",
        sees: &["hachi-hal", "hachi-datagram"],
        tests_see: &["hachi-b1", "hachi-go1"],
        because: "what a maker's robots share names none of them: only its tests put their numbers \
                  in; a robot talks over the same sockets as a sensor, and no service is in sight",
    },
    Layer {
        name: "hachi-b1",
        sees: &["hachi-hal", "hachi-unitree"],
        tests_see: &[],
        because: "a robot is numbers for what its maker's robots share",
    },
    Layer {
        name: "hachi-go1",
        sees: &["hachi-hal", "hachi-unitree"],
        tests_see: &[],
        because: "a robot is numbers for what its maker's robots share",
    },
    Layer {
        name: "hachi-kairos",
        sees: &["hachi-hal"],
        tests_see: &[],
        because: "a robot of another maker shares nothing with the others but hal",
    },
    Layer {
        name: "hachi-cloud",
        sees: &["hachi-hal"],
        tests_see: &[],
        because: "a point cloud has no sensor: usable by someone who has never heard of this robot",
    },
    Layer {
        name: "hachi-registration",
        sees: &["hachi-hal", "hachi-cloud"],
        tests_see: &[],
        because: "a stage sees hal and the stage before it",
    },
    Layer {
        name: "hachi-odometry",
        sees: &["hachi-hal", "hachi-cloud", "hachi-registration"],
        tests_see: &[],
        because: "a stage sees hal and the stages before it",
    },
    Layer {
        name: "hachi-place",
        sees: &["hachi-hal", "hachi-cloud"],
        tests_see: &["hachi-world"],
        because: "a place is recognised in any cloud: usable by someone who has never heard of this robot",
    },
    Layer {
        name: "hachi-posegraph",
        sees: &[],
        tests_see: &[],
        because: "a pose graph has no sensor: usable by someone who has never heard of this robot",
    },
    Layer {
        name: "hachi-slam",
        sees: &[
            "hachi-hal",
            "hachi-cloud",
            "hachi-registration",
            "hachi-odometry",
            "hachi-place",
            "hachi-posegraph",
        ],
        tests_see: &[],
        because: "a stage sees hal and the stages before it; files and threads are the program's",
    },
    Layer {
        name: "hachi-store",
        sees: &["hachi-hal", "hachi-slam", "hachi-people"],
        tests_see: &[],
        because: "the store keeps what stages hand it, and computes nothing",
    },
    Layer {
        name: "hachi-trajectory",
        sees: &["hachi-hal"],
        tests_see: &[],
        because: "errors are measured on poses, whoever estimated them",
    },
    Layer {
        name: "hachi-inference",
        sees: &[],
        tests_see: &[],
        because: "a network turns numbers into numbers: what they mean is not its business",
    },
    Layer {
        name: "hachi-people",
        sees: &["hachi-inference"],
        tests_see: &[],
        because: "people are followed in any images: usable by someone who has never heard of this robot",
    },
    Layer {
        name: "hachi-bridge",
        sees: &["hachi-hal"],
        tests_see: &[],
        because: "file formats carry hal's values; packets go to the drivers undecoded",
    },
    Layer {
        name: "hachi-world",
        sees: &["hachi-hal"],
        tests_see: &[],
        because: "a simulation that used the decoders it tests would share their mistakes",
    },
    Layer {
        name: "hachi-behaviour",
        sees: &["hachi-hal"],
        tests_see: &[],
        because: "the gate holds for every robot and every behaviour: it knows neither",
    },
    Layer {
        name: "hachi-runtime",
        sees: &["hachi-hal"],
        tests_see: &[],
        because: "who runs tasks does not know what they compute",
    },
    Layer {
        name: "hachi-http",
        sees: &[],
        tests_see: &[],
        because: "a request is bytes, whatever it asks for",
    },
];

/// The only ones that see both ends: the program, and the tests of the whole.
const SEE_BOTH_ENDS: [&str; 2] = ["hachi", "hachi-tests"];

fn metadata() -> Metadata {
    MetadataCommand::new()
        .manifest_path(concat!(env!("CARGO_MANIFEST_DIR"), "/../Cargo.toml"))
        .no_deps()
        .other_options(["--offline".to_owned()])
        .exec()
        .unwrap()
}

/// A package's folder below the root: `drivers/velodyne`.
fn folder<'a>(metadata: &Metadata, package: &'a Package) -> &'a str {
    let manifest = package.manifest_path.strip_prefix(&metadata.workspace_root);
    manifest.unwrap().parent().unwrap().as_str()
}

/// The workspace's own crates that a package depends on, with or without those of its tests.
fn sees<'a>(metadata: &Metadata, package: &'a Package, in_tests: bool) -> BTreeSet<&'a str> {
    let own: BTreeSet<_> = metadata
        .workspace_packages()
        .iter()
        .map(|p| p.name.to_string())
        .collect();
    package
        .dependencies
        .iter()
        .filter(|d| own.contains(&d.name) && d.name != package.name.as_str())
        .filter(|d| (d.kind == DependencyKind::Development) == in_tests)
        .map(|d| d.name.as_str())
        .collect()
}

#[test]
fn no_arrow_points_the_wrong_way() {
    let metadata = metadata();
    let mut wrong = Vec::new();
    for package in metadata.workspace_packages() {
        let name = package.name.as_str();
        if SEE_BOTH_ENDS.contains(&name) {
            continue;
        }
        let Some(layer) = LAYERS.iter().find(|layer| layer.name == name) else {
            wrong.push(format!(
                "{name} has no place: give it one in LAYERS, with its reason"
            ));
            continue;
        };
        for seen in sees(&metadata, package, false) {
            if !layer.sees.contains(&seen) {
                wrong.push(format!("{name} -> {seen}: {}", layer.because));
            }
        }
        for seen in sees(&metadata, package, true) {
            if !layer.sees.contains(&seen) && !layer.tests_see.contains(&seen) {
                wrong.push(format!("{name} -> {seen} (tests): {}", layer.because));
            }
        }
    }
    assert!(wrong.is_empty(), "\n{}", wrong.join("\n"));
}

/// A permission left over is an arrow that nobody would notice.
#[test]
fn every_permission_is_in_use() {
    let metadata = metadata();
    let packages = metadata.workspace_packages();
    for layer in LAYERS {
        let Some(package) = packages.iter().find(|p| p.name.as_str() == layer.name) else {
            panic!("{} is no crate of the workspace any more", layer.name);
        };
        let seen = sees(&metadata, package, false);
        let in_tests = sees(&metadata, package, true);
        for allowed in layer.sees {
            assert!(
                seen.contains(allowed),
                "{} -> {allowed} is unused",
                layer.name
            );
        }
        for allowed in layer.tests_see {
            assert!(
                in_tests.contains(allowed),
                "{} -> {allowed} is unused",
                layer.name
            );
        }
    }
}

/// Whatever the table says: what stands nearer to the hardware never sees what stands above it.
#[test]
fn the_table_itself_lets_no_driver_and_no_platform_see_a_service() {
    let metadata = metadata();
    let packages = metadata.workspace_packages();
    let place = |name: &str| {
        let package = packages.iter().find(|p| p.name.as_str() == name);
        folder(
            &metadata,
            package.unwrap_or_else(|| panic!("{name} is no crate")),
        )
    };
    for layer in LAYERS {
        let lower = place(layer.name);
        for seen in layer.sees.iter().chain(layer.tests_see) {
            let upper = place(seen);
            let allowed: &[&str] = match lower.split('/').next() {
                Some("hal") => &[],
                Some("drivers") => &["hal", "drivers/datagram", "drivers/turns"],
                Some("platform") => &["hal", "drivers", "platform"],
                _ => &["hal", "services"],
            };
            let fits = allowed
                .iter()
                .any(|a| upper == *a || upper.starts_with(&format!("{a}/")));
            assert!(fits, "{lower} must not see {upper}");
            assert_ne!(upper, "services/hachi", "{lower} must not see the program");
        }
    }
}
