//! `yarp hand-sim`: a simulated hand on a pseudo-terminal.

use std::io::Write;
use std::path::PathBuf;
use std::process::ExitCode;

use yarp_devices::hand::gcl::FirmwareVersion;
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
    /// Version of its firmware: 4.3 or 4.4
    #[arg(long, value_name = "VERSION", default_value = "4.4", value_parser = version)]
    firmware: FirmwareVersion,
}

fn version(word: &str) -> std::result::Result<FirmwareVersion, String> {
    [FirmwareVersion::V4_3, FirmwareVersion::V4_4]
        .into_iter()
        .find(|version| version.to_string() == word)
        .ok_or_else(|| "expected 4.3 or 4.4".to_owned())
}

fn factor(word: &str) -> std::result::Result<f64, String> {
    match word.parse::<f64>() {
        Ok(factor) if (0.01..=1000.0).contains(&factor) => Ok(factor),
        _ => Err("expected a number from 0.01 to 1000".to_owned()),
    }
}

pub(super) async fn run(args: Args, out: &mut dyn Write) -> Result<ExitCode> {
    let mut interrupt = Interrupt::listen();
    let mut options = SimulatedHandOptions::new()
        .speed(args.speed)
        .version(args.firmware);
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
