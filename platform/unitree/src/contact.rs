//! Which feet stand on the ground, and how far that can be believed.
//!
//! In: a leg state, the direction of up, how the body turns. Out: for each foot whether it stands,
//! how surely, and the load that its torques tell; and from which source. Three sources are
//! followed side by side: foot sensors, torques (static vertical force, `J' f = -tau`), and bare
//! kinematics (feet that are lowest and keep still against each other).
//!
//! Foot sensors count in a unit of their own from a zero of their own, both different from foot to
//! foot and drifting with temperature: the zero is learnt while the torques say that the foot is in
//! the air, the unit while they say that it stands. Until then, and where sensors and torques
//! disagree, the sensors are not used: a B1's are constant on many robots, a Go1's are all zero on
//! old firmware.

use hachi_hal::{Leg, LegKinematics, LegState, Stamp, Vector3};

/// Where the answer comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum ContactSource {
    /// Foot sensors.
    FootForce,
    /// Joint torques.
    Torque,
    /// Joint angles and speeds alone.
    Kinematics,
}

impl ContactSource {
    /// In words.
    pub const fn name(self) -> &'static str {
        match self {
            Self::FootForce => "foot force",
            Self::Torque => "torque",
            Self::Kinematics => "kinematics",
        }
    }
}

/// Two thresholds: standing begins above one and ends below the other.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Hysteresis {
    /// Standing begins here.
    pub touch: f64,
    /// Standing ends here: below `touch`.
    pub release: f64,
}

impl Hysteresis {
    fn step(&self, standing: bool, value: f64) -> bool {
        value > if standing { self.release } else { self.touch }
    }

    /// 0 at the lower threshold, 1 at twice the upper one.
    fn confidence(&self, value: f64) -> f64 {
        let full = 2.0 * self.touch - self.release;
        ((value - self.release) / full).clamp(0.0, 1.0)
    }
}

/// How a robot's feet tell that they stand.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ContactConfig {
    /// Counts that a foot sensor shows above its zero under a quarter of the robot's weight, as far
    /// as is known before it is learnt; `None` where the sensors are not to be used at all.
    pub counts_per_share: Option<f64>,
    /// Thresholds of the load, as shares of a quarter of the robot's weight.
    pub load: Hysteresis,
}

impl ContactConfig {
    /// Half of a foot's share when standing, and a third: a trot loads a foot with twice its share,
    /// and a swinging leg's own weight and acceleration look like up to a third of it.
    pub const LOAD: Hysteresis = Hysteresis {
        touch: 0.5,
        release: 0.33,
    };
}

/// One foot.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct FootContact {
    /// Whether it stands.
    pub standing: bool,
    /// How surely, 0 to 1. Rises in the first moments of a step.
    pub confidence: f64,
    /// The ground's upward push as the torques tell it, N; the leg's own weight is not taken off.
    pub vertical_force: f64,
}

/// All four feet.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Contacts {
    /// When.
    pub stamp: Stamp,
    /// Feet, by [`Leg`].
    pub feet: [FootContact; 4],
    /// From what.
    pub source: ContactSource,
}

impl Contacts {
    /// How many feet stand.
    pub fn standing(&self) -> usize {
        self.feet.iter().filter(|foot| foot.standing).count()
    }
}

/// What the detector is given beside the legs.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ContactInput<'a> {
    /// Joints and feet.
    pub legs: &'a LegState,
    /// Unit vector up, base frame.
    pub up: Vector3,
    /// Unit vector off the ground, base frame, where the ground is known; otherwise up.
    pub ground_normal: Vector3,
    /// Angular velocity, base frame, rad/s.
    pub angular_velocity: Vector3,
}

/// A foot that has just touched is fully trusted after this long, ns: rubber settles.
const SETTLING_NS: i64 = 15_000_000;
/// Without torques, feet this near to the lowest one stand, and those farther than twice that do
/// not, metres.
const LOW_M: f64 = 0.01;
/// Without torques, feet that move faster than this against the lowest one do not stand, m/s.
const STILL_M_PER_S: f64 = 0.4;
/// Confidence of a foot of which only the place is known.
const KINEMATIC_CONFIDENCE: f64 = 0.5;
/// Time over which agreement of sensors and torques is judged, s.
const JUDGED_OVER_S: f64 = 1.0;
/// The sensors are not used above this share of disagreement, and used again below the other.
const DISTRUST: Hysteresis = Hysteresis {
    touch: 0.35,
    release: 0.15,
};
/// A foot teaches its sensor's zero after it has been in the air for this long, and its unit after
/// it has stood for this long, ns.
const STEADY_NS: i64 = 30_000_000;
/// Time in which zero and unit are first learnt, s, and in which they follow the drift afterwards.
const FIRST_S: f64 = 0.1;
const DRIFT_S: f64 = 10.0;
/// Time of learning after which they are known, s.
const KNOWN_S: f64 = 0.3;
/// A sensor that shows less than this many counts for a foot's share feels no load.
const LEAST_COUNTS: f64 = 8.0;
/// Gaps longer than this teach nothing, s.
const LONGEST_STEP_S: f64 = 0.1;

/// A value that is learnt at moments that are steady.
#[derive(Debug, Clone, Copy)]
struct Learnt {
    value: f64,
    for_s: f64,
    steady_since: Option<Stamp>,
}

impl Learnt {
    const fn from(value: f64) -> Self {
        Self {
            value,
            for_s: 0.0,
            steady_since: None,
        }
    }

    fn learn(&mut self, seen: f64, steady: bool, now: Stamp, dt_s: f64) {
        if !steady {
            self.steady_since = None;
            return;
        }
        let since = *self.steady_since.get_or_insert(now);
        if now.nanos_since(since) < STEADY_NS {
            return;
        }
        let over_s = if self.is_known() { DRIFT_S } else { FIRST_S };
        self.value += (seen - self.value) * (dt_s / over_s).min(1.0);
        self.for_s = (self.for_s + dt_s).min(KNOWN_S);
    }

    fn is_known(&self) -> bool {
        self.for_s >= KNOWN_S
    }
}

/// One foot's sensor.
#[derive(Debug, Clone, Copy)]
struct Sensor {
    /// Counts in the air.
    zero: Learnt,
    /// Counts above zero per share of load.
    unit: Learnt,
}

impl Sensor {
    /// The load, in shares; `None` while it can't be told.
    fn load(&self, raw: f64) -> Option<f64> {
        let tells = self.zero.is_known() && self.unit.value >= LEAST_COUNTS;
        tells.then(|| (raw - self.zero.value) / self.unit.value)
    }
}

/// Follows the feet of one robot.
#[derive(Debug, Clone)]
pub struct ContactDetector<K> {
    legs: K,
    config: ContactConfig,
    /// A quarter of the robot's weight, N.
    share_n: f64,
    sensors: [Sensor; 4],
    by_force: [bool; 4],
    by_torque: [bool; 4],
    by_place: [bool; 4],
    /// Share of recent time in which the sensors disagreed with the other source.
    disagreement: f64,
    distrusted: bool,
    touched: [Option<Stamp>; 4],
    last: Option<Stamp>,
}

impl<K: LegKinematics> ContactDetector<K> {
    /// A detector for a robot of this weight.
    pub fn new(legs: K, config: ContactConfig, mass_kg: f64) -> Self {
        const GRAVITY: f64 = 9.80665;
        Self {
            legs,
            config,
            share_n: mass_kg * GRAVITY / 4.0,
            sensors: [Sensor {
                zero: Learnt::from(0.0),
                unit: Learnt::from(config.counts_per_share.unwrap_or(0.0)),
            }; 4],
            by_force: [false; 4],
            by_torque: [false; 4],
            by_place: [false; 4],
            disagreement: 0.0,
            distrusted: false,
            touched: [None; 4],
            last: None,
        }
    }

    /// Counts that each foot's sensor shows in the air, as learnt so far.
    pub fn zeros(&self) -> [f64; 4] {
        self.sensors.map(|sensor| sensor.zero.value)
    }

    /// The feet at one moment.
    pub fn step(&mut self, input: &ContactInput<'_>) -> Contacts {
        let now = input.legs.stamp;
        let dt_s = self.last.map_or(0.0, |last| now.secs_since(last));
        let dt_s = dt_s.clamp(0.0, LONGEST_STEP_S);
        self.last = Some(now);

        let has_torques = input.legs.torques.iter().any(|t| *t != Vector3::zeros());
        let forces = self.vertical_forces(input);
        self.follow_places(input);
        let loads = forces.map(|force| force / self.share_n);
        for (standing, load) in self.by_torque.iter_mut().zip(loads) {
            *standing = self.config.load.step(*standing, load);
        }
        let torque_loads = has_torques.then_some(&loads);
        let reference = match torque_loads {
            Some(_) => self.by_torque,
            None => self.by_place,
        };
        let sensed = self.follow_sensors(input, torque_loads, &reference, dt_s);

        let (source, standing, loads) = match (sensed, torque_loads) {
            (Some(sensed), _) if !self.distrusted => {
                (ContactSource::FootForce, self.by_force, Some(sensed))
            }
            (_, Some(_)) => (ContactSource::Torque, self.by_torque, Some(loads)),
            _ => (ContactSource::Kinematics, self.by_place, None),
        };
        let feet = core::array::from_fn(|i| {
            let sureness = loads.map_or(KINEMATIC_CONFIDENCE, |loads| {
                self.config.load.confidence(loads[i])
            });
            let settled = self.settled(i, standing[i], now);
            FootContact {
                standing: standing[i],
                confidence: if standing[i] { sureness * settled } else { 0.0 },
                vertical_force: forces[i],
            }
        });
        Contacts {
            stamp: now,
            feet,
            source,
        }
    }

    /// How far a foot has settled since it touched, 0 to 1.
    fn settled(&mut self, foot: usize, standing: bool, now: Stamp) -> f64 {
        if !standing {
            self.touched[foot] = None;
            return 0.0;
        }
        let since = *self.touched[foot].get_or_insert(now);
        (now.nanos_since(since) as f64 / SETTLING_NS as f64).clamp(0.0, 1.0)
    }

    /// The ground's upward push on each foot, N. A leg that is stretched so far that its torques
    /// say nothing about the push is taken as unloaded.
    fn vertical_forces(&self, input: &ContactInput<'_>) -> [f64; 4] {
        Leg::ALL.map(|leg| {
            let i = leg.index();
            let jacobian = self.legs.jacobian(leg, &input.legs.angles[i]);
            let inverse = jacobian.transpose().try_inverse();
            let push = inverse.map_or_else(Vector3::zeros, |inv| inv * -input.legs.torques[i]);
            let up = push.dot(&input.up);
            if up.is_finite() { up } else { 0.0 }
        })
    }

    fn follow_places(&mut self, input: &ContactInput<'_>) {
        let legs = input.legs;
        let height = Leg::ALL.map(|leg| {
            let foot = self.legs.foot_in_base(leg, &legs.angles[leg.index()]);
            foot.dot(&input.ground_normal)
        });
        let speed = Leg::ALL.map(|leg| {
            let i = leg.index();
            let foot = self.legs.foot_in_base(leg, &legs.angles[i]);
            self.legs.jacobian(leg, &legs.angles[i]) * legs.speeds[i]
                + input.angular_velocity.cross(&foot)
        });
        let lowest = (0..4)
            .min_by(|&a, &b| height[a].total_cmp(&height[b]))
            .unwrap_or(0);
        for i in 0..4 {
            let within = if self.by_place[i] { 2.0 * LOW_M } else { LOW_M };
            let low = height[i] - height[lowest] < within;
            let still = (speed[i] - speed[lowest]).norm() < STILL_M_PER_S;
            self.by_place[i] = low && still;
        }
    }

    /// What the foot sensors say, in shares; `None` where there are none to use.
    fn follow_sensors(
        &mut self,
        input: &ContactInput<'_>,
        torque_loads: Option<&[f64; 4]>,
        reference: &[bool; 4],
        dt_s: f64,
    ) -> Option<[f64; 4]> {
        self.config.counts_per_share?;
        let (raw, now) = (input.legs.foot_forces, input.legs.stamp);
        if raw == [0.0; 4] {
            return None;
        }
        let mut loads = [Some(0.0); 4];
        for (i, sensor) in self.sensors.iter_mut().enumerate() {
            let load = torque_loads.map_or(1.0, |loads| loads[i]);
            sensor.zero.learn(raw[i], !reference[i], now, dt_s);
            // Only torques know how much load there is.
            let loaded = torque_loads.is_some() && reference[i] && sensor.zero.is_known();
            let unit = (raw[i] - sensor.zero.value) / load.max(self.config.load.release);
            sensor.unit.learn(unit, loaded, now, dt_s);
            loads[i] = sensor.load(raw[i]);
        }
        let [Some(a), Some(b), Some(c), Some(d)] = loads else {
            return None;
        };
        let loads = [a, b, c, d];
        let mut differ = 0.0;
        for i in 0..4 {
            self.by_force[i] = self.config.load.step(self.by_force[i], loads[i]);
            differ += f64::from(u8::from(self.by_force[i] != reference[i])) / 4.0;
        }
        self.disagreement += (differ - self.disagreement) * (dt_s / JUDGED_OVER_S).min(1.0);
        self.distrusted = DISTRUST.step(self.distrusted, self.disagreement);
        Some(loads)
    }
}
