//! One video device of the kernel, and waiting for several: what [`super::V4l2Link`] needs of them,
//! as a trait that the kernel's own devices (`kernel`) and a test's implement.

use std::io;
use std::path::Path;
use std::time::Duration;
use std::vec::Vec;

/// Four characters that name a format.
pub type FourCc = [u8; 4];

/// What a node streams.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    Pictures,
    Metadata,
}

/// A picture format as the kernel granted it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Granted {
    pub width: u32,
    pub height: u32,
    pub stride: u32,
    pub four_cc: FourCc,
}

/// A buffer that was filled.
#[derive(Debug)]
pub struct Filled<'a> {
    pub sequence: u32,
    pub damaged: bool,
    /// When the kernel saw it, ns on its monotonic clock; `None` if it used another.
    pub monotonic_ns: Option<i64>,
    pub bytes: &'a [u8],
}

/// An open video device.
pub trait Node {
    /// What it streams; `None` if it is neither.
    fn kind(&self) -> io::Result<Option<Kind>>;
    /// The formats of its pictures.
    fn formats(&self) -> io::Result<Vec<FourCc>>;
    /// Asks for a picture format; the kernel may grant another.
    fn set_pictures(&self, width: u32, height: u32, four_cc: FourCc) -> io::Result<Granted>;
    /// Asks for a metadata format; the kernel may grant another.
    fn set_metadata(&self, four_cc: FourCc) -> io::Result<FourCc>;
    /// Asks for so many frames a second; gives the seconds a frame, as a fraction.
    fn set_rate(&self, rate: u32) -> io::Result<[u32; 2]>;
    /// Sets a control.
    fn set_control(&self, control: u32, value: i32) -> io::Result<()>;
    /// Writes a control of an extension unit.
    fn set_unit(&self, unit: u8, selector: u8, bytes: &[u8]) -> io::Result<()>;
    /// Reads a control of an extension unit.
    fn get_unit(&self, unit: u8, selector: u8, query: u8, bytes: &mut [u8]) -> io::Result<()>;
    /// Maps buffers, queues them and starts.
    fn start(&mut self, kind: Kind, buffers: u32) -> io::Result<()>;
    /// Hands the next filled buffer to `take` and queues it again; `false` if there is none yet.
    fn dequeue(&mut self, take: &mut dyn FnMut(Filled<'_>)) -> io::Result<bool>;
}

/// The system that has the devices.
pub trait Video {
    type Node: Node;
    /// Opens a device.
    fn open(&self, path: &Path) -> io::Result<Self::Node>;
    /// Waits until a node has something, or for `limit`: whether each has, or has failed.
    fn wait(&self, nodes: &[Self::Node], limit: Duration) -> io::Result<[bool; MOST_NODES]>;
    /// The kernel's monotonic clock, ns.
    fn monotonic_ns(&self) -> i64;
}

/// Most nodes that are waited for: two streams, each with its metadata.
pub const MOST_NODES: usize = 4;
