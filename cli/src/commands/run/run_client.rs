//! Client of `yarp run`: sends one request to a server.

use std::io::Write;
use std::process::ExitCode;
use std::time::Duration;

use yarp_ports::{AdminClient, Network, Port, PortError, PortOptions};
use yarp_wire::carrier::Carrier;
use yarp_wire::{Bottle, Value};

use super::system_information::SystemInformation;
use super::{EXIT_FAILED, REPLY_ERROR, USAGE, note};
use crate::commands::argument_words::Options;
use crate::error::Result;
use crate::network_access;
use crate::signals::Interrupt;

/// Maximum number of attempts to reach a server, and the delay between, as in stock.
const MAX_ATTEMPTS: u32 = 20;
const RETRY_DELAY: Duration = Duration::from_millis(500);
/// Timeout for the reply. The server may have to open terminals.
const REPLY_TIMEOUT: Duration = Duration::from_secs(60);
/// Maximum length of the description of a machine, in bytes.
const MAX_DESCRIPTION: usize = 4 << 20;
/// Name of the client in a connection that belongs to no port.
const SENDER: &str = "/yarprun/client";
/// Exit code of stock if the server did not execute the request.
const EXIT_NOT_DONE: u8 = 2;

/// A request to a server.
#[derive(Debug, PartialEq)]
pub(super) struct RunRequest {
    server: String,
    request: Bottle,
    /// Reply that means success; `None` accepts any reply.
    yes: Option<&'static str>,
    /// True if the reply begins with a process id.
    starts: bool,
}

impl RunRequest {
    /// Parses the options; returns `None` without a request, or an error message.
    pub(super) fn of(options: &Options) -> std::result::Result<Option<Self>, String> {
        if options.has("stresstest") {
            return Err("--stresstest is not supported".to_owned());
        }
        if options.has("cmd") {
            return Self::start(options).map(Some);
        }
        for (name, yes) in [
            ("kill", Some("kill OK")),
            ("sigterm", Some("sigterm OK")),
            ("sigtermall", None),
            ("ps", None),
            ("isrunning", Some("running")),
            ("which", None),
            ("exit", None),
        ] {
            if !options.has(name) {
                continue;
            }
            let server = text(options, "on", "missing remote server")?;
            if yes.is_some() {
                text(options, name, "missing tag")?;
            }
            let signal = || options.group("kill")?.values().get(1)?.value().as_i32();
            if name == "kill" && signal().is_none_or(|number| number == 0) {
                return Err("missing signum".to_owned());
            }
            return Ok(Some(Self {
                server,
                request: [group(options, name)].into_iter().collect(),
                yes,
                starts: false,
            }));
        }
        Ok(None)
    }

    fn start(options: &Options) -> std::result::Result<Self, String> {
        let mut names = vec!["cmd", "as", "workdir", "log", "env"];
        if options.has("stdio") {
            text(options, "stdio", "missing remote stdio server")?;
            names = vec![
                "stdio", "cmd", "as", "on", "workdir", "geometry", "hold", "env", "log",
            ];
        }
        text(options, "cmd", "missing command")?;
        text(options, "as", "missing tag")?;
        let server = text(options, "on", "missing remote server")?;
        let names = names.into_iter().filter(|name| options.has(name));
        Ok(Self {
            server,
            request: names.map(|name| group(options, name)).collect(),
            yes: None,
            starts: true,
        })
    }

    /// Returns true if the reply reports success.
    fn is_done(&self, reply: &Bottle) -> bool {
        let number = reply.get(0).and_then(Value::as_i32);
        match self.yes {
            Some(yes) => reply.get(0).and_then(Value::as_str) == Some(yes),
            None if self.starts => number.is_some_and(|number| number > 0),
            None => number != Some(REPLY_ERROR),
        }
    }
}

/// Returns the text of a required option.
fn text(options: &Options, name: &str, complaint: &str) -> std::result::Result<String, String> {
    let value = options.value(name);
    let text = value.as_ref().and_then(Value::as_str).unwrap_or_default();
    match text.is_empty() {
        true => Err(complaint.to_owned()),
        false => Ok(text.to_owned()),
    }
}

/// Returns an option as a list that begins with its name.
fn group(options: &Options, name: &str) -> Value {
    let values = options.group(name).map(|group| group.values());
    let values = values.unwrap_or_default().iter().map(|value| value.value());
    Value::List(std::iter::once(name.into()).chain(values).collect())
}

/// Sends the request, prints the reply on standard error as stock does, and returns the exit code.
pub(super) async fn ask(
    run_request: &RunRequest,
    options: &Options,
    out: &mut dyn Write,
) -> Result<ExitCode> {
    let network = network_access::network()?;
    if network.server().is_none() || !network_access::serves(&network, network.namespace()).await {
        note("ERROR: no yarp network found.");
        return Ok(ExitCode::from(EXIT_FAILED));
    }
    let mut interrupt = Interrupt::listen();
    if run_request.starts && options.has("stdio") {
        writeln!(out, "*********** {} ************", options.described())?;
    }
    let reply = reply(&network, run_request, &mut interrupt).await?;
    note("RESPONSE:\n=========");
    let Some(reply) = reply else {
        note("Cannot connect to remote server, aborting...\n");
        return Ok(ExitCode::from(EXIT_NOT_DONE));
    };
    for value in reply.iter() {
        note(value.to_plain_string());
    }
    Ok(match run_request.is_done(&reply) {
        // Stock's `ps` ends like this if nothing runs.
        _ if reply.is_empty() => ExitCode::from(EXIT_FAILED),
        true => ExitCode::SUCCESS,
        false => ExitCode::from(EXIT_NOT_DONE),
    })
}

/// Asks for the description of a server's machine and prints it as stock does.
pub(super) async fn ask_system_information(
    options: &Options,
    out: &mut dyn Write,
) -> Result<ExitCode> {
    let server = match text(options, "on", "missing remote server") {
        Ok(server) => server,
        Err(complaint) => {
            note(format_args!("SYNTAX ERROR: {complaint}\n{USAGE}"));
            return Ok(ExitCode::from(EXIT_FAILED));
        }
    };
    let network = network_access::network()?;
    if network.server().is_none() || !network_access::serves(&network, network.namespace()).await {
        note("ERROR: no yarp network found.");
        return Ok(ExitCode::from(EXIT_FAILED));
    }
    let asking = async {
        let endpoint = network.query(&server).await?;
        // Stock's client uses it, too.
        let carrier = Carrier::by_name("tcp").expect("tcp is in the table");
        let address = (endpoint.host.as_str(), endpoint.port);
        let client = AdminClient::open(&server, address, carrier, SENDER, &network).await?;
        let request = Bottle::from_iter([Value::List(["sysinfo".into()].into_iter().collect())]);
        let parse = |bytes: &[u8]| {
            SystemInformation::parse(bytes).map(|parsed| parsed.map(|(information, _)| information))
        };
        client.call_parsed(&request, MAX_DESCRIPTION, parse).await
    };
    let mut interrupt = Interrupt::listen();
    let described = tokio::select! {
        biased;
        () = interrupt.interrupted() => return Ok(ExitCode::from(EXIT_FAILED)),
        described = asking => described,
    };
    match described {
        Ok(information) => {
            write!(out, "RESPONSE:\n=========\n\n{information}")?;
            Ok(ExitCode::SUCCESS)
        }
        Err(error) => {
            note(format_args!(
                "RESPONSE:\n=========\nCannot connect to remote server, aborting...\n{}",
                error.error_chain()
            ));
            Ok(ExitCode::from(EXIT_FAILED))
        }
    }
}

/// Returns the reply of the server; `None` if it cannot be reached, or a signal came first.
async fn reply(
    network: &Network,
    run_request: &RunRequest,
    interrupt: &mut Interrupt,
) -> Result<Option<Bottle>> {
    tokio::select! {
        biased;
        () = interrupt.interrupted() => Ok(None),
        reply = send(network, &run_request.server, &run_request.request) => reply,
    }
}

/// Sends a request to a server; `None` if the server cannot be reached.
///
/// Errors: a reply that does not come in time. The outcome is unknown then.
pub(super) async fn send(
    network: &Network,
    server: &str,
    request: &Bottle,
) -> Result<Option<Bottle>> {
    for attempt in 0..MAX_ATTEMPTS {
        if attempt > 0 {
            tokio::time::sleep(RETRY_DELAY).await;
        }
        let Some(port) =
            network_access::open(network, "...", PortOptions::new().rpc_client()).await?
        else {
            continue;
        };
        let reply = call(&port, server, request).await;
        port.close().await;
        match reply {
            Ok(reply) => return Ok(Some(reply)),
            // Repeating the request might execute it twice.
            Err(error @ PortError::Timeout { .. }) => return Err(error.into()),
            Err(error) => {
                tracing::debug!(target: "yarp.os.Network", "{}", error.error_chain())
            }
        }
    }
    Ok(None)
}

async fn call(
    port: &Port,
    server: &str,
    request: &Bottle,
) -> std::result::Result<Bottle, PortError> {
    port.connect(server).await?;
    port.call_within(request, REPLY_TIMEOUT).await
}

#[cfg(test)]
mod tests {
    use super::*;

    fn run_request(words: &[&str]) -> std::result::Result<Option<RunRequest>, String> {
        let words: Vec<String> = words.iter().map(|word| (*word).to_owned()).collect();
        RunRequest::of(&Options::parse(&words))
    }

    #[test]
    fn options_are_converted_to_stock_requests() {
        let check = |words: &[&str], expected: &str| {
            let run_request = run_request(words).unwrap().unwrap();
            assert_eq!(
                (
                    run_request.server.as_str(),
                    run_request.request.to_string().as_str()
                ),
                ("/h", expected)
            );
        };
        check(
            &[
                "--on", "/h", "--as", "t", "--cmd", "sleep 9", "--env", "A=1;B=2",
            ],
            "(cmd \"sleep 9\") (as t) (env \"A=1;B=2\")",
        );
        check(
            &[
                "--cmd", "ls", "--as", "t", "--on", "/h", "--stdio", "/x", "--hold",
            ],
            "(stdio \"/x\") (cmd ls) (as t) (on \"/h\") (hold)",
        );
        check(&["--on", "/h", "--kill", "t", "9"], "(kill t 9)");
        check(&["--on", "/h", "--sigterm", "t"], "(sigterm t)");
        check(&["--on", "/h", "--sigtermall"], "(sigtermall)");
        check(&["--on", "/h", "--ps"], "(ps)");
        check(&["--on", "/h", "--exit"], "(exit)");
    }

    #[test]
    fn missing_arguments_are_reported() {
        let check = |words: &[&str], expected: &str| {
            assert_eq!(run_request(words), Err(expected.to_owned()))
        };
        check(&["--cmd", "ls", "--as", "t"], "missing remote server");
        check(&["--cmd", "ls", "--on", "/h"], "missing tag");
        check(&["--cmd", "--on", "/h"], "missing command");
        check(&["--sigterm", "--on", "/h"], "missing tag");
        check(&["--sigterm", "t"], "missing remote server");
        check(&["--kill", "t", "--on", "/h"], "missing signum");
        check(&["--stresstest"], "--stresstest is not supported");
        assert_eq!(run_request(&["--on", "/h"]), Ok(None));
    }

    #[test]
    fn replies_report_success() {
        let check = |words: &[&str], reply: &str, expected: bool| {
            let run_request = run_request(words).unwrap().unwrap();
            let reply = Bottle::parse(reply).unwrap();
            assert_eq!(run_request.is_done(&reply), expected, "{words:?} {reply}");
        };
        let start = &["--on", "/h", "--as", "t", "--cmd", "ls"];
        check(start, "17 \"STARTED: ..\"", true);
        check(start, "-1 \"ABORTED: ..\"", false);
        check(&["--on", "/h", "--isrunning", "t"], "running", true);
        check(
            &["--on", "/h", "--isrunning", "t"],
            "\"not running\"",
            false,
        );
        check(&["--on", "/h", "--ps"], "((pid 1))", true);
        check(&["--on", "/h", "--ps"], "-1 \"ABORTED: ..\"", false);
    }
}
