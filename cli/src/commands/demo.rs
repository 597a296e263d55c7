//! `yarp demo`: the experiments of the thesis, on the simulated arm.

use std::io::Write;
use std::process::ExitCode;

use yarp_demos::{joint_synchronisation, repeatability};

use crate::error::Result;

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
    /// moves all joints together and the tool along a line: figure 13 of the thesis
    Sync,
}

pub(super) fn run(args: Args, out: &mut dyn Write) -> Result<ExitCode> {
    let told = match args.demo {
        Demo::Repeatability { repeat } => repeatability::run(repeat as usize, out),
        Demo::Sync => joint_synchronisation::run(out),
    };
    told.map(|()| ExitCode::SUCCESS).map_err(Into::into)
}
