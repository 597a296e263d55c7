//! Probing the wire version of a peer before sending to it.

use std::time::Duration;

use yarp_wire::carrier::Carrier;
use yarp_wire::{Bottle, Value, Vocab32, WireVersion};

use crate::admin_client::AdminClient;
use crate::error::PortError;
use crate::network::Network;

/// A word that YARP 3.x cuts to four characters.
const GENERATION_WORD: &str = "generation";
/// The answer of this implementation after its process id.
pub(crate) const EITHER_VERSION: &str = "either";
/// A reader that has not answered by then does not say.
const PROBE_TIMEOUT: Duration = Duration::from_secs(5);
/// The same for a caller, which waits meanwhile.
const CALLER_PROBE_TIMEOUT: Duration = Duration::from_secs(1);

/// Returns the wire version of the port at an address, or `None` if unknown.
///
/// Asks it, in text, to drop a connection whose name is a vocab of more than four characters. There
/// is no such connection, and the answer repeats the name: truncated to four characters by 3.x.
/// Checked against 3.5.0 and 4.0.0, which has vocabs of eight characters.
pub(crate) async fn peer_version(
    name: &str,
    address: (&str, u16),
    network: &Network,
) -> Option<WireVersion> {
    let request = format!("[del] [{GENERATION_WORD}]");
    let answer = asked(name, address, &request, network, PROBE_TIMEOUT).await?;
    let text = answer.get(1)?.as_str()?.to_owned();
    let first = text.lines().next()?;
    Some(if first.ends_with(&format!(" {}", &GENERATION_WORD[..4])) {
        WireVersion::V3
    } else {
        WireVersion::V4
    })
}

/// Returns the wire version in which a calling port reads its replies, or `None` if unknown.
///
/// Asks it for its process id, which 4.0 no longer reports. Checked against 3.5.0 and 4.0.0. Ports
/// of this implementation report neither: they have probed before they call, and read the wire
/// version that they were told, which the called port uses by default.
pub(crate) async fn caller_version(name: &str, network: &Network) -> Option<WireVersion> {
    let asking = async {
        let endpoint = network.query(name).await.ok()?;
        let address = (endpoint.host.as_str(), endpoint.port);
        asked(name, address, "[pid]", network, CALLER_PROBE_TIMEOUT).await
    };
    let answer = tokio::time::timeout(CALLER_PROBE_TIMEOUT, asking)
        .await
        .ok()??;
    match answer.get(0)? {
        Value::Int32(1) if answer.get(3).is_none() => Some(WireVersion::V3),
        word if word.as_vocab() == Some(Vocab32::new("fail")) => Some(WireVersion::V4),
        _ => None,
    }
}

/// Returns the answer of the port to an admin request before the timeout.
async fn asked(
    name: &str,
    address: (&str, u16),
    request: &str,
    network: &Network,
    timeout: Duration,
) -> Option<Bottle> {
    let deadline = network.timeout().min(timeout);
    let network = network.with_timeout(deadline);
    let carrier = Carrier::by_name("text_ack")?;
    let request = Bottle::parse(request).ok()?;
    let asking = async {
        let mut client = AdminClient::open(name, address, carrier, "admin", &network).await?;
        let answer = client.admin(&request).await?;
        Ok::<_, PortError>((answer, client))
    };
    let (answer, client) = tokio::time::timeout(deadline, asking).await.ok()?.ok()?;
    // Who asks the port for its connections next does not find this one.
    client.close().await;
    Some(answer)
}
