//! Low timer slack and short time slices for threads with deadlines.

#![allow(
    unsafe_code,
    reason = "the system's calls for scheduling have no safe interface"
)]

use std::time::Duration;

use super::Optimisation;

/// Time slice requested for a thread with deadlines: a shorter slice than others have reduces its
/// wait. Source: the minimum of Linux.
const TIMER_SLICE: Duration = Duration::from_micros(100);

/// Requests low timer slack and a short time slice for the calling thread, for short work with
/// deadlines. Needs no privilege, and takes no processor time from other threads.
///
/// Timers of other threads may be late by 50 µs, so that the system can coalesce them; and a busy
/// program may finish a slice of some milliseconds first. If the system lacks these settings
/// nothing changes. Source: `PR_SET_TIMERSLACK` in prctl(2); the slice of the default policy in
/// sched_setattr(2), supported by Linux since 6.12.
pub fn request_low_timer_slack() {
    if !Optimisation::TimerSlack.is_enabled() {
        return;
    }
    // SAFETY: takes numbers.
    unsafe { libc::prctl(libc::PR_SET_TIMERSLACK, 1 as libc::c_ulong) };
    let mut own = libc::sched_attr {
        size: 0,
        sched_policy: 0,
        sched_flags: 0,
        sched_nice: 0,
        sched_priority: 0,
        sched_runtime: 0,
        sched_deadline: 0,
        sched_period: 0,
    };
    let size = size_of_val(&own);
    // SAFETY: `own` has that size, any bytes in it are one of its values, and it lives longer than the call.
    let asked = unsafe { libc::syscall(libc::SYS_sched_getattr, 0, &raw mut own, size, 0) };
    // Others have no slices.
    if asked == 0 && own.sched_policy == libc::SCHED_OTHER as u32 {
        own.sched_runtime = TIMER_SLICE.as_nanos() as u64;
        // SAFETY: `own` is only read, tells its size, and lives longer than the call.
        unsafe { libc::syscall(libc::SYS_sched_setattr, 0, &raw const own, 0) };
    }
}

#[cfg(all(test, target_os = "linux"))]
mod tests {
    use std::thread;

    use super::*;

    #[test]
    fn only_the_calling_thread_gets_low_timer_slack() {
        // SAFETY: takes numbers, and answers one.
        let slack = || unsafe { libc::prctl(libc::PR_GET_TIMERSLACK) };
        let before = slack();
        assert!(before > 1, "{before}");
        let after = thread::spawn(move || {
            request_low_timer_slack();
            slack()
        });
        assert_eq!((slack(), after.join().unwrap()), (before, 1));
    }
}
