//! The allocator of the C library.
#![allow(
    unsafe_code,
    reason = "settings of the allocator have no safe interface"
)]

/// Bounds the number of arenas, unless the environment chooses it (`MALLOC_ARENA_MAX`).
///
/// Each keeps memory that was freed in it, and the default is eight for each processor: what large messages of peers took stayed
/// that many times.
#[cfg(all(target_os = "linux", target_env = "gnu"))]
pub(crate) fn bound_arenas() {
    if std::env::var_os("MALLOC_ARENA_MAX").is_some() {
        return;
    }
    let processors = std::thread::available_parallelism().map_or(1, usize::from);
    let arenas = i32::try_from(processors.max(MIN_ARENAS)).unwrap_or(i32::MAX);
    // SAFETY: the call sets a number, and is allowed at any time.
    if unsafe { libc::mallopt(libc::M_ARENA_MAX, arenas) } == 0 {
        tracing::debug!("the allocator takes no bound of {arenas} arenas");
    }
}

/// Arenas for workers and for the threads that work on large messages, however few processors there are.
#[cfg(all(target_os = "linux", target_env = "gnu"))]
const MIN_ARENAS: usize = 4;

/// Does nothing: other allocators have no such arenas.
#[cfg(not(all(target_os = "linux", target_env = "gnu")))]
pub(crate) fn bound_arenas() {}
