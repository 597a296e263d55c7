//! `yarp demo`: the experiments of the thesis, on the simulated arm.

#[cfg(all(unix, feature = "table"))]
mod table_demos;

use std::io::Write;
use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Duration;

use yarp_demos::state_feed::{self, StateFeedOptions};
use yarp_demos::{DemoArm, joint_synchronisation, repeatability};

use crate::error::Result;
use crate::network_access;
#[cfg(all(unix, feature = "table"))]
use table_demos::TableArgs;

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
        /// Simulated arm
        #[arg(long, value_enum, default_value_t = Simulation::Dynamic)]
        simulation: Simulation,
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
    Sync {
        /// Simulated arm
        #[arg(long, value_enum, default_value_t = Simulation::Dynamic)]
        simulation: Simulation,
    },
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
        /// Simulated arm
        #[arg(long, value_enum, default_value_t = Simulation::Dynamic)]
        simulation: Simulation,
        /// Folder that the plots are written to
        #[arg(long, value_name = "DIR", default_value = "statefeed")]
        out: PathBuf,
    },
}

#[derive(Clone, Copy, Debug, clap::ValueEnum)]
enum Simulation {
    /// Has masses, friction, encoders and a controller
    Dynamic,
    /// Has latency, noise, cogging, elastic cables, stiction, and motors that heat up besides
    Real,
}

impl From<Simulation> for DemoArm {
    fn from(simulation: Simulation) -> Self {
        match simulation {
            Simulation::Dynamic => Self::Dynamic,
            Simulation::Real => Self::Real,
        }
    }
}

pub(super) async fn run(args: Args, out: &mut dyn Write) -> Result<ExitCode> {
    let told = match args.demo {
        #[cfg(all(unix, feature = "table"))]
        Demo::Tidy(args) => return table_demos::tidy(args, out).await,
        #[cfg(all(unix, feature = "table"))]
        Demo::Reorder { table, wait } => return table_demos::reorder(table, wait, out).await,
        Demo::Repeatability { repeat, simulation } => {
            repeatability::run(repeat as usize, simulation.into(), out)
        }
        Demo::Sync { simulation } => joint_synchronisation::run(simulation.into(), out),
        Demo::Statefeed {
            repeat,
            seconds,
            arm,
            simulation,
            out: folder,
        } => {
            let network = arm.is_some().then(network_access::network).transpose()?;
            let options = StateFeedOptions {
                repeat: repeat as usize,
                duration: Duration::from_secs(seconds.into()),
                arm,
                simulation: simulation.into(),
                folder,
            };
            state_feed::run(&options, network, out).await
        }
    };
    told.map(|()| ExitCode::SUCCESS).map_err(Into::into)
}
