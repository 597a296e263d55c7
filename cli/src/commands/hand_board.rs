//! `yarp hand-board`: serves a hand as a control board and as a hand.

use std::io::Write;
use std::process::ExitCode;
use std::sync::Arc;

use yarp_devices::guard::Guarded;
use yarp_devices::hand::{BarrettHand, HandBoard, HandOptions};
use yarp_devices::{DeviceError, Hand};
use yarp_ports::{Network, PortError};
use yarp_wire::PortName;
use yarp_wrappers::{ControlBoardOptions, ControlBoardServer, HandServer, OpenError, StopServer};

use crate::error::Result;
use crate::listen_addresses::{self, BindArgs};
use crate::network_access;
use crate::signals::Interrupt;
use crate::systemd_notify;

/// serve a BarrettHand on a serial line as a control board
///
/// Serves the four motors of a BarrettHand as a control board: three fingers and the spread, in degrees.
/// Beside it, PREFIX/hand/rpc:i takes whole grasps and the hand's own language; type `help` there.
/// PREFIX/stop/rpc:i stops the hand: `stop` ends grasps too, and commands are refused until `release`.
///
/// The hand is initialised first: its fingers open. Guards keep its axes within their limits, and end a
/// velocity without a new command after a second.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// Serial port of the hand, such as /dev/ttyUSB0, or the path that `yarp hand-sim` prints
    #[arg(long, value_name = "PATH")]
    serial: String,
    /// Baud rate
    #[arg(long, value_name = "BAUD", default_value_t = 9600)]
    baud: u32,
    /// Prefix of the names of the hand's ports
    #[arg(long, value_name = "PREFIX", default_value = "/hand")]
    name: String,
    #[command(flatten)]
    bind: BindArgs,
}

pub(super) async fn run(args: Args, out: &mut dyn Write) -> Result<ExitCode> {
    args.name.parse::<PortName>().map_err(PortError::from)?;
    let mut interrupt = Interrupt::listen();
    let network = args.bind.apply(network_access::unreported_network()?);
    network_access::follow_clock(&network, &mut interrupt).await?;
    let options = HandOptions::new(&args.serial).baud(args.baud);
    let path = args.serial.clone();
    let opening = tokio::task::spawn_blocking(move || ready(options, &path));
    let hand = tokio::select! {
        biased;
        () = interrupt.interrupted() => return Ok(ExitCode::SUCCESS),
        hand = opening => hand.expect("opening a hand does not panic")?,
    };
    let hand = Arc::new(hand);
    let options = ControlBoardOptions::new();
    let board = ControlBoardServer::open(&network, hand.clone(), &args.name, options).await?;
    let (whole, stop) = match beside(&network, hand, &args.name).await {
        Ok(opened) => opened,
        Err(error) => {
            board.close().await;
            return Err(error.into());
        }
    };
    let told = writeln!(out, "Hand on {}, served as {}", args.serial, args.name);
    let told = told.and_then(|()| out.flush());
    if told.is_ok() {
        listen_addresses::warn_if_open(&network, &args.name);
        systemd_notify::notify_ready();
        interrupt.interrupted().await;
    }
    whole.close().await;
    board.close().await;
    stop.close().await;
    told?;
    Ok(ExitCode::SUCCESS)
}

/// Opens the ports beside those of the control board.
async fn beside(
    network: &Network,
    hand: Arc<Guarded>,
    name: &str,
) -> std::result::Result<(HandServer, StopServer), OpenError> {
    let whole = HandServer::open(network, hand.clone(), name).await?;
    match StopServer::open(network, hand, name).await {
        Ok(stop) => Ok((whole, stop)),
        Err(error) => {
            whole.close().await;
            Err(error)
        }
    }
}

fn ready(options: HandOptions, path: &str) -> std::result::Result<Guarded, DeviceError> {
    let hand = BarrettHand::open(options).map_err(|error| error.at(path))?;
    let board = HandBoard::start(hand)?;
    board.initialise()?;
    board.guarded()
}
