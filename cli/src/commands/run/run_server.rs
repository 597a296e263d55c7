//! Server of `yarp run`: executes requests that arrive at its port.

use std::env;
use std::fs::File;
use std::io::Write;
use std::path::Path;
use std::process::ExitCode;
use std::sync::Arc;

use rustix::process::Signal;
use tokio::sync::Notify;
use yarp_ports::roles::{Peer, Right};
use yarp_ports::{Answer, Network, PortOptions, Received};
use yarp_wire::{Bottle, Value};

use super::launch::Launch;
use super::orphan_guard::OrphanGuard;
use super::output_log::{LOGGER, OutputLog};
use super::process_table::Processes;
use super::system_information::SystemInformation;
use super::{EXIT_FAILED, REPLY_ERROR, note};
use crate::commands::argument_words::Options;
use crate::error::Result;
use crate::listen_addresses::UNKNOWN_PEER;
use crate::signals::Interrupt;
use crate::{RUN_PROGRAM, network_access, systemd_notify};

/// Runs a server until a request or a signal ends it.
pub(super) async fn serve(name: &str, options: &Options, out: &mut dyn Write) -> Result<ExitCode> {
    let bind = match options.bind() {
        Ok(bind) => bind,
        Err(problem) => {
            note(format_args!("[ERROR] {problem}"));
            return Ok(ExitCode::from(EXIT_FAILED));
        }
    };
    let network = bind.apply(network_access::network()?);
    if network.key().is_none() && may_administer(&network, name, UNKNOWN_PEER) {
        let why = format!(
            "there is no key (auth.conf), and no role (roles.conf) that is about {name}: any host that reaches it can run \
             anything as the user of this server"
        );
        if !options.has("insecure") && !is_stock_program() {
            note(format_args!(
                "[ERROR] Not started: {why}. Add a key or roles, or give --insecure if that is what you want"
            ));
            return Ok(ExitCode::from(EXIT_FAILED));
        }
        tracing::warn!(target: "yarp.run", "********** INSECURE **********");
        tracing::warn!(target: "yarp.run", "{why}");
        tracing::warn!(target: "yarp.run", "******************************");
    }
    let mut interrupt = Interrupt::listen();
    let processes = Arc::new(Processes::new(
        OrphanGuard::start()?,
        OutputLog::new(&network, name),
    ));
    let ending = Arc::new(Notify::new());
    let handler = CommandHandler {
        name: name.to_owned(),
        network: network.clone(),
        processes: processes.clone(),
        ending: ending.clone(),
        logger: options
            .has("log")
            .then(|| options.text("log").filter(|name| !name.is_empty()))
            .map(|name| name.unwrap_or_else(|| LOGGER.to_owned())),
    };
    // The handler checks the roles itself: the right to write is not sufficient.
    let options = PortOptions::new()
        .handler(move |received| handler.answer(received))
        .allow_any_writer()
        .no_browsers()
        .input_only();
    let Some(port) = network_access::open(&network, name, options).await? else {
        note(format_args!("[ERROR] Yarprun failed to open port:  {name}"));
        processes.end().await;
        return Ok(ExitCode::from(EXIT_FAILED));
    };
    // Tools find servers by this property.
    if let Err(error) = network.ask(&format!("set {name} yarprun true")).await {
        tracing::warn!(target: "yarp.run", "cannot mark {name} as a server of commands: {}", error.error_chain());
    }
    // The two blanks are stock's.
    writeln!(out, "[INFO] Yarprun successfully started on port:  {name}")?;
    out.flush()?;
    systemd_notify::notify_ready();
    tokio::select! {
        () = interrupt.interrupted_times(1) => {}
        () = ending.notified() => {}
    }
    port.close().await;
    processes.end().await;
    Ok(ExitCode::SUCCESS)
}

/// Returns whether this program was started under the name of stock's: then a server starts as stock's does, so that launch
/// scripts keep working.
fn is_stock_program() -> bool {
    let path = env::args_os().next().unwrap_or_default();
    Path::new(&path).file_name() == Some(RUN_PROGRAM.as_ref())
}

fn may_administer(network: &Network, name: &str, peer: Peer<'_>) -> bool {
    network.roles().rights(name, peer).has(Right::Administer)
}

/// Handles requests.
struct CommandHandler {
    name: String,
    network: Network,
    processes: Arc<Processes>,
    ending: Arc<Notify>,
    /// Logger of all commands, if the server has one.
    logger: Option<String>,
}

impl CommandHandler {
    fn answer(&self, received: &mut Received) -> Answer {
        let peer = Peer {
            name: &received.from,
            address: received.address,
        };
        if !may_administer(&self.network, &self.name, peer) {
            let name = &self.name;
            let text =
                format!("ABORTED: roles.conf gives {peer} no right to administer on {name}\n");
            return Answer::reply(Bottle::from_iter([Value::Int32(REPLY_ERROR), text.into()]));
        }
        match received.bottle() {
            Ok(request) if contains_word(&request, "sysinfo") => {
                Answer::reply(SystemInformation::of_this_machine())
            }
            Ok(request) => Answer::reply(self.reply(&request)),
            Err(error) => Answer::reply(not_done(&format!("cannot read the request: {error}"))),
        }
    }

    /// Executes a request and returns the reply. The order of the checks is stock's.
    fn reply(&self, request: &Bottle) -> Bottle {
        let text = |name| {
            request
                .find(name)
                .map(Value::to_plain_string)
                .unwrap_or_default()
        };
        let has = |name| contains_word(request, name);
        let processes = &self.processes;
        let verdict = |name: &str, done: bool| {
            Bottle::of(format!("{name} {}", if done { "OK" } else { "FAILED" }).as_str())
        };
        if has("which") {
            return Bottle::of(which(&text("which")).as_str());
        }
        if has("exit") {
            self.ending.notify_one();
            return verdict("exit", true);
        }
        if has("stdio") {
            let launch = Launch::of(request);
            return self.aborted(&launch, "This server opens no terminals; leave out --stdio");
        }
        if has("cmd") {
            let mut launch = Launch::of(request);
            launch.logger = self.logger_of(request);
            return self.start(launch);
        }
        if has("kill") {
            let group = request.find_group("kill");
            let number = group.and_then(|group| group.get(2)?.as_i32());
            let signal = number.and_then(Signal::from_named_raw);
            let done =
                signal.is_some_and(|signal| processes.signal(Some(&text("kill")), signal) > 0);
            return verdict("kill", done);
        }
        if has("sigterm") {
            let count = processes.signal(Some(&text("sigterm")), Signal::TERM);
            return verdict("sigterm", count > 0);
        }
        if has("sigtermall") {
            processes.signal(None, Signal::TERM);
            return verdict("sigtermall", true);
        }
        if has("ps") {
            return processes.list();
        }
        if has("isrunning") {
            return Bottle::of(match processes.is_running(&text("isrunning")) {
                true => "running",
                false => "not running",
            });
        }
        if has("killstdio") {
            // There are no terminals to close.
            return verdict("killstdio", true);
        }
        // Stock does not answer this request.
        not_done(&format!("unknown request: {request}"))
    }

    /// Returns the logger for the output of a requested command: the one that it names, else that of the server.
    fn logger_of(&self, request: &Bottle) -> Option<String> {
        let group = request.find_group("log");
        let named = group.and_then(|group| Some(group.get(1)?.as_str()?.to_owned()));
        let default = || contains_word(request, "log").then(|| LOGGER.to_owned());
        named.or_else(|| self.logger.clone()).or_else(default)
    }

    fn start(&self, launch: Launch) -> Bottle {
        match self.processes.start(launch.clone()) {
            Ok(pid) => {
                let (name, number) = (&self.name, pid.as_raw_nonzero().get());
                let Launch { tag, command, .. } = &launch;
                let told =
                    format!("STARTED: server={name} alias={tag} cmd={command} pid={number}\n");
                note(told.trim_end());
                Bottle::from_iter([Value::Int32(number), told.into()])
            }
            Err(reason) => self.aborted(&launch, &reason),
        }
    }

    fn aborted(&self, launch: &Launch, reason: &str) -> Bottle {
        let (name, Launch { tag, command, .. }) = (&self.name, launch);
        let told = format!("ABORTED: server={name} alias={tag} cmd={command}\n{reason}\n");
        note(told.trim_end());
        Bottle::from_iter([Value::Int32(REPLY_ERROR), told.into()])
    }
}

/// Returns a reply that every client reads as failure.
fn not_done(text: &str) -> Bottle {
    Bottle::from_iter([
        Value::Int32(REPLY_ERROR),
        format!("ABORTED: {text}\n").into(),
    ])
}

/// Returns true if a request contains a word, or a list that begins with it.
fn contains_word(request: &Bottle, name: &str) -> bool {
    request.find_group(name).is_some() || request.iter().any(|value| value.as_str() == Some(name))
}

/// Returns the path of a program; its name if it is not found.
fn which(name: &str) -> String {
    let paths = env::var_os("PATH").unwrap_or_default();
    let mut found = env::split_paths(&paths).map(|path| path.join(name));
    let found = found.find(|path| !name.is_empty() && path.is_file() && File::open(path).is_ok());
    match found {
        Some(path) => path.to_string_lossy().into_owned(),
        None => name.to_owned(),
    }
}
