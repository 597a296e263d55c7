//! `yarp demo tidy` and `yarp demo reorder`: demos on the simulated table.

use std::io::{self, Write};
use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Duration;

use tokio::sync::mpsc::{UnboundedSender, unbounded_channel};
use yarp_demos::DemoError;
use yarp_demos::table::{TableDemoOptions, TablePlace, reorder, tidy, tidy::Stop};

use crate::commands::table_arm::TableArmArgs;
use crate::commands::up::NameServerAccess;
use crate::commands::view::ViewArgs;
use crate::error::{Failure, Result};
use crate::listen_addresses::BindArgs;
use crate::signals::Interrupt;
use crate::{network_access, stock_log};

/// Names of the detectors of this build; the last one is the default.
#[cfg(not(feature = "vision"))]
const DETECTORS: [&str; 1] = ["truth"];
#[cfg(feature = "vision")]
const DETECTORS: [&str; 2] = ["truth", "vision"];
const DEFAULT_DETECTOR: &str = DETECTORS[DETECTORS.len() - 1];

/// Default of `--speed`.
const DEFAULT_SPEED: f64 = 2.0;

/// Accepts the name of a detector, or of the port of one.
fn detector(name: &str) -> std::result::Result<String, String> {
    let is_known = DETECTORS.contains(&name);
    let is_port = name.starts_with('/') && name.parse::<yarp_wire::PortName>().is_ok();
    match is_known || is_port {
        true => Ok(name.to_owned()),
        false => Err(format!(
            "expected {}, or the port of `yarp vision serve`, such as /vision/rpc:i",
            DETECTORS.join(", ")
        )),
    }
}

#[derive(Debug, clap::Args)]
pub(super) struct TableArgs {
    /// Number of random objects
    #[arg(long, default_value_t = 8)]
    objects: usize,
    /// Seed of objects, friction and noise
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Print one line of JSON; exit code 1 below the targets either way
    #[arg(long)]
    json: bool,
    /// Speed of the table relative to a real robot, 0.1 to 20; 2 by default, 1 with an arm on its bus
    #[arg(long, value_name = "FACTOR")]
    speed: Option<f64>,
    #[command(flatten)]
    arm: TableArmArgs,
    /// Source of the objects: `vision` looks through the cameras (feature `vision`); `truth` asks the simulation, with noise;
    /// a name such as `/vision/rpc:i` is the port of a program that looks, such as `yarp vision serve`
    #[arg(long, value_name = "NAME", default_value = DEFAULT_DETECTOR, value_parser = detector)]
    detector: String,
    /// Calibration of the camera with its pose, as `yarp calibrate` writes it; without it that of the simulated table
    #[cfg(feature = "vision")]
    #[arg(long, value_name = "FILE")]
    calibration: Option<PathBuf>,
    /// Calibration of the depth sensor with its pose; without it that of the simulated table
    #[cfg(feature = "vision")]
    #[arg(long, value_name = "FILE")]
    depth_calibration: Option<PathBuf>,
    /// Object database, XML: sizes and prints for the detector `vision`, grasping scripts for the hand
    #[arg(long, value_name = "FILE")]
    database: Option<PathBuf>,
    /// Standard deviation of a detected place along x and y, mm
    #[arg(long, value_name = "MM", default_value_t = 1.0)]
    noise: f64,
    /// Prefix of a table that `yarp table` serves elsewhere, such as /lab; starts a table without it
    #[arg(long, value_name = "PREFIX")]
    remote: Option<String>,
    /// Serve the table on the configured network, where other programs find it, with a name server as `yarp up` starts it;
    /// without it the table has a name server of its own
    #[arg(long, conflicts_with = "remote")]
    shared: bool,
    /// Without --json and --remote there is a live view of the table
    #[command(flatten)]
    view: ViewArgs,
}

/// Time after the first signal from which a third one aborts the process.
const ABORT_AFTER: Duration = Duration::from_secs(2);

impl TableArgs {
    /// Returns the options, and the access to the name server that a shared table needs.
    async fn options(&self) -> Result<(TableDemoOptions, Option<NameServerAccess>)> {
        let mut options = TableDemoOptions::default();
        options.objects = self.objects;
        options.seed = self.seed;
        if self.remote.is_some() && self.arm.are_given() {
            let why = "--simulation is an option of the program that serves the table, not of one with --remote";
            return Err(Failure::Table(why.into()));
        }
        (options.arm, options.speed) = self.arm.arm(self.speed, DEFAULT_SPEED)?;
        options.noise = self.noise / 1e3;
        #[cfg(feature = "vision")]
        if self.detector == "vision" {
            options.detector = yarp_demos::table::DetectorChoice::Vision;
            options.files.calibration.clone_from(&self.calibration);
            let depth = &mut options.files.depth_calibration;
            depth.clone_from(&self.depth_calibration);
        }
        if self.detector.starts_with('/') {
            options.detector = yarp_demos::table::DetectorChoice::Port(self.detector.clone());
        }
        options.files.database.clone_from(&self.database);
        if !self.json {
            options.view = self.view.log();
            options.control = self.view.control();
        }
        if let Some(prefix) = &self.remote {
            options.place = TablePlace::Remote(network_access::network()?, prefix.clone());
        }
        if !self.shared {
            return Ok((options, None));
        }
        let access = NameServerAccess::find(BindArgs::default()).await?;
        options.place = TablePlace::Here(access.network.clone());
        Ok((options, Some(access)))
    }
}

/// Sends what is written to the task that prints it.
struct Printer(UnboundedSender<Vec<u8>>);

impl Write for Printer {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        // Nobody reads any more once the command ends.
        let _ = self.0.send(bytes.to_vec());
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

/// Runs a demo on the table until it ends; the first signal finishes the current object, the second halts.
async fn run(
    args: &TableArgs,
    demo: impl FnOnce(&TableDemoOptions, &Stop, &mut dyn Write) -> std::result::Result<bool, DemoError>
    + Send
    + 'static,
    out: &mut dyn Write,
) -> Result<ExitCode> {
    let stop = Stop::default();
    let button = stop.clone();
    // Only a third signal may abort.
    let mut interrupt = Interrupt::listen_with(2, ABORT_AFTER);
    let mut presses = 1;
    if args.json {
        stock_log::keep_apart();
    }
    let (options, access) = args.options().await?;
    // The address of a view is the first line; a table elsewhere has its own.
    let is_here = !matches!(options.place, TablePlace::Remote(..));
    let mut held = (is_here && options.view.is_some()).then(stock_log::hold_back);
    let (lines, mut written) = unbounded_channel();
    let mut running = tokio::task::spawn_blocking(move || {
        // Whole lines, so that none of the log comes in between.
        demo(&options, &stop, &mut io::LineWriter::new(Printer(lines)))
    });
    let passed = loop {
        tokio::select! {
            biased;
            Some(bytes) = written.recv() => {
                out.write_all(&bytes)?;
                out.flush()?;
                held = None;
            }
            ended = &mut running => break ended.expect("the demo does not panic"),
            () = interrupt.interrupted_times(presses) => {
                button.press();
                presses += 1;
            }
        }
    };
    drop(held);
    while let Ok(bytes) = written.try_recv() {
        out.write_all(&bytes)?;
    }
    if let Some(access) = access {
        access.close().await;
    }
    Ok(match passed? {
        true => ExitCode::SUCCESS,
        false => ExitCode::FAILURE,
    })
}

/// Runs `yarp demo tidy`.
pub(super) async fn tidy(args: TableArgs, out: &mut dyn Write) -> Result<ExitCode> {
    let json = args.json;
    let demo = move |options: &TableDemoOptions, stop: &Stop, out: &mut dyn Write| {
        tidy::run(options, stop, json, out)
    };
    run(&args, demo, out).await
}

/// Runs `yarp demo reorder`.
pub(super) async fn reorder(
    mut args: TableArgs,
    waits: bool,
    out: &mut dyn Write,
) -> Result<ExitCode> {
    let json = args.json;
    // Nobody could command a table that only this process knows.
    args.shared |= waits && args.remote.is_none();
    let demo = move |options: &TableDemoOptions, stop: &Stop, out: &mut dyn Write| {
        reorder::run(options, waits, stop, json, out)
    };
    run(&args, demo, out).await
}
