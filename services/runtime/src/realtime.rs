//! What the kernel is asked for: scheduling classes, cores, memory that stays.
//!
//! In: a row of the task table, for the calling thread. Out: what was granted. Everything here is a
//! wish: without the rights for it a task runs under the normal scheduler and says so.
//!
//! `SCHED_DEADLINE` enforces a budget: the kernel sets aside `budget` in each period and lets the
//! task wait for the next one when it is used up (`man 7 sched`). It takes no thread that is bound to
//! a core, and takes the rest of the budget from one that yields, so that tasks with a core of their
//! own or with helpers run under `SCHED_FIFO`.
#![allow(
    unsafe_code,
    reason = "the standard library has no calls for any of this"
)]

use std::io;

use crate::task::TaskSpec;

/// How a thread is scheduled.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u8)]
pub enum Scheduling {
    /// By one thread in turn.
    Virtual = 0,
    /// As any program.
    Normal = 1,
    /// Before any normal one, by priority.
    Fifo = 2,
    /// With its budget set aside, and held to it.
    Deadline = 3,
}

impl Scheduling {
    /// Its name.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Virtual => "virtual",
            Self::Normal => "normal",
            Self::Fifo => "SCHED_FIFO",
            Self::Deadline => "SCHED_DEADLINE",
        }
    }

    pub(crate) const fn of_code(code: u8) -> Self {
        match code {
            1 => Self::Normal,
            2 => Self::Fifo,
            3 => Self::Deadline,
            _ => Self::Virtual,
        }
    }
}

/// `struct sched_attr` of the kernel, first version (`sched_setattr(2)`).
#[repr(C)]
#[derive(Default)]
struct SchedAttr {
    size: u32,
    policy: u32,
    flags: u64,
    nice: i32,
    priority: u32,
    runtime_ns: u64,
    deadline_ns: u64,
    period_ns: u64,
}

const SCHED_DEADLINE: u32 = 6;
/// Threads that a real-time thread starts are normal ones.
const RESET_ON_FORK: u64 = 1;
/// The kernel takes no shorter budget.
const LEAST_RUNTIME_NS: i64 = 1_024;

/// Schedules the calling thread as its row wants, as well as the kernel lets it.
pub fn schedule(spec: &TaskSpec) -> Scheduling {
    if spec.core.is_none() && !spec.parallel && deadline(spec).is_ok() {
        return Scheduling::Deadline;
    }
    if let Some(core) = spec.core
        && let Err(error) = pin(core)
    {
        tracing::debug!(task = spec.name, core, %error, "no core of its own");
    }
    match fifo(spec.priority) {
        Ok(()) => Scheduling::Fifo,
        Err(_) => Scheduling::Normal,
    }
}

fn deadline(spec: &TaskSpec) -> io::Result<()> {
    let period_ns = spec.trigger.interval_ns().max(LEAST_RUNTIME_NS);
    let period = period_ns.unsigned_abs();
    let attributes = SchedAttr {
        size: size_of::<SchedAttr>() as u32,
        policy: SCHED_DEADLINE,
        flags: RESET_ON_FORK,
        runtime_ns: spec
            .budget_ns
            .clamp(LEAST_RUNTIME_NS, period_ns)
            .unsigned_abs(),
        deadline_ns: period,
        period_ns: period,
        ..SchedAttr::default()
    };
    set(&attributes)
}

/// Puts the calling thread before all normal ones: `SCHED_FIFO` at this priority (1 to 99).
///
/// # Errors
/// The process has no right to (`CAP_SYS_NICE`, or `LimitRTPRIO`).
pub fn fifo(priority: u8) -> io::Result<()> {
    set(&SchedAttr {
        size: size_of::<SchedAttr>() as u32,
        policy: libc::SCHED_FIFO as u32,
        flags: RESET_ON_FORK,
        priority: u32::from(priority.clamp(1, 99)),
        ..SchedAttr::default()
    })
}

fn set(attributes: &SchedAttr) -> io::Result<()> {
    const THIS_THREAD: libc::pid_t = 0;
    const NO_FLAGS: libc::c_uint = 0;
    // SAFETY: the kernel reads `size` bytes of a structure of that size and layout that lives
    // through the call, and changes no memory of ours.
    let result = unsafe {
        libc::syscall(
            libc::SYS_sched_setattr,
            THIS_THREAD,
            std::ptr::from_ref(attributes),
            NO_FLAGS,
        )
    };
    match result {
        0 => Ok(()),
        _ => Err(io::Error::last_os_error()),
    }
}

/// Binds the calling thread to a core.
///
/// # Errors
/// There is no such core, or it is not ours.
pub fn pin(core: usize) -> io::Result<()> {
    // SAFETY: all zeros is the empty set; the macro writes within the set's size, which is checked
    // first; the kernel only reads it.
    let result = unsafe {
        let mut set: libc::cpu_set_t = std::mem::zeroed();
        if core >= 8 * size_of::<libc::cpu_set_t>() {
            return Err(io::ErrorKind::InvalidInput.into());
        }
        libc::CPU_SET(core, &mut set);
        libc::sched_setaffinity(0, size_of::<libc::cpu_set_t>(), &set)
    };
    match result {
        0 => Ok(()),
        _ => Err(io::Error::last_os_error()),
    }
}

/// Stack of a task's thread that is touched before it starts, bytes.
const STACK_BYTES: usize = 256 << 10;

/// Touches the calling thread's stack, so that no run has to wait for a page.
#[inline(never)]
pub fn touch_stack() {
    let mut stack = [0u8; STACK_BYTES];
    for page in stack.chunks_mut(4096) {
        page[0] = 1;
    }
    std::hint::black_box(&stack);
}

/// Why memory is not locked.
#[derive(Debug, thiserror::Error)]
pub enum LockError {
    /// The process may lock too little: beyond the limit every allocation would fail.
    #[error("the limit for locked memory is {0} bytes: set LimitMEMLOCK=infinity")]
    Limit(u64),
    /// The kernel refused.
    #[error("memory can't be locked: {0}")]
    Refused(#[from] io::Error),
}

/// Locks all memory of the process, now and later, so that nothing has to be read back from disk.
///
/// # Errors
/// The limit is not infinite, or the kernel refuses.
pub fn lock_memory() -> Result<(), LockError> {
    let mut limit = libc::rlimit {
        rlim_cur: 0,
        rlim_max: 0,
    };
    // SAFETY: the kernel writes the structure, which lives through the call.
    if unsafe { libc::getrlimit(libc::RLIMIT_MEMLOCK, &mut limit) } != 0 {
        return Err(io::Error::last_os_error().into());
    }
    if limit.rlim_cur != libc::RLIM_INFINITY {
        return Err(LockError::Limit(limit.rlim_cur));
    }
    // SAFETY: no memory of ours is changed.
    match unsafe { libc::mlockall(libc::MCL_CURRENT | libc::MCL_FUTURE) } {
        0 => Ok(()),
        _ => Err(io::Error::last_os_error().into()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::task::{Overrun, Trigger};

    /// What `sched_getscheduler` says of this thread: not what we think we set.
    fn policy() -> i32 {
        // SAFETY: reads the calling thread's policy.
        unsafe { libc::sched_getscheduler(0) & !libc::SCHED_RESET_ON_FORK }
    }

    #[test]
    fn the_kernel_agrees_with_what_is_said_to_be_granted() {
        let spec = TaskSpec {
            name: "probe",
            trigger: Trigger::Period {
                period_ns: 100_000_000,
            },
            budget_ns: 1_000_000,
            priority: 10,
            core: None,
            parallel: false,
            overrun: Overrun::Skip,
            hard: false,
            ladder: &[],
        };
        let (granted, policy) = std::thread::spawn(move || (schedule(&spec), policy()))
            .join()
            .unwrap();
        let expected = match granted {
            Scheduling::Deadline => SCHED_DEADLINE as i32,
            Scheduling::Fifo => libc::SCHED_FIFO,
            _ => libc::SCHED_OTHER,
        };
        assert_eq!(policy, expected, "{granted:?}");
    }

    #[test]
    fn a_thread_keeps_to_the_core_it_is_bound_to() {
        let core = std::thread::spawn(|| {
            pin(0).unwrap();
            // SAFETY: reads where the calling thread runs.
            unsafe { libc::sched_getcpu() }
        });
        assert_eq!(core.join().unwrap(), 0);
        assert!(pin(1_000_000).is_err());
    }
}
