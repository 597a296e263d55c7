//! `yarp conf`: the file with the address of the name server.

use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use yarp_ports::config::{self, ConfigError, Mode, NameServer, file_name};

use super::namespace;
use crate::error::Result;
use crate::stock_format::complain;

/// report location of configuration file, and optionally fix it
///
/// Shows, writes or clears the file with the address of the name server.
///
/// Without arguments: prints the name of the file.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// Clear the file
    #[arg(long)]
    clean: bool,
    /// Host and TCP port of the name server, and its kind (yarp); then hosts and ports of other
    /// servers of the same names, which are used if that one does not answer
    #[arg(
        value_name = "HOST PORT [MODE [HOST PORT]...]",
        allow_hyphen_values = true,
        trailing_var_arg = true
    )]
    words: Vec<String>,
}

pub(super) fn run(args: Args, out: &mut dyn Write) -> Result<ExitCode> {
    let file = file()?;
    let shown = file.display();
    if args.clean {
        config::write(&file, "")?;
        writeln!(out, "Cleared configuration file:\n  {shown}")?;
        return Ok(ExitCode::SUCCESS);
    }
    let (host, port, mode, others) = match &args.words[..] {
        [] => {
            writeln!(out, "{shown}")?;
            return Ok(ExitCode::SUCCESS);
        }
        [host, port] => (host, port, Mode::Yarp, &[][..]),
        [host, port, mode, others @ ..] => (host, port, Mode::from(mode.as_str()), others),
        [_] => {
            complain(out, "Command not understood")?;
            return Ok(ExitCode::FAILURE);
        }
    };
    let Some(port) = port.parse().ok().filter(|port| *port > 0) else {
        complain(
            out,
            &format!("Port number not understood: {port} (expected 1 to 65535)"),
        )?;
        return Ok(ExitCode::FAILURE);
    };
    let mut server = NameServer::at(host, port);
    server.mode = mode;
    for other in others.chunks(2) {
        let place = match other {
            [host, port] => port
                .parse()
                .ok()
                .filter(|port| *port > 0)
                .map(|port| (host, port)),
            _ => None,
        };
        let Some((host, port)) = place else {
            let other = other.join(" ");
            complain(
                out,
                &format!("Other server not understood: {other} (expected HOST PORT)"),
            )?;
            return Ok(ExitCode::FAILURE);
        };
        server.others.push((host.clone(), port));
    }
    writeln!(out, "Configuration file:\n  {shown}")?;
    if let Some(stored) = stored(&file)? {
        writeln!(out, "Stored:\n  {}", describe(&stored))?;
    }
    config::write(&file, &server.to_string())?;
    writeln!(out, "Now stores:\n  {}", describe(&server))?;
    Ok(ExitCode::SUCCESS)
}

/// Returns the file of the current namespace.
fn file() -> Result<PathBuf> {
    let directories = namespace::directories()?;
    let names = namespace::names(&directories)?;
    Ok(directories.config_home.join(file_name(&names[0])))
}

/// Returns the address in the file, if it is valid.
fn stored(file: &Path) -> Result<Option<NameServer>> {
    let text = read(file)?;
    Ok(NameServer::parse(file, &text).ok().flatten())
}

/// Returns the content of a file; empty if the file does not exist.
pub(super) fn read(file: &Path) -> std::result::Result<String, ConfigError> {
    match std::fs::read_to_string(file) {
        Ok(text) => Ok(text),
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => Ok(String::new()),
        Err(source) => Err(ConfigError::Read {
            file: file.to_owned(),
            source,
        }),
    }
}

fn describe(server: &NameServer) -> String {
    let NameServer {
        host,
        port,
        mode,
        others,
    } = server;
    let mut text = format!("host {host} port number {port} ({mode} name server)");
    for (host, port) in others {
        text.push_str(&format!(", or host {host} port number {port}"));
    }
    text
}
