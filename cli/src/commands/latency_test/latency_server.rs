//! Server of the latency test.

use std::io::Write;
use std::process::ExitCode;
use std::time::Instant;

use tokio::sync::{mpsc, oneshot};
use yarp_ports::{Answer, Network, Port, PortOptions, Received};
use yarp_wire::{Bottle, Value};

use super::{EXIT_FAILED, MAX_MESSAGE_BYTES, SERVER, sleep_between_frames};
use crate::commands::argument_words::Options;
use crate::error::Result;
use crate::network_access;
use crate::signals::Interrupt;
use crate::stock_format::complain;

/// End of a test.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
enum End {
    Complete,
    Quit,
    Error,
    Interrupted,
}

/// A message, with the sender for its reply.
type Request = (Bottle, oneshot::Sender<Bottle>);

/// Serves one test after the other.
pub(super) async fn serve(options: &Options, out: &mut dyn Write) -> Result<ExitCode> {
    let network = network_access::network()?;
    let mut interrupt = Interrupt::listen();
    for count in 0_u64.. {
        let (sender, mut requests) = mpsc::channel(1);
        let Some(port) = open(&network, sender).await? else {
            break;
        };
        writeln!(
            out,
            "I am the server, now listening to the client for a `start` command"
        )?;
        out.flush()?;
        let test = test(&port, &mut requests, options, out);
        crate::systemd_notify::notify_ready();
        let end = tokio::select! {
            biased;
            () = interrupt.interrupted() => Ok(End::Interrupted),
            end = test => end,
        };
        port.close().await;
        match end? {
            End::Complete => writeln!(out, "Test {count} complete")?,
            End::Error => complain(out, &format!("Test {count} error"))?,
            End::Quit => {
                writeln!(out, "Test {count} complete, quitting")?;
                break;
            }
            End::Interrupted => return Ok(ExitCode::SUCCESS),
        }
    }
    Ok(ExitCode::from(EXIT_FAILED))
}

async fn open(network: &Network, sender: mpsc::Sender<Request>) -> Result<Option<Port>> {
    let pass_on = move |received: &mut Received| {
        let Ok(bottle) = received.bottle() else {
            return Answer::Nothing;
        };
        let sender = sender.clone();
        // The connection waits until the frame was processed.
        Answer::Later(Box::pin(async move {
            let (reply, replied) = oneshot::channel();
            if sender.send((bottle, reply)).await.is_err() {
                return Answer::Nothing;
            }
            match replied.await {
                Ok(reply) => Answer::reply(reply),
                Err(_) => Answer::Nothing,
            }
        }))
    };
    network_access::open(network, SERVER, PortOptions::new().handler(pass_on)).await
}

/// Parameters of a requested test.
struct Wanted {
    text: Value,
    replies: bool,
}

impl Wanted {
    /// Parses a `start` request; returns `None` if it is malformed or exceeds the maximum.
    fn of(start: &Bottle) -> Option<Self> {
        let size = start.get(1)?.as_i32()?;
        if start.get(0)?.as_str()? != "start" || !(0..=MAX_MESSAGE_BYTES).contains(&size) {
            return None;
        }
        let length = usize::try_from(size).ok()?.saturating_sub(1);
        Some(Self {
            text: "p".repeat(length).into(),
            replies: start.get(2).and_then(Value::as_i32) == Some(1),
        })
    }

    /// Prints the parameters.
    fn print(&self, out: &mut dyn Write) -> std::io::Result<()> {
        let size = self.text.as_str().map_or(0, str::len) + 1;
        writeln!(
            out,
            "Generated a string of {size} bytes, as requested by the client ({size})"
        )?;
        match self.replies {
            true => writeln!(
                out,
                "Replying on the same connection, as requested by the client"
            )?,
            false => writeln!(
                out,
                "Using a separate connection for replies, as requested by the client"
            )?,
        }
        out.flush()
    }
}

/// Runs one test.
async fn test(
    port: &Port,
    requests: &mut mpsc::Receiver<Request>,
    options: &Options,
    out: &mut dyn Write,
) -> Result<End> {
    let pause = options.number("server_wait").unwrap_or(0.0);
    let details = options.has("details");
    let mut wanted: Option<Wanted> = None;
    let mut count = 0;
    while let Some((frame, reply)) = requests.recv().await {
        let word = frame.get(0).and_then(Value::as_str).unwrap_or_default();
        if word == "start" || wanted.is_none() {
            // After a client that disconnected early, another may follow.
            wanted = Wanted::of(&frame);
            let Some(wanted) = &wanted else {
                complain(out, "Invalid command received from the client")?;
                return Ok(End::Error);
            };
            wanted.print(out)?;
            count = 0;
            continue;
        }
        let Some(wanted) = &wanted else {
            continue;
        };
        if details {
            writeln!(out, "Received: \"{frame}\"")?;
        }
        match word {
            "stop" => return Ok(End::Complete),
            "quit" => return Ok(End::Quit),
            _ => {}
        }
        let began = Instant::now();
        let mut answer = frame;
        answer.push(wanted.text.clone());
        let took = began.elapsed().as_secs_f64();
        answer.push(took);
        answer.push(count);
        let shown = details.then(|| answer.to_string());
        match wanted.replies {
            // The client may be gone.
            true => drop(reply.send(answer)),
            false => {
                drop(reply);
                port.write(&answer).await;
            }
        }
        if let Some(answer) = shown {
            writeln!(out, "Replying: \"{answer}\"")?;
            writeln!(
                out,
                "This time was required to append the payload: {took:.6}"
            )?;
            writeln!(out, "Sending the frame number: {count}")?;
        }
        sleep_between_frames(pause).await;
        count += 1;
    }
    Ok(End::Error)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn requests_beyond_the_maximum_are_refused() {
        let wanted = |text: &str| Wanted::of(&Bottle::parse(text).unwrap());
        let text = |start: &str| wanted(start).unwrap().text;
        assert_eq!(text("start 4 1"), Value::from("ppp"));
        assert_eq!(text("start 0 1"), Value::from(""));
        assert!(wanted("start 4 1").unwrap().replies && !wanted("start 4 0").unwrap().replies);
        for refused in [
            "start -1 1",
            "start 2147483647 1",
            "start",
            "start x 1",
            "4 1 1",
            "",
        ] {
            assert!(wanted(refused).is_none(), "{refused}");
        }
    }
}
