//! The limit on open files.

use rustix::process::{Resource, Rlimit, getrlimit, setrlimit};

/// Raises the limit on open files as far as the system allows, and returns it; `None` if there is none.
///
/// Each connection takes a descriptor or two, and the usual limit of 1024 is soon reached by connections that somebody opens
/// and forgets.
pub(crate) fn raise_limit() -> Option<usize> {
    let limit = getrlimit(Resource::Nofile);
    let most = Rlimit {
        current: limit.maximum,
        maximum: limit.maximum,
    };
    if let Err(error) = setrlimit(Resource::Nofile, most) {
        tracing::debug!("at most {:?} open files: {error}", limit.current);
    }
    usize::try_from(getrlimit(Resource::Nofile).current?).ok()
}
