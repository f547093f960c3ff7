//! The container: frames out of pcap and pcapng.
//!
//! In: a reader. Out: link-layer frames with their stamps. The framing of both formats is
//! `pcap-file`'s; its own readers are not used, because they take every pcapng stamp for
//! nanoseconds and give up a whole file for one unreadable option. The few fixed fields needed of
//! an interface, a packet and a simple packet block are read here (pcapng draft, sections 4.2 to
//! 4.4 and A.2).

use std::io::{self, Read};

use byteorder_slice::{BigEndian, LittleEndian};
use hachi_hal::Stamp;
use pcap_file::pcap::PcapParser;
use pcap_file::pcapng::RawBlock;
use pcap_file::{Endianness, PcapError, TsResolution};

use super::CaptureError;

/// Bytes read at a time.
const CHUNK: usize = 256 << 10;
/// Largest block kept in memory. Frames are below 64 kB; capture programs write at most a few MB of
/// names or keys at once.
const MAX_BLOCK: usize = 16 << 20;
/// Most interfaces of one section, a bound on what a file can make us remember.
const MAX_INTERFACES: usize = 1024;

const SECTION_BLOCK: u32 = 0x0A0D_0D0A;
const INTERFACE_BLOCK: u32 = 1;
const OLD_PACKET_BLOCK: u32 = 2;
const SIMPLE_PACKET_BLOCK: u32 = 3;
const ENHANCED_PACKET_BLOCK: u32 = 6;

/// One captured frame.
pub(super) struct Frame<'a> {
    /// Link-layer type (tcpdump.org registry).
    pub(super) link: u32,
    pub(super) stamp: Stamp,
    pub(super) bytes: &'a [u8],
    /// Whether the capture program kept only the frame's beginning.
    pub(super) cut: bool,
}

/// Why there is no further frame.
#[derive(Debug)]
pub(super) enum Stop {
    /// The file ends after a whole frame.
    End,
    /// The file ends within a frame.
    Truncated,
    /// The structure stops making sense.
    Corrupt,
    /// The reader failed.
    Failed(io::Error),
}

/// An interface of a pcapng section.
#[derive(Debug, Clone, Copy)]
struct Interface {
    link: u32,
    snap_len: u32,
    ticks: Ticks,
}

/// What a pcapng stamp counts.
#[derive(Debug, Clone, Copy)]
struct Ticks {
    per_second: u64,
    offset_s: i64,
}

impl Ticks {
    fn stamp(&self, ticks: u64) -> Stamp {
        let nanos = u128::from(ticks) * 1_000_000_000 / u128::from(self.per_second.max(1));
        let nanos = i128::try_from(nanos).unwrap_or(i128::MAX);
        let nanos = nanos.saturating_add(i128::from(self.offset_s) * 1_000_000_000);
        Stamp::from_nanos(i64::try_from(nanos).unwrap_or(i64::MAX))
    }
}

#[derive(Debug)]
enum Format {
    Pcap(PcapParser),
    PcapNg {
        endianness: Endianness,
        interfaces: Vec<Interface>,
        /// For simple packets, which have no stamp of their own.
        last_stamp: Stamp,
    },
}

#[derive(Debug)]
pub(super) struct Container<R> {
    window: Window<R>,
    format: Format,
}

impl<R: Read> Container<R> {
    pub(super) fn open(reader: R) -> Result<Self, CaptureError> {
        let mut window = Window::new(reader);
        let failed = |source| CaptureError::Read { frames: 0, source };
        // The pcap header has 24 bytes, the shortest section header 28.
        while window.unread().len() < 28 && window.fill().map_err(failed)? {}
        let start = window.unread();
        if let Ok((rest, parser)) = PcapParser::new(start) {
            let header_len = start.len() - rest.len();
            window.consume(header_len);
            return Ok(Self {
                window,
                format: Format::Pcap(parser),
            });
        }
        let not_a_capture = || CaptureError::NotACapture {
            start: start[..start.len().min(8)].to_vec(),
        };
        let magic = start.get(..4).zip(start.get(8..12));
        let endianness = match magic {
            Some(([0x0A, 0x0D, 0x0D, 0x0A], [0x1A, 0x2B, 0x3C, 0x4D])) => Endianness::Big,
            Some(([0x0A, 0x0D, 0x0D, 0x0A], [0x4D, 0x3C, 0x2B, 0x1A])) => Endianness::Little,
            _ => return Err(not_a_capture()),
        };
        Ok(Self {
            window,
            format: Format::PcapNg {
                endianness,
                interfaces: Vec::new(),
                last_stamp: Stamp::default(),
            },
        })
    }

    /// The next frame. After a [`Stop`] there is none.
    pub(super) fn next_frame(&mut self) -> Result<Frame<'_>, Stop> {
        let range = loop {
            match self.format.parse(self.window.unread()) {
                Ok(Parsed { len, frame: None }) => self.window.consume(len),
                Ok(Parsed {
                    len,
                    frame: Some(frame),
                }) => break (len, frame),
                Err(PcapError::IncompleteBuffer) => {
                    if !self.window.fill().map_err(Stop::Failed)? {
                        return Err(match self.window.unread() {
                            [] => Stop::End,
                            // Larger than what is kept: no capture program writes that.
                            unread if unread.len() >= MAX_BLOCK => Stop::Corrupt,
                            _ => Stop::Truncated,
                        });
                    }
                }
                Err(_) => return Err(Stop::Corrupt),
            }
        };
        let (len, found) = range;
        let bytes = self.window.consume_slice(len);
        Ok(Frame {
            link: found.link,
            stamp: found.stamp,
            bytes: &bytes[found.start..found.start + found.len],
            cut: found.cut,
        })
    }
}

/// One block of the file: how long it is, and the frame in it.
struct Parsed {
    len: usize,
    frame: Option<Found>,
}

/// Where a frame stands in its block, and what is known of it.
struct Found {
    link: u32,
    stamp: Stamp,
    start: usize,
    len: usize,
    cut: bool,
}

impl Format {
    fn parse(&mut self, unread: &[u8]) -> Result<Parsed, PcapError> {
        match self {
            Self::Pcap(parser) => parse_pcap(parser, unread),
            Self::PcapNg {
                endianness,
                interfaces,
                last_stamp,
            } => {
                if let Some(&[0x0A, 0x0D, 0x0D, 0x0A]) = unread.first_chunk::<4>() {
                    // A new section, perhaps in the other byte order: forget the old one.
                    *endianness = match unread.get(8..12) {
                        Some([0x1A, 0x2B, 0x3C, 0x4D]) => Endianness::Big,
                        Some([0x4D, 0x3C, 0x2B, 0x1A]) => Endianness::Little,
                        Some(_) => return Err(PcapError::InvalidField("section magic")),
                        None => return Err(PcapError::IncompleteBuffer),
                    };
                    interfaces.clear();
                }
                let (rest, block) = match endianness {
                    Endianness::Big => RawBlock::from_slice::<BigEndian>(unread)?,
                    Endianness::Little => RawBlock::from_slice::<LittleEndian>(unread)?,
                };
                let fields = Fields {
                    endianness: *endianness,
                    bytes: &block.body,
                };
                let frame = read_block(block.type_, &fields, interfaces, last_stamp)?;
                Ok(Parsed {
                    len: unread.len() - rest.len(),
                    frame,
                })
            }
        }
    }
}

fn parse_pcap(parser: &PcapParser, unread: &[u8]) -> Result<Parsed, PcapError> {
    let (rest, packet) = parser.next_raw_packet(unread)?;
    let header = parser.header();
    let nanos_per_tick = match header.ts_resolution {
        TsResolution::MicroSecond => 1_000,
        TsResolution::NanoSecond => 1,
    };
    let stamp = Stamp::from_nanos(
        i64::from(packet.ts_sec) * 1_000_000_000 + i64::from(packet.ts_frac) * nanos_per_tick,
    );
    Ok(Parsed {
        len: unread.len() - rest.len(),
        frame: Some(Found {
            // The upper half of the field tells of frame check sequences.
            link: u32::from(header.datalink) & 0xFFFF,
            stamp,
            start: 16,
            len: packet.data.len(),
            cut: packet.incl_len < packet.orig_len,
        }),
    })
}

/// Fixed-width fields of a block's body in its section's byte order.
struct Fields<'a> {
    endianness: Endianness,
    bytes: &'a [u8],
}

impl Fields<'_> {
    fn u16(&self, at: usize) -> Result<u16, PcapError> {
        let bytes = self.array(at)?;
        Ok(match self.endianness {
            Endianness::Big => u16::from_be_bytes(bytes),
            Endianness::Little => u16::from_le_bytes(bytes),
        })
    }

    fn u32(&self, at: usize) -> Result<u32, PcapError> {
        let bytes = self.array(at)?;
        Ok(match self.endianness {
            Endianness::Big => u32::from_be_bytes(bytes),
            Endianness::Little => u32::from_le_bytes(bytes),
        })
    }

    fn array<const N: usize>(&self, at: usize) -> Result<[u8; N], PcapError> {
        let bytes = self.bytes.get(at..).and_then(|rest| rest.first_chunk());
        bytes
            .copied()
            .ok_or(PcapError::InvalidField("block too short for its fields"))
    }
}

/// Bytes of a block before its body: type and length.
const BLOCK_HEADER: usize = 8;

fn read_block(
    kind: u32,
    fields: &Fields<'_>,
    interfaces: &mut Vec<Interface>,
    last_stamp: &mut Stamp,
) -> Result<Option<Found>, PcapError> {
    let no_interface = PcapError::InvalidField("packet of an interface that was not described");
    let (interface, stamp, data_at, captured, original) = match kind {
        SECTION_BLOCK => return Ok(None),
        INTERFACE_BLOCK => {
            if interfaces.len() == MAX_INTERFACES {
                return Err(PcapError::InvalidField("too many interfaces"));
            }
            interfaces.push(Interface {
                link: u32::from(fields.u16(0)?),
                snap_len: fields.u32(4)?,
                ticks: interface_ticks(fields),
            });
            return Ok(None);
        }
        ENHANCED_PACKET_BLOCK | OLD_PACKET_BLOCK => {
            let index = match kind {
                OLD_PACKET_BLOCK => u32::from(fields.u16(0)?),
                _ => fields.u32(0)?,
            };
            let interface = interfaces.get(index as usize).ok_or(no_interface)?;
            let ticks = u64::from(fields.u32(4)?) << 32 | u64::from(fields.u32(8)?);
            let stamp = interface.ticks.stamp(ticks);
            *last_stamp = stamp;
            (interface, stamp, 20, fields.u32(12)?, fields.u32(16)?)
        }
        SIMPLE_PACKET_BLOCK => {
            let interface = interfaces.first().ok_or(no_interface)?;
            let original = fields.u32(0)?;
            let limit = match interface.snap_len {
                0 => u32::MAX,
                limit => limit,
            };
            (interface, *last_stamp, 4, original.min(limit), original)
        }
        _ => return Ok(None),
    };
    let captured_len = captured as usize;
    if fields.bytes.len() - data_at < captured_len {
        return Err(PcapError::InvalidField("packet longer than its block"));
    }
    Ok(Some(Found {
        link: interface.link,
        stamp,
        start: BLOCK_HEADER + data_at,
        len: captured_len,
        cut: captured < original,
    }))
}

/// Resolution and offset of an interface's stamps: options 9 and 14. Without them, microseconds.
/// An option list that breaks off ends there.
fn interface_ticks(fields: &Fields<'_>) -> Ticks {
    let mut ticks = Ticks {
        per_second: 1_000_000,
        offset_s: 0,
    };
    let mut at = 8;
    while let (Ok(code), Ok(len)) = (fields.u16(at), fields.u16(at + 2)) {
        let value = at + 4;
        match (code, len) {
            (0, _) => break,
            (9, 1) => {
                if let Ok([exponent]) = fields.array(value) {
                    ticks.per_second = ticks_per_second(exponent);
                }
            }
            (14, 8) => {
                if let Ok(bytes) = fields.array(value) {
                    ticks.offset_s = match fields.endianness {
                        Endianness::Big => i64::from_be_bytes(bytes),
                        Endianness::Little => i64::from_le_bytes(bytes),
                    };
                }
            }
            _ => {}
        }
        at = value + usize::from(len).next_multiple_of(4);
    }
    ticks
}

/// Negative powers of ten, or of two with the top bit set; beyond 64 bits the finest that fits.
fn ticks_per_second(exponent: u8) -> u64 {
    let (base, power): (u64, u8) = match exponent {
        0x80.. => (2, exponent & 0x7F),
        _ => (10, exponent),
    };
    base.checked_pow(u32::from(power)).unwrap_or(u64::MAX)
}

/// The part of the file that is in memory.
#[derive(Debug)]
struct Window<R> {
    reader: R,
    buffer: Vec<u8>,
    start: usize,
    end: usize,
}

impl<R: Read> Window<R> {
    fn new(reader: R) -> Self {
        Self {
            reader,
            buffer: vec![0; CHUNK],
            start: 0,
            end: 0,
        }
    }

    fn unread(&self) -> &[u8] {
        &self.buffer[self.start..self.end]
    }

    fn consume(&mut self, len: usize) {
        self.start += len;
    }

    fn consume_slice(&mut self, len: usize) -> &[u8] {
        let slice = &self.buffer[self.start..self.start + len];
        self.start += len;
        slice
    }

    /// Reads more behind what is unread. `false` at the end of the file, and when a block is larger
    /// than is kept. The buffer doubles only when it is full of bytes that were really there.
    fn fill(&mut self) -> io::Result<bool> {
        self.buffer.copy_within(self.start..self.end, 0);
        self.end -= self.start;
        self.start = 0;
        if self.end == self.buffer.len() {
            if self.buffer.len() >= MAX_BLOCK {
                return Ok(false);
            }
            self.buffer.resize(self.buffer.len() * 2, 0);
        }
        loop {
            match self.reader.read(&mut self.buffer[self.end..]) {
                Ok(read) => {
                    self.end += read;
                    return Ok(read > 0);
                }
                Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
                Err(error) => return Err(error),
            }
        }
    }
}
