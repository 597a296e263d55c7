//! The commands, one file each.

mod argument_words;
#[cfg(feature = "vision")]
mod calibrate;
mod camera;
mod check;
mod clean;
mod clock;
mod conf;
mod connect;
mod demo;
mod detect;
mod dev;
mod disconnect;
mod env;
mod exists;
mod hand_board;
mod hand_node;
#[cfg(unix)]
mod hand_sim;
mod help;
#[cfg(feature = "tls")]
mod keys;
mod latency_test;
mod manager;
mod merge;
mod name;
mod namespace;
mod ping;
mod plan;
mod plugin;
mod priority_qos;
mod priority_sched;
mod priority_tables;
mod read;
mod readwrite;
mod record;
mod repeat;
mod resource;
mod robotinterface;
mod rpc;
mod rpcserver;
#[cfg(unix)]
mod run;
mod sample;
mod server;
mod split;
mod stats;
#[cfg(all(unix, feature = "table"))]
mod table;
#[cfg(all(unix, feature = "table"))]
mod table_arm;
mod teach;
mod terminate;
mod time;
mod topic;
mod trafficgen;
mod up;
mod version;
mod view;
#[cfg(feature = "vision")]
mod vision;
mod wait;
mod wam;
mod wam_node;
mod where_;
mod write;

use std::io::Write;
use std::process::ExitCode;

pub(crate) use plan::PlanFailure;
pub(crate) use teach::TeachFailure;

use crate::cli::Prefixes;
use crate::error::Result;

/// Every command. The first line about its `Args` is stock's, and is what `yarp help` prints.
#[derive(Debug, clap::Subcommand)]
#[command(rename_all = "lower")]
pub(crate) enum Command {
    #[cfg(feature = "vision")]
    Calibrate(Box<calibrate::Args>),
    Camera(camera::Args),
    Check(check::Args),
    Clean(clean::Args),
    Clock(clock::Args),
    Conf(conf::Args),
    Connect(connect::Args),
    Demo(demo::Args),
    Detect(detect::Args),
    Dev(dev::Args),
    Disconnect(disconnect::Args),
    Env(env::Args),
    Exists(exists::Args),
    #[command(name = "hand-board")]
    HandBoard(hand_board::Args),
    #[command(name = "hand-node")]
    HandNode(hand_node::Args),
    #[cfg(unix)]
    #[command(name = "hand-sim")]
    HandSim(hand_sim::Args),
    Help(help::Args),
    #[cfg(feature = "tls")]
    Keys(keys::Args),
    #[command(name = "latency-test")]
    LatencyTest(latency_test::Args),
    Manager(manager::Args),
    Merge(merge::Args),
    Name(name::Args),
    Namespace(namespace::Args),
    Ping(ping::Args),
    Plan(plan::Args),
    Play(teach::PlayArgs),
    Plugin(plugin::Args),
    #[command(name = "priority-qos", alias = "qos")]
    PriorityQos(priority_qos::Args),
    #[command(name = "priority-sched", alias = "sched")]
    PrioritySched(priority_sched::Args),
    Read(read::Args),
    Readwrite(readwrite::Args),
    Record(record::Args),
    Repeat(repeat::Args),
    Replay(record::ReplayArgs),
    Resource(resource::Args),
    Robotinterface(robotinterface::Args),
    Rpc(rpc::Args),
    Rpcserver(rpcserver::Args),
    #[cfg(unix)]
    Run(run::Args),
    Sample(sample::Args),
    Server(Box<server::Args>),
    Split(split::Args),
    Stats(stats::Args),
    #[cfg(all(unix, feature = "table"))]
    Table(table::Args),
    Teach(teach::Args),
    Terminate(terminate::Args),
    Time(time::Args),
    Topic(topic::Args),
    Trafficgen(trafficgen::Args),
    Up(up::Args),
    Version(version::Args),
    View(view::Args),
    #[cfg(feature = "vision")]
    Vision(vision::Args),
    Wait(wait::Args),
    Wam(wam::Args),
    #[command(name = "wam-node")]
    WamNode(wam_node::Args),
    Where(where_::Args),
    Write(write::Args),
}

impl Command {
    /// Returns whether others depend on this command while it runs, so that it never waits for a reader of what it prints.
    pub(crate) fn serves(&self) -> bool {
        match self {
            Self::Camera(_)
            | Self::Clock(_)
            | Self::Dev(_)
            | Self::HandBoard(_)
            | Self::HandNode(_)
            | Self::Robotinterface(_)
            | Self::Server(_)
            | Self::Up(_)
            | Self::View(_)
            | Self::WamNode(_) => true,
            #[cfg(unix)]
            Self::HandSim(_) => true,
            #[cfg(feature = "table")]
            Self::Table(args) => args.serves(),
            #[cfg(feature = "vision")]
            Self::Vision(args) => args.serves(),
            #[cfg(unix)]
            Self::Run(args) => args.serves(),
            _ => false,
        }
    }

    /// Does it; gives the exit code.
    pub(crate) async fn run(self, prefixes: Prefixes, out: &mut dyn Write) -> Result<ExitCode> {
        match self {
            #[cfg(feature = "vision")]
            Self::Calibrate(args) => calibrate::run(*args, out).await,
            Self::Camera(args) => camera::run(args, out).await,
            Self::Check(args) => check::run(args, out).await,
            Self::Clean(args) => clean::run(args, out).await,
            Self::Clock(args) => clock::run(args, out).await,
            Self::Conf(args) => conf::run(args, out),
            Self::Connect(args) => connect::run(args, out).await,
            Self::Demo(args) => demo::run(args, out).await,
            Self::Detect(args) => detect::run(args, out).await,
            Self::Dev(args) => dev::run(args, out).await,
            Self::Disconnect(args) => disconnect::run(args, out).await,
            Self::Env(args) => env::run(args, out),
            Self::Exists(args) => exists::run(args, out).await,
            Self::HandBoard(args) => hand_board::run(args, out).await,
            Self::HandNode(args) => hand_node::run(args, out).await,
            #[cfg(unix)]
            Self::HandSim(args) => hand_sim::run(args, out).await,
            Self::Help(args) => help::run(args, out),
            #[cfg(feature = "tls")]
            Self::Keys(args) => keys::run(args, out),
            Self::LatencyTest(args) => latency_test::run(args, out).await,
            Self::Manager(args) => manager::run(args, out),
            Self::Merge(args) => merge::run(args, out).await,
            Self::Name(args) => name::run(args, out).await,
            Self::Namespace(args) => namespace::run(args, out),
            Self::Ping(args) => ping::run(args, out).await,
            Self::Plan(args) => plan::run(args, out),
            Self::Play(args) => teach::play(args, out).await,
            Self::Plugin(args) => plugin::run(args, out),
            Self::PriorityQos(args) => priority_qos::run(args, out).await,
            Self::PrioritySched(args) => priority_sched::run(args, out).await,
            Self::Read(args) => read::run(args, out).await,
            Self::Readwrite(args) => readwrite::run(args, out).await,
            Self::Record(args) => record::run(args, out).await,
            Self::Repeat(args) => repeat::run(args, out).await,
            Self::Replay(args) => record::replay(args, out).await,
            Self::Resource(args) => resource::run(args, out),
            Self::Robotinterface(args) => robotinterface::run(args, out).await,
            Self::Rpc(args) => rpc::run(args, prefixes, out).await,
            Self::Rpcserver(args) => rpcserver::run(args, out).await,
            #[cfg(unix)]
            Self::Run(args) => run::run(args, out).await,
            Self::Sample(args) => sample::run(args, out).await,
            Self::Server(args) => server::run(*args, out).await,
            Self::Split(args) => split::run(args, out).await,
            Self::Stats(args) => stats::run(args, out).await,
            #[cfg(all(unix, feature = "table"))]
            Self::Table(args) => table::run(args, out).await,
            Self::Teach(args) => teach::run(args, out).await,
            Self::Terminate(args) => terminate::run(args, out).await,
            Self::Time(args) => time::run(args, out).await,
            Self::Topic(args) => topic::run(args, out).await,
            Self::Trafficgen(args) => trafficgen::run(args, out).await,
            Self::Up(args) => up::run(args, out).await,
            Self::Version(args) => version::run(args, out),
            Self::View(args) => view::run(args, out).await,
            #[cfg(feature = "vision")]
            Self::Vision(args) => vision::run(args, out).await,
            Self::Wait(args) => wait::run(args, out).await,
            Self::Wam(args) => wam::run(args, out).await,
            Self::WamNode(args) => wam_node::run(args, out).await,
            Self::Where(args) => where_::run(args, out).await,
            Self::Write(args) => write::run(args, prefixes, out).await,
        }
    }
}

/// Returns a quantile by nearest rank, such as 0.5 for the median; `None` without values.
#[cfg(feature = "table")]
fn quantile(values: &[f64], part: f64) -> Option<f64> {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let rank = (part * sorted.len() as f64).ceil() as usize;
    sorted.get(rank.max(1) - 1).copied()
}

/// Success or "no".
fn code(yes: bool) -> ExitCode {
    if yes {
        ExitCode::SUCCESS
    } else {
        ExitCode::FAILURE
    }
}

#[cfg(all(test, feature = "table"))]
mod tests {
    use super::*;

    #[test]
    fn quantiles_are_values_of_their_rank() {
        let values = [4.0, 1.0, 3.0, 2.0];
        let found = [0.0, 0.25, 0.26, 0.5, 0.99, 1.0].map(|part| quantile(&values, part));
        assert_eq!(found, [1.0, 1.0, 2.0, 2.0, 4.0, 4.0].map(Some));
        assert_eq!(quantile(&[], 0.5), None);
    }
}
