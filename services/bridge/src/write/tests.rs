//! Expected bytes are written out by hand; round trips go through this crate's own readers.

use std::fs;
use std::process::Command;

use hachi_hal::{Point, ReturnKind};

use super::*;
use crate::cloud::PointTimes;
use crate::error::WriteError;
use crate::scans::read_cloud;

fn points() -> Vec<Point> {
    let kinds = [
        ReturnKind::Strongest,
        ReturnKind::Last,
        ReturnKind::First,
        ReturnKind::StrongestAndLast,
        ReturnKind::SecondStrongest,
        ReturnKind::Unknown,
    ];
    (0..600_u32)
        .map(|index| Point {
            x: index as f32 * 0.37 - 100.0,
            y: -1.0 / (index as f32 + 1.0),
            z: if index == 7 {
                f32::NAN
            } else {
                1e-3 * index as f32
            },
            intensity: (index % 256) as f32,
            time_offset_ns: index * 166_667,
            azimuth_deg: index as f32 * 0.6,
            range_m: index as f32 * 0.002,
            ring: (index % 16) as u16,
            returned: kinds[index as usize % 6],
        })
        .collect()
}

#[test]
fn a_point_in_pcd_is_these_bytes() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("one.pcd");
    let point = Point {
        x: 1.0,
        y: -2.0,
        z: 0.5,
        intensity: 100.0,
        time_offset_ns: 0x0102_0304,
        azimuth_deg: 90.0,
        range_m: 2.25,
        ring: 0x0506,
        returned: ReturnKind::Last,
    };
    write_cloud(&path, &[point]).unwrap();
    let mut expected = b"# .PCD v0.7 - Point Cloud Data file format\nVERSION 0.7\n\
        FIELDS x y z intensity ring time_ns azimuth_deg distance_m return_type\n\
        SIZE 4 4 4 4 2 4 4 4 1\nTYPE F F F F U U F F U\nCOUNT 1 1 1 1 1 1 1 1 1\nWIDTH 1\n\
        HEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS 1\nDATA binary\n"
        .to_vec();
    expected.extend([
        0, 0, 0x80, 0x3f, 0, 0, 0, 0xc0, 0, 0, 0, 0x3f, 0, 0, 0xc8, 0x42, 6, 5, 4, 3, 2, 1, 0, 0,
        0xb4, 0x42, 0, 0, 0x10, 0x40, 2,
    ]);
    assert_eq!(fs::read(&path).unwrap(), expected);
}

#[test]
fn csv_is_a_line_of_names_and_one_for_each_point() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("one.csv");
    let point = Point {
        x: 0.1,
        ring: 15,
        returned: ReturnKind::Strongest,
        ..Point::default()
    };
    write_cloud(&path, &[point]).unwrap();
    assert_eq!(
        fs::read_to_string(&path).unwrap(),
        "x,y,z,intensity,ring,time_ns,azimuth_deg,distance_m,return_type\n0.1,0,0,0,15,0,0,0,1\n"
    );
}

#[test]
fn clouds_come_back_as_they_were_written() {
    let folder = tempfile::tempdir().unwrap();
    let written = points();
    for name in ["turn.pcd", "turn.PLY"] {
        let path = folder.path().join(name);
        write_cloud(&path, &written).unwrap();
        let mut read = Vec::new();
        let info = read_cloud(&path, &mut read).unwrap();
        assert_eq!(info.times, PointTimes::Relative(0, 599 * 166_667));
        assert_eq!(info.non_finite, 1);
        // NaN is equal to nothing: compared by what the points print as.
        assert_eq!(format!("{read:?}"), format!("{written:?}"));
        write_cloud(&path, &[]).unwrap();
        assert_eq!(read_cloud(&path, &mut read).unwrap().points, 0);
    }
}

#[test]
fn maps_come_back_as_they_were_written() {
    let folder = tempfile::tempdir().unwrap();
    for name in ["map.ply", "map.pcd"] {
        let path = folder.path().join(name);
        let mut map = MapWriter::create(&path).unwrap();
        for index in 0..12_345_u16 {
            let value = f32::from(index);
            map.push([value, -value, 0.5], f32::from(index % 256))
                .unwrap();
            assert!(!path.exists(), "a half-written file can be seen");
        }
        assert_eq!(map.finish().unwrap(), 12_345);
        let mut read = Vec::new();
        assert_eq!(read_cloud(&path, &mut read).unwrap().points, 12_345);
        assert_eq!(read[12_344].position(), [12_344.0, -12_344.0, 0.5]);
        assert_eq!(read[300].intensity, 44.0);
    }
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 2);
}

#[test]
fn an_abandoned_map_leaves_the_old_one_and_nothing_else() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("map.ply");
    fs::write(&path, "the old one").unwrap();
    let mut map = MapWriter::create(&path).unwrap();
    map.push([1.0; 3], 1.0).unwrap();
    drop(map);
    assert_eq!(fs::read_to_string(&path).unwrap(), "the old one");
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
}

#[test]
fn a_file_replaces_the_one_before_it_once_it_is_complete() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("report.json");
    write_file(&path, b"a longer old file").unwrap();
    let mut unfinished = AtomicFile::create(&path).unwrap();
    unfinished.write(b"half of the n").unwrap();
    drop(unfinished);
    assert_eq!(fs::read(&path).unwrap(), b"a longer old file");
    write_file(&path, b"new").unwrap();
    assert_eq!(fs::read(&path).unwrap(), b"new");
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
}

#[test]
fn a_folder_that_is_missing_and_a_name_without_format_are_said() {
    let error = write_cloud("/nowhere/at/all/a.pcd", &[]).unwrap_err();
    assert!(error.to_string().contains("check the path"), "{error}");
    assert!(matches!(
        write_cloud("a.xyz", &[]),
        Err(WriteError::UnknownFormat { .. })
    ));
    assert!(matches!(
        MapWriter::create("a.csv"),
        Err(WriteError::UnknownFormat { .. })
    ));
}

const FULL_DISK_FOLDER: &str = "HACHI_TEST_FULL_DISK";

/// The test below runs this one in a process that may write no file beyond 32 kB, which the
/// operating system enforces where a full disk would.
#[test]
fn a_cloud_that_does_not_fit_leaves_nothing_behind() {
    let Ok(folder) = std::env::var(FULL_DISK_FOLDER) else {
        return;
    };
    let many: Vec<Point> = points().into_iter().cycle().take(100_000).collect();
    for name in ["turn.pcd", "turn.csv"] {
        let path = format!("{folder}/{name}");
        let error = write_cloud(&path, &many).unwrap_err();
        assert!(matches!(error, WriteError::NoRoom { .. }), "{error:?}");
        assert!(error.to_string().contains(&path), "{error}");
    }
    let mut map = MapWriter::create(format!("{folder}/map.ply")).unwrap();
    let pushed = many.iter().try_for_each(|p| map.push(p.position(), 0.0));
    let error = pushed.and_then(|()| map.finish().map(|_| ())).unwrap_err();
    assert!(matches!(error, WriteError::NoRoom { .. }), "{error:?}");
    // What fits into the buffer fails on completing the file.
    write_cloud(format!("{folder}/small.pcd"), &many[..600]).unwrap();
    write_cloud(format!("{folder}/larger.pcd"), &many[..1500]).unwrap_err();
}

#[test]
fn a_full_disk_is_a_typed_error_that_names_the_file() {
    let folder = tempfile::tempdir().unwrap();
    let status = Command::new("bash")
        .args([
            "-c",
            "trap '' XFSZ; ulimit -f 32; exec \"$0\" --exact \"$1\"",
        ])
        .arg(std::env::current_exe().unwrap())
        .arg("write::tests::a_cloud_that_does_not_fit_leaves_nothing_behind")
        .env(FULL_DISK_FOLDER, folder.path())
        .output()
        .unwrap();
    let said = String::from_utf8_lossy(&status.stdout);
    assert!(status.status.success(), "{said}");
    let left: Vec<_> = fs::read_dir(folder.path())
        .unwrap()
        .map(|entry| entry.unwrap().file_name())
        .collect();
    assert_eq!(left, ["small.pcd"], "{said}");
}
