//! Finding out the generation of a port before anything is sent to it that the generations read differently.

use std::time::Duration;

use yarp_wire::carrier::Carrier;
use yarp_wire::{Bottle, Dialect};

use crate::dialogue::Dialogue;
use crate::network::Network;

/// A word that generation 3.x cuts to four characters.
const WORD: &str = "generation";
/// A port that has not answered by then does not say.
const PATIENCE: Duration = Duration::from_secs(5);

/// How long a caller waits for its answer because it cannot be asked what it is.
const CALLER_PATIENCE: Duration = Duration::from_secs(1);

/// The generation of who calls itself `name`, or `None` if no port of that name says.
pub(crate) async fn generation_of(name: &str, network: &Network) -> Option<Dialect> {
    if !name.starts_with('/') {
        return None;
    }
    let asking = async {
        let place = network.query(name).await.ok()?;
        generation(name, (&place.host, place.port), network).await
    };
    tokio::time::timeout(CALLER_PATIENCE, asking).await.ok()?
}

/// The generation of the port at an address, or `None` if it does not say.
///
/// Asks it, in text, to drop a connection whose name is a vocab of more than four characters.
/// There is no such connection, and the answer repeats the name: cut to four characters by 3.x.
/// Checked against 3.5.0 and 4.0.0, which has vocabs of eight characters.
pub(crate) async fn generation(
    name: &str,
    address: (&str, u16),
    network: &Network,
) -> Option<Dialect> {
    let deadline = network.deadline().min(PATIENCE);
    let network = network.with_deadline(deadline);
    let carrier = Carrier::by_name("text_ack")?;
    let request = Bottle::parse(&format!("[del] [{WORD}]")).ok()?;
    let asking = async {
        let mut dialogue = Dialogue::open(name, address, carrier, "admin", &network).await?;
        dialogue.admin(&request).await
    };
    let answer = tokio::time::timeout(deadline, asking).await.ok()?.ok()?;
    let text = answer.get(1)?.as_str()?.to_owned();
    let first = text.lines().next()?;
    Some(if first.ends_with(&format!(" {}", &WORD[..4])) {
        Dialect::V3
    } else {
        Dialect::V4
    })
}
