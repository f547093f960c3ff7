//! What the gate lets pass, and how old what it knows may be.

use serde::{Deserialize, Serialize};

use crate::obstacles::SEEN_M;
use crate::swept::LONGEST_STOP_S;

/// Limits of the gate. A robot's own limits hold besides.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct SafetyConfig {
    /// Fastest forward, m/s.
    pub forward_m_per_s: f64,
    /// Fastest backward, m/s. Slow: no sensor looks there before the robot does.
    pub backward_m_per_s: f64,
    /// Fastest to either side, m/s.
    pub sideways_m_per_s: f64,
    /// Fastest turn, rad/s.
    pub turn_rad_per_s: f64,
    /// How fast it may get faster, m/s².
    pub acceleration_m_per_s2: f64,
    /// How fast it gets slower, m/s².
    pub braking_m_per_s2: f64,
    /// How fast a turn may get faster or slower, rad/s².
    pub turn_acceleration_rad_per_s2: f64,
    /// How long a command that passed moves the robot, s.
    pub command_lives_s: f64,
    /// A pose older than this is stale, s.
    pub localisation_stale_s: f64,
    /// A scan older than this is stale, s.
    pub lidar_stale_s: f64,
    /// Whether the robot may only move while the camera sees.
    pub camera_needed: bool,
    /// An image older than this is stale, s.
    pub camera_stale_s: f64,
    /// The event loop hangs after this, s.
    pub event_loop_stale_s: f64,
    /// An emergency stop that says nothing for this long is taken for pressed, s.
    pub emergency_stop_stale_s: f64,
    /// A robot that sends nothing new for this long is silent, s.
    pub robot_silent_s: f64,
    /// Half the length of the robot with its legs, m.
    pub half_length_m: f64,
    /// Half its width, m.
    pub half_width_m: f64,
    /// Distance to keep from what stands around, m.
    pub margin_m: f64,
    /// From an echo of a laser to a motor that brakes, s.
    pub reaction_s: f64,
    /// What rises less over the ground than this is stepped over, m.
    pub obstacle_low_m: f64,
    /// What hangs higher than this is walked under, m.
    pub obstacle_high_m: f64,
    /// A person is believed to be where it was seen for this long, s: `t_exp`.
    pub person_expires_s: f64,
}

impl Default for SafetyConfig {
    fn default() -> Self {
        Self {
            forward_m_per_s: 0.8,
            backward_m_per_s: 0.3,
            sideways_m_per_s: 0.2,
            turn_rad_per_s: 0.7,
            acceleration_m_per_s2: 0.8,
            braking_m_per_s2: 1.6,
            turn_acceleration_rad_per_s2: 2.0,
            command_lives_s: 0.2,
            localisation_stale_s: 0.5,
            lidar_stale_s: 0.35,
            camera_needed: false,
            camera_stale_s: 0.5,
            event_loop_stale_s: 0.25,
            emergency_stop_stale_s: 0.5,
            robot_silent_s: 0.25,
            half_length_m: 0.65,
            half_width_m: 0.32,
            margin_m: 0.15,
            reaction_s: 0.25,
            obstacle_low_m: 0.12,
            obstacle_high_m: 1.0,
            person_expires_s: 1.0,
        }
    }
}

/// A limit that can't work.
#[derive(Debug, Clone, PartialEq)]
pub struct ConfigError {
    /// The key.
    pub key: &'static str,
    /// What it says.
    pub value: f64,
    /// What it may say.
    pub wanted: &'static str,
}

impl std::fmt::Display for ConfigError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self { key, value, wanted } = self;
        write!(f, "safety.{key} = {value} can't work: give {wanted}")
    }
}

impl std::error::Error for ConfigError {}

impl SafetyConfig {
    /// Refuses what would make the gate blind or the robot faster than anybody means.
    ///
    /// # Errors
    /// The first limit that can't work.
    pub fn check(&self) -> Result<(), ConfigError> {
        const SPEED: (f64, f64, &str) = (0.0, 5.0, "0 to 5 m/s");
        const TURN: (f64, f64, &str) = (0.0, 6.0, "0 to 6 rad/s: radians, not degrees");
        const RATE: (f64, f64, &str) = (0.05, 20.0, "0.05 to 20");
        const AGE: (f64, f64, &str) = (0.02, 5.0, "0.02 to 5 s: seconds, not milliseconds");
        const SIZE: (f64, f64, &str) = (0.05, 3.0, "0.05 to 3 m: metres, not millimetres");
        let fields = [
            ("forward_m_per_s", self.forward_m_per_s, SPEED),
            ("backward_m_per_s", self.backward_m_per_s, SPEED),
            ("sideways_m_per_s", self.sideways_m_per_s, SPEED),
            ("turn_rad_per_s", self.turn_rad_per_s, TURN),
            ("acceleration_m_per_s2", self.acceleration_m_per_s2, RATE),
            ("braking_m_per_s2", self.braking_m_per_s2, RATE),
            (
                "turn_acceleration_rad_per_s2",
                self.turn_acceleration_rad_per_s2,
                RATE,
            ),
            (
                "command_lives_s",
                self.command_lives_s,
                (0.02, 0.5, "0.02 to 0.5 s"),
            ),
            ("localisation_stale_s", self.localisation_stale_s, AGE),
            ("lidar_stale_s", self.lidar_stale_s, AGE),
            ("camera_stale_s", self.camera_stale_s, AGE),
            ("event_loop_stale_s", self.event_loop_stale_s, AGE),
            ("emergency_stop_stale_s", self.emergency_stop_stale_s, AGE),
            ("robot_silent_s", self.robot_silent_s, AGE),
            ("half_length_m", self.half_length_m, SIZE),
            ("half_width_m", self.half_width_m, SIZE),
            ("margin_m", self.margin_m, (0.0, 2.0, "0 to 2 m")),
            ("reaction_s", self.reaction_s, (0.0, 2.0, "0 to 2 s")),
            (
                "obstacle_low_m",
                self.obstacle_low_m,
                (0.01, 0.5, "0.01 to 0.5 m"),
            ),
            (
                "obstacle_high_m",
                self.obstacle_high_m,
                (0.1, 4.0, "0.1 to 4 m"),
            ),
            ("person_expires_s", self.person_expires_s, AGE),
        ];
        for (key, value, (least, most, wanted)) in fields {
            // Not-a-number is in no range.
            if !(least..=most).contains(&value) {
                return Err(ConfigError { key, value, wanted });
            }
        }
        self.check_stopping()
    }

    /// Refuses a robot that needs longer to stop, or more room, than the obstacle stop looks ahead.
    fn check_stopping(&self) -> Result<(), ConfigError> {
        let ahead = self.forward_m_per_s.max(self.backward_m_per_s);
        let speed = ahead.hypot(self.sideways_m_per_s);
        let brakes_s = (speed / self.braking_m_per_s2)
            .max(self.turn_rad_per_s / self.turn_acceleration_rad_per_s2);
        let way_m = speed * (self.reaction_s + 0.5 * speed / self.braking_m_per_s2);
        let room_m = self.half_length_m.hypot(self.half_width_m) + self.margin_m + way_m;
        if self.reaction_s + brakes_s > LONGEST_STOP_S || room_m > SEEN_M {
            return Err(ConfigError {
                key: "braking_m_per_s2",
                value: self.braking_m_per_s2,
                wanted: "harder brakes, or less speed or reaction time: it has to stand within 3.9 s and 4.9 m",
            });
        }
        Ok(())
    }

    /// Radius of the safety circle around a followed person, m: `1.4 v_max t_exp`. A person that
    /// stands while the robot goes on to where it was last seen is not reached before the robot
    /// knows that it lost them.
    pub fn safety_circle_m(&self) -> f64 {
        1.4 * self.forward_m_per_s * self.person_expires_s
    }
}
