//! `yarp vision serve`: recognition as a program of its own.

use std::io::Write;
use std::path::PathBuf;
use std::process::ExitCode;

use tokio::task::spawn_blocking;
use yarp_demos::table::{RemoteVision, TableDemoError, TableFiles, serve_vision};
use yarp_ports::PortError;
use yarp_wire::PortName;

use super::failed;
use crate::error::Result;
use crate::listen_addresses::BindArgs;
use crate::network_access;
use crate::signals::Interrupt;

#[derive(Debug, clap::Args)]
pub(super) struct Args {
    /// Name of the port that answers `list` with the objects on the table
    #[arg(long, value_name = "PORT", default_value = "/vision/rpc:i")]
    name: String,
    /// Prefix of the table whose /camera and /depth are looked through, such as /lab
    #[arg(long, value_name = "PREFIX", default_value = "")]
    prefix: String,
    /// Calibration of the camera with its pose, as `yarp calibrate` writes it; without it that of the simulated table
    #[arg(long, value_name = "FILE")]
    calibration: Option<PathBuf>,
    /// Calibration of the depth sensor with its pose; without it that of the simulated table
    #[arg(long, value_name = "FILE")]
    depth_calibration: Option<PathBuf>,
    /// Object database, XML: sizes and prints
    #[arg(long, value_name = "FILE")]
    database: Option<PathBuf>,
    #[command(flatten)]
    bind: BindArgs,
}

pub(super) async fn run(args: Args, out: &mut dyn Write) -> Result<ExitCode> {
    let mut interrupt = Interrupt::listen();
    args.name.parse::<PortName>().map_err(PortError::from)?;
    let network = args.bind.apply(network_access::network()?);
    let files = TableFiles {
        calibration: args.calibration,
        depth_calibration: args.depth_calibration,
        database: args.database,
    };
    let (name, prefix) = (args.name.clone(), args.prefix.clone());
    let opening = spawn_blocking(move || {
        let vision = RemoteVision::connect(&network, &prefix, &files)?;
        serve_vision(&network, &name, vision).map_err(TableDemoError::from)
    });
    let server = tokio::select! {
        biased;
        () = interrupt.interrupted() => return Ok(ExitCode::SUCCESS),
        opened = opening => opened.expect("opening a port does not panic").map_err(failed)?,
    };
    let told = writeln!(
        out,
        "Objects that {0}/camera and {0}/depth see: echo list | yarp rpc {1}",
        args.prefix, args.name
    )
    .and_then(|()| out.flush());
    if told.is_ok() {
        crate::systemd_notify::notify_ready();
        interrupt.interrupted().await;
    }
    // Closing the port waits, which is no work for the executor.
    let _ = spawn_blocking(move || drop(server)).await;
    told?;
    Ok(ExitCode::SUCCESS)
}
