//! Scheduling policy and priority of threads.
//!
//! A policy applies to all threads of the process, or to the thread of one connection
//! ([`DedicatedThread`](crate::port::dedicated_thread::DedicatedThread)). Later threads inherit the
//! policy of the thread that starts them; but the real-time priority of one connection is not
//! inherited (`SCHED_RESET_ON_FORK`, see sched(7)).
//!
//! Policies have the system's numbers: 0 is the default one, 1 and 2 are real-time (`SCHED_FIFO`,
//! `SCHED_RR`, with priorities 1 to 99), 3 is for batches, 5 for an otherwise idle system.

#![allow(
    unsafe_code,
    reason = "the system's calls for scheduling have no safe interface"
)]

use std::collections::HashSet;
use std::io;

/// A policy, and the priority within it.
#[derive(Clone, Copy, Debug, Default, Eq, PartialEq)]
pub(crate) struct Schedule {
    pub(crate) policy: i32,
    pub(crate) priority: i32,
}

/// Returns the number of the thread that asks.
pub(crate) fn thread() -> i32 {
    // SAFETY: takes nothing, and cannot fail.
    unsafe { libc::gettid() }
}

impl Schedule {
    /// Returns the schedule of the calling thread.
    pub(crate) fn now() -> io::Result<Self> {
        Self::of(0)
    }

    /// Returns the schedule of a thread of this process; 0 is the calling one.
    pub(crate) fn of(thread: i32) -> io::Result<Self> {
        let mut parameters = libc::sched_param { sched_priority: 0 };
        // SAFETY: takes a number.
        let policy = checked(unsafe { libc::sched_getscheduler(thread) })?;
        // SAFETY: `parameters` is the output, and lives longer than the call.
        checked(unsafe { libc::sched_getparam(thread, &raw mut parameters) })?;
        Ok(Self {
            policy: policy & !libc::SCHED_RESET_ON_FORK,
            priority: parameters.sched_priority,
        })
    }

    /// Gives it to all threads of this process; nothing is changed if the first one cannot have it.
    pub(crate) fn set(self) -> io::Result<()> {
        let mut done = HashSet::new();
        // A thread that begins meanwhile may have been started by one of the others.
        loop {
            let new: Vec<_> = threads()?
                .into_iter()
                .filter(|thread| !done.contains(thread))
                .collect();
            if new.is_empty() {
                return Ok(());
            }
            for thread in new {
                match self.set_one(thread) {
                    // It has ended.
                    Err(error) if error.raw_os_error() == Some(libc::ESRCH) => {}
                    set => set?,
                }
                done.insert(thread);
            }
        }
    }

    /// Applies the schedule like [`Schedule::give`] to the calling thread; returns its id.
    pub(crate) fn apply_to_current_thread(self) -> io::Result<i32> {
        self.give(0)?;
        Ok(thread())
    }

    /// Applies the schedule to one thread, 0 being the calling one; threads that it starts do not
    /// inherit a real-time priority.
    pub(crate) fn give(self, thread: i32) -> io::Result<()> {
        let alone = Self {
            policy: self.policy | libc::SCHED_RESET_ON_FORK,
            ..self
        };
        alone.set_one(thread)
    }

    fn set_one(self, thread: i32) -> io::Result<()> {
        let parameters = libc::sched_param {
            sched_priority: self.priority,
        };
        // SAFETY: `parameters` is only read, and lives longer than the call.
        checked(unsafe { libc::sched_setscheduler(thread, self.policy, &raw const parameters) })?;
        Ok(())
    }
}

/// Returns the reason why the system refuses a schedule, and what to try.
pub(crate) fn reason(error: &io::Error) -> String {
    match error.raw_os_error() {
        Some(libc::EPERM) => format!(
            "{error}: the process needs CAP_SYS_NICE, or a limit of real-time priority \
             (`ulimit -r`) that is high enough"
        ),
        Some(libc::EINVAL) => {
            format!("{error}: there is no such policy, or it has no such priority")
        }
        _ => error.to_string(),
    }
}

/// Returns the threads of this process.
fn threads() -> io::Result<Vec<i32>> {
    let mut threads = Vec::new();
    for entry in std::fs::read_dir("/proc/self/task")? {
        let name = entry?.file_name();
        threads.extend(name.to_str().and_then(|name| name.parse::<i32>().ok()));
    }
    Ok(threads)
}

fn checked(result: i32) -> io::Result<i32> {
    match result {
        0.. => Ok(result),
        _ => Err(io::Error::last_os_error()),
    }
}
