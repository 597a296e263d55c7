//! Writers whose messages come in datagrams, and that fell silent.
//!
//! Datagrams have no end: of a writer over `udp` or `mcast` that is killed nothing more comes, as of
//! one that has nothing to say. Stock (3.5.0) keeps both in its list until they come back. Here the
//! name server is asked at the beginning where the writer's port is; whenever nothing has come for
//! a while, that port is asked to whom it writes.
//!
//! A writer that nobody has registered cannot be asked, and stays. So does one whose port takes
//! connections and says nothing, as a program that is stopped, or does not let us ask.

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
/// So many such questions in a row are enough: the answer may just be on its way.
const MAX_FAILED_PROBES: u32 = 3;

/// What a question has shown.
#[derive(Debug)]
enum ProbeResult {
    /// It writes to us, or there is no telling.
    Connected,
    /// It seems not to.
    NotConnected(String),
    /// There is no such port any more.
    Gone(String),
}

/// Waits until the writer of a connection is gone; tells how that was noticed.
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

/// Where the writer's port is, as far as the name server says.
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
