//! `yarp table`: a simulated table with arm, hand and cameras.

mod table_evaluation;

use std::error::Error;
use std::fs;
use std::io::Write;
use std::path::PathBuf;
use std::process::ExitCode;

use yarp_demos::table::{ServedTable, ServedTableOptions};
use yarp_ports::{Network, PortError};
use yarp_table::{
    Class, Dataset, DatasetOptions, LiveOptions, LiveTable, Placement, Scene, write_models,
    write_shot,
};
use yarp_view::View;
use yarp_wire::PortName;

use crate::error::{Failure, Result};
use crate::listen_addresses::{self, BindArgs};
use crate::signals::Interrupt;
use crate::{network_access, stock_log};

use super::table_arm::TableArmArgs;
use super::view::{ViewArgs, warn_missing};

/// simulate a table with objects, an arm, a hand and cameras
///
/// Serves arm, hand and cameras of one simulated table as devices, as a laboratory would; `yarp table render` writes images
/// with ground truth instead.
///
/// Ctrl-C ends it and takes the names back.
#[derive(Debug, clap::Args)]
#[command(args_conflicts_with_subcommands = true)]
pub(crate) struct Args {
    #[command(subcommand)]
    action: Option<Action>,
    /// Number of random objects
    #[arg(long, value_name = "COUNT", default_value_t = 8)]
    objects: usize,
    /// Seed of objects, light, friction and noise
    #[arg(long, default_value_t = 0)]
    seed: u64,
    /// Objects from an XML file instead of random ones
    #[arg(long, value_name = "FILE", conflicts_with = "objects")]
    scene: Option<PathBuf>,
    /// Speed relative to a real robot, 0.1 to 20; 1 by default
    #[arg(long, value_name = "FACTOR")]
    speed: Option<f64>,
    /// Images a second while somebody watches, 0.1 to 30
    #[arg(long, value_name = "HERTZ", default_value_t = 5.0)]
    rate: f64,
    #[command(flatten)]
    arm: TableArmArgs,
    #[command(flatten)]
    bind: BindArgs,
    /// Prefix of the port names /wam, /hand, /camera and /depth
    #[arg(long, value_name = "PREFIX", default_value = "")]
    prefix: String,
    /// Serve PREFIX/faults/rpc:i, at which anybody may freeze or cover the cameras and stall the hand
    #[arg(long)]
    faults: bool,
    #[command(flatten)]
    view: ViewArgs,
}

#[derive(Debug, clap::Subcommand)]
enum Action {
    /// Write images of random tables with ground truth
    Render {
        /// Number of images
        #[arg(long, default_value_t = 1)]
        count: u64,
        /// Seed of the set
        #[arg(long, default_value_t = 0)]
        seed: u64,
        /// Folder to write to: 000000.png, 000000.xml, ...
        #[arg(long, value_name = "DIR")]
        out: PathBuf,
        /// Most objects on an image
        #[arg(long, value_name = "COUNT")]
        objects: Option<usize>,
        /// Only objects of this class; may be given several times
        #[arg(long = "class", value_name = "CLASS", value_parser = class)]
        classes: Vec<Class>,
        /// Write the prints of the cartons too, into DIR/models
        #[arg(long)]
        models: bool,
    },
    /// Measure the time of rendering an image and of simulating a second with 30 objects; exits with 1 above the targets
    Evaluate(table_evaluation::Args),
}

fn class(word: &str) -> std::result::Result<Class, String> {
    let words: Vec<_> = Class::ALL.map(Class::word).to_vec();
    Class::from_word(word).ok_or_else(|| format!("expected one of {}", words.join(", ")))
}

fn failed(error: impl Error + Send + Sync + 'static) -> Failure {
    Failure::Table(error.into())
}

impl Args {
    /// Returns whether it serves devices.
    pub(super) fn serves(&self) -> bool {
        self.action.is_none()
    }
}

pub(super) async fn run(args: Args, out: &mut dyn Write) -> Result<ExitCode> {
    match args.action {
        None => serve(args, out).await,
        Some(Action::Evaluate(args)) => table_evaluation::run(&args, out),
        Some(Action::Render {
            count,
            seed,
            out: directory,
            objects,
            classes,
            models,
        }) => {
            let mut options = DatasetOptions::default();
            options.placement.count = objects.unwrap_or(options.placement.count);
            if !classes.is_empty() {
                options.placement.classes = classes;
            }
            render(Dataset::new(seed, options), count, models, &directory, out)
        }
    }
}

fn render(
    dataset: Dataset,
    count: u64,
    models: bool,
    directory: &std::path::Path,
    out: &mut dyn Write,
) -> Result<ExitCode> {
    fs::create_dir_all(directory).map_err(failed)?;
    for index in 0..count {
        let shot = dataset.shot(index).map_err(failed)?;
        write_shot(directory, &format!("{index:06}"), &shot).map_err(failed)?;
    }
    if models {
        let models = directory.join("models");
        fs::create_dir_all(&models).map_err(failed)?;
        write_models(&models).map_err(failed)?;
    }
    writeln!(out, "{count} images in {}", directory.display())?;
    Ok(ExitCode::SUCCESS)
}

fn scene(args: &Args) -> Result<Scene> {
    if let Some(path) = &args.scene {
        let text = fs::read_to_string(path).map_err(failed)?;
        return Scene::from_xml(&text).map_err(failed);
    }
    let placement = Placement::default().with_count(args.objects);
    Scene::random(args.seed, &placement).map_err(failed)
}

async fn serve(args: Args, out: &mut dyn Write) -> Result<ExitCode> {
    let mut interrupt = Interrupt::listen();
    let mut serving = ServedTableOptions::default();
    serving.prefix.clone_from(&args.prefix);
    let (arm, speed) = args.arm.arm(args.speed, 1.0)?;
    serving.speed = speed;
    serving.rate = args.rate;
    serving.faults = args.faults;
    for name in serving.names() {
        name.parse::<PortName>().map_err(PortError::from)?;
    }
    let network = args.bind.apply(network_access::network()?);
    let scene = scene(&args)?;
    let count = scene.objects.len();
    let mut options = LiveOptions::default();
    options.speed = speed;
    options.rate = args.rate;
    options.seed = args.seed;
    options.arm = arm;
    let view = open_view(&args, &network, &serving, out).await?;
    let starting = tokio::task::spawn_blocking(move || LiveTable::start(scene, options));
    let table = tokio::select! {
        biased;
        () = interrupt.interrupted() => return Ok(ExitCode::SUCCESS),
        table = starting => table.expect("starting a table does not panic")?,
    };
    let served = ServedTable::open(&network, table, &serving).await;
    let served = served.map_err(failed)?;
    for part in ["wam", "hand"] {
        listen_addresses::warn_if_open(&network, &format!("{}/{part}", args.prefix));
    }
    let told = tell(&args.prefix, count, out);
    if told.is_ok() {
        crate::systemd_notify::notify_ready();
        interrupt.interrupted().await;
    }
    if let Some(view) = view {
        view.close().await;
    }
    served.close().await;
    told.map(|()| ExitCode::SUCCESS)
}

/// Opens the view of the table and prints its address.
async fn open_view(
    args: &Args,
    network: &Network,
    serving: &ServedTableOptions,
    out: &mut dyn Write,
) -> Result<Option<View>> {
    let held = stock_log::hold_back();
    let view = args.view.open(network, serving.view()).await;
    let view = view.unwrap_or_else(|error| {
        warn_missing(&error);
        None
    });
    if let Some(view) = &view {
        writeln!(out, "Live view: {}", view.url())?;
        out.flush()?;
    }
    drop(held);
    Ok(view)
}

/// Prints what is there and what to try.
fn tell(prefix: &str, count: usize, out: &mut dyn Write) -> Result<()> {
    writeln!(
        out,
        "A table with {count} objects: arm {prefix}/wam, hand {prefix}/hand, camera {prefix}/camera, depth {prefix}/depth

Try in another terminal:
  yarpview --name /view --remote {prefix}/camera        # see it with stock YARP
  echo '[set] [pos] 1 40.0' | yarp rpc {prefix}/wam/rpc:i # move the shoulder
  echo 'help' | yarp rpc {prefix}/hand/hand/rpc:i         # what the hand understands

Ctrl-C ends it."
    )?;
    out.flush()?;
    Ok(())
}
