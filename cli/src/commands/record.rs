//! `yarp record` and `yarp replay`: recordings of ports in files.

use std::io::Write;
use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Duration;

use yarp_devices::clock::TimeSource;
use yarp_view::{Recorder, Replay};

use crate::error::Result;
use crate::network_access;
use crate::signals::Interrupt;

/// Interval between two looks at the recording.
const CHECK_INTERVAL: Duration = Duration::from_millis(200);

/// record the messages of ports to an MCAP file
///
/// Records everything that the ports publish until Ctrl-C. The file is MCAP; `yarp replay` plays it back.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// File to write, as in run.mcap; an existing one is replaced
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
    /// Name of the port that receives the messages
    #[arg(long, value_name = "NAME", default_value = "...")]
    name: String,
    /// End after so many seconds
    #[arg(long, value_name = "SECONDS", value_parser = clap::value_parser!(u32).range(1..))]
    seconds: Option<u32>,
    /// Ports to record, as in /wam/stateExt:o /camera
    #[arg(required = true, value_name = "PORT")]
    ports: Vec<String>,
}

/// play a recording back into the network
///
/// Opens a port for each recorded one, with the same name, and writes its messages at their times. `yarp view` shows them like a robot.
#[derive(Debug, clap::Args)]
pub(crate) struct ReplayArgs {
    /// Recording of `yarp record`
    #[arg(value_name = "FILE")]
    file: PathBuf,
    /// Text before the names of the ports, as in /replay, where the robot itself is on the network
    #[arg(long, value_name = "PREFIX", default_value = "")]
    prefix: String,
    /// Speed relative to the recording, 0.01 to 100
    #[arg(long, value_name = "FACTOR", default_value_t = 1.0, value_parser = speed)]
    speed: f64,
    /// Play again and again until Ctrl-C
    #[arg(long = "loop")]
    repeats: bool,
}

fn speed(word: &str) -> std::result::Result<f64, &'static str> {
    let speed = word
        .parse()
        .ok()
        .filter(|speed| (0.01..=100.0).contains(speed));
    speed.ok_or("expected 0.01 to 100")
}

pub(super) async fn run(args: Args, out: &mut dyn Write) -> Result<ExitCode> {
    let mut interrupt = Interrupt::listen();
    let network = network_access::network()?;
    network_access::follow_clock(&network, &mut interrupt).await?;
    let recorder = Recorder::start(&network, &args.name, &args.out).await?;
    for port in &args.ports {
        if let Err(error) = recorder.connect(port).await {
            recorder.finish().await?;
            return Err(error.into());
        }
    }
    writeln!(
        out,
        "Recording {} to {}; Ctrl-C ends it.",
        args.ports.join(", "),
        args.out.display()
    )?;
    out.flush()?;
    let source = TimeSource::current();
    let end = args
        .seconds
        .map(|seconds| source.instant() + Duration::from_secs(seconds.into()));
    loop {
        tokio::select! {
            biased;
            () = interrupt.interrupted() => break,
            () = tokio::time::sleep(CHECK_INTERVAL) => {}
        }
        let is_over = end.is_some_and(|end| source.instant() >= end);
        if is_over || recorder.has_failed() {
            break;
        }
    }
    let counts = recorder.finish().await?;
    writeln!(
        out,
        "{} messages recorded, {} dropped",
        counts.taken, counts.dropped
    )?;
    Ok(ExitCode::SUCCESS)
}

pub(super) async fn replay(args: ReplayArgs, out: &mut dyn Write) -> Result<ExitCode> {
    let mut interrupt = Interrupt::listen();
    let network = network_access::network()?;
    let replay = Replay::open(&network, &args.file, &args.prefix).await?;
    writeln!(
        out,
        "Replaying {}: {}",
        args.file.display(),
        replay.names().join(", ")
    )?;
    out.flush()?;
    let result = loop {
        let played = tokio::select! {
            biased;
            () = interrupt.interrupted() => break Ok(()),
            played = replay.play(args.speed) => played,
        };
        match played {
            Ok(count) => writeln!(out, "{count} messages played")?,
            Err(error) => break Err(error),
        }
        out.flush()?;
        if !args.repeats {
            break Ok(());
        }
    };
    replay.close().await;
    result?;
    Ok(ExitCode::SUCCESS)
}
