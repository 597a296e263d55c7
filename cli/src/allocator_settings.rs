//! The allocator of the C library.
#![allow(
    unsafe_code,
    reason = "settings of the allocator have no safe interface"
)]

/// Bounds the memory that stays with the process after it was freed, except for what the environment chooses
/// (`MALLOC_ARENA_MAX`, `MALLOC_MMAP_THRESHOLD_`, `MALLOC_TRIM_THRESHOLD_`).
///
/// Each arena keeps memory that was freed in it, and the default is eight for each processor: what large messages of peers took
/// stayed that many times. Blocks above [`OWN_MAPPING`] return to the system; without a fixed threshold, the allocator
/// keeps blocks of up to 32 MiB once such a block was freed. With a fixed one it returns smaller blocks, too, as soon as 128 KiB are
/// free at the end of its memory, and asks for them again: while that goes on, every thread that needs memory waits. So an arena
/// keeps as much as a block without a mapping of its own may take.
#[cfg(all(target_os = "linux", target_env = "gnu"))]
pub(crate) fn bound_arenas() {
    let processors = std::thread::available_parallelism().map_or(1, usize::from);
    let arenas = i32::try_from(processors.max(MIN_ARENAS)).unwrap_or(i32::MAX);
    for (variable, parameter, value) in [
        ("MALLOC_ARENA_MAX", libc::M_ARENA_MAX, arenas),
        (
            "MALLOC_MMAP_THRESHOLD_",
            libc::M_MMAP_THRESHOLD,
            OWN_MAPPING,
        ),
        (
            "MALLOC_TRIM_THRESHOLD_",
            libc::M_TRIM_THRESHOLD,
            OWN_MAPPING,
        ),
    ] {
        if std::env::var_os(variable).is_some() {
            continue;
        }
        // SAFETY: the call sets a number, and is allowed at any time.
        if unsafe { libc::mallopt(parameter, value) } == 0 {
            tracing::debug!("the allocator refuses {value} for {variable}");
        }
    }
}

/// Bytes of a block above which it gets a mapping of its own: more than an image of 1280 x 720, whose memory is used again.
#[cfg(all(target_os = "linux", target_env = "gnu"))]
const OWN_MAPPING: i32 = 4 << 20;

/// Arenas for workers and for the threads that work on large messages, however few processors there are.
#[cfg(all(target_os = "linux", target_env = "gnu"))]
const MIN_ARENAS: usize = 4;

/// Does nothing: other allocators have no such arenas.
#[cfg(not(all(target_os = "linux", target_env = "gnu")))]
pub(crate) fn bound_arenas() {}
