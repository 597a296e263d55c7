//! A mutex that a control loop shares with callers of lower priority.
//!
//! With an ordinary mutex a caller that holds it and is preempted by a third thread keeps the loop waiting for as long as that
//! thread runs. The kernel knows who holds this one: while the loop waits, the holder runs at the loop's priority. The loop
//! waits for the rest of one call then, some microseconds.

use std::ops::{Deref, DerefMut};
use std::sync::{Mutex, MutexGuard, PoisonError};

use turn::{Turn, TurnGuard};

/// A mutex whose holder inherits the priority of those who wait for it. Where the system has no such locks, it is an ordinary one.
#[derive(Debug)]
pub(crate) struct InheritingMutex<T> {
    turn: Turn,
    /// Locked by whose turn it is, so that nobody waits for it.
    value: Mutex<T>,
}

/// The lock on an [`InheritingMutex`]; dropping it unlocks.
#[derive(Debug)]
pub(crate) struct InheritingGuard<'a, T> {
    // Dropped in this order: the next one finds the value unlocked.
    value: MutexGuard<'a, T>,
    _turn: TurnGuard<'a>,
}

impl<T> InheritingMutex<T> {
    /// Creates an unlocked mutex.
    pub(crate) fn new(value: T) -> Self {
        Self {
            turn: Turn::default(),
            value: Mutex::new(value),
        }
    }

    /// Locks it; a panic of an earlier holder is ignored. A thread that holds it already waits forever.
    pub(crate) fn lock(&self) -> InheritingGuard<'_, T> {
        let turn = self.turn.take();
        InheritingGuard {
            value: self.value.lock().unwrap_or_else(PoisonError::into_inner),
            _turn: turn,
        }
    }
}

impl<T> Deref for InheritingGuard<'_, T> {
    type Target = T;

    fn deref(&self) -> &T {
        &self.value
    }
}

impl<T> DerefMut for InheritingGuard<'_, T> {
    fn deref_mut(&mut self) -> &mut T {
        &mut self.value
    }
}

#[cfg(target_os = "linux")]
mod turn {
    use std::sync::atomic::{AtomicU32, Ordering};

    use rustix::io::Errno;
    use rustix::thread::futex::{Flags, lock_pi, unlock_pi};

    /// Number of the thread whose turn it is, as the kernel expects it; 0 is nobody's.
    #[derive(Debug, Default)]
    pub(super) struct Turn(AtomicU32);

    /// A turn; dropping it ends it.
    #[derive(Debug)]
    pub(super) struct TurnGuard<'a> {
        /// `None` if the kernel has no such locks.
        taken: Option<&'a AtomicU32>,
    }

    thread_local! {
        static THREAD: u32 = rustix::thread::gettid().as_raw_nonzero().get().cast_unsigned();
    }

    impl Turn {
        /// Waits for the turn of this thread.
        pub(super) fn take(&self) -> TurnGuard<'_> {
            let thread = THREAD.with(|thread| *thread);
            let (acquired, relaxed) = (Ordering::Acquire, Ordering::Relaxed);
            let free = self.0.compare_exchange(0, thread, acquired, relaxed);
            let taken = free.is_ok() || self.wait();
            TurnGuard {
                taken: taken.then_some(&self.0),
            }
        }

        /// Waits in the kernel, which raises the priority of the holder; returns false if it cannot.
        fn wait(&self) -> bool {
            loop {
                match lock_pi(&self.0, Flags::PRIVATE, None) {
                    Ok(()) => return true,
                    // Again: the holder is ending.
                    Err(Errno::INTR | Errno::AGAIN) => {}
                    Err(_) => return false,
                }
            }
        }
    }

    impl Drop for TurnGuard<'_> {
        fn drop(&mut self) {
            let Some(turn) = self.taken else { return };
            let thread = THREAD.with(|thread| *thread);
            let (released, relaxed) = (Ordering::Release, Ordering::Relaxed);
            if turn.compare_exchange(thread, 0, released, relaxed).is_err() {
                // Somebody waits. It fails only for a thread whose turn it is not.
                let _ = unlock_pi(turn, Flags::PRIVATE);
            }
        }
    }
}

#[cfg(not(target_os = "linux"))]
mod turn {
    use std::marker::PhantomData;

    /// Everybody's: the value's own mutex is waited for.
    #[derive(Debug, Default)]
    pub(super) struct Turn;

    #[derive(Debug)]
    pub(super) struct TurnGuard<'a>(PhantomData<&'a Turn>);

    impl Turn {
        pub(super) fn take(&self) -> TurnGuard<'_> {
            TurnGuard(PhantomData)
        }
    }
}

#[cfg(test)]
mod tests {
    use std::panic::{AssertUnwindSafe, catch_unwind};
    use std::sync::Arc;
    use std::thread;

    use super::*;

    #[test]
    fn one_thread_at_a_time_has_the_value() {
        let counter = InheritingMutex::new(0_u32);
        thread::scope(|scope| {
            for _ in 0..4 {
                scope.spawn(|| {
                    for _ in 0..20_000 {
                        let mut counter = counter.lock();
                        let before = *counter;
                        std::hint::spin_loop();
                        *counter = before + 1;
                    }
                });
            }
        });
        assert_eq!(*counter.lock(), 80_000);
    }

    #[test]
    fn a_panic_unlocks_it() {
        let mutex = InheritingMutex::new(1);
        let outcome = catch_unwind(AssertUnwindSafe(|| {
            let mut held = mutex.lock();
            *held = 2;
            panic!("on purpose");
        }));
        assert!(outcome.is_err());
        assert_eq!(*mutex.lock(), 2);
    }

    /// Returns the priority at which the kernel runs a thread of this process, 20 plus its niceness; real-time ones are negative.
    #[cfg(target_os = "linux")]
    fn priority(thread: rustix::thread::Pid) -> i32 {
        let path = format!("/proc/self/task/{}/stat", thread.as_raw_nonzero());
        let text = std::fs::read_to_string(path).expect("the thread runs");
        let (_, fields) = text.rsplit_once(") ").expect("a name in parentheses");
        // The third field of all is the first after the name.
        let field = fields.split(' ').nth(18 - 3).expect("the 18th field");
        field.parse().expect("a number")
    }

    /// Raising the niceness needs no permission, so that no thread of this test needs a real-time priority.
    #[cfg(target_os = "linux")]
    #[test]
    fn the_holder_runs_at_the_priority_of_who_waits() {
        let mutex = Arc::new(InheritingMutex::new(()));
        let (tell, told) = std::sync::mpsc::channel();
        let (release, released) = std::sync::mpsc::channel::<()>();
        let theirs = mutex.clone();
        let holder = thread::spawn(move || {
            rustix::process::setpriority_process(None, 19).expect("anybody may be nice");
            let thread = rustix::thread::gettid();
            let held = theirs.lock();
            tell.send(thread).expect("somebody waits");
            released.recv().expect("somebody releases");
            drop(held);
            priority(thread)
        });
        let thread = told.recv().expect("it is held");
        assert_eq!(priority(thread), 20 + 19);
        let (tell, told) = std::sync::mpsc::channel();
        let waiting = thread::spawn(move || {
            tell.send(rustix::thread::gettid()).expect("somebody asks");
            drop(mutex.lock());
        });
        let above = priority(told.recv().expect("it waits"));
        assert!(above < 20 + 19);
        let end = std::time::Instant::now() + std::time::Duration::from_secs(20);
        while priority(thread) != above {
            assert!(std::time::Instant::now() < end, "the holder stays nice");
            thread::yield_now();
        }
        release.send(()).expect("it holds");
        // It has its own priority again.
        assert_eq!(holder.join().expect("it ends"), 20 + 19);
        waiting.join().expect("it gets the lock");
    }
}
