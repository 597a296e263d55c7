//! Several servers, one namespace.
//!
//! The names are kept by a [`SharedStore`] that the servers share, usually etcd. Each server has a copy of
//! it, from which it answers questions. What changes something is tried on a draft of the copy and
//! written in one transaction that holds only if nobody has written since (`writer`); if somebody
//! has, the draft follows and the request is tried again. So all servers together do one request after
//! the other, as a single one would; the rest is as in `request_handler`.
//!
//! | file | what it is about |
//! | --- | --- |
//! | `content` | what is written there, and how it is read |
//! | `writer` | the task that has the draft |
//! | `line` | the way from the desk to it |
//! | `leases` | ports tell one server that they are there; it tells the others |
//! | `etcd` | etcd as the truth (feature `etcd`) |

mod commit_writer;
#[cfg(feature = "etcd")]
mod etcd_store;
mod lease_forwarding;
pub(crate) mod store_format;
mod writer_channel;

use std::future::Future;
use std::time::Duration;

pub(crate) use commit_writer::Writer;
#[cfg(feature = "etcd")]
pub use etcd_store::EtcdStore;
pub(crate) use lease_forwarding::LeaseForwarder;
pub(crate) use store_format::Content;
pub(crate) use writer_channel::{Precondition, WriteOutcome, WriterChannel, is_change};

/// How long a request may take that changes something; then it is refused.
pub(crate) const WRITE_TIMEOUT: Duration = Duration::from_secs(4);

/// One value under a key.
#[derive(Clone, Debug, Eq, PartialEq)]
pub struct Entry {
    /// The key, without what is common to all of them.
    pub key: String,
    /// The value.
    pub value: Vec<u8>,
}

/// A key that has another value now, or none.
#[derive(Clone, Debug, Eq, PartialEq)]
pub struct Write {
    /// The key, without what is common to all of them.
    pub key: String,
    /// The value; none if the key is gone.
    pub value: Option<Vec<u8>>,
}

/// Everything that there is, at one moment.
#[derive(Clone, Debug, Default)]
pub struct Snapshot {
    /// The number of the last commit; 0 if there was none.
    pub generation: i64,
    /// All entries, those first that were made first.
    pub entries: Vec<Entry>,
}

/// What one commit has written.
#[derive(Clone, Debug, Default)]
pub struct Commit {
    /// Its number, higher than those before.
    pub generation: i64,
    /// What it has written.
    pub writes: Vec<Write>,
}

/// What became of a commit.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub enum CommitResult {
    /// It holds, under this number.
    Committed(i64),
    /// Nothing was written: the last commit is another one, this.
    Conflict(i64),
}

/// What is heard by asking.
#[derive(Clone, Debug, Default)]
pub struct Heartbeat {
    /// The number of the last commit.
    pub generation: i64,
    /// Where the other servers are that have asked lately: host and TCP port.
    pub others: Vec<(String, u16)>,
}

/// What several servers have in common: entries, written by numbered commits.
///
/// After an error [`load`](Self::load) comes next, unless it is [`SharedStoreError::Rejected`], after which all
/// is as before. Every call may take some seconds at the most; dropping one before its end is allowed.
pub trait SharedStore: Send + 'static {
    /// What it is called in messages: where it is.
    fn name(&self) -> String;

    /// Everything that there is, all that was committed before the call included; begins to listen
    /// for the commits behind it.
    fn load(&mut self) -> impl Future<Output = Result<Snapshot, SharedStoreError>> + Send;

    /// Waits for the next commits, of this server and of others: each once, in their order, all of
    /// them from the last [`load`](Self::load) on.
    fn next(&mut self) -> impl Future<Output = Result<Vec<Commit>, SharedStoreError>> + Send;

    /// Writes all of it, if the last commit is the one called `generation`, or nothing.
    ///
    /// Without anything to write it only tells whether that commit is the last one, as of some
    /// moment during the call. [`SharedStoreError::Rejected`] says that it was not done and will not be; after
    /// any other error neither is known.
    fn commit(
        &mut self,
        generation: i64,
        writes: &[Write],
    ) -> impl Future<Output = Result<CommitResult, SharedStoreError>> + Send;

    /// Asks for the last commit, and says that this server, to be reached at `place`, is there.
    fn heartbeat(
        &mut self,
        place: (&str, u16),
    ) -> impl Future<Output = Result<Heartbeat, SharedStoreError>> + Send;

    /// Says that the server at `place` is there no longer; in vain, if that cannot be said.
    fn leave(&mut self, place: (&str, u16)) -> impl Future<Output = ()> + Send;
}

/// Why several servers have nothing in common at the moment.
#[derive(Clone, Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SharedStoreError {
    /// The address of the store cannot be read.
    #[error(
        "{address:?} is no address of a store: {reason}; expected etcd://HOST:PORT,HOST:PORT/PREFIX"
    )]
    Address {
        /// What was given.
        address: String,
        /// What is wrong with it.
        reason: String,
    },
    /// It does not answer, or not in time.
    #[error(
        "{step} failed at {place}: {reason}; is etcd running there, and do most of its members see each other?"
    )]
    Unreachable {
        /// What was tried.
        step: &'static str,
        /// Where.
        place: String,
        /// What was heard.
        reason: String,
    },
    /// It does not take what is to be written.
    #[error("{place} does not take it: {reason}")]
    Rejected {
        /// Where.
        place: String,
        /// What was heard.
        reason: String,
    },
    /// There is something else under the prefix.
    #[error(
        "{place} holds what is no name server's: {reason}; nothing is changed there, choose another prefix"
    )]
    Foreign {
        /// Where.
        place: String,
        /// What it is.
        reason: String,
    },
    /// What was written has not been heard of within the time.
    #[error("{place} has commits that its watch does not deliver")]
    WatchLagged {
        /// Where.
        place: String,
    },
}
