//! How fast a capture is decoded on one core, in packets a second and as a multiple of live speed.
//!
//! ```text
//! cargo run --release -p hachi-velodyne --example decode_speed -- FILE.pcap
//! ```
//!
//! The packets are read into memory first; only decoding, and decoding with assembly into turns, is
//! timed. Live speed is 754 packets a second in single return and 1508 in dual return. Median and
//! best of several runs are printed: on a machine with other work the best is the truer one.
#![allow(clippy::print_stdout, reason = "printing is what this program is for")]

use std::cell::Cell;
use std::convert::Infallible;
use std::error::Error;
use std::hint::black_box;
use std::time::Instant;

use hachi_datagram::{CaptureConfig, CaptureSource};
use hachi_hal::{LidarScans, PacketSource, Point, Received, Stamp};
use hachi_velodyne::packet::{DATA_LEN, DATA_PORT, Decoder, DecoderConfig, HOUR_US, PointBatch};
use hachi_velodyne::{VelodyneConfig, VelodyneScans};

const NEVER: Stamp = Stamp::from_nanos(i64::MAX);
/// Timed runs of each kind.
const RUNS: usize = 301;
/// Most packets in one timed run: a few milliseconds, so that on a busy machine some runs are not
/// interrupted.
const PACKETS_PER_RUN: usize = 1_500;

/// Packets in memory, played over and over as one stream, up to a limit that is raised for each
/// timed run.
struct Replay<'a> {
    packets: &'a [Packet],
    period_ns: u32,
    played: usize,
    limit: &'a Cell<usize>,
}

impl PacketSource for Replay<'_> {
    type Error = Infallible;

    fn receive(&mut self, buffer: &mut [u8], _: Stamp) -> Result<Option<Received>, Infallible> {
        if self.played == self.limit.get() {
            return Ok(None);
        }
        let (_, payload) = &self.packets[self.played % self.packets.len()];
        buffer[..DATA_LEN].copy_from_slice(payload);
        // Time goes on where the capture begins again.
        let at_us = self.played as u64 * u64::from(self.period_ns) / 1_000;
        let hour_us = (at_us % u64::from(HOUR_US)) as u32;
        buffer[1_200..1_204].copy_from_slice(&hour_us.to_le_bytes());
        self.played += 1;
        Ok(Some(Received {
            len: DATA_LEN,
            stamp: Stamp::from_nanos(at_us as i64 * 1_000),
            port: DATA_PORT,
        }))
    }

    fn at_end(&self) -> bool {
        false
    }
}

/// A packet and when it arrived.
type Packet = (Received, Vec<u8>);

fn read(path: &str) -> Result<Vec<Packet>, Box<dyn Error>> {
    let mut source = CaptureSource::open(path, CaptureConfig::default())?;
    let mut buffer = vec![0; 65_536];
    let mut packets = Vec::new();
    while let Some(received) = source.receive(&mut buffer, NEVER)? {
        packets.push((received, buffer[..received.len].to_vec()));
    }
    Ok(packets)
}

/// Times `work` on piece after piece of the packets; packets a second, best and median.
fn measure(packets: &[Packet], mut work: impl FnMut(&[Packet])) -> (f64, f64) {
    let pieces = packets.chunks(PACKETS_PER_RUN).cycle();
    let mut rates: Vec<_> = pieces
        .take(RUNS)
        .map(|piece| {
            let begun = Instant::now();
            work(piece);
            piece.len() as f64 / begun.elapsed().as_secs_f64()
        })
        .collect();
    rates.sort_by(f64::total_cmp);
    (rates[RUNS - 1], rates[RUNS / 2])
}

fn main() -> Result<(), Box<dyn Error>> {
    let path = std::env::args()
        .nth(1)
        .ok_or("usage: decode_speed FILE.pcap")?;
    let mut packets = read(&path)?;
    packets.retain(|(received, _)| received.len == DATA_LEN);
    let decoder = Decoder::new(DecoderConfig::default());
    let first = packets.first().ok_or("no data packets in the file")?;
    let info = decoder.inspect(&first.1)?;
    let live = 1e9 / f64::from(info.mode.packet_period_ns());

    let mut batch = PointBatch::new();
    let mut points = 0;
    for (_, payload) in &packets {
        decoder.decode(payload, 0, &mut batch)?;
        points += batch.as_slice().len();
    }
    let per_packet = points as f64 / packets.len() as f64;
    println!(
        "{} packets, {per_packet:.0} points each, {:?} return",
        packets.len(),
        info.mode
    );

    let decode = measure(&packets, |piece| {
        for (_, payload) in piece {
            // Every packet was decoded once above.
            let _ = black_box(decoder.decode(black_box(payload), 0, &mut batch));
            black_box(batch.as_slice().len());
        }
    });
    let limit = Cell::new(0);
    let replay = Replay {
        packets: &packets,
        period_ns: info.mode.packet_period_ns(),
        played: 0,
        limit: &limit,
    };
    let mut scans = VelodyneScans::new(replay, VelodyneConfig::default());
    let mut sink: Vec<Point> = Vec::with_capacity(200_000);
    let assembly = measure(&packets, |piece| {
        limit.set(limit.get() + piece.len());
        while let Ok(Some(header)) = scans.read_scan(&mut sink, NEVER) {
            black_box(header);
        }
    });
    for (name, (best, median)) in [("decode", decode), ("decode and assembly", assembly)] {
        println!(
            "{name}: best {best:.0} packets/s ({:.0} x live), median {median:.0} ({:.0} x live)",
            best / live,
            median / live
        );
    }
    Ok(())
}
