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
use crate::network::Place;
use crate::remote;

/// The longest pause after a question that was not answered as it should be.
const ASK_AGAIN: Duration = Duration::from_secs(15);
/// So many such questions in a row are enough: the answer may just be on its way.
const ASK_TIMES: u32 = 3;

/// What a question has shown.
#[derive(Debug)]
enum Found {
    /// It writes to us, or there is no telling.
    There,
    /// It seems not to.
    Missing(String),
    /// There is no such port any more.
    Gone(String),
}

/// Waits until the writer of a connection is gone; tells how that was noticed.
pub(super) async fn gone(core: &Core, from: &str, meter: &Arc<Meter>) -> String {
    let silence = core.options.silence;
    let mut place = place(core, from).await;
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
        let Some(place) = &place else {
            place = self::place(core, from).await;
            continue;
        };
        match ask(core, place).await {
            Found::There => missed = 0,
            Found::Gone(reason) => return reason,
            Found::Missing(reason) => {
                missed += 1;
                if missed == ASK_TIMES {
                    return reason;
                }
                pause = silence.min(ASK_AGAIN);
            }
        }
    }
}

/// Where the writer's port is, as far as the name server says.
async fn place(core: &Core, name: &str) -> Option<Place> {
    core.network.query(name).await.ok()
}

/// Asks the writer's port for its readers.
async fn ask(core: &Core, place: &Place) -> Found {
    let request = admin::list(Direction::Out, None);
    let error = match remote::administer(&core.network, place, &request).await {
        Ok(answer) => {
            let refuses = answer.get(0) == Some(&Vocab32::FAIL.into());
            let knows_us = |value: &Value| value.as_str() == Some(&core.name);
            return match refuses || answer.iter().any(knows_us) {
                true => Found::There,
                false => Found::Missing(format!("{} does not write to this port", place.name)),
            };
        }
        Err(error) => error,
    };
    match &error {
        PortError::Connect { source, .. } if source.kind() == io::ErrorKind::ConnectionRefused => {
            Found::Gone(error.story())
        }
        PortError::Connect { step, .. } | PortError::Deadline { step, .. }
            if *step == PortError::CONNECTING =>
        {
            Found::Missing(error.story())
        }
        _ => Found::There,
    }
}
