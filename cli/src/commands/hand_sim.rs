//! `yarp hand-sim`: a simulated hand on a pseudo-terminal.

use std::io::Write;
use std::path::PathBuf;
use std::process::ExitCode;

use yarp_devices::hand::simulated::{SimulatedHand, SimulatedHandOptions};

use crate::error::Result;
use crate::signals::Interrupt;
use crate::systemd_notify;

/// run a simulated BarrettHand on a serial line
///
/// Runs a simulated BarrettHand on a pseudo-terminal and prints its path, which any program opens
/// as the serial port of a hand.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// Symbolic link to the pseudo-terminal
    #[arg(long, value_name = "PATH")]
    link: Option<PathBuf>,
    /// Speed relative to a real hand
    #[arg(long, value_name = "FACTOR", default_value_t = 1.0, value_parser = factor)]
    speed: f64,
}

fn factor(word: &str) -> std::result::Result<f64, String> {
    match word.parse::<f64>() {
        Ok(factor) if (0.01..=1000.0).contains(&factor) => Ok(factor),
        _ => Err("expected a number from 0.01 to 1000".to_owned()),
    }
}

pub(super) async fn run(args: Args, out: &mut dyn Write) -> Result<ExitCode> {
    let mut interrupt = Interrupt::listen();
    let mut options = SimulatedHandOptions::new().speed(args.speed);
    if let Some(link) = args.link {
        options = options.link(link);
    }
    let hand = SimulatedHand::start(options)?;
    writeln!(out, "{}", hand.path())?;
    out.flush()?;
    systemd_notify::notify_ready();
    interrupt.interrupted().await;
    Ok(ExitCode::SUCCESS)
}
