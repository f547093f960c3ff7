//! The kernel's structures and request numbers, of those that are used here, as `linux/videodev2.h`
//! and `linux/uvcvideo.h` have them on 64-bit machines.
//!
//! Sizes and places are checked when this is compiled: a request number carries its structure's
//! size, so a wrong one is refused by the kernel rather than misread.

use std::mem::{offset_of, size_of};

/// `V4L2_CAP_*`
pub(super) const CAN_CAPTURE: u32 = 0x1;
pub(super) const CAN_CAPTURE_METADATA: u32 = 0x0080_0000;
/// `capabilities` are the whole device's, `device_caps` this node's.
const HAS_NODE_CAPABILITIES: u32 = 0x8000_0000;
/// `V4L2_BUF_TYPE_*`
pub(super) const PICTURES: u32 = 1;
pub(super) const METADATA: u32 = 13;
/// `V4L2_MEMORY_MMAP`
pub(super) const MAPPED: u32 = 1;
/// `V4L2_FIELD_NONE`
pub(super) const PROGRESSIVE: u32 = 1;
/// `V4L2_BUF_FLAG_*`
pub(super) const DAMAGED: u32 = 0x40;
const CLOCK_MASK: u32 = 0xE000;
const CLOCK_MONOTONIC: u32 = 0x2000;

/// `struct v4l2_capability`
#[repr(C)]
pub(super) struct Capability {
    texts: [u8; 80],
    version: u32,
    capabilities: u32,
    device_caps: u32,
    reserved: [u32; 3],
}

impl Capability {
    /// What this node can do.
    pub(super) fn of_node(&self) -> u32 {
        if self.capabilities & HAS_NODE_CAPABILITIES != 0 {
            self.device_caps
        } else {
            self.capabilities
        }
    }
}

/// `struct v4l2_fmtdesc`
#[repr(C)]
pub(super) struct FormatDescription {
    pub(super) index: u32,
    pub(super) kind: u32,
    flags: u32,
    description: [u8; 32],
    pub(super) four_cc: u32,
    mbus_code: u32,
    reserved: [u32; 3],
}

/// `struct v4l2_pix_format`, the part of `v4l2_format`'s union for pictures.
#[repr(C)]
#[derive(Clone, Copy)]
pub(super) struct PictureFormat {
    pub(super) width: u32,
    pub(super) height: u32,
    pub(super) four_cc: u32,
    pub(super) field: u32,
    pub(super) bytes_per_line: u32,
    pub(super) size_image: u32,
    rest: [u32; 6],
}

/// `struct v4l2_format` with its union as pictures or metadata see it: the metadata's two fields
/// (four-character code, buffer size) lie where the picture's width and height do.
#[repr(C, align(8))]
pub(super) struct Format {
    pub(super) kind: u32,
    padding: u32,
    pub(super) picture: PictureFormat,
    rest: [u8; 152],
}

/// `struct v4l2_streamparm` as captures see it.
#[repr(C)]
pub(super) struct StreamParameters {
    pub(super) kind: u32,
    capability: u32,
    mode: u32,
    /// Seconds a frame: numerator and denominator.
    pub(super) time_per_frame: [u32; 2],
    rest: [u32; 46],
}

/// `struct v4l2_requestbuffers`
#[repr(C)]
pub(super) struct RequestBuffers {
    pub(super) count: u32,
    pub(super) kind: u32,
    pub(super) memory: u32,
    rest: [u32; 2],
}

/// `struct v4l2_buffer`
#[repr(C)]
pub(super) struct BufferState {
    pub(super) index: u32,
    pub(super) kind: u32,
    pub(super) bytes_used: u32,
    pub(super) flags: u32,
    field: u32,
    padding: u32,
    seconds: i64,
    microseconds: i64,
    time_code: [u32; 4],
    pub(super) sequence: u32,
    pub(super) memory: u32,
    /// The union's `offset`: where the buffer is to be mapped.
    pub(super) offset: u32,
    union_rest: u32,
    pub(super) length: u32,
    rest: [u32; 3],
}

impl BufferState {
    /// When the kernel saw the frame, ns on its monotonic clock, if that is the clock it used.
    pub(super) fn monotonic_ns(&self) -> Option<i64> {
        let ns = self
            .seconds
            .checked_mul(1_000_000_000)?
            .checked_add(self.microseconds.checked_mul(1_000)?)?;
        (self.flags & CLOCK_MASK == CLOCK_MONOTONIC && ns > 0).then_some(ns)
    }
}

/// `struct v4l2_control`
#[repr(C)]
pub(super) struct Control {
    pub(super) id: u32,
    pub(super) value: i32,
}

/// `struct uvc_xu_control_query`
#[repr(C)]
pub(super) struct UnitQuery {
    pub(super) unit: u8,
    pub(super) selector: u8,
    pub(super) query: u8,
    pub(super) size: u16,
    pub(super) data: *mut u8,
}

/// A request number: what the kernel reads and writes, the driver's letter, a number, and the size
/// (`_IOC` of `asm-generic/ioctl.h`).
const fn request(direction: u32, letter: u8, number: u32, size: usize) -> u32 {
    direction << 30 | (size as u32) << 16 | (letter as u32) << 8 | number
}

const WRITE: u32 = 1;
const READ: u32 = 2;
const BOTH: u32 = READ | WRITE;

pub(super) const QUERY_CAPABILITIES: u32 = request(READ, b'V', 0, size_of::<Capability>());
pub(super) const ENUMERATE_FORMATS: u32 = request(BOTH, b'V', 2, size_of::<FormatDescription>());
pub(super) const SET_FORMAT: u32 = request(BOTH, b'V', 5, size_of::<Format>());
pub(super) const REQUEST_BUFFERS: u32 = request(BOTH, b'V', 8, size_of::<RequestBuffers>());
pub(super) const QUERY_BUFFER: u32 = request(BOTH, b'V', 9, size_of::<BufferState>());
pub(super) const QUEUE: u32 = request(BOTH, b'V', 15, size_of::<BufferState>());
pub(super) const DEQUEUE: u32 = request(BOTH, b'V', 17, size_of::<BufferState>());
pub(super) const STREAM_ON: u32 = request(WRITE, b'V', 18, size_of::<u32>());
pub(super) const STREAM_OFF: u32 = request(WRITE, b'V', 19, size_of::<u32>());
pub(super) const SET_PARAMETERS: u32 = request(BOTH, b'V', 22, size_of::<StreamParameters>());
pub(super) const SET_CONTROL: u32 = request(BOTH, b'V', 28, size_of::<Control>());
pub(super) const QUERY_UNIT: u32 = request(BOTH, b'u', 0x21, size_of::<UnitQuery>());

// What a C compiler says of the kernel's headers.
const _: () = {
    assert!(offset_of!(Capability, capabilities) == 84);
    assert!(offset_of!(Capability, device_caps) == 88);
    assert!(offset_of!(FormatDescription, four_cc) == 44);
    assert!(offset_of!(FormatDescription, mbus_code) == 48);
    assert!(offset_of!(Format, picture) == 8);
    assert!(size_of::<PictureFormat>() == 48);
    assert!(offset_of!(PictureFormat, bytes_per_line) == 16);
    assert!(offset_of!(PictureFormat, size_image) == 20);
    assert!(offset_of!(StreamParameters, time_per_frame) == 12);
    assert!(offset_of!(BufferState, seconds) == 24);
    assert!(offset_of!(BufferState, time_code) == 40);
    assert!(offset_of!(BufferState, sequence) == 56);
    assert!(offset_of!(BufferState, memory) == 60);
    assert!(offset_of!(BufferState, offset) == 64);
    assert!(offset_of!(BufferState, length) == 72);
    assert!(offset_of!(UnitQuery, size) == 4);
    assert!(offset_of!(UnitQuery, data) == 8);
    assert!(QUERY_CAPABILITIES == 0x8068_5600);
    assert!(ENUMERATE_FORMATS == 0xC040_5602);
    assert!(SET_FORMAT == 0xC0D0_5605);
    assert!(REQUEST_BUFFERS == 0xC014_5608);
    assert!(QUERY_BUFFER == 0xC058_5609);
    assert!(QUEUE == 0xC058_560F);
    assert!(DEQUEUE == 0xC058_5611);
    assert!(STREAM_ON == 0x4004_5612);
    assert!(STREAM_OFF == 0x4004_5613);
    assert!(SET_PARAMETERS == 0xC0CC_5616);
    assert!(SET_CONTROL == 0xC008_561C);
    assert!(QUERY_UNIT == 0xC010_7521);
};
