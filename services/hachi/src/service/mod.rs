//! The service: a robot's sensors and base, and the tasks between them. Read [`wiring`] first: it is
//! the flow.
//!
//! In: packets of the LiDAR, states of the robot, pictures of a camera, from sockets and USB or from the simulated robot. Out:
//! a map, a place on it, commands that passed the gate, health and telemetry. The same tasks run by
//! threads (`hachi run`) and in virtual time (`hachi demo`).
//!
//! | module | task | released by |
//! |---|---|---|
//! | [`base`] | `base command`: hears the robot, asks the gate, tells the robot | 5 ms |
//! | [`emergency_stop`] | `emergency stop`: a stop's node on a CAN bus, for the gate; where there is one | 5 ms |
//! | [`lidar`] | `lidar receive`: packets to scans | 4 ms |
//! | [`imu`] | `imu`: an inertial sensor on a bus, for odometry; where there is one | twice a measurement |
//! | [`legs`] | `legs`: footprint and leg odometry | a state of the robot |
//! | [`filter`] | `filter`: obstacles first, then which points are kept | a scan |
//! | [`odometry`] | `odometry`: where the scan was | a filtered scan |
//! | [`slam`] | `slam`: nodes, loops, the map | a placed scan |
//! | [`camera`] | `camera receive`: pictures; where people are looked for | 10 ms |
//! | [`detection`] | `detection`: who is in a picture, what they look like | a picture |
//! | [`tracking`] | `tracking`: who is where, whom the robot knows | a picture that was looked at |
//! | [`behaviour`] | `behaviour`: the patrol | 50 ms |
//! | [`record`] | `recorder`: what sensors sent, to a file; where one is wanted | 50 ms |
//! | [`keeper`] | `keeper`: what is learnt of people, to their store; where there is one | 1 s |
//! | [`supervisor`] | `supervisor`: what is stale, what is wrong | 50 ms |
//!
//! [`orders`] about people come in through [`web`] and are carried out by tracking's [`reception`], which
//! keeps the [`roster`] of who is known, an [`enrolment`], and the [`view`] that the page shows.
//! [`people`] puts the tasks behind the camera together. [`messages`] is what passes between tasks, [`signs`] what each leaves for whoever asks, [`rows`]
//! the table's numbers, [`settings`] the file they come from, [`eyes`] camera and networks, [`simulator`] the other side of the
//! wire, [`web`] what is told over HTTP.

pub mod acquaintances;
pub mod base;
pub mod behaviour;
pub mod body;
pub mod camera;
pub mod crew;
pub mod detection;
pub mod emergency_stop;
pub mod enrolment;
pub mod eyes;
pub mod filter;
pub mod herald;
pub mod imu;
pub mod keeper;
pub mod legs;
pub mod lidar;
pub mod messages;
pub mod odometry;
pub mod orders;
pub mod people;
pub mod reception;
pub mod record;
pub mod roster;
pub mod rows;
pub mod settings;
pub mod signs;
pub mod simulated;
pub mod simulator;
pub mod slam;
pub mod supervisor;
#[cfg(test)]
mod test_people;
pub mod tracking;
pub mod view;
pub mod web;
pub mod wiring;
