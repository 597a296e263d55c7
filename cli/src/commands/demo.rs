//! `yarp demo`: the experiments of the thesis, on the simulated arm.

#[cfg(all(unix, feature = "table"))]
use std::io;
use std::io::Write;
use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Duration;

use yarp_demos::state_feed::{self, StateFeedOptions};
use yarp_demos::{joint_synchronisation, repeatability};

use crate::error::Result;
use crate::network_access;

#[cfg(all(unix, feature = "table"))]
use super::up::NameServerAccess;
#[cfg(all(unix, feature = "table"))]
use super::view::ViewArgs;
#[cfg(all(unix, feature = "table"))]
use crate::listen_addresses::BindArgs;
#[cfg(all(unix, feature = "table"))]
use crate::signals::Interrupt;
#[cfg(all(unix, feature = "table"))]
use crate::stock_log;
#[cfg(all(unix, feature = "table"))]
use tokio::sync::mpsc::{UnboundedSender, unbounded_channel};
#[cfg(all(unix, feature = "table"))]
use yarp_demos::DemoError;
#[cfg(all(unix, feature = "table"))]
use yarp_demos::table::{TableDemoOptions, TablePlace};
#[cfg(all(unix, feature = "table"))]
use yarp_demos::table::{reorder, tidy, tidy::Stop};

/// repeat the thesis's experiments on the simulated arm
///
/// Repeats the thesis's experiments on the simulated arm, in this process and faster than real time. No name server
/// is needed.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    #[command(subcommand)]
    demo: Demo,
}

#[derive(Debug, clap::Subcommand)]
enum Demo {
    /// sends the arm to four poses again and again: table 5 of the thesis beside ours
    Repeatability {
        /// Number of visits to each pose
        #[arg(long, value_name = "N", default_value_t = 500, value_parser = clap::value_parser!(u32).range(1..))]
        repeat: u32,
    },
    /// tidies a simulated table over the network: polygons, glasses and plates into a basket each
    #[cfg(all(unix, feature = "table"))]
    Tidy(TableArgs),
    /// sorts the objects of a simulated table into slots, by class or as another program commands
    #[cfg(all(unix, feature = "table"))]
    Reorder {
        #[command(flatten)]
        table: TableArgs,
        /// Move only what is commanded at /reorder/rpc:i (`put ID SLOT`, `list`, `slots`, `help`), until `quit`; implies --shared
        #[arg(long)]
        wait: bool,
    },
    /// moves all joints together and the tool along a line: figure 13 of the thesis
    Sync,
    /// measures repeatability, straightness and the state feed, with plots: tables 5 and 6 and figure 13 of the thesis
    Statefeed {
        /// Number of visits to each pose
        #[arg(long, value_name = "N", default_value_t = 500, value_parser = clap::value_parser!(u32).range(1..))]
        repeat: u32,
        /// Seconds of each of the two measurements of the state feed
        #[arg(long, value_name = "SECONDS", default_value_t = 20, value_parser = clap::value_parser!(u32).range(1..=3600))]
        seconds: u32,
        /// Prefix of an arm on the network to measure, as in /wam; without it a simulated one
        #[arg(long, value_name = "PREFIX")]
        arm: Option<String>,
        /// Folder that the plots are written to
        #[arg(long, value_name = "DIR", default_value = "statefeed")]
        out: PathBuf,
    },
}

/// Names of the detectors of this build; the last one is the default.
#[cfg(all(unix, feature = "table", not(feature = "vision")))]
const DETECTORS: [&str; 1] = ["truth"];
#[cfg(all(unix, feature = "table", feature = "vision"))]
const DETECTORS: [&str; 2] = ["truth", "vision"];
#[cfg(all(unix, feature = "table"))]
const DEFAULT_DETECTOR: &str = DETECTORS[DETECTORS.len() - 1];

#[cfg(all(unix, feature = "table"))]
#[derive(Debug, clap::Args)]
struct TableArgs {
    /// Number of random objects
    #[arg(long, default_value_t = 8)]
    objects: usize,
    /// Seed of objects, friction and noise
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Print one line of JSON; exit code 1 below the targets either way
    #[arg(long)]
    json: bool,
    /// Speed of the table relative to a real robot, 0.1 to 20
    #[arg(long, value_name = "FACTOR", default_value_t = 2.0)]
    speed: f64,
    /// Source of the objects: `vision` looks through the cameras (feature `vision`); `truth` asks the simulation, with noise
    #[arg(long, value_name = "NAME", default_value = DEFAULT_DETECTOR, value_parser = DETECTORS)]
    detector: String,
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
#[cfg(all(unix, feature = "table"))]
const ABORT_AFTER: Duration = Duration::from_secs(2);

#[cfg(all(unix, feature = "table"))]
impl TableArgs {
    /// Returns the options, and the access to the name server that a shared table needs.
    async fn options(&self) -> Result<(TableDemoOptions, Option<NameServerAccess>)> {
        let mut options = TableDemoOptions::default();
        options.objects = self.objects;
        options.seed = self.seed;
        options.speed = self.speed;
        options.noise = self.noise / 1e3;
        #[cfg(feature = "vision")]
        if self.detector == "vision" {
            options.detector = yarp_demos::table::DetectorChoice::Vision;
        }
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
#[cfg(all(unix, feature = "table"))]
struct Printer(UnboundedSender<Vec<u8>>);

#[cfg(all(unix, feature = "table"))]
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
#[cfg(all(unix, feature = "table"))]
async fn on_table(
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
    // The address of a view is the first line.
    let mut held = options.view.is_some().then(stock_log::hold_back);
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

pub(super) async fn run(args: Args, out: &mut dyn Write) -> Result<ExitCode> {
    let told = match args.demo {
        #[cfg(all(unix, feature = "table"))]
        Demo::Tidy(args) => {
            let json = args.json;
            let demo = move |options: &TableDemoOptions, stop: &Stop, out: &mut dyn Write| {
                tidy::run(options, stop, json, out)
            };
            return on_table(&args, demo, out).await;
        }
        #[cfg(all(unix, feature = "table"))]
        Demo::Reorder { mut table, wait } => {
            let json = table.json;
            // Nobody could command a table that only this process knows.
            table.shared |= wait && table.remote.is_none();
            let demo = move |options: &TableDemoOptions, stop: &Stop, out: &mut dyn Write| {
                reorder::run(options, wait, stop, json, out)
            };
            return on_table(&table, demo, out).await;
        }
        Demo::Repeatability { repeat } => repeatability::run(repeat as usize, out),
        Demo::Sync => joint_synchronisation::run(out),
        Demo::Statefeed {
            repeat,
            seconds,
            arm,
            out: folder,
        } => {
            let network = arm.is_some().then(network_access::network).transpose()?;
            let options = StateFeedOptions {
                repeat: repeat as usize,
                duration: Duration::from_secs(seconds.into()),
                arm,
                folder,
            };
            state_feed::run(&options, network, out).await
        }
    };
    told.map(|()| ExitCode::SUCCESS).map_err(Into::into)
}
