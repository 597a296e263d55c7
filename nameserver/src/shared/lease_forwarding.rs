//! Forwards the leases that ports renew at this server to the other servers.
//!
//! A lease holds at all servers, whichever server the port talks to. If forwarding fails, it is
//! repeated when the port renews its lease, four times while the lease holds.

use std::collections::BTreeMap;
use std::net::IpAddr;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use tokio::task::JoinSet;
use tokio::time::{MissedTickBehavior, interval};
use yarp_ports::Network;
use yarp_wire::name_service::{Command, LeaseHolder, Request};

use crate::name_server::lock;
use crate::registry::Registry;

/// Interval between two rounds.
const FORWARD_INTERVAL: Duration = Duration::from_secs(2);
/// Timeout for an answer of another server.
const FORWARD_TIMEOUT: Duration = Duration::from_secs(2);
/// Maximum number of leases in one request.
const MAX_LEASES_PER_REQUEST: usize = 64;

/// Leases that were renewed since the last round.
#[derive(Debug, Default)]
pub(crate) struct LeaseForwarder(Mutex<BTreeMap<String, LeaseHolder>>);

impl LeaseForwarder {
    /// Takes note of ports that are registered where they say, and ask from `from` themselves.
    pub(crate) fn record(&self, registry: &Registry, from: IpAddr, holders: &[LeaseHolder]) {
        let known = holders.iter().filter(|holder| {
            let place = registry.find(&holder.name);
            let is_there = place
                .is_some_and(|place| (&place.host, place.port) == (&holder.host, holder.number));
            is_there && registry.is_asked_by(&holder.name, from)
        });
        let mut held = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        held.extend(known.map(|holder| (holder.name.clone(), holder.clone())));
    }

    fn take(&self) -> Vec<LeaseHolder> {
        let mut held = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        std::mem::take(&mut *held).into_values().collect()
    }

    /// Forwards leases to the other servers forever, through `network`.
    pub(crate) async fn forward(self: Arc<Self>, registry: Arc<Mutex<Registry>>, network: Network) {
        let mut round = interval(FORWARD_INTERVAL);
        round.set_missed_tick_behavior(MissedTickBehavior::Delay);
        loop {
            round.tick().await;
            let others = lock(&registry).settings().others.clone();
            let holders = self.take();
            if holders.is_empty() {
                continue;
            }
            let mut telling = JoinSet::new();
            for (host, port) in others {
                let network = network
                    .with_server(&host, port)
                    .with_timeout(FORWARD_TIMEOUT);
                let holders = holders.clone();
                telling.spawn(async move {
                    for some in holders.chunks(MAX_LEASES_PER_REQUEST) {
                        let holders = some.to_vec();
                        let request = Request::plain(Command::Passed { holders });
                        if let Err(error) = network.ask(&request.to_string()).await {
                            tracing::debug!("leases were not forwarded: {error}");
                            return;
                        }
                    }
                });
            }
            telling.join_all().await;
        }
    }
}
