//! System calls that the standard library has no name for, each behind a safe function.
//!
//! All `unsafe` of the program is here. On systems that lack a call the answer is `None`.
#![allow(unsafe_code)] // the calls below; each block has its argument

/// A soft limit of this process.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Limit {
    /// No limit.
    Unlimited,
    /// So much, in the resource's unit.
    At(u64),
}

/// What is limited.
#[derive(Debug, Clone, Copy)]
pub(super) enum Resource {
    /// Bytes that may be locked in RAM.
    LockedMemory,
    /// The highest real-time priority that may be asked for.
    RealtimePriority,
    /// Files open at once.
    OpenFiles,
}

/// The soft limit on a resource.
#[cfg(target_os = "linux")]
pub(super) fn limit(resource: Resource) -> Option<Limit> {
    let which = match resource {
        Resource::LockedMemory => libc::RLIMIT_MEMLOCK,
        Resource::RealtimePriority => libc::RLIMIT_RTPRIO,
        Resource::OpenFiles => libc::RLIMIT_NOFILE,
    };
    let mut limit = libc::rlimit {
        rlim_cur: 0,
        rlim_max: 0,
    };
    // SAFETY: `limit` is a valid rlimit that lives through the call, which writes only to it.
    let status = unsafe { libc::getrlimit(which, &mut limit) };
    match limit.rlim_cur {
        _ if status != 0 => None,
        libc::RLIM_INFINITY => Some(Limit::Unlimited),
        value => Some(Limit::At(value)),
    }
}

/// Free bytes for this user on the file system that holds `path`.
#[cfg(unix)]
pub(super) fn free_bytes(path: &std::path::Path) -> Option<u64> {
    use std::os::unix::ffi::OsStrExt;
    let path = std::ffi::CString::new(path.as_os_str().as_bytes()).ok()?;
    // SAFETY: a statvfs holds only integers, for which all zeros are a value.
    let mut status: libc::statvfs = unsafe { std::mem::zeroed() };
    // SAFETY: `path` ends in a zero and `status` is valid for writes; both live through the call.
    if unsafe { libc::statvfs(path.as_ptr(), &mut status) } != 0 {
        return None;
    }
    // The fields' widths differ between systems.
    #[allow(clippy::unnecessary_cast, clippy::useless_conversion)]
    let (blocks, size) = (status.f_bavail as u64, status.f_frsize as u64);
    blocks.checked_mul(size)
}

/// Whether the calling thread may run under `SCHED_FIFO`. Tries it at the lowest priority and goes
/// back to ordinary scheduling.
#[cfg(target_os = "linux")]
pub(super) fn may_use_fifo() -> Option<bool> {
    let set = |policy, priority| {
        let parameter = libc::sched_param {
            sched_priority: priority,
        };
        // SAFETY: 0 is the calling thread; `parameter` is valid and lives through the call.
        unsafe { libc::sched_setscheduler(0, policy, &parameter) == 0 }
    };
    let granted = set(libc::SCHED_FIFO, 1);
    if granted {
        set(libc::SCHED_OTHER, 0);
    }
    Some(granted)
}

/// Whether the calling thread may run under `SCHED_DEADLINE`. Tries 1 ms of every 100 ms and goes
/// back to ordinary scheduling.
#[cfg(target_os = "linux")]
pub(super) fn may_use_deadline() -> Option<bool> {
    const MILLISECOND_NS: u64 = 1_000_000;
    let set = |policy: i32, runtime_ns: u64, period_ns: u64| {
        let attributes = libc::sched_attr {
            size: size_of::<libc::sched_attr>() as u32,
            sched_policy: policy as u32,
            sched_flags: 0,
            sched_nice: 0,
            sched_priority: 0,
            sched_runtime: runtime_ns,
            sched_deadline: period_ns,
            sched_period: period_ns,
        };
        // SAFETY: 0 is the calling thread; `attributes` is a whole sched_attr of the size it
        // states and lives through the call, which only reads it.
        unsafe { libc::syscall(libc::SYS_sched_setattr, 0, &attributes, 0) == 0 }
    };
    let granted = set(libc::SCHED_DEADLINE, MILLISECOND_NS, 100 * MILLISECOND_NS);
    if granted {
        set(libc::SCHED_OTHER, 0, 0);
    }
    Some(granted)
}

#[cfg(not(target_os = "linux"))]
pub(super) fn limit(_: Resource) -> Option<Limit> {
    None
}

#[cfg(not(unix))]
pub(super) fn free_bytes(_: &std::path::Path) -> Option<u64> {
    None
}

#[cfg(not(target_os = "linux"))]
pub(super) fn may_use_fifo() -> Option<bool> {
    None
}

#[cfg(not(target_os = "linux"))]
pub(super) fn may_use_deadline() -> Option<bool> {
    None
}
