//! `yarp wam-node`: the embedded server of a WAM arm.

use std::io::Write;
use std::process::ExitCode;
use std::sync::Arc;
use std::time::Duration;

use yarp_devices::Device;
use yarp_devices::embedded::{LinkMode, NodeOptions, WamNode};
use yarp_ports::PortError;
use yarp_wire::PortName;
use yarp_wrappers::{StopServer, software_stop};

use crate::arm_selection::{Arm, ArmArgs, LinkModeArgs};
use crate::error::{Failure, Result};
use crate::listen_addresses::{self, BindArgs};
use crate::signals::Interrupt;
use crate::{network_access, systemd_notify};

/// Prefix of the port of the software stop if none is given.
const DEFAULT_NAME: &str = "/wam-node";

/// Interval between two checks of the connection to the driver.
const STATUS_POLL_INTERVAL: Duration = Duration::from_millis(100);

/// serve an arm to its driver, on the arm's own PC
///
/// Runs on the PC in the arm and speaks the protocol of the thesis with the driver, which `yarp up --arm embedded` serves
/// to the network. Needs no name server; where one answers, PREFIX/stop/rpc:i stops the arm beside the driver.
///
/// The arm is idle until the driver switches gravity compensation on. When the driver disconnects,
/// the arm stops and holds; Ctrl-C ends the server and releases the arm.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// Arm to serve: simulated (moves exactly as commanded), dynamic (with masses and friction),
    /// simulated-can (with the effects of a real arm, behind the driver of its bus), or can:INTERFACE (on a CAN bus of this machine that is up, as in can:can0)
    #[arg(long, default_value_t = Arm::Dynamic, value_parser = own_arm)]
    arm: Arm,
    #[command(flatten)]
    link_mode: LinkModeArgs,
    /// Move the joints to the nearest posture for poses to which the tool cannot go straight, instead of refusing them: the
    /// tool leaves the line, and joints may turn far
    #[arg(long)]
    allow_posture_changes: bool,
    /// Prefix of the name of the port of the software stop, PREFIX/stop/rpc:i; /wam-node if a name server answers
    #[arg(long, value_name = "PREFIX")]
    name: Option<String>,
    #[command(flatten)]
    bind: BindArgs,
    #[command(flatten)]
    configuration: ArmArgs,
}

/// Parses an arm that this PC can drive.
fn own_arm(text: &str) -> std::result::Result<Arm, String> {
    match text.parse()? {
        Arm::Embedded => Err("an arm behind an embedded PC is served by that PC".to_owned()),
        arm => Ok(arm),
    }
}

pub(super) async fn run(args: Args, out: &mut dyn Write) -> Result<ExitCode> {
    let mut interrupt = Interrupt::listen();
    let link_mode = args.link_mode.link_mode(false).map_err(Failure::LinkMode)?;
    let configuration = args.configuration.configuration(&args.arm, link_mode)?;
    let mut options = NodeOptions::new(link_mode);
    options.moves.allow_posture_changes = args.allow_posture_changes;
    if args.allow_posture_changes {
        tracing::warn!("moves to poses may change the posture of the arm");
    }
    let arm = configuration.start()?;
    let stop = serve_stop(&args, arm.clone()).await?;
    let node = WamNode::start(arm, options)?;
    let places = node.addresses();
    let verb = match link_mode {
        LinkMode::Listen(_) => "waits for the driver at",
        LinkMode::Connect(_) => "connects to the driver at",
    };
    writeln!(
        out,
        "{} WAM arm {verb} {} and {}. Ctrl-C ends it.",
        args.arm, places.arm, places.packets
    )?;
    if stop.is_some() {
        let port = software_stop::port_of(args.prefix());
        writeln!(out, "{port} stops the arm.")?;
    }
    out.flush()?;
    systemd_notify::notify_ready();
    let told = print_events(&node, &mut interrupt, out).await;
    drop(node);
    if let Some(stop) = stop {
        stop.close().await;
    }
    told.map(|()| ExitCode::SUCCESS)
}

impl Args {
    fn prefix(&self) -> &str {
        self.name.as_deref().unwrap_or(DEFAULT_NAME)
    }
}

/// Serves the software stop of the arm; `None`, with a warning, if that is impossible and no name was given: the arm does
/// not depend on the network.
async fn serve_stop(args: &Args, arm: Arc<dyn Device>) -> Result<Option<StopServer>> {
    let prefix = args.prefix();
    prefix.parse::<PortName>().map_err(PortError::from)?;
    let network = args.bind.apply(network_access::unreported_network()?);
    if args.name.is_none() && !network_access::serves(&network, network.namespace()).await {
        tracing::warn!("no name server answers: the software stop has no port");
        return Ok(None);
    }
    match StopServer::open(&network, arm, prefix).await {
        Ok(stop) => {
            listen_addresses::warn_if_open(&network, prefix);
            Ok(Some(stop))
        }
        Err(error) if args.name.is_none() => {
            tracing::warn!("the software stop has no port: {error}");
            Ok(None)
        }
        Err(error) => Err(error.into()),
    }
}

/// Prints connections and disconnections of the driver, until a signal.
async fn print_events(
    node: &WamNode,
    interrupt: &mut Interrupt,
    out: &mut dyn Write,
) -> Result<()> {
    let mut connected = false;
    loop {
        let status = node.status();
        if status.connected != connected {
            connected = status.connected;
            match (connected, status.last_end) {
                (true, _) => writeln!(out, "The driver is connected.")?,
                (false, end) => writeln!(
                    out,
                    "The driver is gone ({}); the arm holds.",
                    end.unwrap_or_default()
                )?,
            }
            out.flush()?;
        }
        tokio::select! {
            biased;
            () = interrupt.interrupted() => return Ok(()),
            () = tokio::time::sleep(STATUS_POLL_INTERVAL) => {}
        }
    }
}
