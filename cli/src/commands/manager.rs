//! `yarp manager`: reads applications of stock's `yarpmanager`.

use std::io::Write;
use std::path::PathBuf;
use std::process::ExitCode;

use serde_json::{Value as Json, json};
use yarp_hosting::application::{Application, Connection, Module, RequiredPort};

use crate::error::Result;

const COMPONENT: &str = "yarpmanager";

/// read an application of stock's yarpmanager
///
/// Prints the programs that it lists, where they would run, and the connections, and logs what stock leaves out. Nothing is started
/// or connected: that is not supported yet.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// Application: an XML file
    #[arg(value_name = "FILE", required_unless_present = "application")]
    file: Option<PathBuf>,
    /// The same, as stock names it
    #[arg(long, value_name = "FILE", conflicts_with = "file")]
    application: Option<PathBuf>,
    /// Print what would be started and connected; has to be given, since nothing else is supported
    #[arg(long, required = true)]
    dryrun: bool,
    /// Print it as JSON
    #[arg(long)]
    json: bool,
    /// End with 1 if something in the file is left out
    #[arg(long)]
    strict: bool,
}

pub(super) fn run(args: Args, out: &mut dyn Write) -> Result<ExitCode> {
    let file = args.file.or(args.application).unwrap_or_default();
    let application = match Application::read(&file, &|name| std::env::var(name).ok()) {
        Ok(application) => application,
        Err(error) => {
            tracing::error!(target: COMPONENT, "{}", yarp_ports::error_chain(&error));
            return Ok(ExitCode::FAILURE);
        }
    };
    for problem in &application.problems {
        tracing::warn!(target: COMPONENT, "{problem}");
    }
    match args.json {
        true => writeln!(out, "{:#}", as_json(&application))?,
        false => describe(&application, out)?,
    }
    Ok(super::code(!args.strict || application.problems.is_empty()))
}

fn describe(application: &Application, out: &mut dyn Write) -> Result<()> {
    writeln!(out, "application {}", application.name)?;
    for module in &application.modules {
        let node = module.node.as_deref().unwrap_or("any machine");
        write!(out, "module {} on {node}", module.name)?;
        for (what, value) in [
            ("parameters", &module.parameters),
            ("prefix", &module.prefix),
            ("environment", &module.environment),
            ("folder", &module.workdir),
            ("deployer", &module.deployer),
        ] {
            if let Some(value) = value {
                write!(out, ", {what} {value}")?;
            }
        }
        writeln!(out)?;
    }
    for nested in &application.applications {
        let prefix = nested.prefix.as_deref().unwrap_or("none");
        writeln!(out, "application {} inside, prefix {prefix}", nested.name)?;
    }
    for port in &application.ports {
        writeln!(out, "needs port {}", port.name)?;
    }
    for connection in &application.connections {
        let carrier = connection.carrier.as_deref().unwrap_or("default");
        let persistent = if connection.persistent {
            ", persistent"
        } else {
            ""
        };
        let Connection { from, to, .. } = connection;
        writeln!(
            out,
            "connection {from} to {to}, carrier {carrier}{persistent}"
        )?;
    }
    Ok(())
}

fn as_json(application: &Application) -> Json {
    json!({
        "name": application.name,
        "description": application.description,
        "version": application.version,
        "modules": application.modules.iter().map(module_as_json).collect::<Vec<_>>(),
        "applications": application.applications.iter().map(|nested| json!({
            "name": nested.name,
            "prefix": nested.prefix,
        })).collect::<Vec<_>>(),
        "connections": application.connections.iter().map(|connection| json!({
            "from": connection.from,
            "to": connection.to,
            "carrier": connection.carrier,
            "external": connection.external,
            "qos": connection.qos,
            "persistent": connection.persistent,
            "id": connection.id,
        })).collect::<Vec<_>>(),
        "ports": ports_as_json(&application.ports),
        "arbitrators": application.arbitrators.iter().map(|arbitrator| json!({
            "port": arbitrator.port,
            "rules": arbitrator.rules,
        })).collect::<Vec<_>>(),
        "problems": application.problems.iter().map(ToString::to_string).collect::<Vec<_>>(),
    })
}

fn module_as_json(module: &Module) -> Json {
    json!({
        "name": module.name,
        "node": module.node,
        "parameters": module.parameters,
        "prefix": module.prefix,
        "environment": module.environment,
        "workdir": module.workdir,
        "stdio": module.stdio,
        "deployer": module.deployer,
        "display": module.display,
        "rank": module.rank,
        "ports": ports_as_json(&module.ports),
        "waits": module.waits,
        "port_names": module.port_names,
    })
}

fn ports_as_json(ports: &[RequiredPort]) -> Vec<Json> {
    let one = |port: &RequiredPort| {
        json!({
            "name": port.name,
            "timeout": port.timeout,
            "request": port.request,
            "reply": port.reply,
        })
    };
    ports.iter().map(one).collect()
}
