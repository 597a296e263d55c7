//! Liveness of writers over datagrams.
//!
//! Datagrams have no end: a killed writer over `udp` or `mcast` looks like one that has nothing to
//! send. Stock (3.5.0) keeps both in its list until they reconnect. Here the name server is asked
//! at the beginning for the address of the writer's port; whenever no datagram has arrived for a
//! while, that port is asked for its readers.
//!
//! An unregistered writer cannot be probed, and stays. So does one whose port accepts connections
//! without answering, such as a stopped program, or refuses admin requests.

use std::io;
use std::sync::Arc;
use std::time::Duration;

use yarp_wire::admin::{self, Direction};
use yarp_wire::{Value, Vocab32};

use super::core::Core;
use super::counters::Meter;
use crate::error::PortError;
use crate::network::Endpoint;
use crate::remote_admin;

/// The longest pause after a question that was not answered as it should be.
const PROBE_INTERVAL: Duration = Duration::from_secs(15);
/// Number of consecutive failed probes after which the writer is gone: the answer to one may be in
/// transit.
const MAX_FAILED_PROBES: u32 = 3;

/// The result of a probe.
#[derive(Debug)]
enum ProbeResult {
    /// It writes to us, or there is no telling.
    Connected,
    /// It seems not to.
    NotConnected(String),
    /// There is no such port any more.
    Gone(String),
}

/// Waits until the writer of a connection is gone; returns the reason.
pub(super) async fn wait_until_gone(core: &Core, from: &str, meter: &Arc<Meter>) -> String {
    let silence = core.options.datagram_timeout;
    let mut endpoint = endpoint(core, from).await;
    let mut heard = meter.traffic();
    let mut missed = 0;
    let mut pause = silence;
    loop {
        tokio::time::sleep(pause).await;
        pause = silence;
        let now = meter.traffic();
        if now != heard {
            (heard, missed) = (now, 0);
            continue;
        }
        let Some(endpoint) = &endpoint else {
            endpoint = self::endpoint(core, from).await;
            continue;
        };
        match probe(core, endpoint).await {
            ProbeResult::Connected => missed = 0,
            ProbeResult::Gone(reason) => return reason,
            ProbeResult::NotConnected(reason) => {
                missed += 1;
                if missed == MAX_FAILED_PROBES {
                    return reason;
                }
                pause = silence.min(PROBE_INTERVAL);
            }
        }
    }
}

/// Returns the address of the writer's port, if the name server knows it.
async fn endpoint(core: &Core, name: &str) -> Option<Endpoint> {
    core.network.query(name).await.ok()
}

/// Asks the writer's port for its readers.
async fn probe(core: &Core, endpoint: &Endpoint) -> ProbeResult {
    let request = admin::list(Direction::Out, None);
    let error = match remote_admin::administer(&core.network, endpoint, &request).await {
        Ok(answer) => {
            let refuses = answer.get(0) == Some(&Vocab32::FAIL.into());
            let knows_us = |value: &Value| value.as_str() == Some(&core.name);
            return match refuses || answer.iter().any(knows_us) {
                true => ProbeResult::Connected,
                false => ProbeResult::NotConnected(format!(
                    "{} does not write to this port",
                    endpoint.name
                )),
            };
        }
        Err(error) => error,
    };
    match &error {
        PortError::Connect { source, .. } if source.kind() == io::ErrorKind::ConnectionRefused => {
            ProbeResult::Gone(error.error_chain())
        }
        PortError::Connect { step, .. } | PortError::Timeout { step, .. }
            if *step == PortError::CONNECTING =>
        {
            ProbeResult::NotConnected(error.error_chain())
        }
        _ => ProbeResult::Connected,
    }
}
