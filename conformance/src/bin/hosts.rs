//! `hosts watch READER CARRIER`: a writer on one of two hosts whose link goes down and up.
//!
//! Opens `/hosts/watch`, which supervises a connection to `READER`, and `/hosts/plain`, which does
//! not; writes numbers to both, and calls `/hosts/server`. Prints one line per event:
//!
//! ```text
//! link STATE              the supervised connection changed
//! plain lost              the plain connection ended
//! call ok | call failed   the outcome of a call changed
//! closed                  after the end of the input: everything was closed
//! ```
//!
//! `hosts serve`: opens `/hosts/server`, which echoes, and `/hosts/reader`; prints `read NUMBER`
//! for each message from `/hosts/watch`.

use std::process::ExitCode;
use std::time::Duration;

use yarp_ports::{Answer, ConnectionState, Network, Port, PortOptions, Queue, ReconnectOptions};
use yarp_wire::Bottle;

type Failure = Box<dyn std::error::Error>;

/// Interval between two messages.
const WRITE_INTERVAL: Duration = Duration::from_millis(100);
/// Timeout of a call.
const CALL_TIMEOUT: Duration = Duration::from_secs(2);
/// Time without data after which a host counts as gone.
const PEER_TIMEOUT: Duration = Duration::from_secs(3);

#[tokio::main]
async fn main() -> ExitCode {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let words: Vec<&str> = words.iter().map(String::as_str).collect();
    let result = match words[..] {
        ["serve"] => serve().await,
        ["watch", reader, carrier] => watch(reader, carrier).await,
        _ => Err("usage: hosts serve | hosts watch READER CARRIER".into()),
    };
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("hosts: {error}");
            ExitCode::FAILURE
        }
    }
}

/// Waits for the end of standard input.
async fn end_of_input() {
    let reading = tokio::task::spawn_blocking(|| std::io::stdin().lines().for_each(drop));
    // A thread that panicked has ended, too.
    let _ = reading.await;
}

async fn serve() -> Result<(), Failure> {
    let network = Network::from_process()?;
    let echo = PortOptions::new()
        .handler(|message| message.bottle().map_or(Answer::Nothing, Answer::reply));
    let server = Port::open(&network, "/hosts/server", echo).await?;
    let options = PortOptions::new().queue(Queue::Wait(10));
    let reader = Port::open(&network, "/hosts/reader", options).await?;
    println!("ready");
    let reading = async {
        while let Ok(message) = reader.read().await {
            if *message.from == *"/hosts/watch" {
                println!("read {}", message.bottle().unwrap_or_default());
            }
        }
    };
    tokio::select! {
        () = reading => {}
        () = end_of_input() => {}
    }
    tokio::join!(server.close(), reader.close());
    println!("closed");
    Ok(())
}

async fn watch(reader: &str, carrier: &str) -> Result<(), Failure> {
    let network = Network::from_process()?.with_timeout(CALL_TIMEOUT);
    let watch = Port::open(&network, "/hosts/watch", PortOptions::new()).await?;
    let plain = Port::open(&network, "/hosts/plain", PortOptions::new()).await?;
    let caller = Port::open(&network, "/hosts/caller", PortOptions::new().rpc_client()).await?;
    plain.connect_over(reader, carrier).await?;
    caller.connect("/hosts/server").await?;
    let supervision = ReconnectOptions::new()
        .backoff(Duration::from_millis(100), Duration::from_secs(1))
        .connect_timeout(CALL_TIMEOUT)
        .peer_timeout(PEER_TIMEOUT);
    let mut link = watch.connect_persistent(&format!("{carrier}:/{reader}"), supervision);
    let telling = async {
        loop {
            match link.changed().await {
                ConnectionState::Connected => println!("link up"),
                ConnectionState::Disconnected { reason } => println!("link lost: {reason}"),
                _ => {}
            }
        }
    };
    let writing = async {
        let mut connected = true;
        for number in 0.. {
            let message = Bottle::of(number);
            watch.write_if_idle(&message, None);
            plain.write_if_idle(&message, None);
            if plain.outputs().is_empty() && std::mem::take(&mut connected) {
                println!("plain lost");
            }
            tokio::time::sleep(WRITE_INTERVAL).await;
        }
    };
    let calling = async {
        let hello = Bottle::of("hello");
        let mut last = None;
        loop {
            if caller.outputs().is_empty() {
                // An attempt to connect also ends within its timeout.
                let _ = caller.connect("/hosts/server").await;
            }
            let answer = caller.call_within::<Bottle>(&hello, CALL_TIMEOUT).await;
            let outcome = answer.is_ok();
            if last.replace(outcome) != Some(outcome) {
                println!("call {}", if outcome { "ok" } else { "failed" });
            }
            tokio::time::sleep(WRITE_INTERVAL).await;
        }
    };
    tokio::select! {
        () = telling => {}
        () = writing => {}
        () = calling => {}
        () = end_of_input() => {}
    }
    drop(link);
    tokio::join!(watch.close(), plain.close(), caller.close());
    println!("closed");
    Ok(())
}
