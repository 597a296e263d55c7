//! The words in which a reader refuses the modifiers of a connection.

use std::time::Duration;

use bytes::BytesMut;
use yarp_wire::Limits;
use yarp_wire::carrier::{Carrier, Sender, Transport};
use yarp_wire::connection::Initiator;

use super::Target;
use crate::connect::connect_over;
use crate::log_text::printable;
use crate::socket::{ReadBuffer, write_all};

/// Maximum time for the reader to give its reason.
const REASON_TIMEOUT: Duration = Duration::from_secs(1);
/// Maximum length of a reason, bytes.
const MAX_REASON_LEN: usize = 1024;
/// Name of the sender that asks for the reason; a name without a slash is not that of a port.
const ASKING: &str = "connect";
/// Start of the line with the reason.
const PREFIX: &str = "* Error. ";

/// Returns the reason why the reader refuses the modifiers, if it gives one.
///
/// Only a refused connection of text lines carries a reason, so the same modifiers are asked for once more over `text`.
/// Stock's ports give none.
pub(super) async fn refusal_reason(target: &Target<'_>) -> Option<String> {
    let asking = tokio::time::timeout(REASON_TIMEOUT, ask(target));
    asking.await.ok().flatten()
}

async fn ask(target: &Target<'_>) -> Option<String> {
    let to = target.to;
    let connecting = connect_over(
        &to.name,
        &to.host,
        to.port,
        target.network,
        Transport::Stream,
    );
    let stream = connecting.await.ok()?;
    let mut output = BytesMut::new();
    let sender = Sender {
        name: ASKING.to_owned(),
        modifiers: target.spec.modifiers.clone(),
    };
    let carrier = Carrier::by_name("text").expect("text is in the table");
    let _ = Initiator::new(
        carrier,
        &sender,
        target.wire_version,
        Limits::DEFAULT,
        &mut output,
    );
    write_all(&stream, &mut output).await.ok()?;
    let mut input = ReadBuffer::default();
    loop {
        if let Some(reason) = reason(&input.bytes) {
            return Some(reason);
        }
        if input.bytes.len() > MAX_REASON_LEN || input.read(&stream, 0).await.ok()? == 0 {
            return None;
        }
    }
}

/// Returns the reason in a complete first line.
fn reason(bytes: &[u8]) -> Option<String> {
    let end = bytes.iter().position(|&byte| byte == b'\r')?;
    let line = String::from_utf8_lossy(&bytes[..end.min(MAX_REASON_LEN)]).into_owned();
    let reason = line.strip_prefix(PREFIX)?;
    Some(printable(reason).to_string())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::port_limits::MAX_LOGGED_TEXT;

    #[test]
    fn only_a_complete_line_of_an_error_is_a_reason() {
        let told = b"* Error. no modifier\r\n* Goodbye.\r\n";
        assert_eq!(reason(told).as_deref(), Some("no modifier"));
        assert_eq!(reason(&told[..12]), None);
        assert_eq!(reason(b"Welcome connect\r\n"), None);
        let long = format!("{PREFIX}{}\r", "x".repeat(4000));
        let cut = reason(long.as_bytes()).unwrap();
        assert_eq!(cut, format!("{}...", "x".repeat(MAX_LOGGED_TEXT)));
    }
}
