//! `yarp merge`: merges the messages of several ports.

use std::io::Write;
use std::process::ExitCode;
use std::sync::{Arc, Mutex, PoisonError};

use tokio::sync::Notify;
use yarp_devices::clock;
use yarp_ports::{Answer, Network, Port, PortOptions, Received};
use yarp_wire::{Bottle, Stamp};

use super::argument_words::Options;
use crate::error::Result;
use crate::network_access;
use crate::port_connections::{self, Verbosity};
use crate::signals::Interrupt;

const USAGE: &str = "\
This is yarp merge. Please provide a list of ports to read from, e.g:
  yarp merge /port1 /port2
Alternative syntax:
  yarp merge --input /p1 /p2 --output /p3 --worker /prefix --carrier udp";

/// Maximum number of merged messages queued for a reader before it misses one. Stock omits one
/// whenever the one before it was not acknowledged yet, and then the last message of a burst may be
/// missing.
const MAX_BACKLOG: usize = 16;

/// Exit code of stock if the command cannot start.
const EXIT_FAILED: u8 = 255;

/// concatenate input from several ports into a single unit
///
/// Whenever one of the ports sends a message, the latest messages of all of them, concatenated, are
/// sent as one. `--output PORT` (/portsMerge/o0) is the output; `--worker PREFIX` (/portsMerge/i)
/// is the prefix of the input ports, and `--carrier CARRIER` (udp) the carrier they read over.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// Ports and options
    #[arg(
        value_name = "PORT ... | --input PORT ... [--output PORT] [--worker PREFIX] [--carrier CARRIER]",
        allow_hyphen_values = true,
        trailing_var_arg = true
    )]
    words: Vec<String>,
}

/// Latest messages, by index of their port.
#[derive(Default)]
struct LatestInputs {
    bottles: Mutex<Vec<Bottle>>,
    changed: Notify,
}

pub(super) async fn run(args: Args, out: &mut dyn Write) -> Result<ExitCode> {
    if args.words.is_empty() {
        writeln!(out, "{USAGE}")?;
        return Ok(ExitCode::from(EXIT_FAILED));
    }
    let options = Options::parse(&args.words);
    let text = |name: &str, usual: &str| options.text(name).unwrap_or_else(|| usual.to_owned());
    let sources = match options.group("input") {
        Some(group) => {
            let values = group.values().iter();
            values.map(|value| value.to_plain_string()).collect()
        }
        None => args.words.clone(),
    };
    let (output, worker) = (
        text("output", "/portsMerge/o0"),
        text("worker", "/portsMerge/i"),
    );
    let network = network_access::network()?;
    let mut interrupt = Interrupt::listen();
    network_access::follow_clock(&network, &mut interrupt).await?;
    let newest = Arc::new(LatestInputs::default());
    let names = (0..sources.len()).map(|place| format!("{worker}{place}"));
    let mut ports = open(&network, names, &newest).await?;
    let writer = network_access::open(&network, &output, PortOptions::new()).await?;
    let mut ready = ports.len() == sources.len();
    if let Some(writer) = &writer {
        let carrier = text("carrier", "udp");
        for (source, port) in sources.iter().zip(&ports) {
            ready = ready
                && port_connections::connect(
                    &network,
                    source,
                    port.name(),
                    Some(&carrier),
                    Verbosity::All,
                )
                .await;
        }
        if ready {
            crate::systemd_notify::notify_ready();
            writeln!(out, "Ready. Output goes to {}", writer.name())?;
            out.flush()?;
            pass_on(&newest, writer, &mut interrupt).await;
        }
    }
    for port in ports.drain(..).chain(writer) {
        port.close().await;
    }
    Ok(ExitCode::from(EXIT_FAILED))
}

/// Opens the input ports; stops at the first failure.
async fn open(
    network: &Network,
    names: impl Iterator<Item = String>,
    newest: &Arc<LatestInputs>,
) -> Result<Vec<Port>> {
    let mut ports = Vec::new();
    for (place, name) in names.enumerate() {
        newest.bottles().push(Bottle::new());
        let newest = newest.clone();
        let take = move |received: &mut Received| {
            if let Ok(bottle) = received.bottle() {
                newest.bottles()[place] = bottle;
                newest.changed.notify_one();
            }
            Answer::Nothing
        };
        let options = PortOptions::new().handler(take).input_only();
        match network_access::open(network, &name, options).await? {
            Some(port) => ports.push(port),
            None => break,
        }
    }
    Ok(ports)
}

/// Forwards messages until a signal.
async fn pass_on(newest: &LatestInputs, writer: &Port, interrupt: &mut Interrupt) {
    // Stock counts from 0.
    let mut stamp = Stamp::new(-1, 0.0);
    loop {
        tokio::select! {
            biased;
            () = interrupt.interrupted() => return,
            () = newest.changed.notified() => {}
        }
        stamp = stamp.next(clock::now());
        let bottles = newest.bottles().clone();
        let all: Bottle = bottles.iter().flat_map(|one| one.iter().cloned()).collect();
        writer.try_write(&all, Some(stamp.into()), MAX_BACKLOG);
    }
}

impl LatestInputs {
    fn bottles(&self) -> std::sync::MutexGuard<'_, Vec<Bottle>> {
        self.bottles.lock().unwrap_or_else(PoisonError::into_inner)
    }
}
