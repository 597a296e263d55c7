//! Several servers for one namespace.
//!
//! The names are kept in a [`SharedStore`], usually etcd. Each server has a copy, from which it
//! answers queries. A change is tried on a draft of the copy and written in one transaction, on the
//! condition that no other server has written since (`commit_writer`); if one has, the draft
//! applies that commit and the request is tried again. So all servers together process one request
//! after the other, like a single server; the rest is in `name_request_handler`.
//!
//! | file | content |
//! | --- | --- |
//! | `store_format` | keys and values of the store |
//! | `commit_writer` | the task that owns the draft and commits changes |
//! | `writer_channel` | the channel from the request handler to that task |
//! | `lease_forwarding` | forwards leases of ports to the other servers |
//! | `etcd_store` | etcd as the shared store (feature `etcd`) |

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
pub(crate) use writer_channel::{Precondition, WriteOutcome, WriterChannel};

/// Timeout of a request that changes something.
pub(crate) const WRITE_TIMEOUT: Duration = Duration::from_secs(4);

/// A key and its value.
#[derive(Clone, Debug, Eq, PartialEq)]
pub struct Entry {
    /// Key, without the prefix common to all keys.
    pub key: String,
    /// Value.
    pub value: Vec<u8>,
}

/// A key with its new value, or its removal.
#[derive(Clone, Debug, Eq, PartialEq)]
pub struct Write {
    /// Key, without the prefix common to all keys.
    pub key: String,
    /// New value; `None` removes the key.
    pub value: Option<Vec<u8>>,
}

/// All entries at one moment.
#[derive(Clone, Debug, Default)]
pub struct Snapshot {
    /// Number of the last commit; 0 if there was none.
    pub generation: i64,
    /// All entries, in order of creation.
    pub entries: Vec<Entry>,
}

/// The writes of one commit.
#[derive(Clone, Debug, Default)]
pub struct Commit {
    /// Number of the commit, higher than those before.
    pub generation: i64,
    /// Writes of the commit.
    pub writes: Vec<Write>,
}

/// Result of a commit.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub enum CommitResult {
    /// The commit was done, under this number.
    Committed(i64),
    /// Nothing was written: the last commit is this other one.
    Conflict(i64),
}

/// Result of a heartbeat.
#[derive(Clone, Debug, Default)]
pub struct Heartbeat {
    /// Number of the last commit.
    pub generation: i64,
    /// Host and TCP port of each other server that has sent a heartbeat lately.
    pub others: Vec<(String, u16)>,
}

/// A store that several servers share: entries, written by numbered commits.
///
/// After an error the caller calls [`load`](Self::load) next, except after
/// [`SharedStoreError::Rejected`], which changes nothing. Every call takes at most some seconds and
/// may be cancelled.
pub trait SharedStore: Send + 'static {
    /// Returns the name of the store for messages: its address.
    fn name(&self) -> String;

    /// Returns all entries, including everything committed before the call, and starts to watch for
    /// later commits.
    fn load(&mut self) -> impl Future<Output = Result<Snapshot, SharedStoreError>> + Send;

    /// Waits for the next commits, of this server and of others: each once, in order, without gaps
    /// since the last [`load`](Self::load).
    fn next(&mut self) -> impl Future<Output = Result<Vec<Commit>, SharedStoreError>> + Send;

    /// Writes all of `writes` if the last commit is `generation`, and nothing otherwise.
    ///
    /// Without writes, it only reports if that commit was the last one at some moment during the
    /// call. After [`SharedStoreError::Rejected`] the commit was not and will not be done; after
    /// any other error its outcome is unknown.
    fn commit(
        &mut self,
        generation: i64,
        writes: &[Write],
    ) -> impl Future<Output = Result<CommitResult, SharedStoreError>> + Send;

    /// Returns the number of the last commit, and reports this server, reachable at `place`, as
    /// running.
    fn heartbeat(
        &mut self,
        place: (&str, u16),
    ) -> impl Future<Output = Result<Heartbeat, SharedStoreError>> + Send;

    /// Reports the server at `place` as ended. Errors are ignored.
    fn leave(&mut self, place: (&str, u16)) -> impl Future<Output = ()> + Send;
}

/// Error of a shared store.
#[derive(Clone, Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SharedStoreError {
    /// The address of the store is malformed.
    #[error(
        "{address:?} is no address of a store: {reason}; expected etcd://HOST:PORT,HOST:PORT/PREFIX"
    )]
    Address {
        /// Address as given.
        address: String,
        /// Reason.
        reason: String,
    },
    /// The store does not answer in time.
    #[error(
        "{step} failed at {place}: {reason}; is etcd running there, and do most of its members reach each other?"
    )]
    Unreachable {
        /// Step that failed.
        step: &'static str,
        /// Address of the store.
        place: String,
        /// Reason.
        reason: String,
    },
    /// The store rejects the commit.
    #[error("{place} rejected the change: {reason}")]
    Rejected {
        /// Address of the store.
        place: String,
        /// Reason.
        reason: String,
    },
    /// The prefix contains data of another program.
    #[error(
        "{place} holds data of another program: {reason}; nothing is changed there, choose another prefix"
    )]
    Foreign {
        /// Address of the store.
        place: String,
        /// Data that was found.
        reason: String,
    },
    /// A commit was not delivered by the watch in time.
    #[error("{place} has commits that its watch does not deliver")]
    WatchLagged {
        /// Address of the store.
        place: String,
    },
}
