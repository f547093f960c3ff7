//! Whole turns of an RS-Helios-16P from any packet source: socket, capture, simulator, mock.
//!
//! In: datagrams with arrival stamps. Out: [`LidarScans`], and a count of everything that was left
//! out, by reason. Elsewhere: decoding (`packet`), cutting and stamping (`hachi-turns`), sockets and
//! files (`hachi-datagram`).
//!
//! A sensor's angles differ from the manual's by degrees and come with its DIFOP packet; MSOP
//! packets are held until it does. Once it has come, nothing here allocates.

mod arrivals;
mod counters;
mod held;

use alloc::boxed::Box;
use alloc::vec;
use alloc::vec::Vec;

use hachi_hal::{LidarScans, PacketSource, PointSink, Received, ScanHeader, Stamp};
use hachi_turns::{ClockMap, CutAngle, PacketPoints, Turn, TurnAssembler, TurnStamper, deliver};

use crate::packet::{
    BLOCK_PERIOD_NS, BLOCKS, Calibration, Decoder, DecoderConfig, Difop, LaserTiming, MsopHeader,
    MsopInfo, PACKET_LEN, PacketKind, PointBatch, ReturnMode, recognise,
};
use arrivals::{Arrival, Arrivals};
pub use counters::RobosenseCounters;
use held::Held;

/// Most points of one turn: 600 rpm gives 57,600 in single return and as many in dual; half the
/// speed twice that.
const MAX_TURN_POINTS: usize = 120_000;
/// Longest datagram there is.
const BUFFER_LEN: usize = 65_536;

/// Where the lasers' angles come from.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub enum CalibrationSource {
    /// The sensor's DIFOP packet; packets before it are held, the manual's angles are the last
    /// resort.
    #[default]
    Difop,
    /// These, whatever the sensor says.
    Fixed(Calibration),
}

/// How turns are made.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct RobosenseConfig {
    /// Where the lasers' angles come from.
    pub calibration: CalibrationSource,
    /// Which echoes the packets hold, if not what the DIFOP packet says.
    pub return_mode: Option<ReturnMode>,
    /// When the lasers fire, if not by the time between packets.
    pub timing: Option<LaserTiming>,
    /// The sensor is set to a limited field of view, so that azimuth jumps at its edges.
    pub limited_view: bool,
    /// Azimuth at which one turn ends and the next begins, degrees; 0 is straight ahead.
    pub cut_angle_deg: f32,
}

/// Whether the angles are known.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Angles {
    /// Not yet: packets are held.
    Awaited,
    /// No longer awaited; the manual's are used until the sensor's come.
    Nominal,
    Known,
}

/// A packet that was decoded and is being added to turns.
#[derive(Debug, Clone, Copy)]
struct Loaded {
    info: MsopInfo,
    start_ns: i64,
    cut_at: Option<usize>,
}

/// Whole turns of an RS-Helios-16P.
#[derive(Debug)]
pub struct RobosenseScans<S> {
    source: S,
    config: RobosenseConfig,
    angles: Angles,
    calibration: Calibration,
    decoding: DecoderConfig,
    decoder: Decoder,
    held: Held,
    arrivals: Arrivals,
    clock: ClockMap,
    assembler: TurnAssembler,
    stamper: TurnStamper,
    counters: RobosenseCounters,
    difop: Option<Difop>,
    loaded: Option<Loaded>,
    batch: Box<PointBatch>,
    buffer: Vec<u8>,
    source_ended: bool,
    ended: bool,
}

impl<S: PacketSource> RobosenseScans<S> {
    /// Turns from the packets of `source`.
    pub fn new(source: S, config: RobosenseConfig) -> Self {
        let (angles, calibration) = match config.calibration {
            CalibrationSource::Difop => (Angles::Awaited, Calibration::nominal()),
            CalibrationSource::Fixed(calibration) => (Angles::Known, calibration),
        };
        let decoding = DecoderConfig {
            return_mode: config.return_mode.unwrap_or_default(),
            timing: config.timing.unwrap_or_default(),
            limited_view: config.limited_view,
        };
        Self {
            source,
            config,
            angles,
            calibration,
            decoding,
            decoder: Decoder::new(decoding, &calibration),
            held: Held::default(),
            arrivals: Arrivals::default(),
            clock: ClockMap::new(),
            assembler: TurnAssembler::new(CutAngle::new(config.cut_angle_deg), MAX_TURN_POINTS),
            stamper: TurnStamper::new(),
            counters: RobosenseCounters::default(),
            difop: None,
            loaded: None,
            batch: Box::new(PointBatch::new()),
            buffer: vec![0; BUFFER_LEN],
            source_ended: false,
            ended: false,
        }
    }

    /// The source, for its own counters.
    pub fn source(&self) -> &S {
        &self.source
    }

    /// What happened to packets so far.
    pub fn counters(&self) -> RobosenseCounters {
        RobosenseCounters {
            lost: self.arrivals.lost(),
            turn_too_long: self.assembler.too_long(),
            receiver_clock_set_back: self.clock.steps(),
            ..self.counters
        }
    }

    /// The newest DIFOP packet: calibration, speed, synchronisation.
    pub fn difop(&self) -> Option<&Difop> {
        self.difop.as_ref()
    }

    /// Whether turns are made with the sensor's own (or the configured) angles.
    pub fn is_calibrated(&self) -> bool {
        self.angles == Angles::Known
    }

    /// What to add to the sensor's time to get the stamps given out, ns.
    pub fn stamp_offset_ns(&self) -> Option<i64> {
        self.clock.offset_ns()
    }

    fn take(&mut self, received: Received) {
        let payload = &self.buffer[..received.len];
        match recognise(payload) {
            Some(PacketKind::Difop) => self.take_difop(),
            Some(PacketKind::Msop) => {
                let Some(payload) = self.buffer.first_chunk::<PACKET_LEN>().copied() else {
                    return;
                };
                if self.angles == Angles::Awaited {
                    self.held.push(&payload, received.stamp);
                    if self.held.is_full() {
                        self.angles = Angles::Nominal;
                    }
                } else {
                    self.take_msop(&payload, received.stamp);
                }
            }
            None if received.len == PACKET_LEN => self.counters.wrong_product += 1,
            None => self.counters.wrong_size += 1,
        }
    }

    fn take_difop(&mut self) {
        let difop = match Difop::decode(&self.buffer[..PACKET_LEN]) {
            Ok(difop) => difop,
            Err(_) => return self.counters.bad_difop += 1,
        };
        self.counters.difop_packets += 1;
        self.difop = Some(difop);
        match (self.config.calibration, difop.calibration) {
            (CalibrationSource::Fixed(_), _) => {}
            (CalibrationSource::Difop, Ok(calibration)) => {
                self.calibration = calibration;
                self.angles = Angles::Known;
            }
            (CalibrationSource::Difop, Err(_)) => {
                self.counters.bad_calibration += 1;
                if self.angles == Angles::Awaited {
                    self.angles = Angles::Nominal;
                }
            }
        }
        self.decoding.return_mode = self.config.return_mode.unwrap_or(difop.return_mode);
        self.decoder = Decoder::new(self.decoding, &self.calibration);
    }

    /// The blocks' time follows from the time between two packets.
    fn learn_timing(&mut self, period_ns: i64) {
        /// The recorded sensor's, half of it, and the manual's.
        const KNOWN_NS: [u32; 3] = [BLOCK_PERIOD_NS / 2, BLOCK_PERIOD_NS, 2 * BLOCK_PERIOD_NS];
        let block_ns = period_ns / BLOCKS as i64;
        let fits = |known: &u32| (block_ns - i64::from(*known)).abs() < i64::from(*known) / 8;
        let Some(known) = KNOWN_NS.into_iter().find(fits) else {
            return;
        };
        if self.config.timing.is_none() && self.decoding.timing.block_ns != known {
            self.decoding.timing = LaserTiming::for_block(known);
            self.decoder = Decoder::new(self.decoding, &self.calibration);
        }
    }

    fn take_msop(&mut self, payload: &[u8; PACKET_LEN], received: Stamp) {
        let header = match MsopHeader::decode(payload) {
            Ok(header) => header,
            Err(error) => return self.counters.count(error),
        };
        // Below 2^63 by the check on its seconds.
        let start_ns = header.time_ns as i64;
        let broken = match self.arrivals.place(header.counter, start_ns, received) {
            Arrival::InOrder { period_ns } => {
                if let Some(period_ns) = period_ns {
                    self.learn_timing(period_ns);
                }
                false
            }
            Arrival::NewTime => true,
            Arrival::Duplicate => return self.counters.duplicate += 1,
            Arrival::OutOfOrder => return self.counters.out_of_order += 1,
            Arrival::Doubtful => return self.counters.stamp_jump += 1,
        };
        if broken {
            self.assembler.break_stream();
            self.clock.reset();
        }
        let info = match self.decoder.decode(payload, 0, &mut self.batch) {
            Ok(info) => info,
            Err(error) => return self.counters.count(error),
        };
        self.counters.packets += 1;
        if self.angles != Angles::Known {
            self.counters.uncalibrated_packets += 1;
        }
        // The packet leaves the sensor after its last firing.
        let sent_ns = start_ns + i64::from(info.last_shot_ns);
        self.clock.observe(sent_ns, received);
        let loaded = Loaded {
            info,
            start_ns,
            cut_at: self.cut_at(&info),
        };
        self.assembler.load(&loaded.points(&self.batch));
        self.loaded = Some(loaded);
    }

    /// How many points of the batch lie before the cut angle, if the packet passes it. Lasers point
    /// up to 4° beside the rotor, so it is the rotor that decides.
    fn cut_at(&self, info: &MsopInfo) -> Option<usize> {
        /// Well below the 0.01° of a block's azimuth, well above the rounding of an angle.
        const EPSILON_DEG: f32 = 0.001;
        let cut = self.assembler.cut();
        let first = cut.past(info.first_azimuth_deg);
        if cut.past(info.last_azimuth_deg) >= first {
            return None;
        }
        let mut firings = self.batch.firings().iter();
        let passed = firings.find(|firing| cut.past(firing.azimuth_deg) < first - EPSILON_DEG);
        let all = self.batch.as_slice().len();
        Some(passed.map_or(all, |firing| firing.first_point))
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

    /// Takes the next packet that was held; `false` if there is none or they must wait on.
    fn take_held(&mut self) -> bool {
        if self.angles == Angles::Awaited {
            return false;
        }
        match self.held.pop() {
            Some(packet) => {
                self.take_msop(&packet.payload, packet.received);
                true
            }
            None => false,
        }
    }

    fn emit(&mut self, turn: &Turn, sink: &mut dyn PointSink) -> ScanHeader {
        let offset_ns = self.clock.offset_ns().unwrap_or(0);
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

impl<S: PacketSource> LidarScans for RobosenseScans<S> {
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
            if self.ended {
                return Ok(None);
            }
            if self.take_held() {
                continue;
            }
            if self.source_ended {
                self.ended = true;
                let turn = self.assembler.finish();
                return Ok(turn.map(|turn| self.emit(&turn, points)));
            }
            // A source that never runs dry must not keep us here for ever.
            if late {
                return Ok(None);
            }
            match self.source.receive(&mut self.buffer, deadline)? {
                Some(received) => {
                    late = received.stamp > deadline;
                    self.take(received);
                }
                None if self.source.at_end() => {
                    self.source_ended = true;
                    if self.angles == Angles::Awaited {
                        self.angles = Angles::Nominal;
                    }
                }
                None => return Ok(None),
            }
        }
    }

    fn at_end(&self) -> bool {
        self.ended
    }
}
