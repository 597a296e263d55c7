//! Names of a program's own ports.

use std::process;
use std::sync::atomic::{AtomicU32, Ordering};

/// Distinguishes the devices of one process.
static COUNT: AtomicU32 = AtomicU32::new(0);

/// Returns a name that no other program uses: `/client/PROCESS/NUMBER` and then the name of the remote device.
pub(crate) fn unique(remote: &str) -> String {
    let number = COUNT.fetch_add(1, Ordering::Relaxed);
    format!("/client/{}/{number}{remote}", process::id())
}
