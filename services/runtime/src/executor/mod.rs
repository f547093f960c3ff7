//! Who runs the tasks: threads in real time, or one thread in virtual time. The tasks are the same.

pub mod threads;
pub mod virtual_time;
