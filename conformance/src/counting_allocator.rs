//! An allocator that counts, for tests of leaks and needless allocations.
//!
//! ```text
//! #[global_allocator]
//! static COUNTING: Counting = Counting;
//! ```

use std::alloc::{GlobalAlloc, Layout, System};
use std::sync::atomic::{AtomicIsize, AtomicUsize, Ordering};

static HELD: AtomicIsize = AtomicIsize::new(0);
static CALLS: AtomicUsize = AtomicUsize::new(0);

/// The system's allocator, with counters for all threads together.
#[derive(Debug)]
pub struct Counting;

/// Returns the number of allocated bytes; always 0 if [`Counting`] is not the allocator.
pub fn allocated_bytes() -> isize {
    HELD.load(Ordering::Relaxed)
}

/// Returns the number of allocations and reallocations so far.
pub fn calls() -> usize {
    CALLS.load(Ordering::Relaxed)
}

fn count(change: isize) {
    HELD.fetch_add(change, Ordering::Relaxed);
    if change > 0 {
        CALLS.fetch_add(1, Ordering::Relaxed);
    }
}

// SAFETY: every call goes on to the system allocator with the same arguments; counting touches two
// atomics and neither allocates nor fails.
#[allow(unsafe_code, reason = "an allocator cannot be written without")]
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        count(layout.size() as isize);
        // SAFETY: the caller's contract is the system allocator's.
        unsafe { System.alloc(layout) }
    }

    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        count(layout.size() as isize);
        // SAFETY: as above.
        unsafe { System.alloc_zeroed(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        count(-(layout.size() as isize));
        // SAFETY: as above.
        unsafe { System.dealloc(pointer, layout) }
    }

    unsafe fn realloc(&self, pointer: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        count(size as isize - layout.size() as isize);
        // SAFETY: as above.
        unsafe { System.realloc(pointer, layout, size) }
    }
}
