//! Writers whose messages come in datagrams, and that fell silent.
//!
//! Datagrams have no end: of a writer over `udp` or `mcast` that is killed nothing more comes, as of
//! one that has nothing to say. Stock (3.5.0) keeps both in its list until they come back. Here the
//! name server is asked at the beginning where the writer's port is; whenever nothing has come for
//! a while, that port is asked to whom it writes.
//!
//! A writer that nobody has registered cannot be asked: its connection ends after several such
//! intervals without a datagram. One whose port takes connections and says nothing stays, as a program that is
//! stopped, and so does one that does not let us ask, or whose name server does not answer.

use std::io;
use std::sync::Arc;
use std::time::Duration;

use yarp_wire::admin::{self, Direction};
use yarp_wire::{Value, Vocab32};

use super::connection_slots::KnownWriter;
use super::counters::Meter;
use super::port_context::PortContext;
use crate::error::PortError;
use crate::network::Endpoint;
use crate::port_limits::UNKNOWN_WRITER_INTERVALS;
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
pub(super) async fn wait_until_gone(
    port: &PortContext,
    from: &str,
    meter: &Arc<Meter>,
    known: &KnownWriter,
) -> String {
    let silence = port.options.datagram_timeout;
    let mut endpoint = endpoint(port, from, known).await;
    let mut unknown = 0;
    let mut heard = meter.traffic();
    let mut missed = 0;
    let mut pause = silence;
    loop {
        tokio::time::sleep(pause).await;
        pause = silence;
        let now = meter.traffic();
        if now != heard {
            (heard, missed, unknown) = (now, 0, 0);
            continue;
        }
        let endpoint = match &endpoint {
            Ok(Some(endpoint)) => endpoint,
            unasked => {
                unknown += u32::from(unasked.is_ok());
                if unknown == UNKNOWN_WRITER_INTERVALS {
                    let seconds = silence.as_secs_f64() * f64::from(unknown);
                    return format!("nothing came for {seconds} s, and no name server knows it");
                }
                endpoint = self::endpoint(port, from, known).await;
                continue;
            }
        };
        match probe(port, endpoint).await {
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

/// Returns the endpoint of the writer's port from the name server; `None` if the name is unknown.
async fn endpoint(
    port: &PortContext,
    name: &str,
    known: &KnownWriter,
) -> Result<Option<Endpoint>, PortError> {
    match port.network.query(name).await {
        Ok(endpoint) => {
            known.set();
            Ok(Some(endpoint))
        }
        Err(PortError::Unknown { .. } | PortError::NoNameServer) => Ok(None),
        Err(error) => Err(error),
    }
}

/// Asks the writer's port for its readers.
async fn probe(port: &PortContext, endpoint: &Endpoint) -> ProbeResult {
    let request = admin::list(Direction::Out, None);
    let error = match remote_admin::administer(&port.network, endpoint, &request).await {
        Ok(answer) => {
            let refuses = answer.get(0) == Some(&Vocab32::FAIL.into());
            let knows_us = |value: &Value| value.as_str() == Some(&port.name);
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
