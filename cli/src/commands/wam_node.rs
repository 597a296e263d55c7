//! `yarp wam-node`: the embedded server of a WAM arm.

use std::io::Write;
use std::process::ExitCode;
use std::time::Duration;

use yarp_devices::embedded::{LinkMode, NodeOptions, WamNode};

use crate::arm_selection::{Arm, ArmArgs, LinkModeArgs};
use crate::error::{Failure, Result};
use crate::signals::Interrupt;
use crate::systemd_notify;

/// Interval between two checks of the connection to the driver.
const STATUS_POLL_INTERVAL: Duration = Duration::from_millis(100);

/// serve an arm to its driver, on the arm's own PC
///
/// Runs on the PC in the arm and speaks the protocol of the thesis with the driver, which `yarp up --arm embedded` serves
/// to the network. Needs no name server.
///
/// The arm is idle until the driver switches gravity compensation on. When the driver disconnects,
/// the arm stops and holds; Ctrl-C ends the server and releases the arm.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// Arm to serve: simulated (moves exactly as commanded), dynamic (with masses and friction), or
    /// can:INTERFACE (on a CAN bus of this machine that is up, as in can:can0)
    #[arg(long, default_value_t = Arm::Dynamic, value_parser = own_arm)]
    arm: Arm,
    #[command(flatten)]
    link_mode: LinkModeArgs,
    /// Move the joints to the nearest posture for poses to which the tool cannot go straight, instead of refusing them: the
    /// tool leaves the line, and joints may turn far
    #[arg(long)]
    allow_posture_changes: bool,
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
    let configuration = args.configuration.configuration(&args.arm)?;
    let mut options = NodeOptions::new(link_mode);
    options.moves.allow_posture_changes = args.allow_posture_changes;
    if args.allow_posture_changes {
        tracing::warn!("moves to poses may change the posture of the arm");
    }
    let node = WamNode::start(args.arm.clone().start(link_mode, &configuration)?, options)?;
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
    out.flush()?;
    systemd_notify::notify_ready();
    let told = print_events(&node, &mut interrupt, out).await;
    drop(node);
    told.map(|()| ExitCode::SUCCESS)
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
