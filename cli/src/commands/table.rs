//! `yarp table`: a simulated table with arm, hand and cameras.

use std::error::Error;
use std::fs;
use std::io::Write;
use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Duration;

use yarp_ports::PortError;
use yarp_table::{
    Class, Dataset, DatasetOptions, LiveOptions, LiveTable, Placement, Scene, write_models,
    write_shot,
};
use yarp_wire::PortName;
use yarp_wrappers::frame_grabber::Capability;
use yarp_wrappers::{
    ControlBoardOptions, ControlBoardServer, FrameGrabberOptions, FrameGrabberServer, HandServer,
};

use crate::error::{Failure, Result};
use crate::network_access;
use crate::signals::Interrupt;

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
    /// Speed relative to a real robot, 0.1 to 20
    #[arg(long, value_name = "FACTOR", default_value_t = 1.0)]
    speed: f64,
    /// Images a second while somebody watches, 0.1 to 30
    #[arg(long, value_name = "HERTZ", default_value_t = 5.0)]
    rate: f64,
    /// Prefix of the port names /wam, /hand, /camera and /depth
    #[arg(long, value_name = "PREFIX", default_value = "")]
    prefix: String,
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
}

fn class(word: &str) -> std::result::Result<Class, String> {
    let words: Vec<_> = Class::ALL.map(Class::word).to_vec();
    Class::from_word(word).ok_or_else(|| format!("expected one of {}", words.join(", ")))
}

fn failed(error: impl Error + Send + Sync + 'static) -> Failure {
    Failure::Table(error.into())
}

pub(super) async fn run(args: Args, out: &mut dyn Write) -> Result<ExitCode> {
    if let Some(Action::Render {
        count,
        seed,
        out: directory,
        objects,
        classes,
        models,
    }) = args.action
    {
        let mut options = DatasetOptions::default();
        options.placement.count = objects.unwrap_or(options.placement.count);
        if !classes.is_empty() {
            options.placement.classes = classes;
        }
        return render(Dataset::new(seed, options), count, models, &directory, out);
    }
    serve(args, out).await
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

/// Everything on ports.
struct Served {
    arm: ControlBoardServer,
    hand: ControlBoardServer,
    grasps: HandServer,
    camera: FrameGrabberServer,
    depth: FrameGrabberServer,
}

async fn serve(args: Args, out: &mut dyn Write) -> Result<ExitCode> {
    let mut interrupt = Interrupt::listen();
    let name = |part: &str| format!("{}/{part}", args.prefix);
    for part in ["wam", "hand", "camera", "depth"] {
        name(part).parse::<PortName>().map_err(PortError::from)?;
    }
    let network = network_access::network()?;
    let scene = scene(&args)?;
    let count = scene.objects.len();
    let mut options = LiveOptions::default();
    options.speed = args.speed;
    options.rate = args.rate;
    options.seed = args.seed;
    let starting = tokio::task::spawn_blocking(move || LiveTable::start(scene, options));
    let table = tokio::select! {
        biased;
        () = interrupt.interrupted() => return Ok(ExitCode::SUCCESS),
        table = starting => table.expect("starting a table does not panic")?,
    };
    let board = ControlBoardOptions::new;
    // Looked for twice as often as images come, so that none is missed.
    let period = Duration::from_secs_f64(0.5 / args.rate).min(Duration::from_millis(33));
    let images = FrameGrabberOptions::new().period(period);
    let served = Served {
        arm: ControlBoardServer::open(&network, table.arm(), &name("wam"), board()).await?,
        hand: ControlBoardServer::open(&network, table.hand(), &name("hand"), board()).await?,
        grasps: HandServer::open(&network, table.hand(), &name("hand")).await?,
        camera: FrameGrabberServer::open(&network, table.camera(), &name("camera"), images.clone())
            .await?,
        depth: FrameGrabberServer::open(
            &network,
            table.depth(),
            &name("depth"),
            images.capability(Capability::Raw),
        )
        .await?,
    };
    let told = tell(&args.prefix, count, out);
    if told.is_ok() {
        interrupt.interrupted().await;
    }
    served.close().await;
    // Joins its threads, which is no work for the executor.
    let _ = tokio::task::spawn_blocking(move || drop(table)).await;
    told.map(|()| ExitCode::SUCCESS)
}

impl Served {
    async fn close(self) {
        self.depth.close().await;
        self.camera.close().await;
        self.grasps.close().await;
        self.hand.close().await;
        self.arm.close().await;
    }
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
