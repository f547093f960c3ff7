//! Whole turns of a VLP-16 from any packet source: socket, capture, simulator, mock.
//!
//! In: datagrams with arrival stamps. Out: [`LidarScans`], and a count of everything that was left
//! out, by reason. Elsewhere: decoding (`packet`), cutting and stamping (`hachi-turns`), sockets and
//! files (`hachi-datagram`).
//!
//! Data and position packets are told apart by their length, so a source may deliver them through
//! one port or two. Once warm, nothing here allocates.

mod arrivals;
mod counters;

use alloc::boxed::Box;
use alloc::vec;
use alloc::vec::Vec;

use hachi_hal::{LidarScans, PacketSource, PointSink, Received, ScanHeader, Stamp};
use hachi_turns::{ClockMap, CutAngle, PacketPoints, Turn, TurnAssembler, TurnStamper, deliver};

use crate::packet::{
    DATA_LEN, DataInfo, Decoder, DecoderConfig, MAX_POINTS, POSITION_LEN, PointBatch,
    PositionPacket, utc_from_hour_stamp,
};
use arrivals::{Arrival, Arrivals};
pub use counters::VelodyneCounters;

/// Most points of one turn: dual return at 300 rpm gives 115,741.
const MAX_TURN_POINTS: usize = 120_000;
/// Longest datagram there is.
const BUFFER_LEN: usize = 65_536;

/// Where the stamps of scans come from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum StampSource {
    /// The clock of the packets' arrival, to which the sensor's own is fitted: one clock for all
    /// sensors of a robot.
    #[default]
    Arrival,
    /// The sensor's UTC as long as it is locked to GPS; the arrival clock otherwise.
    SensorUtc,
}

/// How turns are made.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct VelodyneConfig {
    /// How packets are decoded.
    pub decoder: DecoderConfig,
    /// Azimuth at which one turn ends and the next begins, degrees; 0 is straight ahead.
    pub cut_angle_deg: f32,
    /// Where the stamps of scans come from.
    pub stamps: StampSource,
}

/// A packet that was decoded and is being added to turns.
#[derive(Debug, Clone, Copy)]
struct Loaded {
    info: DataInfo,
    start_ns: i64,
    cut_at: Option<usize>,
}

/// Whole turns of a VLP-16.
#[derive(Debug)]
pub struct VelodyneScans<S> {
    source: S,
    decoder: Decoder,
    stamps: StampSource,
    arrivals: Arrivals,
    clock: ClockMap,
    assembler: TurnAssembler,
    stamper: TurnStamper,
    counters: VelodyneCounters,
    position: Option<PositionPacket>,
    /// Offset from the sensor's time to UTC while the sensor is locked.
    utc_offset_ns: Option<i64>,
    loaded: Option<Loaded>,
    batch: Box<PointBatch>,
    buffer: Vec<u8>,
    ended: bool,
}

impl<S: PacketSource> VelodyneScans<S> {
    /// Turns from the packets of `source`. All memory is taken here.
    pub fn new(source: S, config: VelodyneConfig) -> Self {
        let cut = CutAngle::new(config.cut_angle_deg);
        Self {
            source,
            decoder: Decoder::new(config.decoder),
            stamps: config.stamps,
            arrivals: Arrivals::default(),
            clock: ClockMap::new(),
            assembler: TurnAssembler::new(cut, MAX_TURN_POINTS.max(MAX_POINTS)),
            stamper: TurnStamper::new(),
            counters: VelodyneCounters::default(),
            position: None,
            utc_offset_ns: None,
            loaded: None,
            batch: Box::new(PointBatch::new()),
            buffer: vec![0; BUFFER_LEN],
            ended: false,
        }
    }

    /// The source, for its own counters.
    pub fn source(&self) -> &S {
        &self.source
    }

    /// What happened to packets so far.
    pub fn counters(&self) -> VelodyneCounters {
        VelodyneCounters {
            lost: self.arrivals.lost(),
            turn_too_long: self.assembler.too_long(),
            receiver_clock_set_back: self.clock.steps(),
            ..self.counters
        }
    }

    /// The newest position packet: GPS time and place, PPS state, temperatures.
    pub fn position(&self) -> Option<&PositionPacket> {
        self.position.as_ref()
    }

    /// What to add to the sensor's time to get the stamps given out, ns.
    pub fn stamp_offset_ns(&self) -> Option<i64> {
        match self.stamps {
            StampSource::SensorUtc => self.utc_offset_ns.or_else(|| self.clock.offset_ns()),
            StampSource::Arrival => self.clock.offset_ns(),
        }
    }

    fn take(&mut self, received: Received) {
        match received.len {
            DATA_LEN => self.take_data(received.stamp),
            POSITION_LEN => self.take_position(),
            _ => self.counters.wrong_size += 1,
        }
    }

    fn take_position(&mut self) {
        match PositionPacket::decode(&self.buffer[..POSITION_LEN]) {
            Ok(position) => {
                self.counters.position_packets += 1;
                self.position = Some(position);
                if !position.is_utc() {
                    self.utc_offset_ns = None;
                }
            }
            Err(_) => self.counters.bad_position += 1,
        }
    }

    fn take_data(&mut self, received: Stamp) {
        let payload = &self.buffer[..DATA_LEN];
        let info = match self.decoder.decode(payload, 0, &mut self.batch) {
            Ok(info) => info,
            Err(error) => return self.counters.count(error),
        };
        let period_ns = info.mode.packet_period_ns();
        let (start_ns, broken) = match self.arrivals.place(info.hour_us, period_ns, received) {
            Arrival::InOrder { start_ns } => (start_ns, false),
            Arrival::NewTime { start_ns } => (start_ns, true),
            Arrival::Duplicate => return self.counters.duplicate += 1,
            Arrival::OutOfOrder => return self.counters.out_of_order += 1,
            Arrival::Doubtful => return self.counters.stamp_jump += 1,
        };
        self.counters.packets += 1;
        if broken {
            self.assembler.break_stream();
            self.clock.reset();
        }
        // The packet leaves the sensor after its last firing.
        let sent_ns = start_ns + i64::from(period_ns);
        self.clock.observe(sent_ns, received);
        if self.position.as_ref().is_some_and(PositionPacket::is_utc) {
            let utc = utc_from_hour_stamp(received, info.hour_us);
            self.utc_offset_ns = Some(utc.as_nanos().saturating_sub(start_ns));
        }
        let loaded = Loaded {
            info,
            start_ns,
            cut_at: self.cut_at(&info),
        };
        self.assembler.load(&loaded.points(&self.batch));
        self.loaded = Some(loaded);
    }

    /// How many points of the batch lie before the cut angle, if the packet passes it.
    fn cut_at(&self, info: &DataInfo) -> Option<usize> {
        /// Well below the 0.01° of a shot, well above the rounding of an angle.
        const EPSILON_DEG: f32 = 0.001;
        let cut = self.assembler.cut();
        let first = cut.past(info.first_azimuth_deg);
        if cut.past(info.last_azimuth_deg) >= first {
            return None;
        }
        let points = self.batch.as_slice();
        let passed = |azimuth| cut.past(azimuth) < first - EPSILON_DEG;
        let index = points.iter().position(|point| passed(point.azimuth_deg));
        Some(index.unwrap_or(points.len()))
    }

    /// The next turn that the packet in hand ends.
    fn advance(&mut self) -> Option<Turn> {
        let loaded = self.loaded?;
        let turn = self.assembler.advance(&loaded.points(&self.batch));
        if turn.is_none() {
            self.loaded = None;
        }
        turn
    }

    fn emit(&mut self, turn: &Turn, sink: &mut dyn PointSink) -> ScanHeader {
        let offset_ns = self.stamp_offset_ns().unwrap_or(0);
        let points = self.assembler.points_mut();
        let mut header = self.stamper.stamp(turn, points, offset_ns);
        self.counters.sink_full += deliver(points, &mut header, sink);
        self.counters.turns += 1;
        header
    }
}

impl Loaded {
    fn points<'a>(&self, batch: &'a PointBatch) -> PacketPoints<'a> {
        PacketPoints {
            points: batch.as_slice(),
            start_ns: self.start_ns,
            last_shot_ns: self.info.last_shot_ns,
            first_azimuth_deg: self.info.first_azimuth_deg,
            last_azimuth_deg: self.info.last_azimuth_deg,
            rate_deg_per_s: self.info.rate_deg_per_s,
            cut_at: self.cut_at,
        }
    }
}

impl<S: PacketSource> LidarScans for VelodyneScans<S> {
    type Error = S::Error;

    fn read_scan(
        &mut self,
        points: &mut dyn PointSink,
        deadline: Stamp,
    ) -> Result<Option<ScanHeader>, S::Error> {
        points.clear();
        let mut late = false;
        loop {
            if let Some(turn) = self.advance() {
                return Ok(Some(self.emit(&turn, points)));
            }
            // A source that never runs dry must not keep us here for ever.
            if self.ended || late {
                return Ok(None);
            }
            match self.source.receive(&mut self.buffer, deadline)? {
                Some(received) => {
                    late = received.stamp > deadline;
                    self.take(received);
                }
                None if self.source.at_end() => {
                    self.ended = true;
                    let turn = self.assembler.finish();
                    return Ok(turn.map(|turn| self.emit(&turn, points)));
                }
                None => return Ok(None),
            }
        }
    }

    fn at_end(&self) -> bool {
        self.ended
    }
}
