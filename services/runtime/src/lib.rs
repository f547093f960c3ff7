//! Tasks that keep their deadlines: what runs when, for how long it may, and what happens if it
//! does not keep to that.
//!
//! In: tasks ([`Work`]) with their row of the table ([`TaskSpec`]), joined by bounded queues. Out:
//! the same tasks run by threads under real-time scheduling ([`executor::threads`]), or one after
//! the other by a single thread in virtual time ([`executor::virtual_time`]), and what they did
//! ([`telemetry`]).
//!
//! | module | holds |
//! |---|---|
//! | [`task`] | a row of the table; what a task does |
//! | [`queue`], [`bell`] | bounded queues with a policy for when they are full; what wakes a task |
//! | [`ladder`] | three overruns in a row lead a step down, many good runs a step up |
//! | [`table`] | the tasks put together |
//! | [`executor`] | who runs them |
//! | [`realtime`] | scheduling classes, cores, locked memory |
//! | [`histogram`], [`telemetry`], [`prometheus`] | what is measured, and how it is told |
//! | [`health`] | the state of the whole, by name |
//! | [`watchdog`] | bites when it is not fed |
//! | [`notify`] | what systemd is told |
//!
//! Nothing here knows what the tasks compute. Between tasks there is no lock: queues, bells,
//! histograms and health are atomics, so that no task waits for a slower one. Once started, neither
//! executor allocates.

pub mod bell;
pub mod clock;
pub mod executor;
pub mod health;
pub mod histogram;
pub mod ladder;
pub mod notify;
pub mod prometheus;
pub mod queue;
pub mod realtime;
pub mod table;
pub mod task;
pub mod telemetry;
pub mod watchdog;

pub use bell::Bell;
pub use clock::{TaskClock, VirtualClock};
pub use health::{Health, HealthState, Trouble};
pub use histogram::{Histogram, Summary};
pub use queue::{Receiver, Sender, WhenFull, bounded};
pub use table::{Halt, TaskTable};
pub use task::{Overrun, Progress, TaskSpec, Trigger, Work};
pub use telemetry::{TaskRow, Telemetry};
pub use watchdog::SoftWatchdog;
