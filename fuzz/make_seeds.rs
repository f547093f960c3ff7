//! Writes the seed corpora: a few small inputs per target, made by our own encoders.
//!
//! `cargo run --example make_seeds` in this folder; the seeds lie in `seeds/TARGET`.

use std::fs;
use std::io::Result;
use std::path::Path;
use std::sync::Arc;

use hachi_hal::{Distortion, Intrinsics, Pose, Stamp};
use hachi_inference::known;
use hachi_people::identify::AppearanceModel;
use hachi_place::{Database, Describer, DescriberConfig, Descriptor, Profile};
use hachi_realsense::encode as d400;
use hachi_realsense::frame as d400_frame;
use hachi_robosense::encode as helios;
use hachi_robosense::packet as helios_packet;
use hachi_robotiq::frame as robotiq_frame;
use hachi_robotiq::serve as robotiq_serve;
use hachi_slam::codec::encode;
use hachi_slam::node::Ground;
use hachi_slam::submap::{Submap, SubmapBuilder};
use hachi_slam::{Map, Node, NodeId};
use hachi_store::people::codec::{Record, encode_model, encode_record};
use hachi_store::people::{NetworkIdentity, NewPerson, PeopleFile, PeoplePaths};
use hachi_store::{Identity, MapFile};
use hachi_unitree::frame as unitree;
use hachi_velodyne::encode as vlp16;
use hachi_velodyne::packet as vlp16_packet;

const SENTENCE: &[u8] = b"$GPRMC,120000.00,A,4807.038,N,01131.000,E,000.0,000.0,221126,,,A*5B\r\n";

fn vlp16_data(mode: vlp16_packet::ReturnMode) -> Vec<u8> {
    let stride = if mode == vlp16_packet::ReturnMode::Dual {
        2
    } else {
        1
    };
    let blocks = std::array::from_fn(|k| vlp16::Block {
        azimuth: (k / stride * 40) as u16,
        echoes: std::array::from_fn(|j| vlp16::Echo {
            distance: 1_000 + (k * 32 + j) as u16,
            reflectivity: j as u8,
        }),
    });
    vlp16::data_packet(&blocks, 3_599_999_000, mode, vlp16_packet::Model::Vlp16).to_vec()
}

fn helios_msop() -> Vec<u8> {
    let blocks = std::array::from_fn(|k| helios::Block {
        azimuth: k as u16 * 20,
        echoes: std::array::from_fn(|j| helios::Echo {
            distance: 1_000 + (k * 32 + j) as u16,
            intensity: j as u8,
        }),
    });
    helios::msop_packet(&blocks, 1, 1_483_724_884_000_000).to_vec()
}

fn helios_difop() -> Vec<u8> {
    helios::difop_packet(&helios::DifopContents {
        rpm: 600,
        return_mode: helios_packet::ReturnMode::Strongest,
        sync_source: helios_packet::SyncSource::Gps,
        sync_status: helios_packet::SyncStatus::Gps,
        time_us: 1_483_724_884_000_000,
        calibration: Some(helios_packet::Calibration::nominal()),
    })
    .to_vec()
}

/// An IPv4 datagram to port 2368 with four bytes, or one of two fragments of it.
fn ipv4(flags_and_offset: u16, part: &[u8]) -> Vec<u8> {
    let mut bytes = vec![0x45, 0, 0, 20 + part.len() as u8, 0, 9];
    bytes.extend(flags_and_offset.to_be_bytes());
    bytes.extend([64, 17, 0, 0, 192, 168, 1, 201, 255, 255, 255, 255]);
    bytes.extend(part);
    bytes
}

const UDP: [u8; 12] = [9, 64, 9, 64, 0, 12, 0, 0, 1, 2, 3, 4];

fn pcap(link: u32, frames: &[Vec<u8>]) -> Vec<u8> {
    let mut bytes = 0xA1B2_3C4D_u32.to_le_bytes().to_vec();
    bytes.extend([2, 0, 4, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0xFF, 0xFF, 0, 0]);
    bytes.extend(link.to_le_bytes());
    for frame in frames {
        for word in [100, 0, frame.len() as u32, frame.len() as u32] {
            bytes.extend(word.to_le_bytes());
        }
        bytes.extend(frame);
    }
    bytes
}

fn pcapng(frame: &[u8]) -> Vec<u8> {
    let block = |kind: u32, body: &[u8]| {
        let mut padded = body.to_vec();
        padded.resize(body.len().next_multiple_of(4), 0);
        let len = (12 + padded.len() as u32).to_le_bytes();
        [&kind.to_le_bytes()[..], &len, &padded, &len].concat()
    };
    let mut section = vec![0x4D, 0x3C, 0x2B, 0x1A, 1, 0, 0, 0];
    section.extend([0xFF; 8]);
    let interface = [101, 0, 0, 0, 0, 0, 0, 0, 9, 0, 1, 0, 9, 0, 0, 0, 0, 0, 0, 0];
    let mut packet = [[0; 4], [0; 4], [5; 4]].concat();
    packet.extend((frame.len() as u32).to_le_bytes());
    packet.extend((frame.len() as u32).to_le_bytes());
    packet.extend(frame);
    [
        block(0x0A0D_0D0A, &section),
        block(1, &interface),
        block(6, &packet),
    ]
    .concat()
}

/// Commands for the scan targets: many unchanged packets 1.3 ms (0.7 ms) apart, then `packet`
/// whole, then some more.
fn stream(ticks: u8, packet: &[u8]) -> Vec<u8> {
    let go_on = [0, 32 + ticks].repeat(100);
    let len = (packet.len() as u16).to_be_bytes();
    let mut bytes = vec![0, 0];
    bytes.extend(&go_on);
    bytes.extend([0xFF, 32 + ticks]);
    bytes.extend(len);
    bytes.extend(packet);
    bytes.extend(&go_on);
    bytes
}

/// A robot that stands, as its states have it: high level, low level.
fn unitree_states(layout: &unitree::Layout) -> [Vec<u8>; 2] {
    let mut high = unitree::HighState::of(layout);
    high.body.imu.quaternion[0] = 1.0;
    high.body.imu.accelerometer[2] = 9.8;
    for (i, motor) in high.body.motors.iter_mut().enumerate() {
        motor.angle = [0.0, 0.9, -1.8][i % 3];
        motor.torque = [0.5, 1.0, 8.0][i % 3];
    }
    let mut low = unitree::LowState::of(layout);
    low.body = high.body.clone();
    low.tick_ms = 12_345;
    let form = unitree::CheckForm::Transformed;
    [
        high.encode(form).as_bytes().to_vec(),
        low.encode(layout).as_bytes().to_vec(),
    ]
}

/// A walking command and motors that are asked nothing.
fn unitree_commands(layout: &unitree::Layout) -> [Vec<u8>; 2] {
    let form = unitree::CheckForm::Plain;
    let high = unitree::HighCmd {
        mode: 2,
        gait: 1,
        velocity: [0.3, -0.1],
        ..unitree::HighCmd::default()
    };
    let high = high.encode(layout, form).expect("the numbers are finite");
    let low = unitree::LowCmd::default();
    let (low, _) = low.encode(layout, form).expect("the numbers are finite");
    [high.as_bytes().to_vec(), low.as_bytes().to_vec()]
}

/// A camera's tables, one answer, one metadata buffer, one picture; and commands for a stream of
/// pictures with their metadata.
fn realsense() -> Vec<Vec<u8>> {
    let optics = Intrinsics {
        width: 848,
        height: 480,
        focal: [424.2, 424.3],
        centre: [423.4, 236.1],
        distortion: Distortion::BrownConrady([-0.05, 0.06, 0.0, 0.001, -0.02]),
    };
    let timing = d400_frame::CaptureTiming {
        sensor_us: Some(7_000),
        exposure_us: Some(6_000),
        ..d400_frame::CaptureTiming::default()
    };
    let said = d400_frame::FrameMetadata {
        device_us: Some(10_000),
        timing,
        depth: Some(d400_frame::DepthState::default()),
        ..d400_frame::FrameMetadata::default()
    };
    let (metadata, len) = d400::metadata(&said);
    let mut picture = vec![8, 0, 4, 0, 16, 0];
    picture.extend([0xE8, 3].repeat(32));
    let opcode = hachi_realsense::monitor::Opcode::ReadCalibration;
    let decoded = [
        d400::depth_table(0.095, &[optics]).to_vec(),
        d400::color_table(&optics, &Pose::translation(0.06, 0.0, 0.0)).to_vec(),
        d400::answer(opcode, &[1, 2, 3]).to_vec(),
        metadata[..len].to_vec(),
        picture,
    ];
    // Depth, its metadata, colour, its metadata; 33 ms in four steps.
    let pair = [0x0C, 80, 0x0E, 80, 0x0D, 80, 0x0F, 80];
    let streamed = [vec![1, 0, 0, 0], pair.repeat(12)].concat();
    let inputs = decoded.into_iter().map(|bytes| with_switches(0, bytes));
    inputs.chain([streamed]).collect()
}

/// A request and an answer of a gripper; and the answers to two writes and two reads in pieces.
fn robotiq() -> Vec<Vec<u8>> {
    let command = robotiq_frame::Command {
        activate: true,
        go: true,
        position: 255,
        ..robotiq_frame::Command::default()
    };
    let state = robotiq_frame::State {
        activate: true,
        activation: robotiq_frame::Activation::Done,
        ..robotiq_frame::State::default()
    };
    let written = robotiq_serve::Asked::Write {
        command,
        registers: 3,
    };
    let read = robotiq_serve::Asked::Read {
        function: 3,
        registers: 3,
    };
    let [written, read] = [written, read].map(|a| robotiq_serve::answer(9, a, &state).to_vec());
    let pieces = |frame: &[u8]| [vec![frame.len() as u8], frame.to_vec()].concat();
    let conversation = [&written, &written, &read, &read, &written].map(|f| pieces(f));
    vec![
        robotiq_frame::Request::Write(command).encode(9).to_vec(),
        robotiq_frame::Request::Read.encode(9).to_vec(),
        written.clone(),
        read.clone(),
        [vec![0x80], conversation.concat()].concat(),
    ]
}

/// A stop's node that starts, closes its contacts, is pressed and falls silent; an axis's messages.
fn canbus() -> Vec<Vec<u8>> {
    let frame = |id: u16, ticks: u8, bytes: &[u8]| {
        let [high, low] = id.to_be_bytes();
        [&[high, low, bytes.len() as u8, ticks], bytes].concat()
    };
    let stop = [
        frame(0x701, 0, &[0]),
        frame(0x701, 50, &[5]),
        frame(0x181, 1, &[3]),
        frame(0x701, 50, &[5]),
        frame(0x181, 10, &[0]),
        frame(0x081, 1, &[0x20, 0x81]),
        frame(0x7E8, 255, &[]),
    ];
    let axis = [
        frame(0x021, 0, &[0, 0, 0, 0, 8, 0, 0, 0x80]),
        frame(0x029, 1, &[0, 0, 0x80, 0x3F, 0, 0, 0, 0xC0]),
        frame(0x037, 1, &[0, 0, 0xC0, 0x41, 0, 0, 0, 0x3F]),
    ];
    vec![stop.concat(), axis.concat()]
}

/// A measurement; and reads of a chip that is not ready, ready with a measurement, and failing.
fn imu() -> Vec<Vec<u8>> {
    let at_rest = vec![0, 0, 0, 0, 0, 0, 0x10, 0, 0, 0, 0, 0, 0, 164];
    let reads = [
        vec![0, 0, 0, 0, 0, 8, 0],
        at_rest.clone(),
        vec![0xFF, 0, 8, 0],
        at_rest.clone(),
    ];
    vec![at_rest, reads.concat()]
}

/// Numbers of a walk: bytes around the middle stand for joints near zero.
fn leg_numbers() -> Vec<u8> {
    (0..600_u32).map(|i| (90 + i * 37 % 75) as u8).collect()
}

/// A person in view once.
fn somebody() -> (NetworkIdentity, AppearanceModel) {
    let network = NetworkIdentity {
        name: "osnet".to_owned(),
        sha256: [7; 32],
    };
    let model = AppearanceModel::first(&[0.6, -0.8, 0.1, 0.0]).expect("a feature");
    (network, model)
}

/// A store of one person: length of the key file, key file, store.
fn people_store() -> Result<Vec<u8>> {
    let folder = tempfile::tempdir()?;
    let paths = PeoplePaths::beside(&folder.path().join("seed.db"));
    let mut store = PeopleFile::open_or_create(&paths).expect("a new file");
    let (network, model) = somebody();
    let person = NewPerson {
        name: "Anna",
        enrolled_unix_s: 1_700_000_000,
        network: &network,
        model: &model,
        images: &[vec![1; 40]],
    };
    store.enrol(&person).expect("room for a temporary file");
    drop(store);
    let (key, file) = (fs::read(&paths.key)?, fs::read(&paths.file)?);
    let length = (key.len() as u16).to_le_bytes();
    Ok([&length[..], &key, &file].concat())
}

fn people_codec() -> Vec<Vec<u8>> {
    let (network, model) = somebody();
    let record = Record {
        name: "Anna".to_owned(),
        enrolled_unix_s: 1_700_000_000,
    };
    vec![encode_record(&record), encode_model(&network, &model)]
}

/// What a browser asks, what a program orders, and the answer to it.
fn http_request() -> Vec<Vec<u8>> {
    let order = "{\"at\":[320,180]}";
    vec![
        b"GET /people HTTP/1.1\r\nHost: localhost:9470\r\nOrigin: http://localhost:9470\r\n\r\n"
            .to_vec(),
        format!(
            "POST /people/pick HTTP/1.1\r\nHost: [::1]:9470\r\nContent-Type: application/json\r\n\
             Content-Length: {}\r\n\r\n{order}",
            order.len()
        )
        .into_bytes(),
        hachi_http::Response::json(200, order.to_owned()).to_bytes(),
    ]
}

/// A floor and a wall as a submap.
fn corner() -> Submap {
    let mut builder = SubmapBuilder::default();
    let points = (0..400).flat_map(|i| {
        let (a, b) = ((i % 20) as f32 * 0.2 - 2.0, (i / 20) as f32 * 0.2 - 2.0);
        [([a, b, -0.5], 40.0), ([2.0, a, 0.5 * (b + 1.0)], 90.0)]
    });
    builder.add([0.0; 3], points);
    let mut submap = Submap::default();
    builder.finish(&mut submap);
    submap
}

fn submap_bytes() -> Vec<u8> {
    let mut bytes = Vec::new();
    encode(&corner(), &mut bytes);
    bytes
}

/// The corner as a place, and a data base of it seen from three headings.
fn places() -> [Vec<u8>; 2] {
    let mut describer = Describer::new(Profile::INDOOR, DescriberConfig::default());
    let (mut database, mut place) = (Database::default(), Descriptor::default());
    for turn in 0..3 {
        let (sin, cos) = (turn as f32).sin_cos();
        let cloud: Vec<[f32; 4]> = corner()
            .points
            .iter()
            .map(|p| {
                let [x, y, z] = p.position;
                [cos * x - sin * y, sin * x + cos * y, z + 0.5, 40.0]
            })
            .collect();
        describer.describe(&cloud, &mut place);
        database.insert(turn, &place).expect("one layout");
    }
    [place.to_bytes(), database.to_bytes()]
}

/// A map of two nodes that hang on each other by nothing.
fn map_file() -> Result<Vec<u8>> {
    let folder = tempfile::tempdir()?;
    let path = folder.path().join("seed.map");
    let identity = Identity {
        platform: "go1".to_owned(),
        sensor: "VLP-16".to_owned(),
    };
    let file = MapFile::create(&path, &identity).expect("a new file");
    let mut map = Map::new(Box::new(file), 1 << 20);
    for id in 0..2 {
        let pose = Pose::translation(f64::from(id), 0.0, 0.0);
        let ground = Ground::level(0.5);
        let node = Node {
            id: NodeId(id),
            session: id,
            piece: map.begin_piece(),
            chained: false,
            stamp: Stamp::from_nanos(1_700_000_000_000_000_000),
            odom_from_node: pose,
            map_from_node: pose,
            path_m: 0.0,
            ground,
        };
        map.places.describe(&corner(), &ground);
        map.add_node(node, Arc::new(corner()), None)
            .expect("a piece of its own");
    }
    map.commit(true).expect("room for a temporary file");
    drop(map);
    fs::read(&path)
}

/// A model of `ir_version` 8 whose graph has one node with an input named x; a detector's manifest.
fn onnx_file() -> Vec<Vec<u8>> {
    let manifest = known::manifest("yolox_nano_416x416").expect("it is known");
    vec![
        vec![0x08, 8, 0x3A, 5, 0x0A, 3, 0x0A, 1, b'x'],
        manifest.into(),
    ]
}

fn with_switches(switches: u8, payload: Vec<u8>) -> Vec<u8> {
    [vec![switches], payload].concat()
}

fn main() -> Result<()> {
    use vlp16_packet::ReturnMode::{Dual, Strongest};
    let position = vlp16_packet::PositionPacket::new(77, vlp16_packet::Pps::Locked, SENTENCE);
    let position = vlp16::position_packet(&position).to_vec();
    let ethernet = [vec![1; 12], vec![8, 0], ipv4(0, &UDP)].concat();
    let fragments = [ipv4(0x2000, &UDP[..8]), ipv4(1, &UDP[8..])];
    let [go1_high, go1_low] = unitree_states(&unitree::Layout::GO1);
    let [b1_high, b1_low] = unitree_states(&unitree::Layout::B1);
    let [go1_walk, go1_idle] = unitree_commands(&unitree::Layout::GO1);
    let [b1_walk, _] = unitree_commands(&unitree::Layout::B1);
    let seeds: [(&str, Vec<Vec<u8>>); 24] = [
        ("canbus", canbus()),
        ("imu", imu()),
        ("realsense", realsense()),
        ("robotiq", robotiq()),
        (
            "velodyne_packet",
            vec![
                with_switches(0, vlp16_data(Strongest)),
                with_switches(3, vlp16_data(Dual)),
            ],
        ),
        ("velodyne_position", vec![position.clone()]),
        (
            "velodyne_scans",
            vec![stream(13, &vlp16_data(Dual)), stream(13, &position)],
        ),
        ("robosense_msop", vec![with_switches(0, helios_msop())]),
        ("robosense_difop", vec![helios_difop()]),
        (
            "robosense_scans",
            vec![stream(7, &helios_difop()), stream(7, &helios_msop())],
        ),
        (
            "capture",
            vec![
                pcap(1, &[ethernet]),
                pcap(101, &fragments),
                pcapng(&ipv4(0, &UDP)),
            ],
        ),
        (
            "unitree_state",
            vec![
                with_switches(0, go1_high),
                with_switches(1, b1_high),
                with_switches(0, go1_low),
                with_switches(1, b1_low),
            ],
        ),
        (
            "unitree_command",
            vec![
                with_switches(0, go1_walk),
                with_switches(1, b1_walk),
                with_switches(0, go1_idle),
            ],
        ),
        ("leg_tracker", vec![leg_numbers()]),
        ("submap", vec![submap_bytes()]),
        ("place_database", places().to_vec()),
        ("map_file", vec![map_file()?]),
        ("people_codec", people_codec()),
        ("people_store", vec![people_store()?]),
        (
            "detector_outputs",
            (0..4)
                .map(|kind| with_switches(kind, leg_numbers()))
                .collect(),
        ),
        ("http_request", http_request()),
        ("onnx_file", onnx_file()),
        (
            "mot_text",
            vec![
                b"1,-1,10,20,30,60,0.9,-1,-1,-1\n2,-1,12,20,30,60,0.8\n3,-1,14,20,30,60,0.9\n"
                    .to_vec(),
                b"1 1 5 5 10 20 1 1 1\n1,2,40,5,10,20,0,7,0.5\n\n# end\n".to_vec(),
            ],
        ),
        (
            "nmea",
            vec![
                SENTENCE.to_vec(),
                b"GPGGA,123519.5,4807.038,N,01131.000,E,1,08,0.9,545.4,M,46.9,M,,".to_vec(),
            ],
        ),
    ];
    for (target, inputs) in seeds {
        let folder = Path::new("seeds").join(target);
        fs::create_dir_all(&folder)?;
        for (number, bytes) in inputs.iter().enumerate() {
            fs::write(folder.join(number.to_string()), bytes)?;
        }
    }
    Ok(())
}
