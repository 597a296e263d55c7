//! Renewal of the leases on port names: the name server may restart and lose them.
//!
//! One task for all ports of a [`Network`] runs every few seconds, each time with one short
//! connection. It sends the registered ports to the name server (`lease`); the answer of this
//! implementation holds a number that changes when the server restarts. A stock name server answers
//! `lease` like any unknown word; it is asked, less often, for its process instead. Missing names
//! are registered again only after a restart: a name that was unregistered deliberately stays
//! removed.

use std::collections::BTreeMap;
use std::net::Ipv4Addr;
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use tokio::task::{JoinHandle, JoinSet};
use yarp_wire::name_service::{Command, LeaseHolder, RegisterRequest, Registration, Request};

use crate::error::PortError;
use crate::log_text::printable;
use crate::network::Network;

/// Renewal interval of a server of this implementation; a lease lasts four of them.
const RENEWAL_INTERVAL: Duration = Duration::from_secs(5);
/// Check interval of a stock server.
const STOCK_CHECK_INTERVAL: Duration = Duration::from_secs(15);
/// Timeout of a renewal or check.
const REQUEST_TIMEOUT: Duration = Duration::from_secs(5);
/// Maximum number of names in one request.
const MAX_NAMES_PER_REQUEST: usize = 64;

/// The names of a network's ports, and the task that keeps them.
#[derive(Debug, Default)]
pub(crate) struct LeasedNames(Mutex<Held>);

#[derive(Debug, Default)]
struct Held {
    /// Registration, and the address that it listens at.
    ports: BTreeMap<String, (RegisterRequest, Ipv4Addr)>,
    task: Option<JoinHandle<()>>,
}

impl LeasedNames {
    fn held(&self) -> MutexGuard<'_, Held> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Keeps a port that has been registered, from within a runtime.
    pub(crate) fn keep(
        network: &Network,
        endpoint: &Registration,
        type_name: Option<String>,
        address: Ipv4Addr,
    ) {
        let port = RegisterRequest {
            name: endpoint.name.clone(),
            carrier: Some(endpoint.carrier.clone()),
            host: Some(endpoint.host.clone()),
            number: Some(endpoint.port.into()),
            type_name,
        };
        let mut held = network.leased_names().held();
        held.ports.insert(endpoint.name.clone(), (port, address));
        // The runtime of the first port may have ended.
        if held.task.as_ref().is_none_or(JoinHandle::is_finished) {
            held.task = Some(tokio::spawn(renew_leases(network.clone())));
        }
    }

    /// Forgets a port that closes.
    pub(crate) fn forget(&self, name: &str) {
        let mut held = self.held();
        held.ports.remove(name);
        if held.ports.is_empty()
            && let Some(task) = held.task.take()
        {
            task.abort();
        }
    }

    fn ports(&self) -> Vec<RegisterRequest> {
        let held = self.held();
        held.ports.values().map(|(port, _)| port.clone()).collect()
    }

    fn has(&self, name: &str) -> bool {
        self.address(name).is_some()
    }

    /// Returns the address that a port listens at, if it is kept.
    fn address(&self, name: &str) -> Option<Ipv4Addr> {
        self.held().ports.get(name).map(|(_, address)| *address)
    }
}

/// Visits every name server until the last port has closed.
async fn renew_leases(network: Network) {
    let tasks: JoinSet<()> = network.each().map(run_for_server).collect();
    tasks.join_all().await;
}

async fn run_for_server(network: Network) {
    let network = network.with_timeout(REQUEST_TIMEOUT);
    let mut renewer = LeaseRenewer::new(network);
    loop {
        // Programs that were started together do not all come at once.
        let apart = Duration::from_millis(u64::from(std::process::id() % 1000));
        tokio::time::sleep(renewer.every + apart).await;
        match renewer.renew_all().await {
            Ok(()) => {}
            // It may be another server that comes back.
            Err(error) => {
                renewer.every = RENEWAL_INTERVAL;
                tracing::debug!("cannot renew the name leases: {}", error.error_chain());
            }
        }
    }
}

struct LeaseRenewer {
    network: Network,
    every: Duration,
    /// Identifies the current start of the server.
    start: Option<String>,
    /// Time of the last success for all names.
    last_success: Instant,
    /// Duration of the server's leases.
    lease: Duration,
}

impl LeaseRenewer {
    fn new(network: Network) -> Self {
        Self {
            network,
            every: RENEWAL_INTERVAL,
            start: None,
            last_success: Instant::now(),
            lease: Duration::MAX,
        }
    }

    async fn renew_all(&mut self) -> Result<(), PortError> {
        let ports = self.network.leased_names().ports();
        if self.every == RENEWAL_INTERVAL {
            let mut start = None;
            for some in ports.chunks(MAX_NAMES_PER_REQUEST) {
                start = self.renew(some).await?;
                if start.is_none() {
                    self.every = STOCK_CHECK_INTERVAL;
                    break;
                }
            }
            // Not earlier: a start counts as handled once all names are registered.
            self.start = start;
        }
        if self.every == STOCK_CHECK_INTERVAL {
            self.compare(&ports).await?;
        }
        self.last_success = Instant::now();
        Ok(())
    }

    /// Renews the leases of some ports; returns the identity of the server's start, if it supports
    /// leases.
    async fn renew(&mut self, ports: &[RegisterRequest]) -> Result<Option<String>, PortError> {
        let holders = ports.iter().filter_map(|port| {
            Some(LeaseHolder {
                name: port.name.clone(),
                host: port.host.clone()?,
                number: u16::try_from(port.number?).ok()?,
            })
        });
        let holders = holders.collect();
        let request = Request::plain(Command::Lease { holders }).to_string();
        let answer = self.network.ask(&request).await?;
        let mut lines = answer.lines();
        let first = lines.next().and_then(|line| line.strip_prefix("lease "));
        let Some((seconds, start)) = first.and_then(|rest| rest.split_once(' ')) else {
            return Ok(None);
        };
        let start = start.to_owned();
        // After a long absence the server may have given us up.
        let away = self.last_success.elapsed() > self.lease;
        self.lease = seconds.parse().map_or(Duration::MAX, Duration::from_secs);
        let mut others = Vec::new();
        let again = self.start.as_ref() != Some(&start) || away;
        for line in lines {
            let (what, name) = line.split_once(' ').unwrap_or((line, ""));
            let port = ports.iter().find(|port| port.name == name);
            match (what, port) {
                ("lost", Some(port)) if again => self.register(port).await?,
                ("lost", Some(port)) => self.network.leased_names().forget(&port.name),
                ("taken", Some(port)) => {
                    tracing::warn!("another port has the name {} now", printable(name));
                    self.network.leased_names().forget(&port.name);
                }
                ("also", _) => others.extend(endpoint(name)),
                _ => {}
            }
        }
        self.network.add_servers(&others);
        Ok(Some(start))
    }

    /// Asks a server of stock whether it is still the same.
    async fn compare(&mut self, ports: &[RegisterRequest]) -> Result<(), PortError> {
        let namespace = self.network.namespace();
        let answer = self
            .network
            .ask(&format!("get {namespace} process"))
            .await?;
        let process = answer.lines().next().map(str::to_owned);
        if process == self.start {
            return Ok(());
        }
        for port in ports {
            match self.network.query(&port.name).await {
                Err(PortError::Unknown { .. }) => self.register(port).await?,
                other => drop(other?),
            }
        }
        self.start = process;
        Ok(())
    }

    /// Registers a port again where it was.
    async fn register(&self, port: &RegisterRequest) -> Result<(), PortError> {
        let leased_names = self.network.leased_names();
        let Some(address) = leased_names.address(&port.name) else {
            return Ok(());
        };
        match self.network.register(port.clone()).await {
            Ok(_) => {
                let addresses = Network::reached_at(address);
                self.network
                    .register_properties(&port.name, &addresses)
                    .await?;
            }
            Err(error @ PortError::Refused { .. }) => {
                tracing::warn!("{} is no longer registered: {error}", port.name);
                leased_names.forget(&port.name);
            }
            Err(error) => return Err(error),
        }
        if leased_names.has(&port.name) {
            tracing::info!(
                "registered {} again, the name server had forgotten it",
                port.name
            );
        } else {
            // It closed meanwhile.
            self.network.unregister(&port.name).await?;
        }
        Ok(())
    }
}

/// `HOST PORT`: where another server of the same names is.
fn endpoint(text: &str) -> Option<(String, u16)> {
    let (host, port) = text.split_once(' ')?;
    Some((host.to_owned(), port.parse().ok()?))
}
