//! `yarp demo`: the experiments of the thesis, on the simulated arm.

use std::io::Write;
use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Duration;

use yarp_demos::state_feed::{self, StateFeedOptions};
use yarp_demos::{joint_synchronisation, repeatability};

use crate::error::Result;
use crate::network_access;
#[cfg(all(unix, feature = "table"))]
use crate::signals::Interrupt;
#[cfg(all(unix, feature = "table"))]
use yarp_demos::DemoError;
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
        /// Move only what is commanded at /reorder/rpc:i (`put ID SLOT`, `list`, `slots`, `help`), until `quit`
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

/// Names of the detectors of this build.
#[cfg(all(unix, feature = "table", not(feature = "vision")))]
const DETECTORS: [&str; 1] = ["truth"];
#[cfg(all(unix, feature = "table", feature = "vision"))]
const DETECTORS: [&str; 2] = ["truth", "vision"];

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
    /// Source of the objects: `truth` asks the simulation, with noise; `vision` looks through the cameras (feature `vision`)
    #[arg(long, value_name = "NAME", default_value = "truth", value_parser = DETECTORS)]
    detector: String,
    /// Standard deviation of a detected place along x and y, mm
    #[arg(long, value_name = "MM", default_value_t = 1.0)]
    noise: f64,
    /// Prefix of a table that `yarp table` serves elsewhere, such as /lab; starts a table and a name server without it
    #[arg(long, value_name = "PREFIX")]
    remote: Option<String>,
}

/// Time after the first signal from which a third one aborts the process.
#[cfg(all(unix, feature = "table"))]
const ABORT_AFTER: Duration = Duration::from_secs(2);

#[cfg(all(unix, feature = "table"))]
impl TableArgs {
    fn options(&self) -> Result<yarp_demos::table::TableDemoOptions> {
        let mut options = yarp_demos::table::TableDemoOptions::default();
        options.objects = self.objects;
        options.seed = self.seed;
        options.speed = self.speed;
        options.noise = self.noise / 1e3;
        #[cfg(feature = "vision")]
        if self.detector == "vision" {
            options.detector = yarp_demos::table::DetectorChoice::Vision;
        }
        if let Some(prefix) = &self.remote {
            options.remote = Some((crate::network_access::network()?, prefix.clone()));
        }
        Ok(options)
    }
}

/// Runs a demo on the table until it ends; the first signal finishes the current object, the second halts.
#[cfg(all(unix, feature = "table"))]
async fn on_table(
    demo: impl FnOnce(&Stop, &mut Vec<u8>) -> std::result::Result<bool, DemoError> + Send + 'static,
    out: &mut dyn Write,
) -> Result<ExitCode> {
    let stop = Stop::default();
    let button = stop.clone();
    // Only a third signal may abort.
    let mut interrupt = Interrupt::listen_with(2, ABORT_AFTER);
    let mut presses = 1;
    let mut running = tokio::task::spawn_blocking(move || {
        let mut text = Vec::new();
        let told = demo(&stop, &mut text);
        (told, text)
    });
    let (told, text) = loop {
        tokio::select! {
            ended = &mut running => break ended.expect("the demo does not panic"),
            () = interrupt.interrupted_times(presses) => {
                button.press();
                presses += 1;
            }
        }
    };
    out.write_all(&text)?;
    Ok(match told? {
        true => ExitCode::SUCCESS,
        false => ExitCode::FAILURE,
    })
}

pub(super) async fn run(args: Args, out: &mut dyn Write) -> Result<ExitCode> {
    let told = match args.demo {
        #[cfg(all(unix, feature = "table"))]
        Demo::Tidy(args) => {
            let options = args.options()?;
            let demo =
                move |stop: &Stop, text: &mut Vec<u8>| tidy::run(&options, stop, args.json, text);
            return on_table(demo, out).await;
        }
        #[cfg(all(unix, feature = "table"))]
        Demo::Reorder { table, wait } => {
            let options = table.options()?;
            let demo = move |stop: &Stop, text: &mut Vec<u8>| {
                reorder::run(&options, wait, stop, table.json, text)
            };
            return on_table(demo, out).await;
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
