//! Real-time settings of a thread that controls hardware.
//!
//! Each setting needs a permission that an ordinary user may lack: what is refused is logged with what to try, and control
//! runs without it.

#![allow(
    unsafe_code,
    reason = "the system's call for the scheduling policy has no safe interface"
)]

use std::fmt;
use std::io;

use rustix::mm::MlockAllFlags;
use rustix::process::{Resource, getrlimit};
use rustix::thread::{CapabilitySet, CpuSet};

/// Default priority of control: above what a desktop uses, below the kernel's interrupt threads (50).
pub const DEFAULT_PRIORITY: u8 = 40;
/// Largest priority of `SCHED_FIFO`.
pub const MAX_PRIORITY: u8 = 99;

/// Real-time settings of a thread.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub struct RealTime {
    /// Priority under `SCHED_FIFO`, 1 to [`MAX_PRIORITY`]; `None` leaves the thread under the default policy.
    pub priority: Option<u8>,
    /// The only processor on which the thread runs, counted from 0; `None` for any.
    pub processor: Option<usize>,
    /// Keeps the memory of the whole process from being paged out.
    pub lock_memory: bool,
}

impl Default for RealTime {
    /// [`DEFAULT_PRIORITY`], any processor, locked memory.
    fn default() -> Self {
        Self {
            priority: Some(DEFAULT_PRIORITY),
            processor: None,
            lock_memory: true,
        }
    }
}

impl RealTime {
    /// No setting.
    pub const NONE: Self = Self {
        priority: None,
        processor: None,
        lock_memory: false,
    };

    /// Applies the settings to the calling thread, locks the memory of its process, and returns what the system granted. Logs
    /// what it refused.
    ///
    /// Threads that the calling one starts later do not inherit its priority.
    pub fn apply(&self) -> Self {
        let is_granted = |outcome: Option<io::Result<()>>, what: &str, remedy: &str| match outcome {
            Some(Ok(())) => true,
            Some(Err(error)) => {
                tracing::warn!("control runs without {what}: {error}; {remedy}");
                false
            }
            None => false,
        };
        let priority = is_granted(
            self.priority.map(set_priority),
            "real-time priority",
            "grant CAP_SYS_NICE or a real-time priority (`ulimit -r`)",
        );
        let processor = is_granted(
            self.processor.map(bind),
            "a processor of its own",
            "name one that this machine has and that the process may use",
        );
        let lock_memory = is_granted(
            self.lock_memory.then(lock_memory),
            "locked memory",
            "grant CAP_IPC_LOCK or `ulimit -l unlimited`",
        );
        Self {
            priority: self.priority.filter(|_| priority),
            processor: self.processor.filter(|_| processor),
            lock_memory,
        }
    }
}

/// In words, for people.
impl fmt::Display for RealTime {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.priority {
            Some(priority) => write!(f, "SCHED_FIFO {priority}")?,
            None => write!(f, "no real-time priority")?,
        }
        match self.processor {
            Some(processor) => write!(f, ", processor {processor}")?,
            None => write!(f, ", any processor")?,
        }
        match self.lock_memory {
            true => write!(f, ", memory locked"),
            false => write!(f, ", memory not locked"),
        }
    }
}

fn set_priority(priority: u8) -> io::Result<()> {
    let parameters = libc::sched_param {
        sched_priority: priority.into(),
    };
    let policy = libc::SCHED_FIFO | libc::SCHED_RESET_ON_FORK;
    // SAFETY: `parameters` is only read, and lives longer than the call; 0 is the calling thread.
    match unsafe { libc::sched_setscheduler(0, policy, &raw const parameters) } {
        0 => Ok(()),
        _ => Err(io::Error::last_os_error()),
    }
}

fn bind(processor: usize) -> io::Result<()> {
    if processor >= CpuSet::MAX_CPU {
        return Err(io::Error::from(io::ErrorKind::InvalidInput));
    }
    let mut set = CpuSet::new();
    set.set(processor);
    Ok(rustix::thread::sched_setaffinity(None, &set)?)
}

fn lock_memory() -> io::Result<()> {
    let privileged = rustix::thread::capabilities(None)
        .is_ok_and(|sets| sets.effective.contains(CapabilitySet::IPC_LOCK));
    // With a finite limit later allocations would fail.
    if !privileged && getrlimit(Resource::Memlock).current.is_some() {
        return Err(io::Error::from(io::ErrorKind::PermissionDenied));
    }
    // Pages are locked when they are first used: reserved stacks cost nothing.
    let all = MlockAllFlags::CURRENT | MlockAllFlags::FUTURE | MlockAllFlags::ONFAULT;
    Ok(rustix::mm::mlockall(all)?)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns policy, priority and permitted processors of the calling thread.
    fn schedule() -> (i32, i32, u32) {
        let mut parameters = libc::sched_param { sched_priority: 0 };
        // SAFETY: takes a number; 0 is the calling thread.
        let policy = unsafe { libc::sched_getscheduler(0) };
        // SAFETY: `parameters` is the output, and lives longer than the call.
        assert_eq!(unsafe { libc::sched_getparam(0, &raw mut parameters) }, 0);
        let processors = rustix::thread::sched_getaffinity(None).expect("it is readable");
        (
            policy & !libc::SCHED_RESET_ON_FORK,
            parameters.sched_priority,
            processors.count(),
        )
    }

    #[test]
    fn what_is_reported_is_what_the_thread_has() {
        let permitted = rustix::thread::sched_getaffinity(None).expect("it is readable");
        let last = (0..CpuSet::MAX_CPU).rfind(|processor| permitted.is_set(*processor));
        let asked = RealTime {
            priority: Some(3),
            processor: last,
            lock_memory: false,
        };
        let applied = asked.apply();
        let (policy, priority, processors) = schedule();
        // An ordinary user is refused the priority.
        match applied.priority {
            Some(3) => assert_eq!((policy, priority), (libc::SCHED_FIFO, 3)),
            _ => assert_eq!((policy, priority), (libc::SCHED_OTHER, 0)),
        }
        assert_eq!(applied.processor.map(|_| 1), Some(processors));
        for _ in 0..100 {
            // SAFETY: takes nothing, and returns a number.
            let running_on = unsafe { libc::sched_getcpu() };
            assert_eq!(usize::try_from(running_on).ok(), last);
            std::thread::yield_now();
        }
        let child = std::thread::spawn(schedule).join().expect("it ends");
        assert_eq!(child.0, libc::SCHED_OTHER);
    }

    #[test]
    fn what_is_refused_is_not_reported_as_granted() {
        for processor in [CpuSet::MAX_CPU - 1, CpuSet::MAX_CPU] {
            let asked = RealTime {
                processor: Some(processor),
                ..RealTime::NONE
            };
            assert_eq!(asked.apply(), RealTime::NONE);
        }
        let text = RealTime::NONE.to_string();
        assert_eq!(
            text,
            "no real-time priority, any processor, memory not locked"
        );
        let text = RealTime {
            priority: Some(40),
            processor: Some(1),
            lock_memory: true,
        };
        assert_eq!(
            text.to_string(),
            "SCHED_FIFO 40, processor 1, memory locked"
        );
    }

    /// The kernel's interrupt threads have 50.
    #[test]
    fn control_has_priority_40_and_locked_memory_by_default() {
        let default = RealTime::default();
        let expected = "SCHED_FIFO 40, any processor, memory locked";
        assert_eq!(default.to_string(), expected);
        assert!(default.priority.is_some_and(|priority| priority < 50));
    }
}
