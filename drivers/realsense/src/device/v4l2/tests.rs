//! The link over devices that are a script: which device is taken for what, what is asked of the
//! kernel, and what comes of its answers.

use std::cell::{Cell, RefCell};
use std::collections::{BTreeMap, VecDeque};
use std::rc::Rc;
use std::string::{String, ToString};
use std::{format, vec};

use hachi_hal::{DeviceError, FaultKind};

use super::video::Filled;
use super::*;

/// What a device can do, and what it will give.
#[derive(Debug, Clone, Default)]
struct Script {
    kind: Option<Kind>,
    formats: Vec<FourCc>,
    /// Granted instead of what is asked for.
    granted: Option<(u32, u32)>,
    granted_rate: Option<[u32; 2]>,
    metadata: Option<FourCc>,
    /// Sequence number and the kernel's stamp of each buffer, or an error.
    buffers: VecDeque<Result<(u32, Option<i64>), i32>>,
    open_error: Option<i32>,
}

#[derive(Debug, Clone, Default)]
struct FakeVideo {
    devices: Rc<RefCell<BTreeMap<PathBuf, Script>>>,
    log: Rc<RefCell<Vec<String>>>,
    /// The robot's clock and the kernel's, which is half as far.
    now_ns: Rc<Cell<i64>>,
}

#[derive(Debug)]
struct FakeNode {
    path: PathBuf,
    system: FakeVideo,
}

impl FakeNode {
    fn script<T>(&self, with: impl FnOnce(&mut Script) -> T) -> T {
        with(
            self.system
                .devices
                .borrow_mut()
                .get_mut(&self.path)
                .unwrap(),
        )
    }

    fn say(&self, what: String) {
        let name = self.path.file_name().unwrap().to_str().unwrap();
        self.system.log.borrow_mut().push(format!("{name} {what}"));
    }
}

impl Node for FakeNode {
    fn kind(&self) -> io::Result<Option<Kind>> {
        Ok(self.script(|s| s.kind))
    }
    fn formats(&self) -> io::Result<Vec<FourCc>> {
        Ok(self.script(|s| s.formats.clone()))
    }
    fn set_pictures(&self, width: u32, height: u32, four_cc: FourCc) -> io::Result<Granted> {
        let (width, height) = self.script(|s| s.granted).unwrap_or((width, height));
        Ok(Granted {
            width,
            height,
            stride: 2 * width + 64,
            four_cc,
        })
    }
    fn set_metadata(&self, four_cc: FourCc) -> io::Result<FourCc> {
        Ok(self.script(|s| s.metadata).unwrap_or(four_cc))
    }
    fn set_rate(&self, rate: u32) -> io::Result<[u32; 2]> {
        Ok(self.script(|s| s.granted_rate).unwrap_or([1, rate]))
    }
    fn set_control(&self, control: u32, value: i32) -> io::Result<()> {
        self.say(format!("control {control:#x} = {value}"));
        Ok(())
    }
    fn set_unit(&self, unit: u8, selector: u8, bytes: &[u8]) -> io::Result<()> {
        self.say(format!("unit {unit}.{selector} = {bytes:?}"));
        Ok(())
    }
    fn get_unit(&self, unit: u8, selector: u8, query: u8, bytes: &mut [u8]) -> io::Result<()> {
        self.say(format!("unit {unit}.{selector} ? {query:#x}"));
        bytes.fill(9);
        Ok(())
    }
    fn start(&mut self, kind: Kind, buffers: u32) -> io::Result<()> {
        self.say(format!("starts {kind:?} in {buffers}"));
        Ok(())
    }
    fn dequeue(&mut self, take: &mut dyn FnMut(Filled<'_>)) -> io::Result<bool> {
        match self.script(|s| s.buffers.pop_front()) {
            Some(Ok((sequence, monotonic_ns))) => {
                take(Filled {
                    sequence,
                    damaged: sequence == 13,
                    monotonic_ns,
                    bytes: &[sequence as u8],
                });
                Ok(true)
            }
            Some(Err(code)) => Err(io::Error::from_raw_os_error(code)),
            None => Ok(false),
        }
    }
}

impl Video for FakeVideo {
    type Node = FakeNode;
    fn open(&self, path: &Path) -> io::Result<FakeNode> {
        match self.devices.borrow().get(path).and_then(|s| s.open_error) {
            Some(code) => Err(io::Error::from_raw_os_error(code)),
            None => Ok(FakeNode {
                path: path.to_path_buf(),
                system: self.clone(),
            }),
        }
    }
    fn wait(&self, nodes: &[FakeNode], limit: Duration) -> io::Result<[bool; MOST_NODES]> {
        let mut ready = [false; MOST_NODES];
        for (ready, node) in ready.iter_mut().zip(nodes) {
            *ready = node.script(|s| !s.buffers.is_empty());
        }
        if !ready.contains(&true) {
            let limit_ns = i64::try_from(limit.as_nanos()).unwrap();
            self.now_ns.set(self.now_ns.get() + limit_ns);
        }
        Ok(ready)
    }
    fn monotonic_ns(&self) -> i64 {
        self.now_ns.get() / 2
    }
}

impl Clock for FakeVideo {
    fn now(&self) -> Stamp {
        Stamp::from_nanos(self.now_ns.get())
    }
}

const NODES: [&str; 6] = ["video3", "video4", "video5", "video6", "video7", "video8"];

fn dev(name: &str) -> PathBuf {
    Path::new("/dev").join(name)
}

fn d455() -> Vec<FoundCamera> {
    let paths = NODES.map(|name| format!("/dev/{name}"));
    let nodes = paths.each_ref().map(|path| path.as_str());
    vec![FoundCamera::new(0x0B5C, Some("123"), Some(5_000), &nodes)]
}

/// A D455 on a kernel with metadata: depth, infrared, colour, each with its metadata behind it.
fn system() -> FakeVideo {
    let pictures = |formats: &[&FourCc]| Script {
        kind: Some(Kind::Pictures),
        formats: formats.iter().map(|f| **f).collect(),
        ..Script::default()
    };
    let metadata = Script {
        kind: Some(Kind::Metadata),
        ..Script::default()
    };
    let scripts = [
        pictures(&[b"Z16 "]),
        metadata.clone(),
        pictures(&[b"GREY", b"UYVY", b"Y8I "]),
        metadata.clone(),
        pictures(&[b"YUYV", b"BYR2"]),
        metadata,
    ];
    let video = FakeVideo::default();
    *video.devices.borrow_mut() = NODES.iter().map(|n| dev(n)).zip(scripts).collect();
    video.now_ns.set(2_000_000_000);
    video
}

fn request() -> CameraRequest {
    CameraRequest {
        serial: None,
        depth: StreamFormat::new(848, 480, 30),
        color: StreamFormat::new(1_280, 720, 30),
    }
}

fn open(video: &FakeVideo) -> Result<V4l2Link<FakeVideo, FakeVideo>, LinkError> {
    let mut port = V4l2Port {
        clock: video.clone(),
        video: video.clone(),
        find: d455,
    };
    let opened = port.open(&request(), video.now())?;
    Ok(opened.expect("a camera is plugged in"))
}

fn change(video: &FakeVideo, name: &str, with: impl FnOnce(&mut Script)) {
    with(video.devices.borrow_mut().get_mut(&dev(name)).unwrap());
}

#[test]
fn devices_are_told_apart_by_what_they_can_do() {
    let video = system();
    let mut link = open(&video).unwrap();
    let of = |stream, part, name| (stream, part, dev(name));
    assert_eq!(
        link.roles,
        [
            of(Stream::Depth, Part::Picture, "video3"),
            of(Stream::Depth, Part::Metadata, "video4"),
            of(Stream::Color, Part::Picture, "video7"),
            of(Stream::Color, Part::Metadata, "video8"),
        ]
    );
    assert_eq!(
        link.layout(Stream::Color).stride,
        2 * 1_280 + 64,
        "as granted"
    );
    link.start().unwrap();
    link.set_unit(Selector::Emitter, &[1]).unwrap();
    let mut value = [0; 2];
    link.get_unit(Selector::LaserPower, Query::Maximum, &mut value)
        .unwrap();
    assert_eq!(value, [9, 9]);
    link.set_video(Stream::Color, 0x9A_0901, 3).unwrap();
    assert_eq!(
        *video.log.borrow(),
        [
            "video4 starts Metadata in 4",
            "video8 starts Metadata in 4",
            "video3 starts Pictures in 4",
            "video7 starts Pictures in 4",
            "video3 unit 3.2 = [1]",
            "video3 unit 3.4 ? 0x83",
            "video7 control 0x9a0901 = 3",
        ]
    );
}

#[test]
fn without_metadata_devices_or_formats_a_camera_still_opens() {
    let video = system();
    for name in ["video4", "video6", "video8"] {
        change(&video, name, |s| s.metadata = Some(*b"VIVD"));
    }
    let link = open(&video).unwrap();
    assert!(!link.has_metadata(Stream::Depth) && !link.has_metadata(Stream::Color));
    let video = system();
    change(&video, "video4", |s| s.kind = None);
    let link = open(&video).unwrap();
    assert!(!link.has_metadata(Stream::Depth) && link.has_metadata(Stream::Color));
}

#[test]
fn a_format_that_is_not_granted_is_named() {
    for damage in [
        (|s: &mut Script| s.granted = Some((640, 480))) as fn(&mut Script),
        |s| s.granted_rate = Some([1, 15]),
        |s| s.granted_rate = Some([0, 0]),
    ] {
        let video = system();
        change(&video, "video7", damage);
        let refused = open(&video).unwrap_err();
        let said = refused.to_string();
        assert!(
            said.contains("/dev/video7 has no colour stream of 1280x720 at 30"),
            "{said}"
        );
        assert_eq!(refused.kind(), FaultKind::FixConfig);
    }
    // Thirty a second may be said as two in 66,666 µs and not as one in 33,333.
    let video = system();
    change(&video, "video7", |s| s.granted_rate = Some([10, 300]));
    assert!(open(&video).is_ok());
}

#[test]
fn what_the_system_refuses_is_said_with_what_to_do() {
    for (code, kind, words) in [
        (libc::EACCES, FaultKind::FixConfig, "group `video`"),
        (libc::EBUSY, FaultKind::Reopen, "end the other program"),
        (libc::ENODEV, FaultKind::Reopen, "unplugged"),
        (libc::EIO, FaultKind::Reopen, "opening the camera"),
    ] {
        let video = system();
        change(&video, "video5", |s| s.open_error = Some(code));
        let refused = open(&video).unwrap_err();
        assert_eq!(refused.kind(), kind);
        assert!(refused.to_string().contains(words), "{refused}");
    }
    let video = system();
    change(&video, "video3", |s| s.formats.clear());
    let refused = open(&video).unwrap_err();
    assert!(refused.to_string().contains("no depth device"), "{refused}");
}

#[test]
fn buffers_of_all_devices_come_in_turn_on_the_robots_clock() {
    let video = system();
    let mut link = open(&video).unwrap();
    link.start().unwrap();
    // The kernel's clock stands at 1 s, the robot's at 2 s.
    change(&video, "video3", |s| {
        s.buffers = [Ok((1, Some(990_000_000))), Ok((2, None)), Ok((13, Some(5)))].into();
    });
    change(&video, "video8", |s| {
        s.buffers = [Ok((7, Some(1_500_000_000)))].into()
    });
    let mut seen = Vec::new();
    let deadline = video.now() + 50_000_000;
    let mut take = |b: Buffer<'_>| {
        let received = b.received.as_nanos();
        seen.push((
            b.stream,
            b.part,
            b.sequence,
            received,
            b.damaged,
            b.bytes.to_vec(),
        ));
    };
    while link.dequeue(deadline, &mut take).unwrap() {}
    let (depth, color) = (Stream::Depth, Stream::Color);
    assert_eq!(
        seen,
        [
            (depth, Part::Picture, 1, 1_990_000_000, false, vec![1]),
            // A stamp from the future is no stamp.
            (color, Part::Metadata, 7, 2_000_000_000, false, vec![7]),
            (depth, Part::Picture, 2, 2_000_000_000, false, vec![2]),
            (depth, Part::Picture, 13, 1_000_000_005, true, vec![13]),
        ]
    );
    assert_eq!(video.now(), deadline, "it waited, and no longer");
}

#[test]
fn a_camera_that_is_pulled_out_is_noticed() {
    let video = system();
    let mut link = open(&video).unwrap();
    link.start().unwrap();
    change(&video, "video7", |s| {
        s.buffers = [Ok((1, None)), Err(libc::ENODEV)].into()
    });
    let mut take = |_: Buffer<'_>| {};
    assert!(link.dequeue(video.now(), &mut take).unwrap());
    let gone = link.dequeue(video.now(), &mut take).unwrap_err();
    assert!(matches!(gone, LinkError::Unplugged), "{gone}");
}

#[test]
fn another_cameras_serial_number_is_waited_for_until_the_deadline() {
    let video = system();
    let mut port = V4l2Port {
        clock: video.clone(),
        video: video.clone(),
        find: d455,
    };
    let other = CameraRequest {
        serial: Some("999".to_string()),
        ..request()
    };
    assert!(port.open(&other, video.now()).unwrap().is_none());
    let same = CameraRequest {
        serial: Some("123".to_string()),
        ..request()
    };
    assert!(port.open(&same, video.now()).unwrap().is_some());
    port.find = Vec::new;
    assert!(port.open(&request(), video.now()).unwrap().is_none());
}
