//! The simulated camera through the RealSense driver: its bytes, tables and metadata over the
//! driver's link, and what comes out against the world's truth.

use hachi_hal::{Pose, RgbdCamera, RgbdGeometry, RgbdImages, Stamp, Vector3};
use hachi_realsense::align::depth_to_color;
use hachi_realsense::device::simulated::SimulatedPort;
use hachi_realsense::device::{LinkError, StreamFormat};
use hachi_realsense::{CameraError, RealSense, RealSenseConfig};
use hachi_world::{
    CameraConfig, CameraFrame, Outfit, Person, Preset, SimulatedCamera, SimulationConfig, Visit,
};

const WIDTH: u32 = 424;
const HEIGHT: u32 = 240;
const PIXELS: usize = (WIDTH * HEIGHT) as usize;
/// Frames until the camera is pulled out for a moment, and all of them. Its clock wraps at the fifth.
const UNPLUGGED_AFTER: usize = 4;
const FRAMES: usize = 8;
/// From a reading of the camera's clock to the next one, half an exposure later, ns.
const HALF_EXPOSURE_NS: i64 = 4_000_000;
/// From the middle of an exposure to the kernel's stamp, ns.
const WAY_NS: i64 = 6_000_000;

const OUTFIT: Outfit = Outfit {
    top: [190, 40, 40],
    trousers: [40, 50, 120],
    shoes: [30, 30, 30],
};

/// Somebody who walks away down the corridor, in front of the robot.
fn walker() -> Person {
    Person {
        id: 42,
        height_m: 1.8,
        skin: [220, 180, 150],
        hair: [50, 40, 30],
        visits: vec![Visit {
            begins_s: 0.0,
            path: vec![[2.6, 0.2], [9.0, -0.3]],
            speed_m_s: 1.2,
            stays_s: 0.0,
            outfit: OUTFIT,
        }],
    }
}

/// Where the driver's depth puts whom a mask shows: the median of the mask's points, in the map.
fn place(
    frame: &CameraFrame,
    geometry: &RgbdGeometry,
    aligned: &[u16],
    map_from_color: &Pose,
) -> Vector3 {
    let mut points: Vec<Vector3> = (0..PIXELS)
        .filter(|&index| frame.masks[index] == 1 && aligned[index] != 0)
        .map(|index| {
            let pixel = [index % WIDTH as usize, index / WIDTH as usize].map(|v| v as f64);
            let depth_m = f64::from(aligned[index]) * geometry.depth_unit_m;
            let point = geometry.color.deproject(pixel, depth_m);
            (map_from_color * nalgebra::Point3::from(point)).coords
        })
        .collect();
    assert!(points.len() > 200, "{} points", points.len());
    Vector3::from_fn(|axis, _| {
        points.sort_by(|a, b| a[axis].total_cmp(&b[axis]));
        points[points.len() / 2][axis]
    })
}

/// Mean colour of the shirt: the upper middle of the person's box, where the mask says so.
fn shirt(frame: &CameraFrame, rgb: &[u8]) -> [f64; 3] {
    let whole = frame.people[0].whole.unwrap();
    let rows = whole.top + whole.height() / 4..whole.top + whole.height() * 2 / 5;
    let columns = whole.left + whole.width() * 2 / 5..whole.left + whole.width() * 3 / 5;
    let pixels: Vec<usize> = rows
        .flat_map(|row| {
            columns
                .clone()
                .map(move |column| (row * WIDTH + column) as usize)
        })
        .filter(|&index| frame.masks[index] == 1)
        .collect();
    let mean = |channel: usize| {
        let sum: f64 = pixels
            .iter()
            .map(|&i| f64::from(rgb[3 * i + channel]))
            .sum();
        sum / pixels.len() as f64
    };
    [mean(0), mean(1), mean(2)]
}

#[test]
fn a_person_in_the_simulated_world_is_where_the_driver_says() {
    let simulation = SimulationConfig {
        people: [walker()].into(),
        ..SimulationConfig::preset(Preset::Corridor, 1, 10.0)
    };
    let config = CameraConfig::d455(WIDTH, HEIGHT, 0.2);
    let expected = config.geometry;
    let base_from_color = config.base_from_depth * expected.color_from_depth.inverse();
    let mut camera = SimulatedCamera::new(&simulation, config);
    let port = SimulatedPort::new(expected);
    let format = StreamFormat::new(WIDTH, HEIGHT, 30);
    let settings = RealSenseConfig {
        depth: format,
        color: format,
        ..RealSenseConfig::default()
    };
    let mut driver = RealSense::new(port.clone(), settings);
    let (mut depth, mut color) = (vec![0; PIXELS], vec![0; 3 * PIXELS]);
    let mut aligned = vec![0; PIXELS];
    let mut unplugged = 0;
    for frames in 0..FRAMES {
        if frames == UNPLUGGED_AFTER {
            port.plug(false);
            port.plug(true);
        }
        let mut read = |at: Stamp| {
            let images = RgbdImages {
                depth: &mut depth,
                color: &mut color,
            };
            driver.read_frame(images, at)
        };
        // Opens it, or finds that it is gone.
        match read(simulation.start) {
            Ok(None) => {}
            Err(CameraError::Link(LinkError::Unplugged)) => {
                unplugged += 1;
                assert!(read(simulation.start).unwrap().is_none());
            }
            other => panic!("{other:?}"),
        }
        let truth = camera.next_frame().unwrap();
        port.expose(
            truth.stamp,
            truth.stamp + WAY_NS,
            &truth.depth,
            &truth.color,
        );
        let header = read(truth.stamp + WAY_NS).unwrap().unwrap();
        assert_eq!(header.sequence as usize, frames);
        // The driver takes the way to the kernel for the least that it has seen: all but the half
        // exposure between the two readings of the camera's clock.
        let late_ns = header.stamp.nanos_since(truth.stamp);
        let expected_ns = WAY_NS - HALF_EXPOSURE_NS;
        assert!((late_ns - expected_ns).abs() < 2_000, "{late_ns}");
        assert_eq!(header.color_stamp, header.stamp);
        let geometry = *driver.geometry().unwrap();
        for (got, want) in [
            (geometry.depth, expected.depth),
            (geometry.color, expected.color),
        ] {
            assert!(
                (got.focal[0] - want.focal[0]).abs() < 1e-3,
                "{got:?} {want:?}"
            );
            assert!(
                (got.centre[1] - want.centre[1]).abs() < 1e-3,
                "{got:?} {want:?}"
            );
        }
        let counts = truth.depth.chunks_exact(2);
        assert!(
            counts
                .zip(&depth)
                .all(|(b, &c)| u16::from_le_bytes([b[0], b[1]]) == c)
        );

        let person = &truth.people[0];
        assert_eq!(person.id, 42);
        depth_to_color(&geometry, &depth, &mut aligned).unwrap();
        let map_from_color = simulation.map_from_base(truth.stamp) * base_from_color;
        let found = place(truth, &geometry, &aligned, &map_from_color);
        let off = (found - person.map_from_person.translation.vector).xy();
        // The front of a body is some centimetres before its middle.
        assert!(off.norm() < 0.2, "{off} at {}", truth.stamp);
        // Under the light of the corridor, a shirt is between half and all as bright as its cloth.
        let [r, g, b] = shirt(truth, &color);
        assert!(
            (85.0..195.0).contains(&r) && r > 2.5 * g && r > 2.5 * b,
            "{r} {g} {b}"
        );
    }
    assert_eq!(unplugged, 1);
    let counters = driver.counters();
    assert_eq!(
        (counters.pairs, counters.opened, counters.unplugged),
        (8, 2, 1)
    );
    assert_eq!(
        counters.dropped().map(|(_, n)| n).sum::<u64>(),
        1,
        "{counters:?}"
    );
}
