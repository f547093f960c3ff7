//! The system calls below [`super::video`]: opening, asking, mapping, waiting.
//!
//! The `v4l` crate has most of these calls too, but ends the program where a camera is pulled out
//! at the wrong moment or a driver grants a colour space that it does not know, cannot wait for
//! several devices and knows no extension units; so the few calls needed are made here. This is the
//! only module of the crate with `unsafe`.
#![allow(unsafe_code)] // each block has its argument

use std::fs::File;
use std::io;
use std::mem;
use std::os::fd::{AsRawFd, RawFd};
use std::os::unix::fs::OpenOptionsExt;
use std::path::Path;
use std::ptr::{self, NonNull};
use std::time::Duration;
use std::vec::Vec;

use super::abi::{self, BufferState, Control, Format, StreamParameters, UnitQuery};
use super::video::{Filled, FourCc, Granted, Kind, MOST_NODES, Node, Video};

/// The kernel of this machine.
#[derive(Debug, Clone, Copy, Default)]
pub struct Kernel;

/// An open `/dev/videoN`.
#[derive(Debug)]
pub struct Device {
    // Before the file: mappings end before it closes.
    buffers: Vec<Mapping>,
    streams: Option<Kind>,
    file: File,
}

/// Makes a request, again if a signal came in between.
///
/// # Safety
/// `T` is the structure that `number` is for, so that the kernel reads and writes no more than
/// `argument`; pointers inside it are valid for what the request does with them.
unsafe fn request<T>(fd: RawFd, number: u32, argument: &mut T) -> io::Result<()> {
    loop {
        // SAFETY: `argument` is a live exclusive reference to what the request works on, by the
        // caller's promise.
        let result = unsafe { libc::ioctl(fd, number as _, ptr::from_mut(argument)) };
        if result >= 0 {
            return Ok(());
        }
        let error = io::Error::last_os_error();
        if error.kind() != io::ErrorKind::Interrupted {
            return Err(error);
        }
    }
}

/// A structure of zeros.
fn zeroed<T: Plain>() -> T {
    // SAFETY: `Plain` types consist of integers alone, for which zeros are a value.
    unsafe { mem::zeroed() }
}

/// The kernel's structures that hold integers alone.
///
/// # Safety
/// All zeros are a value.
unsafe trait Plain {}
// SAFETY: arrays of integers and integers, every one of them.
unsafe impl Plain for abi::Capability {}
// SAFETY: as above.
unsafe impl Plain for abi::FormatDescription {}
// SAFETY: as above.
unsafe impl Plain for Format {}
// SAFETY: as above.
unsafe impl Plain for StreamParameters {}
// SAFETY: as above.
unsafe impl Plain for abi::RequestBuffers {}
// SAFETY: as above.
unsafe impl Plain for BufferState {}

const fn buffer_type(kind: Kind) -> u32 {
    match kind {
        Kind::Pictures => abi::PICTURES,
        Kind::Metadata => abi::METADATA,
    }
}

impl Device {
    fn fd(&self) -> RawFd {
        self.file.as_raw_fd()
    }

    fn buffer(&self, kind: Kind, index: u32) -> BufferState {
        let mut state: BufferState = zeroed();
        state.index = index;
        state.kind = buffer_type(kind);
        state.memory = abi::MAPPED;
        state
    }

    fn queue(&self, kind: Kind, index: u32) -> io::Result<()> {
        let mut state = self.buffer(kind, index);
        // SAFETY: QUEUE is for a `BufferState`; mapped buffers carry no pointer.
        unsafe { request(self.fd(), abi::QUEUE, &mut state) }
    }
}

impl Node for Device {
    fn kind(&self) -> io::Result<Option<Kind>> {
        let mut capability: abi::Capability = zeroed();
        // SAFETY: QUERY_CAPABILITIES is for a `Capability`, which holds no pointer.
        unsafe { request(self.fd(), abi::QUERY_CAPABILITIES, &mut capability)? };
        let can = capability.of_node();
        Ok(if can & abi::CAN_CAPTURE != 0 {
            Some(Kind::Pictures)
        } else if can & abi::CAN_CAPTURE_METADATA != 0 {
            Some(Kind::Metadata)
        } else {
            None
        })
    }

    fn formats(&self) -> io::Result<Vec<FourCc>> {
        /// More than any camera has; a driver that never ends is one that is broken.
        const MOST: u32 = 64;
        let mut found = Vec::new();
        for index in 0..MOST {
            let mut description: abi::FormatDescription = zeroed();
            description.index = index;
            description.kind = abi::PICTURES;
            // SAFETY: ENUMERATE_FORMATS is for a `FormatDescription`, which holds no pointer.
            let answer = unsafe { request(self.fd(), abi::ENUMERATE_FORMATS, &mut description) };
            match answer {
                Ok(()) => found.push(description.four_cc.to_le_bytes()),
                // Past the last one.
                Err(error) if error.raw_os_error() == Some(libc::EINVAL) => break,
                Err(error) => return Err(error),
            }
        }
        Ok(found)
    }

    fn set_pictures(&self, width: u32, height: u32, four_cc: FourCc) -> io::Result<Granted> {
        let mut format: Format = zeroed();
        format.kind = abi::PICTURES;
        format.picture.width = width;
        format.picture.height = height;
        format.picture.four_cc = u32::from_le_bytes(four_cc);
        format.picture.field = abi::PROGRESSIVE;
        // SAFETY: SET_FORMAT is for a `Format`; for pictures it holds no pointer.
        unsafe { request(self.fd(), abi::SET_FORMAT, &mut format)? };
        Ok(Granted {
            width: format.picture.width,
            height: format.picture.height,
            stride: format.picture.bytes_per_line,
            four_cc: format.picture.four_cc.to_le_bytes(),
        })
    }

    fn set_metadata(&self, four_cc: FourCc) -> io::Result<FourCc> {
        let mut format: Format = zeroed();
        format.kind = abi::METADATA;
        format.picture.width = u32::from_le_bytes(four_cc);
        // SAFETY: SET_FORMAT is for a `Format`; for metadata it holds no pointer.
        unsafe { request(self.fd(), abi::SET_FORMAT, &mut format)? };
        Ok(format.picture.width.to_le_bytes())
    }

    fn set_rate(&self, rate: u32) -> io::Result<[u32; 2]> {
        let mut parameters: StreamParameters = zeroed();
        parameters.kind = abi::PICTURES;
        parameters.time_per_frame = [1, rate];
        // SAFETY: SET_PARAMETERS is for `StreamParameters`, which hold no pointer.
        unsafe { request(self.fd(), abi::SET_PARAMETERS, &mut parameters)? };
        Ok(parameters.time_per_frame)
    }

    fn set_control(&self, control: u32, value: i32) -> io::Result<()> {
        let mut control = Control { id: control, value };
        // SAFETY: SET_CONTROL is for a `Control`, which holds no pointer.
        unsafe { request(self.fd(), abi::SET_CONTROL, &mut control) }
    }

    fn set_unit(&self, unit: u8, selector: u8, bytes: &[u8]) -> io::Result<()> {
        const SET_CURRENT: u8 = 0x01;
        let mut query = UnitQuery {
            unit,
            selector,
            query: SET_CURRENT,
            size: u16::try_from(bytes.len()).map_err(|_| io::ErrorKind::InvalidInput)?,
            data: bytes.as_ptr().cast_mut(),
        };
        // SAFETY: QUERY_UNIT is for a `UnitQuery`; `data` points to `size` live bytes, which the
        // kernel only reads when a control is set.
        unsafe { request(self.fd(), abi::QUERY_UNIT, &mut query) }
    }

    fn get_unit(&self, unit: u8, selector: u8, query: u8, bytes: &mut [u8]) -> io::Result<()> {
        let mut query = UnitQuery {
            unit,
            selector,
            query,
            size: u16::try_from(bytes.len()).map_err(|_| io::ErrorKind::InvalidInput)?,
            data: bytes.as_mut_ptr(),
        };
        // SAFETY: QUERY_UNIT is for a `UnitQuery`; `data` points to `size` live bytes, borrowed
        // for writing.
        unsafe { request(self.fd(), abi::QUERY_UNIT, &mut query) }
    }

    fn start(&mut self, kind: Kind, buffers: u32) -> io::Result<()> {
        let mut wanted: abi::RequestBuffers = zeroed();
        wanted.count = buffers;
        wanted.kind = buffer_type(kind);
        wanted.memory = abi::MAPPED;
        // SAFETY: REQUEST_BUFFERS is for `RequestBuffers`, which hold no pointer.
        unsafe { request(self.fd(), abi::REQUEST_BUFFERS, &mut wanted)? };
        for index in 0..wanted.count {
            let mut state = self.buffer(kind, index);
            // SAFETY: QUERY_BUFFER is for a `BufferState`; mapped buffers carry no pointer.
            unsafe { request(self.fd(), abi::QUERY_BUFFER, &mut state)? };
            let mapping = Mapping::new(&self.file, state.offset, state.length)?;
            self.buffers.push(mapping);
            self.queue(kind, index)?;
        }
        let mut of_type = buffer_type(kind);
        // SAFETY: STREAM_ON is for a number.
        unsafe { request(self.fd(), abi::STREAM_ON, &mut of_type)? };
        self.streams = Some(kind);
        Ok(())
    }

    fn dequeue(&mut self, take: &mut dyn FnMut(Filled<'_>)) -> io::Result<bool> {
        let Some(kind) = self.streams else {
            return Ok(false);
        };
        let mut state = self.buffer(kind, 0);
        // SAFETY: DEQUEUE is for a `BufferState`; mapped buffers carry no pointer.
        match unsafe { request(self.fd(), abi::DEQUEUE, &mut state) } {
            Ok(()) => {}
            Err(error) if error.kind() == io::ErrorKind::WouldBlock => return Ok(false),
            Err(error) => return Err(error),
        }
        let Some(mapping) = self.buffers.get(state.index as usize) else {
            return Err(io::ErrorKind::InvalidData.into());
        };
        take(Filled {
            sequence: state.sequence,
            damaged: state.flags & abi::DAMAGED != 0,
            monotonic_ns: state.monotonic_ns(),
            bytes: mapping.filled(state.bytes_used as usize),
        });
        self.queue(kind, state.index)?;
        Ok(true)
    }
}

impl Drop for Device {
    fn drop(&mut self) {
        if let Some(kind) = self.streams {
            let mut of_type = buffer_type(kind);
            // A camera that is gone has stopped already.
            // SAFETY: STREAM_OFF is for a number.
            let _ = unsafe { request(self.fd(), abi::STREAM_OFF, &mut of_type) };
        }
    }
}

/// A buffer of the kernel's, mapped for reading.
#[derive(Debug)]
struct Mapping {
    at: NonNull<u8>,
    len: usize,
}

// SAFETY: a mapping is memory of the process, the same in every thread; it is only read.
unsafe impl Send for Mapping {}

impl Mapping {
    fn new(file: &File, offset: u32, len: u32) -> io::Result<Self> {
        let len = len as usize;
        // SAFETY: a new mapping at a place that the kernel chooses touches no memory in use.
        let at = unsafe {
            libc::mmap(
                ptr::null_mut(),
                len,
                libc::PROT_READ,
                libc::MAP_SHARED,
                file.as_raw_fd(),
                libc::off_t::from(offset),
            )
        };
        if at == libc::MAP_FAILED {
            return Err(io::Error::last_os_error());
        }
        let at = NonNull::new(at.cast()).ok_or(io::ErrorKind::InvalidData)?;
        Ok(Self { at, len })
    }

    /// The first `used` bytes. Called only between taking the buffer out of the kernel's queue and
    /// putting it back, while the kernel leaves it alone.
    fn filled(&self, used: usize) -> &[u8] {
        // SAFETY: the mapping is at least as long as the slice and lives as long as `self`; the
        // kernel does not write to a buffer that is not in its queue.
        unsafe { std::slice::from_raw_parts(self.at.as_ptr(), used.min(self.len)) }
    }
}

impl Drop for Mapping {
    fn drop(&mut self) {
        // SAFETY: `at` and `len` are those of a mapping that was made in `new` and is unmapped
        // nowhere else; no slice of it outlives `self`.
        unsafe { libc::munmap(self.at.as_ptr().cast(), self.len) };
    }
}

impl Video for Kernel {
    type Node = Device;

    fn open(&self, path: &Path) -> io::Result<Device> {
        let file = File::options()
            .read(true)
            .write(true)
            .custom_flags(libc::O_NONBLOCK)
            .open(path)?;
        Ok(Device {
            buffers: Vec::new(),
            streams: None,
            file,
        })
    }

    fn wait(&self, nodes: &[Device], limit: Duration) -> io::Result<[bool; MOST_NODES]> {
        let mut entries = [libc::pollfd {
            // Negative: not looked at.
            fd: -1,
            events: libc::POLLIN,
            revents: 0,
        }; MOST_NODES];
        for (entry, node) in entries.iter_mut().zip(nodes) {
            entry.fd = node.fd();
        }
        // An hour at a time, so that it fits; a millisecond more, so that it is not spun through.
        let limit = limit.min(Duration::from_secs(3_600));
        let milliseconds = limit.as_millis() as libc::c_int + libc::c_int::from(!limit.is_zero());
        // SAFETY: the pointer and length describe `entries`, which outlives the call.
        let ready = unsafe {
            libc::poll(
                entries.as_mut_ptr(),
                MOST_NODES as libc::nfds_t,
                milliseconds,
            )
        };
        if ready < 0 {
            let error = io::Error::last_os_error();
            if error.kind() != io::ErrorKind::Interrupted {
                return Err(error);
            }
        }
        Ok(entries.map(|entry| entry.revents != 0))
    }

    fn monotonic_ns(&self) -> i64 {
        let mut now = libc::timespec {
            tv_sec: 0,
            tv_nsec: 0,
        };
        // SAFETY: `now` is a valid timespec that outlives the call. This clock cannot fail.
        unsafe { libc::clock_gettime(libc::CLOCK_MONOTONIC, &raw mut now) };
        now.tv_sec
            .saturating_mul(1_000_000_000)
            .saturating_add(now.tv_nsec)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Not a camera, and still the real calls: the kernel refuses each by its own rules.
    #[test]
    fn what_is_no_camera_is_refused_by_the_kernel() {
        let mut node = Kernel.open(Path::new("/dev/null")).unwrap();
        let refused = |result: io::Result<()>| result.unwrap_err().raw_os_error();
        let not_a_camera = Some(libc::ENOTTY);
        assert_eq!(refused(node.kind().map(drop)), not_a_camera);
        assert_eq!(refused(node.formats().map(drop)), not_a_camera);
        let picture = node.set_pictures(640, 480, *b"Z16 ");
        assert_eq!(refused(picture.map(drop)), not_a_camera);
        assert_eq!(refused(node.set_metadata(*b"D4XX").map(drop)), not_a_camera);
        assert_eq!(refused(node.set_rate(30).map(drop)), not_a_camera);
        assert_eq!(refused(node.set_control(1, 1)), not_a_camera);
        assert_eq!(refused(node.set_unit(3, 2, &[1])), not_a_camera);
        assert_eq!(refused(node.get_unit(3, 2, 0x81, &mut [0])), not_a_camera);
        assert_eq!(refused(node.start(Kind::Pictures, 4)), not_a_camera);
        assert!(!node.dequeue(&mut |_| panic!("nothing streams")).unwrap());
        let missing = Kernel.open(Path::new("/dev/no-such-camera")).unwrap_err();
        assert_eq!(missing.kind(), io::ErrorKind::NotFound);
    }

    #[test]
    fn a_mapping_shows_what_is_in_its_file_and_no_more() {
        let path = std::env::temp_dir().join(std::format!("hachi-mapping-{}", std::process::id()));
        std::fs::write(&path, [7; 4_096]).unwrap();
        let file = File::open(&path).unwrap();
        let mapping = Mapping::new(&file, 0, 4_096).unwrap();
        std::fs::remove_file(&path).unwrap();
        assert_eq!(mapping.filled(3), [7, 7, 7]);
        assert_eq!(mapping.filled(1 << 20).len(), 4_096);
        drop(mapping);
        assert!(Mapping::new(&file, 0, 0).is_err(), "nothing to map");
    }

    #[test]
    fn waiting_ends_by_itself_and_when_something_is_there() {
        let quiet = Kernel.wait(&[], Duration::from_millis(5)).unwrap();
        assert_eq!(quiet, [false; MOST_NODES]);
        // Always readable.
        let node = Kernel.open(Path::new("/dev/zero")).unwrap();
        let ready = Kernel.wait(&[node], Duration::from_secs(60)).unwrap();
        assert_eq!(ready, [true, false, false, false]);
        let before = Kernel.monotonic_ns();
        assert!(before > 0 && Kernel.monotonic_ns() >= before);
    }
}
