//! The host's side of a robot's high-level service.
//!
//! In: commands ([`BaseDrive`]) and a clock. Out: hal's devices ([`LegStates`], [`Imu`],
//! [`Battery`], [`EmergencyStop`]) and whole [`BodySample`]s for the leg tracker. One thread owns
//! it: [`HighClient::exchange`] sends what is due, takes in what has come, and is back by its
//! deadline. The command in force is sent at the command rate for as long as that is called; when
//! it dies, or the robot falls silent, zero velocity is sent instead.

use std::net::{IpAddr, Ipv4Addr, SocketAddr};

use hachi_datagram::SystemClock;
use hachi_hal::{
    BaseCommand, BaseDrive, BaseStatus, Battery, BatterySample, EmergencyStop, Imu, ImuSample,
    LegState, LegStates, Stamp, StopSample,
};
use heapless::Deque;

use super::counters::ClientCounters;
use super::error::ClientError;
use super::link::{RobotLink, UdpLink};
use crate::command::{Commander, CommanderConfig, Rung};
use crate::frame::{
    CheckForm, FieldError, FrameError, HighState, Key, Keys, LONGEST_FRAME, Remote,
};
use crate::fresh::{ContentWatch, LinkHealth};
use crate::reading;
use crate::robot::Quadruped;
use crate::tracker::BodySample;

/// How a robot is reached and spoken to.
#[derive(Debug, Clone, PartialEq)]
pub struct ClientConfig {
    /// The robot's service.
    pub robot: SocketAddr,
    /// Address to send from.
    pub local_address: IpAddr,
    /// Port to send from; 0 takes a free one.
    pub local_port: u16,
    /// Gait, check value, level flag.
    pub commander: CommanderConfig,
    /// From one command to the next, ns. Below 100 Hz robots walk jerkily or not at all.
    pub command_period_ns: i64,
    /// A robot that sends nothing for this long is silent, ns.
    pub silent_ns: i64,
    /// A robot that sends always the same for this long is frozen, ns.
    pub frozen_ns: i64,
    /// Keys of the remote control that stop the robot when held together.
    pub stop_keys: Keys,
}

impl ClientConfig {
    /// The robot at its usual address.
    pub fn for_robot(robot: &Quadruped) -> Self {
        let (address, port) = robot.endpoints.high;
        Self {
            robot: SocketAddr::from((Ipv4Addr::from(address), port)),
            local_address: IpAddr::V4(Ipv4Addr::UNSPECIFIED),
            local_port: robot.endpoints.local_port,
            commander: CommanderConfig::default(),
            command_period_ns: 4_000_000,
            // Fifty frames of 500 Hz; ten refreshes of 50 Hz.
            silent_ns: 100_000_000,
            frozen_ns: 200_000_000,
            // The maker's own: damping.
            stop_keys: Keys::of(&[Key::L2, Key::B]),
        }
    }
}

/// A robot that has not answered yet is called this often, ns.
const HELLO_PERIOD_NS: i64 = 100_000_000;

/// Samples that wait to be fetched: a tenth of a second at the highest rate.
const WAITING: usize = 64;

/// Frames taken in after the deadline: whoever floods the port does not keep us here.
const MOST_OVERTIME: usize = 256;

type Waiting<T> = Deque<T, WAITING>;

/// A robot's high-level service, over any link.
#[derive(Debug)]
pub struct HighClient<L = UdpLink> {
    robot: Quadruped,
    config: ClientConfig,
    link: L,
    commander: Commander,
    sent_at: Option<Stamp>,
    watch: ContentWatch,
    state: Option<(HighState, Stamp)>,
    check_form: Option<CheckForm>,
    last_refusal: Option<FrameError>,
    last_ill: Option<FieldError>,
    bodies: Waiting<BodySample>,
    legs: Waiting<LegState>,
    imu: Waiting<ImuSample>,
    batteries: Waiting<BatterySample>,
    stops: Waiting<StopSample>,
    counters: ClientCounters,
}

impl HighClient {
    /// Opens the socket. Nothing is sent yet.
    ///
    /// # Errors
    /// The port is taken, or the robot has no such gait.
    pub fn open(
        robot: &Quadruped,
        config: ClientConfig,
        clock: SystemClock,
    ) -> Result<Self, ClientError> {
        let local = (config.local_address, config.local_port);
        let link = UdpLink::open(config.robot, local, clock)?;
        Self::over(robot, config, link)
    }

    /// Datagrams from other senders than the robot, left out.
    pub fn foreign_senders(&self) -> u64 {
        self.link.source.counters().foreign_sender
    }

    /// The port that the robot answers at.
    pub fn local_port(&self) -> u16 {
        let ports = self.link.source.local_ports();
        ports.first().copied().unwrap_or(0)
    }
}

impl<L: RobotLink> HighClient<L> {
    /// The service over a link that is there already.
    ///
    /// # Errors
    /// The robot has no such gait.
    pub fn over(robot: &Quadruped, config: ClientConfig, link: L) -> Result<Self, ClientError> {
        Ok(Self {
            robot: *robot,
            link,
            commander: Commander::new(robot, config.commander)?,
            config,
            sent_at: None,
            watch: ContentWatch::default(),
            state: None,
            check_form: None,
            last_refusal: None,
            last_ill: None,
            bodies: Deque::new(),
            legs: Deque::new(),
            imu: Deque::new(),
            batteries: Deque::new(),
            stops: Deque::new(),
            counters: ClientCounters::default(),
        })
    }

    /// Sends what is due and takes in what comes, until a new state is there or `deadline` has
    /// passed and nothing waits any more. Whether a new state came.
    ///
    /// Frames that only repeat the last one are taken in on the way: a robot sends ten for each new
    /// one, and a caller that does not wait must not fall behind.
    ///
    /// # Errors
    /// The socket fails; call again, or open anew, as its kind says.
    pub fn exchange(&mut self, deadline: Stamp) -> Result<bool, ClientError> {
        let mut overtime = 0;
        while overtime < MOST_OVERTIME {
            let now = self.link.now();
            let due = self.next_sending(now);
            if due <= now {
                self.send(now)?;
            }
            let mut buffer = [0; LONGEST_FRAME + 1];
            let wait = self.next_sending(now).min(deadline);
            match self.link.receive(&mut buffer, wait) {
                Ok(Some(received)) => {
                    let new = self.take_in(&buffer[..received.len], received.stamp);
                    if new {
                        return Ok(true);
                    }
                }
                Ok(None) if self.link.now() >= deadline => return Ok(false),
                Ok(None) => {}
                // Longer than any frame: some other program's.
                Err(hachi_datagram::UdpError::Oversize { .. }) => self.counters.wrong_length += 1,
                Err(error) => return Err(error.into()),
            }
            overtime += usize::from(self.link.now() >= deadline);
        }
        Ok(false)
    }

    fn next_sending(&self, now: Stamp) -> Stamp {
        let period = match self.state {
            None => HELLO_PERIOD_NS,
            Some(_) => self.config.command_period_ns,
        };
        self.sent_at.map_or(now, |at| at + period)
    }

    /// Sends the command in force; zero velocity where it has died or the robot does not answer.
    fn send(&mut self, now: Stamp) -> Result<BaseStatus, ClientError> {
        if !matches!(self.health(now), LinkHealth::Alive) {
            self.commander.halt();
        }
        let told = self.commander.told(now);
        let frame = told
            .command
            .encode(&self.robot.layout, self.commander.check_form())?;
        self.sent_at = Some(now);
        self.link.send(frame.as_bytes())?;
        self.counters.sent += 1;
        Ok(told.status)
    }

    /// Whether the datagram is a new state.
    fn take_in(&mut self, bytes: &[u8], stamp: Stamp) -> bool {
        let (state, form) = match HighState::decode(&self.robot.layout, bytes) {
            Ok(decoded) => decoded,
            Err(error) => {
                self.counters.refuse(&error);
                self.last_refusal = Some(error);
                return false;
            }
        };
        if !self.watch.is_new(bytes, stamp) {
            self.counters.repeated += 1;
            return false;
        }
        // Kernel stamps follow a date that can be set back; hal's streams never go back.
        let stamp = match &self.state {
            Some((_, last)) if stamp <= *last => *last + 1,
            _ => stamp,
        };
        self.counters.states += 1;
        self.counters.transformed += u64::from(form == CheckForm::Transformed);
        self.check_form = Some(form);
        self.commander.reported(state.mode, stamp);
        self.deliver(&state, stamp);
        self.state = Some((state, stamp));
        true
    }

    /// Puts what the state says where it can be fetched, each part for itself.
    fn deliver(&mut self, state: &HighState, stamp: Stamp) {
        let body = &state.body;
        let legs = reading::leg_state(body, &self.robot.joints, stamp);
        let imu = reading::imu_sample(body, stamp);
        let attitude = reading::attitude(body, stamp);
        let battery = reading::battery(body, &self.robot.layout, stamp);
        let remote = Remote::decode(&state.remote);
        let counters = &mut self.counters;
        if let (Ok(legs), Ok(imu), Ok(attitude)) = (&legs, &imu, &attitude) {
            let sample = BodySample {
                legs: *legs,
                imu: *imu,
                attitude: *attitude,
            };
            push(&mut self.bodies, sample, counters);
        }
        let ill = &mut self.last_ill;
        let mut noted = |error: FieldError, count: &mut u64| {
            *count += 1;
            *ill = Some(error);
        };
        if let Err(error) = attitude {
            noted(error, &mut counters.ill_imu);
        }
        match legs {
            Ok(sample) => push(&mut self.legs, sample, counters),
            Err(error) => noted(error, &mut counters.ill_legs),
        }
        match imu {
            Ok(sample) => push(&mut self.imu, sample, counters),
            Err(error) => noted(error, &mut counters.ill_imu),
        }
        match battery {
            Ok(sample) => push(&mut self.batteries, sample, counters),
            Err(error) => noted(error, &mut counters.ill_other),
        }
        match remote {
            Ok(remote) => {
                let pressed = remote.keys.holds(self.config.stop_keys);
                push(&mut self.stops, StopSample { stamp, pressed }, counters);
            }
            Err(error) => noted(error, &mut counters.ill_other),
        }
    }

    /// Samples of legs and body together that have come, one after the other; does not listen.
    pub fn next_body(&mut self) -> Option<BodySample> {
        self.bodies.pop_front()
    }

    /// The last of the emergency stop's reports that have come; does not listen.
    pub fn last_stop(&mut self) -> Option<StopSample> {
        let last = self.stops.pop_back();
        self.stops.clear();
        last
    }

    /// The last of the battery's reports that have come; does not listen.
    pub fn last_battery(&mut self) -> Option<BatterySample> {
        let last = self.batteries.pop_back();
        self.batteries.clear();
        last
    }

    /// The next sample of legs and body together; waits until `deadline`.
    ///
    /// # Errors
    /// The socket fails.
    pub fn read_body(&mut self, deadline: Stamp) -> Result<Option<BodySample>, ClientError> {
        self.fetch(deadline, |client| client.bodies.pop_front())
    }

    /// Takes from a queue; where it is empty, listens until something is in it or `deadline`.
    fn fetch<T>(
        &mut self,
        deadline: Stamp,
        mut pop: impl FnMut(&mut Self) -> Option<T>,
    ) -> Result<Option<T>, ClientError> {
        loop {
            if let Some(sample) = pop(self) {
                return Ok(Some(sample));
            }
            if !self.exchange(deadline)? {
                return Ok(None);
            }
        }
    }

    /// How the link is.
    pub fn health(&self, now: Stamp) -> LinkHealth {
        self.watch
            .health(now, self.config.silent_ns, self.config.frozen_ns)
    }

    /// The last state, and when it arrived.
    pub fn state(&self) -> Option<&(HighState, Stamp)> {
        self.state.as_ref()
    }

    /// The remote control as the last state has it; `None` where there is no state or a stick is
    /// nowhere.
    pub fn remote(&self) -> Option<Remote> {
        let (state, _) = self.state.as_ref()?;
        Remote::decode(&state.remote).ok()
    }

    /// In which form the robot sends its check values.
    pub fn check_form(&self) -> Option<CheckForm> {
        self.check_form
    }

    /// Where on the ladder of modes the robot is told to be.
    pub fn rung(&self) -> Option<Rung> {
        self.commander.rung()
    }

    /// What happened so far.
    pub fn counters(&self) -> &ClientCounters {
        &self.counters
    }

    /// Why the last refused frame was refused, and the last ill value was ill.
    pub fn last_refusals(&self) -> (Option<FrameError>, Option<FieldError>) {
        (self.last_refusal, self.last_ill)
    }
}

/// The newest samples stay; the oldest makes room and is counted.
fn push<T>(queue: &mut Waiting<T>, sample: T, counters: &mut ClientCounters) {
    if queue.is_full() {
        queue.pop_front();
        counters.overwritten += 1;
    }
    // There is room now.
    let _ = queue.push_back(sample);
}

impl<L: RobotLink> BaseDrive for HighClient<L> {
    type Error = ClientError;

    fn command(&mut self, command: &BaseCommand, now: Stamp) -> Result<(), ClientError> {
        let silence = match self.health(now) {
            LinkHealth::Silent { for_ns } | LinkHealth::Frozen { for_ns } => Some(for_ns),
            LinkHealth::Alive | LinkHealth::Unheard => None,
        };
        match silence {
            // Stopping is never refused for want of an answer.
            Some(for_ns) if command.moves() => Err(ClientError::NoAnswer {
                robot: self.config.robot,
                for_ms: for_ns / 1_000_000,
            }),
            _ => Ok(self.commander.command(command, now)?),
        }
    }

    fn service(&mut self, now: Stamp) -> Result<BaseStatus, ClientError> {
        self.send(now)
    }
}

impl<L: RobotLink> LegStates for HighClient<L> {
    type Error = ClientError;

    fn read_legs(&mut self, deadline: Stamp) -> Result<Option<LegState>, ClientError> {
        self.fetch(deadline, |client| client.legs.pop_front())
    }
}

impl<L: RobotLink> Imu for HighClient<L> {
    type Error = ClientError;

    fn read(&mut self, deadline: Stamp) -> Result<Option<ImuSample>, ClientError> {
        self.fetch(deadline, |client| client.imu.pop_front())
    }
}

impl<L: RobotLink> Battery for HighClient<L> {
    type Error = ClientError;

    fn read_battery(&mut self, deadline: Stamp) -> Result<Option<BatterySample>, ClientError> {
        self.fetch(deadline, |client| client.batteries.pop_front())
    }
}

impl<L: RobotLink> EmergencyStop for HighClient<L> {
    type Error = ClientError;

    fn read_stop(&mut self, deadline: Stamp) -> Result<Option<StopSample>, ClientError> {
        self.fetch(deadline, |client| client.stops.pop_front())
    }
}
