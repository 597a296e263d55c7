//! Server of `yarp run`: executes requests that arrive at its port.

use std::env;
use std::fs::File;
use std::io::Write;
use std::path::Path;
use std::process::ExitCode;
use std::sync::Arc;

use rustix::process::{Pid, Signal};
use tokio::sync::Notify;
use yarp_ports::roles::{Peer, Right};
use yarp_ports::{Answer, Network, PortOptions, Received};
use yarp_wire::{Bottle, Value};

use super::launch::Launch;
use super::orphan_guard::OrphanGuard;
use super::output_log::{LOGGER, OutputLog};
use super::process_table::Processes;
use super::system_information::SystemInformation;
use super::terminal_session::TerminalSession;
use super::terminal_window::{TerminalProgram, TerminalRequest};
use super::{EXIT_FAILED, REPLY_ERROR, contains_word, note, run_client};
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
    let handler = Arc::new(CommandHandler {
        name: name.to_owned(),
        network: network.clone(),
        processes: processes.clone(),
        ending: ending.clone(),
        logger: options
            .has("log")
            .then(|| options.text("log").filter(|name| !name.is_empty()))
            .map(|name| name.unwrap_or_else(|| LOGGER.to_owned())),
        terminal_program: TerminalProgram::of(options),
    });
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
    terminal_program: TerminalProgram,
}

impl CommandHandler {
    fn answer(self: &Arc<Self>, received: &mut Received) -> Answer {
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
            Ok(request) if is_for_terminal(&request) => {
                let handler = self.clone();
                // It goes on if the client does not wait for the reply.
                let starting =
                    tokio::spawn(async move { handler.start_in_terminal(&request).await });
                Answer::Later(Box::pin(async move {
                    let failed = |_| not_done("the terminal was not opened");
                    Answer::reply(starting.await.unwrap_or_else(failed))
                }))
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
            let group = request.find_group("killstdio");
            let session = group.and_then(|group| group.get(2)?.as_str());
            processes.close_terminals(&text("killstdio"), session);
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
            Ok(pid) => self.started(&launch, pid),
            Err(reason) => self.aborted(&launch, &reason),
        }
    }

    fn started(&self, launch: &Launch, pid: Pid) -> Bottle {
        let (name, number) = (&self.name, pid.as_raw_nonzero().get());
        let Launch { tag, command, .. } = launch;
        let told = format!("STARTED: server={name} alias={tag} cmd={command} pid={number}\n");
        note(told.trim_end());
        Bottle::from_iter([Value::Int32(number), told.into()])
    }

    /// Starts a command of this server with a terminal, or a terminal for the command of another server.
    async fn start_in_terminal(self: Arc<Self>, request: &Bottle) -> Bottle {
        let text = |name| request.find(name).and_then(Value::as_str);
        if text("on") != Some(&self.name) {
            return self.open_terminal(request).await;
        }
        let terminal_server = text("stdio").unwrap_or_default().to_owned();
        let mut launch = Launch::of(request);
        launch.logger = self.logger_of(request);
        let mut session = match TerminalSession::open(&self.network, &self.name, &launch.tag).await
        {
            Ok(session) => session,
            Err(reason) => {
                let reason = format!("Can't open the ports of the terminal: {reason}");
                return self.aborted(&launch, &reason);
            }
        };
        let opened = self
            .request_terminal(request, &terminal_server, session.id())
            .await;
        if !is_process(&opened) {
            let mut reply = self.aborted(
                &launch,
                &format!("There is no terminal on {terminal_server}"),
            );
            reply.extend(opened);
            session.close().await;
            return reply;
        }
        let mut reply = match self.processes.start_piped(launch.clone()) {
            Ok(command) => {
                let mut reply = self.started(&launch, command.pid);
                reply.push(session.id());
                let handler = self.clone();
                tokio::spawn(async move {
                    let log = match &launch.logger {
                        Some(logger) => {
                            let log = handler.processes.log();
                            log.open(&launch.command, command.pid, logger).await
                        }
                        None => None,
                    };
                    session.run(command, log).await;
                    handler
                        .end_session(session, &launch.tag, &terminal_server)
                        .await;
                });
                reply
            }
            Err(reason) => {
                let reply = self.aborted(&launch, &reason);
                session.send_text(&format!("{reason}\n")).await;
                self.end_session(session, &launch.tag, &terminal_server)
                    .await;
                reply
            }
        };
        reply.extend(opened);
        reply
    }

    /// Has the server `terminal_server` open a terminal; returns its reply.
    async fn request_terminal(
        &self,
        request: &Bottle,
        terminal_server: &str,
        session: &str,
    ) -> Bottle {
        let group = Bottle::from_iter(["stdiouuid", session].map(Value::from));
        let mut request = request.clone();
        request.push(Value::List(group));
        if terminal_server == self.name {
            return self.open_terminal(&request).await;
        }
        match run_client::send(&self.network, terminal_server, &request).await {
            Ok(Some(reply)) => reply,
            Ok(None) => not_done(&format!("cannot connect to the server {terminal_server}")),
            Err(error) => not_done(&error.error_chain()),
        }
    }

    /// Opens a terminal on this machine.
    async fn open_terminal(&self, request: &Bottle) -> Bottle {
        let name = &self.name;
        let request = match TerminalRequest::of(request) {
            Ok(request) => request,
            Err(reason) => return not_done(&reason),
        };
        let tag = request.tag().to_owned();
        let opened = request.open(&self.terminal_program, &self.processes, &self.network);
        let (number, told) = match opened.await {
            Ok(pid) => {
                let number = pid.as_raw_nonzero().get();
                let told = format!("STARTED: server={name} alias={tag} cmd=xterm pid={number}\n");
                (number, told)
            }
            Err(reason) => {
                let told = format!("ABORTED: server={name} alias={tag} cmd=xterm\n{reason}\n");
                (REPLY_ERROR, told)
            }
        };
        note(told.trim_end());
        Bottle::from_iter([Value::Int32(number), told.into()])
    }

    /// Closes the terminal and the ports of a command that has ended.
    async fn end_session(&self, session: TerminalSession, tag: &str, terminal_server: &str) {
        if terminal_server == self.name {
            self.processes.close_terminals(tag, Some(session.id()));
        } else {
            let words = ["killstdio", tag, session.id()].map(Value::from);
            let request = Bottle::from_iter([Value::List(Bottle::from_iter(words))]);
            // A terminal of ours also ends by itself when it notices that the ports are gone.
            if !matches!(
                run_client::send(&self.network, terminal_server, &request).await,
                Ok(Some(_))
            ) {
                note(format_args!(
                    "{terminal_server} is gone: it was not told to close a terminal"
                ));
            }
        }
        session.close().await;
    }

    fn aborted(&self, launch: &Launch, reason: &str) -> Bottle {
        let (name, Launch { tag, command, .. }) = (&self.name, launch);
        let told = format!("ABORTED: server={name} alias={tag} cmd={command}\n{reason}\n");
        note(told.trim_end());
        Bottle::from_iter([Value::Int32(REPLY_ERROR), told.into()])
    }
}

/// Returns true if a request is for a command with a terminal, or for that terminal. Stock looks for these first.
fn is_for_terminal(request: &Bottle) -> bool {
    contains_word(request, "stdio")
        && !contains_word(request, "which")
        && !contains_word(request, "exit")
}

/// Returns true if a reply begins with the id of a process.
fn is_process(reply: &Bottle) -> bool {
    let number = reply.get(0).and_then(Value::as_i32);
    number.is_some_and(|number| number > 0)
}

/// Returns a reply that every client reads as failure.
fn not_done(text: &str) -> Bottle {
    Bottle::from_iter([
        Value::Int32(REPLY_ERROR),
        format!("ABORTED: {text}\n").into(),
    ])
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
