//! The shared store in etcd.
//!
//! Below the prefix are the keys of `store_format`, and:
//!
//! | key | content |
//! | --- | --- |
//! | `generation` | written by every commit: its revision is the number of the commit |
//! | `server/HOST:PORT` | exists while the server holds its etcd lease |
//!
//! The store talks to one member of the cluster at a time, and after an error to the next one. All
//! reads are linearizable (etcd's default): they see every commit that was acknowledged before, and
//! fail where no majority of the members can be reached.

use std::collections::BTreeMap;
use std::future::Future;
use std::time::Duration;

use etcd_client::{
    Client, Compare, CompareOp, ConnectOptions, Error, Event, EventType, GetOptions, PutOptions,
    Txn, TxnOp, TxnOpResponse, WatchOptions, WatchStream,
};
use tokio::time::timeout;

use super::{
    Commit, CommitResult, Entry, Heartbeat, SharedStore, SharedStoreError, Snapshot, Write,
};

/// Timeout for connecting.
const CONNECT_TIMEOUT: Duration = Duration::from_millis(700);
/// Timeout for a response.
const RESPONSE_TIMEOUT: Duration = Duration::from_millis(1500);
/// Time to live of a server's lease, in seconds: after that long without renewal the server counts
/// as gone.
const LEASE_TTL_SECONDS: i64 = 10;
/// Maximum number of entries in one response.
const MAX_PAGE_ENTRIES: i64 = 128;
/// Maximum size of a response, in bytes: a page of the largest values.
const MAX_RESPONSE_BYTES: usize = 64 << 20;
/// Default TCP port of etcd.
const DEFAULT_ETCD_PORT: u16 = 2379;

const GENERATION_KEY: &str = "generation";
const SERVER_KEY_PREFIX: &str = "server/";

/// A prefix in an etcd cluster, used as shared store.
#[derive(Debug)]
pub struct EtcdStore {
    /// Members of the cluster, `HOST:PORT`.
    members: Vec<String>,
    /// Index of the member in use.
    current: usize,
    /// Key prefix, which begins and ends with a slash.
    prefix: String,
    connection: Option<MemberConnection>,
    /// Lease that keeps this server's key alive.
    lease_id: Option<i64>,
}

/// Connection to one member.
struct MemberConnection {
    client: Client,
    /// Stream of changes after the last load.
    watch: Option<WatchStream>,
}

impl std::fmt::Debug for MemberConnection {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("MemberConnection").finish_non_exhaustive()
    }
}

impl EtcdStore {
    /// Parses `etcd://HOST:PORT,HOST:PORT/PREFIX`, without connecting.
    ///
    /// The default port is 2379. The prefix may contain further slashes.
    pub fn at(address: &str) -> Result<Self, SharedStoreError> {
        let wrong = |reason: &str| SharedStoreError::Address {
            address: address.to_owned(),
            reason: reason.to_owned(),
        };
        let rest = address
            .strip_prefix("etcd://")
            .ok_or_else(|| wrong("it does not begin with etcd://"))?;
        let (members, prefix) = rest
            .split_once('/')
            .ok_or_else(|| wrong("no prefix follows the members"))?;
        let prefix = prefix.trim_matches('/');
        let stray = |c: char| !c.is_ascii_graphic();
        if prefix.is_empty() {
            return Err(wrong("the prefix is empty"));
        }
        if prefix.contains(stray) {
            return Err(wrong("the prefix holds a blank or a special character"));
        }
        let members = members.split(',').map(|member| {
            let (host, port) = match member.rsplit_once(':') {
                // The colons of an IPv6 address are in brackets.
                Some((host, port)) if !port.ends_with(']') => (host, port.parse().ok()),
                _ => (member, Some(DEFAULT_ETCD_PORT)),
            };
            let good = |c: char| c.is_ascii_alphanumeric() || "-._:[]".contains(c);
            match port.filter(|port| *port > 0) {
                Some(port) if !host.is_empty() && host.chars().all(good) => {
                    Ok(format!("{host}:{port}"))
                }
                _ => Err(wrong(&format!("{member:?} is no HOST:PORT"))),
            }
        });
        Ok(Self {
            members: members.collect::<Result<_, _>>()?,
            current: 0,
            prefix: format!("/{prefix}/"),
            connection: None,
            lease_id: None,
        })
    }

    fn key(&self, key: &str) -> String {
        format!("{}{key}", self.prefix)
    }

    fn unreachable(&self, step: &'static str, reason: impl ToString) -> SharedStoreError {
        SharedStoreError::Unreachable {
            step,
            place: format!("etcd://{}", self.members[self.current]),
            reason: reason.to_string(),
        }
    }

    /// Returns the client, after connecting if necessary.
    async fn client(&mut self) -> Result<Client, SharedStoreError> {
        if let Some(connection) = &self.connection {
            return Ok(connection.client.clone());
        }
        let member = format!("http://{}", self.members[self.current]);
        let options = ConnectOptions::new()
            .with_connect_timeout(CONNECT_TIMEOUT)
            .with_require_leader(true)
            .with_keep_alive(RESPONSE_TIMEOUT, RESPONSE_TIMEOUT)
            .with_keep_alive_while_idle(true);
        let connecting = Client::connect([member], Some(options));
        let client = self.with_timeout("connecting", connecting).await?;
        self.connection = Some(MemberConnection {
            client: client.clone(),
            watch: None,
        });
        Ok(client)
    }

    /// Waits for a response; after an error the next member is used.
    async fn with_timeout<T>(
        &mut self,
        step: &'static str,
        work: impl Future<Output = Result<T, Error>>,
    ) -> Result<T, SharedStoreError> {
        let error = match timeout(RESPONSE_TIMEOUT, work).await {
            Ok(Ok(done)) => return Ok(done),
            Ok(Err(error)) if is_final(&error) => {
                return Err(SharedStoreError::Rejected {
                    place: self.name(),
                    reason: error_text(&error),
                });
            }
            Ok(Err(error)) => self.unreachable(step, error_text(&error)),
            Err(_) => self.unreachable(
                step,
                format!("no answer in {} ms", RESPONSE_TIMEOUT.as_millis()),
            ),
        };
        self.drop_connection();
        Err(error)
    }

    fn drop_connection(&mut self) {
        self.connection = None;
        self.current = (self.current + 1) % self.members.len();
    }

    /// Returns an entry's key without the prefix; `None` for the keys of this module.
    fn entry_key<'a>(&self, key: &'a str) -> Option<&'a str> {
        let key = key.strip_prefix(&self.prefix)?;
        (key != GENERATION_KEY && !key.starts_with(SERVER_KEY_PREFIX)).then_some(key)
    }

    /// Reads all entries at one revision, and returns them with that revision.
    async fn read(&mut self, client: &Client) -> Result<(i64, Snapshot), SharedStoreError> {
        let mut kv = client
            .kv_client()
            .max_decoding_message_size(MAX_RESPONSE_BYTES);
        let end = end_of(&self.prefix);
        let mut from = self.prefix.clone().into_bytes();
        let mut revision = 0;
        let mut generation = 0;
        let mut found = Vec::new();
        loop {
            let options = GetOptions::new()
                .with_range(end.clone())
                .with_limit(MAX_PAGE_ENTRIES)
                .with_revision(revision);
            let got = self
                .with_timeout("reading", kv.get(from, Some(options)))
                .await?;
            if revision == 0 {
                revision = got.header().map_or(0, |header| header.revision());
            }
            for entry in got.kvs() {
                let key = String::from_utf8_lossy(entry.key()).into_owned();
                if key == self.key(GENERATION_KEY) {
                    generation = entry.mod_revision();
                } else if let Some(key) = self.entry_key(&key) {
                    let entry_ = Entry {
                        key: key.to_owned(),
                        value: entry.value().to_vec(),
                    };
                    found.push((entry.create_revision(), entry_));
                }
            }
            let Some(last) = got.kvs().last().filter(|_| got.more()) else {
                break;
            };
            from = last.key().to_vec();
            // The next possible key.
            from.push(0);
        }
        found.sort_by_key(|(made, _)| *made);
        let entries = found.into_iter().map(|(_, entry)| entry).collect();
        let snapshot = Snapshot {
            generation,
            entries,
        };
        Ok((revision, snapshot))
    }

    /// Watches all changes after a revision.
    async fn start_watch(
        &mut self,
        client: &mut Client,
        revision: i64,
    ) -> Result<WatchStream, SharedStoreError> {
        let options = WatchOptions::new()
            .with_range(end_of(&self.prefix))
            .with_start_revision(revision + 1);
        let prefix = self.prefix.clone();
        let listening = client.watch(prefix, Some(options));
        self.with_timeout("listening", listening).await
    }

    /// Groups changes into commits.
    fn commits(&self, events: &[Event]) -> Result<Vec<Commit>, SharedStoreError> {
        let mut commits = BTreeMap::<i64, Commit>::new();
        for event in events {
            let Some(entry) = event.kv() else {
                continue;
            };
            let key = String::from_utf8_lossy(entry.key());
            let gone = event.event_type() == EventType::Delete;
            if key == self.key(GENERATION_KEY) {
                if gone {
                    return Err(
                        self.unreachable("listening", "another program has removed the names")
                    );
                }
                let generation = entry.mod_revision();
                commits.entry(generation).or_default().generation = generation;
            } else if let Some(key) = self.entry_key(&key) {
                let write = Write {
                    key: key.to_owned(),
                    value: (!gone).then(|| entry.value().to_vec()),
                };
                let commit = commits.entry(entry.mod_revision()).or_default();
                commit.writes.push(write);
            }
        }
        // A change outside of any commit was written by another program.
        if commits.values().any(|commit| commit.generation == 0) {
            return Err(self.unreachable("listening", "another program writes there"));
        }
        Ok(commits.into_values().collect())
    }

    /// Renews this server's lease.
    async fn renew_lease(
        &mut self,
        client: &mut Client,
        place: &str,
    ) -> Result<(), SharedStoreError> {
        if let Some(lease) = self.lease_id
            && timeout(RESPONSE_TIMEOUT, client.lease_keep_alive(lease))
                .await
                .is_ok_and(|kept| kept.is_ok())
        {
            return Ok(());
        }
        let granting = client.lease_grant(LEASE_TTL_SECONDS, None);
        let granted = self.with_timeout("signing in", granting).await?;
        self.lease_id = Some(granted.id());
        let key = self.key(&format!("{SERVER_KEY_PREFIX}{place}"));
        let options = PutOptions::new().with_lease(granted.id());
        let putting = client.put(key, place, Some(options));
        self.with_timeout("signing in", putting).await?;
        Ok(())
    }
}

impl SharedStore for EtcdStore {
    fn name(&self) -> String {
        let prefix = self.prefix.trim_end_matches('/');
        format!("etcd://{}{prefix}", self.members.join(","))
    }

    async fn load(&mut self) -> Result<Snapshot, SharedStoreError> {
        let mut client = self.client().await?;
        // The old watch is dropped only now: what it still holds is part of this load.
        if let Some(connection) = &mut self.connection {
            connection.watch = None;
        }
        let (revision, snapshot) = self.read(&client).await?;
        let watch = self.start_watch(&mut client, revision).await?;
        if let Some(connection) = &mut self.connection {
            connection.watch = Some(watch);
        }
        Ok(snapshot)
    }

    async fn next(&mut self) -> Result<Vec<Commit>, SharedStoreError> {
        let Some(watch) = self
            .connection
            .as_mut()
            .and_then(|connection| connection.watch.as_mut())
        else {
            return Err(self.unreachable("listening", "not connected"));
        };
        let heard = watch.message().await;
        let error = match heard {
            Ok(Some(changes)) if !changes.canceled() => {
                let commits = self.commits(changes.events());
                if commits.is_err() {
                    // The same member can report the present state.
                    self.connection = None;
                }
                return commits;
            }
            Ok(Some(changes)) => self.unreachable("listening", changes.cancel_reason()),
            Ok(None) => self.unreachable("listening", "the connection ended"),
            Err(error) => self.unreachable("listening", error_text(&error)),
        };
        self.drop_connection();
        Err(error)
    }

    async fn commit(
        &mut self,
        generation: i64,
        writes: &[Write],
    ) -> Result<CommitResult, SharedStoreError> {
        let mut client = self.client().await?;
        let last = self.key(GENERATION_KEY);
        let mut operations: Vec<TxnOp> = writes
            .iter()
            .map(|write| {
                let key = self.key(&write.key);
                match &write.value {
                    Some(value) => TxnOp::put(key, value.clone(), None),
                    None => TxnOp::delete(key, None),
                }
            })
            .collect();
        if !writes.is_empty() {
            operations.push(TxnOp::put(last.clone(), "", None));
        }
        let condition = Compare::mod_revision(last.clone(), CompareOp::Equal, generation);
        let transaction = Txn::new()
            .when([condition])
            .and_then(operations)
            .or_else([TxnOp::get(last, None)]);
        let done = self
            .with_timeout("writing", client.txn(transaction))
            .await?;
        if done.succeeded() {
            let revision = done.header().map_or(0, |header| header.revision());
            return Ok(CommitResult::Committed(match writes.is_empty() {
                true => generation,
                false => revision,
            }));
        }
        Ok(CommitResult::Conflict(revision_in(&done.op_responses(), 0)))
    }

    async fn heartbeat(
        &mut self,
        (host, port): (&str, u16),
    ) -> Result<Heartbeat, SharedStoreError> {
        let mut client = self.client().await?;
        let own = format!("{host}:{port}");
        self.renew_lease(&mut client, &own).await?;
        let servers = self.key(SERVER_KEY_PREFIX);
        let asking = Txn::new().and_then([
            TxnOp::get(self.key(GENERATION_KEY), None),
            TxnOp::get(servers.clone(), Some(GetOptions::new().with_prefix())),
        ]);
        let heard = self.with_timeout("asking", client.txn(asking)).await?;
        let heard = heard.op_responses();
        let mut others = Vec::new();
        if let Some(TxnOpResponse::Get(found)) = heard.get(1) {
            for entry in found.kvs() {
                let key = String::from_utf8_lossy(entry.key());
                let place = key.strip_prefix(&servers).filter(|place| **place != own);
                let place = place.and_then(|place| place.rsplit_once(':'));
                others.extend(
                    place.and_then(|(host, port)| Some((host.to_owned(), port.parse().ok()?))),
                );
            }
        }
        Ok(Heartbeat {
            generation: revision_in(&heard, 0),
            others,
        })
    }

    async fn leave(&mut self, _: (&str, u16)) {
        let (Some(connection), Some(lease)) = (&mut self.connection, self.lease_id.take()) else {
            return;
        };
        // Otherwise the lease expires by itself.
        let _ = timeout(RESPONSE_TIMEOUT, connection.client.lease_revoke(lease)).await;
    }
}

/// Returns the revision at which the requested key was written; 0 if there is none.
fn revision_in(answers: &[TxnOpResponse], index: usize) -> i64 {
    match answers.get(index) {
        Some(TxnOpResponse::Get(found)) => {
            found.kvs().first().map_or(0, |entry| entry.mod_revision())
        }
        _ => 0,
    }
}

/// Returns the first key after all that begin with `prefix`, which ends with a slash.
fn end_of(prefix: &str) -> Vec<u8> {
    let mut end = prefix.as_bytes().to_vec();
    if let Some(last) = end.last_mut() {
        *last += 1;
    }
    end
}

/// Returns true if etcd rejects the request permanently, rather than for the moment.
fn is_final(error: &Error) -> bool {
    match error {
        // Invalid arguments and exhausted resources: the transaction is too large, or the disk
        // quota is used up.
        Error::GRpcStatus(status) => matches!(status.code() as i32, 3 | 8),
        _ => false,
    }
}

/// Returns the text of an error, on one line.
fn error_text(error: &Error) -> String {
    match error {
        Error::GRpcStatus(status) => status.message().to_owned(),
        error => error.to_string(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn addresses_name_members_and_a_prefix() {
        let check = |address: &str, members: &[&str], prefix: &str| {
            let truth = EtcdStore::at(address).unwrap();
            assert_eq!(truth.members, members, "{address}");
            assert_eq!(truth.prefix, prefix, "{address}");
        };
        check("etcd://a:1,b:2/lab", &["a:1", "b:2"], "/lab/");
        check("etcd://a/lab/yarp/", &["a:2379"], "/lab/yarp/");
        check(
            "etcd://[fd00::1]:7,[fd00::2]/x",
            &["[fd00::1]:7", "[fd00::2]:2379"],
            "/x/",
        );
        let name = EtcdStore::at("etcd://a,b:2/lab").unwrap().name();
        assert_eq!(name, "etcd://a:2379,b:2/lab");
    }

    #[test]
    fn malformed_addresses_are_refused() {
        for (address, reason) in [
            ("http://a:1/x", "it does not begin with etcd://"),
            ("etcd://a:1", "no prefix follows the members"),
            ("etcd://a:1/", "the prefix is empty"),
            (
                "etcd://a:1/a b",
                "the prefix holds a blank or a special character",
            ),
            ("etcd:///x", "\"\" is no HOST:PORT"),
            ("etcd://a:x/x", "\"a:x\" is no HOST:PORT"),
            ("etcd://a:0/x", "\"a:0\" is no HOST:PORT"),
            ("etcd://a:1,,b:2/x", "\"\" is no HOST:PORT"),
            ("etcd://u@a:1/x", "\"u@a:1\" is no HOST:PORT"),
        ] {
            let error = EtcdStore::at(address).unwrap_err().to_string();
            assert!(error.contains(reason), "{address}: {error}");
        }
    }
}
