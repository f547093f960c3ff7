//! Host and simulated robot over the loopback: the real client, the real bytes.
#![cfg(feature = "std")]

use std::net::{Ipv4Addr, SocketAddr, UdpSocket};
use std::time::{Duration, Instant};

use hachi_b1::B1;
use hachi_datagram::SystemClock;
use hachi_go1::GO1;
use hachi_hal::conformance::{check_battery, check_emergency_stop, check_imu, check_legs};
use hachi_hal::{
    BaseAction, BaseCommand, BaseDrive, BodyVelocity, Clock, DeviceError, FaultKind, Imu,
    LegStates, Stamp,
};
use hachi_unitree::Quadruped;
use hachi_unitree::command::{CommandRefused, Mode, Rung};
use hachi_unitree::device::{
    ClientConfig, ClientError, HighClient, KinematicBody, RobotBody, SimulatedRobot,
    SimulatedRobotConfig,
};
use hachi_unitree::frame::{CheckForm, HighCmd, HighState, Key, Keys, Remote};
use hachi_unitree::fresh::LinkHealth;

const MS: i64 = 1_000_000;
/// Nothing here takes a tenth of this on a machine that does nothing else.
const PATIENCE: Duration = Duration::from_secs(20);

/// A kinematic body whose states can be spoilt.
struct Body {
    inner: KinematicBody,
    spoil: fn(&mut HighState),
}

impl RobotBody for Body {
    fn step(&mut self, command: &HighCmd, dt_s: f64) {
        self.inner.step(command, dt_s);
    }
    fn fill(&self, state: &mut HighState) {
        self.inner.fill(state);
        (self.spoil)(state);
    }
}

struct Pair {
    robot: SimulatedRobot<Body>,
    client: HighClient,
    clock: SystemClock,
}

impl Pair {
    fn new(quadruped: &Quadruped, inner: KinematicBody) -> Self {
        let config = SimulatedRobotConfig::for_robot(quadruped);
        let body = Body {
            inner,
            spoil: |_| {},
        };
        let robot = SimulatedRobot::open(&quadruped.layout, body, config).unwrap();
        let clock = SystemClock::new();
        let client = HighClient::open(quadruped, local(quadruped, robot.address()), clock).unwrap();
        Self {
            robot,
            client,
            clock,
        }
    }

    fn standing(quadruped: &Quadruped, height_m: f64) -> Self {
        Self::new(quadruped, KinematicBody::standing(quadruped, height_m))
    }

    /// One millisecond of both.
    fn turn(&mut self) {
        self.robot.step(self.clock.now()).unwrap();
        let deadline = self.clock.now() + MS;
        self.client.exchange(deadline).unwrap();
    }

    /// Turns until something is so.
    #[track_caller]
    fn until(&mut self, what: &str, mut is_so: impl FnMut(&mut Self) -> bool) {
        let begun = Instant::now();
        while !is_so(self) {
            assert!(begun.elapsed() < PATIENCE, "never: {what}");
            self.turn();
        }
    }

    fn act(&mut self, lives_ms: i64, action: BaseAction) -> Result<(), ClientError> {
        let now = self.clock.now();
        let command = BaseCommand {
            stamp: now,
            time_to_live_ns: lives_ms * MS,
            action,
        };
        self.client.command(&command, now)
    }

    fn is_alive(&self) -> bool {
        self.client.health(self.clock.now()) == LinkHealth::Alive
    }
}

fn local(quadruped: &Quadruped, robot: SocketAddr) -> ClientConfig {
    ClientConfig {
        robot,
        local_address: Ipv4Addr::LOCALHOST.into(),
        local_port: 0,
        // A busy machine runs test threads late.
        silent_ns: 2_000 * MS,
        frozen_ns: 2_000 * MS,
        ..ClientConfig::for_robot(quadruped)
    }
}

fn walk(forward: f64) -> BaseAction {
    BaseAction::Move(BodyVelocity {
        forward,
        ..BodyVelocity::ZERO
    })
}

#[test]
fn the_host_speaks_first_and_the_robot_answers_in_its_own_form() {
    for (quadruped, form) in [(GO1, CheckForm::Transformed), (B1, CheckForm::Plain)] {
        let mut pair = Pair::standing(&quadruped, 0.28);
        // Nobody has spoken: the robot says nothing.
        pair.robot.step(pair.clock.now()).unwrap();
        assert_eq!(pair.robot.counters().states, 0);
        pair.until("an answer", |pair| pair.client.counters().states > 3);
        assert_eq!(pair.client.check_form(), Some(form));
        assert_eq!(pair.client.rung(), Some(Rung::Standing));
        // Until it was told something a robot that stands by itself is left so.
        assert_eq!(pair.robot.command().mode, 0);
        assert!(pair.is_alive());
    }
}

#[test]
fn commands_move_the_robot_and_their_death_stops_it() {
    let mut pair = Pair::standing(&GO1, 0.28);
    pair.until("an answer", |pair| pair.client.counters().states > 0);
    pair.act(300, walk(0.5)).unwrap();
    pair.until("a start", |pair| {
        pair.robot.body().inner.velocity().forward == 0.5
    });
    // The host goes on calling, the command dies, and zero velocity is sent.
    pair.until("a stop", |pair| {
        pair.robot.body().inner.velocity().is_zero()
    });
    assert_eq!(pair.robot.counters().stale, 0, "the host told it");
    let [x, y, _] = pair.robot.body().inner.pose();
    assert!(x > 0.0 && y == 0.0, "{x}");
    pair.until("standing", |pair| pair.robot.command().mode == 1);
    // It reports where it is.
    pair.until("its place", |pair| {
        pair.client
            .state()
            .is_some_and(|(state, _)| f64::from(state.position[0]) >= x - 1e-6)
    });
}

#[test]
fn a_host_that_hangs_leaves_the_robot_standing() {
    let mut pair = Pair::standing(&B1, 0.58);
    pair.until("an answer", |pair| pair.client.counters().states > 0);
    pair.act(500, walk(0.3)).unwrap();
    pair.until("a start", |pair| {
        !pair.robot.body().inner.velocity().is_zero()
    });
    // From here on only the robot lives.
    let begun = Instant::now();
    while !pair.robot.body().inner.velocity().is_zero() {
        assert!(begun.elapsed() < PATIENCE);
        pair.robot.step(pair.clock.now()).unwrap();
        std::thread::yield_now();
    }
    assert_eq!(pair.robot.counters().stale, 1);
}

#[test]
fn a_lying_robot_is_got_up_and_walks_only_then() {
    let mut pair = Pair::new(&GO1, KinematicBody::lying(&GO1, 0.28));
    pair.until("an answer", |pair| pair.client.counters().states > 0);
    let refused = pair.act(100, walk(0.2)).unwrap_err();
    assert!(
        matches!(
            refused,
            ClientError::Refused(CommandRefused::NotStanding(Rung::Lying))
        ),
        "{refused}"
    );
    pair.act(100, BaseAction::StandUp).unwrap();
    pair.until("standing", |pair| {
        pair.client.rung() == Some(Rung::Standing) && pair.robot.body().inner.mode() == Mode::Stand
    });
    pair.until("a walk", |pair| {
        let _ = pair.act(100, walk(0.2));
        pair.robot.body().inner.mode() == Mode::Walk
    });
}

#[test]
fn a_robot_that_falls_silent_is_not_moved_and_comes_back() {
    let mut pair = Pair::standing(&GO1, 0.28);
    let mut config = local(&GO1, pair.robot.address());
    (config.silent_ns, config.frozen_ns) = (150 * MS, 300 * MS);
    pair.client = HighClient::open(&GO1, config, pair.clock).unwrap();
    pair.until("an answer", |pair| pair.client.counters().states > 0);
    pair.act(500, walk(0.5)).unwrap();
    let begun = Instant::now();
    while !matches!(
        pair.client.health(pair.clock.now()),
        LinkHealth::Silent { .. }
    ) {
        assert!(begun.elapsed() < PATIENCE);
        let deadline = pair.clock.now() + 10 * MS;
        pair.client.exchange(deadline).unwrap();
    }
    let error = pair.act(500, walk(0.5)).unwrap_err();
    assert!(matches!(error, ClientError::NoAnswer { .. }), "{error}");
    assert_eq!(error.kind(), FaultKind::ReadAgain);
    // Stopping is never refused, and what is sent is standing still.
    pair.act(500, BaseAction::Stop).unwrap();
    let status = pair.client.service(pair.clock.now()).unwrap();
    assert!(status.velocity.is_zero());
    pair.until("it is back", |pair| pair.is_alive());
    assert_eq!(pair.robot.command().velocity, [0.0; 2]);
    pair.until("it walks again", |pair| {
        let _ = pair.act(500, walk(0.5));
        !pair.robot.body().inner.velocity().is_zero()
    });
}

#[test]
fn a_robot_that_repeats_itself_is_frozen() {
    let mut pair = Pair::standing(&GO1, 0.28);
    let mut config = local(&GO1, pair.robot.address());
    config.frozen_ns = 200 * MS;
    pair.client = HighClient::open(&GO1, config, pair.clock).unwrap();
    pair.robot.body_mut().spoil = |state| {
        let place = state.position;
        *state = HighState::of(&GO1.layout);
        state.position = [place[2], 0.0, 0.0];
    };
    pair.until("frozen", |pair| {
        matches!(
            pair.client.health(pair.clock.now()),
            LinkHealth::Frozen { .. }
        )
    });
    assert!(pair.client.counters().repeated > 0);
    let error = pair.act(100, walk(0.1)).unwrap_err();
    assert!(matches!(error, ClientError::NoAnswer { .. }), "{error}");
}

#[test]
fn damaged_and_foreign_datagrams_are_counted_and_left_out() {
    let mut pair = Pair::standing(&GO1, 0.28);
    pair.until("an answer", |pair| pair.client.counters().states > 0);
    let mut bad = HighState::of(&GO1.layout).encode(CheckForm::Plain);
    bad.as_bytes_mut()[100] ^= 1;
    assert!(pair.robot.inject(bad.as_bytes()));
    assert!(pair.robot.inject(&[0; 5_000]));
    let other = HighState::of(&B1.layout).encode(CheckForm::Plain);
    assert!(pair.robot.inject(other.as_bytes()));
    // From another computer.
    let stranger = UdpSocket::bind("127.0.0.2:0").unwrap();
    let good = HighState::of(&GO1.layout).encode(CheckForm::Plain);
    let target = (Ipv4Addr::LOCALHOST, pair.client.local_port());
    stranger.send_to(good.as_bytes(), target).unwrap();
    pair.until("all are seen", |pair| {
        let counters = pair.client.counters();
        counters.wrong_check == 1
            && counters.wrong_length == 2
            && pair.client.foreign_senders() == 1
    });
    let (refusal, _) = pair.client.last_refusals();
    assert!(refusal.is_some());
    // And the robot leaves out what is no command.
    let host = UdpSocket::bind("127.0.0.1:0").unwrap();
    host.send_to(&[1, 2, 3], pair.robot.address()).unwrap();
    pair.until("the robot saw it", |pair| {
        pair.robot.counters().refused == 1
    });
    assert!(pair.is_alive());
}

#[test]
fn an_ill_motor_costs_the_legs_and_not_the_attitude() {
    let mut pair = Pair::standing(&GO1, 0.28);
    pair.robot.body_mut().spoil = |state| state.body.motors[4].angle = f32::NAN;
    pair.until("five states", |pair| pair.client.counters().states >= 5);
    let counters = *pair.client.counters();
    assert!(counters.ill_legs >= 5 && counters.ill_imu == 0);
    let now = pair.clock.now();
    assert!(Imu::read(&mut pair.client, now).unwrap().is_some());
    assert!(pair.client.read_legs(now).unwrap().is_none());
    let (_, ill) = pair.client.last_refusals();
    assert!(ill.unwrap().to_string().contains("joint angle[4]"));
}

#[test]
fn the_client_keeps_the_promises_of_its_devices() {
    let mut pair = Pair::standing(&B1, 0.58);
    pair.until("states", |pair| pair.client.counters().states >= 20);
    let clock = pair.clock;
    let client = &mut pair.client;
    let tally = check_legs(client, &clock, 20, MS).unwrap();
    assert!(tally.items >= 20, "{tally:?}");
    assert!(check_imu(client, &clock, 20, MS).unwrap().items >= 20);
    assert!(check_battery(client, &clock, 20, MS).unwrap().items >= 20);
    let stops = check_emergency_stop(client, &clock, 20, MS).unwrap();
    assert!(stops.items >= 20);
    let sample = client.read_body(clock.now()).unwrap().unwrap();
    assert_eq!(sample.legs.stamp, sample.attitude.stamp);
}

#[test]
fn the_remote_control_s_stop_keys_are_an_emergency_stop() {
    use hachi_hal::EmergencyStop;
    let mut pair = Pair::standing(&GO1, 0.28);
    let pressed = |pair: &mut Pair| {
        let mut last = None;
        while let Some(sample) = pair.client.read_stop(Stamp::default()).unwrap() {
            last = Some(sample.pressed);
        }
        last
    };
    pair.until("states", |pair| pair.client.counters().states >= 3);
    assert_eq!(pressed(&mut pair), Some(false));
    pair.robot.body_mut().spoil = |state| {
        state.remote = Remote {
            keys: Keys::of(&[Key::L2, Key::B]),
            ly: 0.5,
            ..Remote::default()
        }
        .encode();
    };
    pair.until("pressed", |pair| pressed(pair) == Some(true));
    assert!(pair.client.remote().unwrap().is_steered());
}

#[test]
fn samples_that_nobody_fetches_make_room_and_are_counted() {
    let mut pair = Pair::standing(&B1, 0.58);
    pair.until("more than fit", |pair| pair.client.counters().states > 80);
    assert!(pair.client.counters().overwritten > 0);
    let mut fetched = 0;
    let mut last = Stamp::default();
    while let Some(sample) = pair.client.read_legs(Stamp::default()).unwrap() {
        assert!(sample.stamp > last);
        last = sample.stamp;
        fetched += 1;
    }
    assert!((64..80).contains(&fetched), "{fetched}");
}

/// A Go1 sends ten frames for each new one. A host that looks now and then and does not wait must
/// have the newest after one look.
#[test]
fn a_host_that_does_not_wait_is_not_left_behind_by_repeated_frames() {
    use hachi_unitree::device::{MemoryLink, SimulatedService};
    use std::cell::Cell;

    #[derive(Clone)]
    struct Hand(std::rc::Rc<Cell<i64>>);
    impl Clock for Hand {
        fn now(&self) -> Stamp {
            Stamp::from_nanos(self.0.get())
        }
    }
    let hand = Hand(std::rc::Rc::default());
    let link = MemoryLink::new(hand.clone());
    let config = ClientConfig::for_robot(&GO1);
    let mut client = HighClient::over(&GO1, config, link.clone()).unwrap();
    let body = KinematicBody::standing(&GO1, 0.28);
    let config = SimulatedRobotConfig::for_robot(&GO1);
    let mut robot = SimulatedService::new(&GO1.layout, body, config);
    for ms in 1..=1_000 {
        hand.0.set(ms * MS);
        while let Some(frame) = link.heard() {
            robot.hear(&frame, hand.now());
        }
        if let Some(state) = robot.step(hand.now()) {
            link.answer(state.as_bytes());
        }
        if ms % 10 == 0 {
            while client.exchange(hand.now()).unwrap() {}
        }
    }
    // New every 20 ms; the last look was at the last moment.
    let (_, stamp) = client.state().unwrap();
    assert!(hand.now().nanos_since(*stamp) <= 30 * MS, "{stamp}");
    assert!(client.counters().states >= 45, "{:?}", client.counters());
    assert!(matches!(client.health(hand.now()), LinkHealth::Alive));
}
