//! `yarp name`: sends requests to the name server.

use std::io::Write;
use std::process::ExitCode;

use yarp_ports::{Network, addresses};
use yarp_wire::carrier::ALL;
use yarp_wire::name_service::{END, Registration};
use yarp_wire::{Bottle, Contact, Value};

use crate::error::Result;
use crate::network_access;
use crate::stock_format::complain;

/// send commands to the yarp name server
///
/// Sends a request to the name server.
///
/// `query PORT` prints the address of a port; `register PORT [CARRIER [IP [NUMBER]]]` registers a
/// port; `unregister PORT` unregisters it. Any other request is sent unchanged: `list`, `set PORT
/// KEY VALUE`, `get PORT KEY`, `check PORT KEY VALUE`, `help`. `list --state [PREFIX]` shows which
/// ports are alive, unreachable or gone, if the name server is one of ours.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// Request
    #[arg(
        value_name = "REQUEST",
        allow_hyphen_values = true,
        trailing_var_arg = true
    )]
    words: Vec<String>,
}

pub(super) async fn run(args: Args, out: &mut dyn Write) -> Result<ExitCode> {
    let words: Vec<&str> = args.words.iter().map(String::as_str).collect();
    let Some((command, rest)) = words.split_first() else {
        // Stock sends nothing and waits for the answer.
        complain(out, "Please supply a request, for example: yarp name list")?;
        return Ok(ExitCode::FAILURE);
    };
    let network = network_access::network()?;
    match *command {
        "query" => query(&network, rest.first().copied().unwrap_or_default(), out).await,
        "register" => register(&network, rest, out).await,
        "list" if rest.first() == Some(&"--state") => {
            states(&network, rest.get(1).copied().unwrap_or_default(), out).await
        }
        "unregister" => unregister(&network, rest.first().copied().unwrap_or_default(), out).await,
        _ if answers_with_a_bottle(&words) => structured(&network, &words, out).await,
        _ => plain(&network, &words.join(" "), out).await,
    }
}

/// Returns true for requests whose answer is a bottle: stock's client waits for an end that never
/// comes.
fn answers_with_a_bottle(words: &[&str]) -> bool {
    matches!(
        words[0],
        "bot" | "topic" | "untopic" | "subscribe" | "unsubscribe" | "type"
    )
}

async fn query(network: &Network, name: &str, out: &mut dyn Write) -> Result<ExitCode> {
    let contact = Contact {
        name: name.to_owned(),
        ..Contact::default()
    };
    match network_access::find(network, &contact).await? {
        Some(place) => {
            writeln!(out, "{}\n", registration(&place))?;
            Ok(ExitCode::SUCCESS)
        }
        None => {
            complain(out, &format!("{name} not known."))?;
            Ok(ExitCode::FAILURE)
        }
    }
}

fn registration(place: &Registration) -> String {
    let Registration {
        name,
        host,
        port,
        carrier,
        ..
    } = place;
    format!("registration name {name} ip {host} port {port} type {carrier}")
}

async fn register(network: &Network, words: &[&str], out: &mut dyn Write) -> Result<ExitCode> {
    let words = if words.is_empty() {
        &["..."][..]
    } else {
        words
    };
    let answer = match network.ask(&format!("register {}", words.join(" "))).await {
        Ok(answer) => answer,
        Err(error) => {
            network_access::log_server_unreachable(network, &error);
            return Ok(ExitCode::FAILURE);
        }
    };
    let Some(place) = answer.registration() else {
        let lines: Vec<_> = answer.lines().collect();
        complain(
            out,
            &format!("the name server refused: {}", lines.join(" ")),
        )?;
        return Ok(ExitCode::FAILURE);
    };
    let name = &place.name;
    let carriers = ALL.map(|carrier| carrier.name).join(" ");
    for (key, values) in [
        ("offers", carriers.clone()),
        ("accepts", carriers),
        ("ips", addresses::own().join(" ")),
    ] {
        network.ask(&format!("set {name} {key} {values}")).await?;
    }
    writeln!(out, "{}\n", registration(&place))?;
    Ok(ExitCode::SUCCESS)
}

async fn unregister(network: &Network, name: &str, out: &mut dyn Write) -> Result<ExitCode> {
    match network.unregister(name).await {
        Ok(()) => {
            writeln!(out, "Unregistered name.")?;
            Ok(ExitCode::SUCCESS)
        }
        Err(error) => {
            network_access::log_server_unreachable(network, &error);
            Ok(ExitCode::FAILURE)
        }
    }
}

/// Lists ports with their states, which a stock name server does not know.
async fn states(network: &Network, prefix: &str, out: &mut dyn Write) -> Result<ExitCode> {
    let asking = async {
        let states = network.ask(&format!("state {prefix}")).await?;
        let list = network.ask(&format!("list {prefix}")).await?;
        Ok((states, list))
    };
    let (states, list) = match asking.await {
        Ok(answers) => answers,
        Err(error) => {
            network_access::log_server_unreachable(network, &error);
            complain(out, "Failed to reach name server")?;
            return Ok(ExitCode::FAILURE);
        }
    };
    let known: Vec<_> = states.lines().collect();
    match known.is_empty() {
        true => {
            for line in list.lines() {
                writeln!(out, "{line} state unknown")?;
            }
        }
        false => {
            for line in known {
                writeln!(out, "{line}")?;
            }
        }
    }
    writeln!(out, "{END}")?;
    Ok(ExitCode::SUCCESS)
}

async fn plain(network: &Network, request: &str, out: &mut dyn Write) -> Result<ExitCode> {
    let answer = match network.ask(request).await {
        Ok(answer) => answer,
        Err(error) => {
            if network.server().is_some() {
                network_access::log_unreachable(&error);
            }
            complain(out, "Failed to reach name server")?;
            return Ok(ExitCode::FAILURE);
        }
    };
    let mut structured = false;
    for line in answer.lines() {
        structured |= line.starts_with('[');
        writeln!(out, "{line}")?;
    }
    if !structured {
        writeln!(out, "{END}")?;
    }
    Ok(ExitCode::SUCCESS)
}

async fn structured(network: &Network, words: &[&str], out: &mut dyn Write) -> Result<ExitCode> {
    let request: Bottle = words.iter().copied().map(Value::from).collect();
    match network_access::ask_server(network, &request).await {
        Ok(answer) => {
            writeln!(out, "{answer}")?;
            Ok(ExitCode::SUCCESS)
        }
        Err(error) => {
            network_access::log_server_unreachable(network, &error);
            complain(out, "Failed to reach name server")?;
            Ok(ExitCode::FAILURE)
        }
    }
}
