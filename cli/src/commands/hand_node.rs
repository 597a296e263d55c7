//! `yarp hand-node`: connects a hand to a driver on another machine.

use std::io::Write;
use std::net::ToSocketAddrs;
use std::process::ExitCode;
use std::sync::Arc;

use yarp_devices::DeviceError;
use yarp_devices::hand::node::{self, HandNode};
use yarp_devices::hand::{BarrettHand, HandOptions};

use crate::error::Result;
use crate::signals::Interrupt;
use crate::systemd_notify;

/// serve a BarrettHand on a serial port to a driver elsewhere
///
/// Connects to a driver that listens on a TCP port, and executes its requests on the hand on a
/// serial port.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// Serial port of the hand, such as /dev/ttyUSB0, or the path that `yarp hand-sim` prints
    #[arg(long, value_name = "PATH")]
    serial: String,
    /// Baud rate
    #[arg(long, value_name = "BAUD", default_value_t = 9600)]
    baud: u32,
    /// Address on which the driver listens
    #[arg(long, value_name = "HOST:PORT", default_value_t = format!("127.0.0.1:{}", node::PORT))]
    driver: String,
}

pub(super) async fn run(args: Args, out: &mut dyn Write) -> Result<ExitCode> {
    let mut interrupt = Interrupt::listen();
    let driver = args.driver.to_socket_addrs()?.next();
    let driver = driver.ok_or_else(|| DeviceError::NotSupported {
        what: format!("a driver at {}", args.driver),
    })?;
    let options = HandOptions::new(&args.serial).baud(args.baud);
    let opening = tokio::task::spawn_blocking(|| BarrettHand::open(options));
    let hand = tokio::select! {
        biased;
        () = interrupt.interrupted() => return Ok(ExitCode::SUCCESS),
        hand = opening => hand.expect("opening a hand does not panic"),
    };
    let hand = hand.map_err(|error| error.at(&args.serial))?;
    let server = HandNode::start(Arc::new(hand), driver)?;
    writeln!(
        out,
        "Hand on {}, looking for a driver at {driver}",
        args.serial
    )?;
    out.flush()?;
    systemd_notify::notify_ready();
    interrupt.interrupted().await;
    // Stops a motion in progress, which takes a moment.
    drop(server);
    Ok(ExitCode::SUCCESS)
}
