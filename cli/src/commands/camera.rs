//! `yarp camera`: a simulated camera on the network.

use std::io::Write;
use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::Arc;
use std::time::Duration;

use yarp_devices::camera::{CameraOptions, Pattern, Scene, SimulatedCamera};
use yarp_ports::PortError;
use yarp_wire::PortName;
use yarp_wrappers::frame_grabber::Capability;
use yarp_wrappers::{FrameGrabberOptions, FrameGrabberServer};

use crate::error::Result;
use crate::listen_addresses::BindArgs;
use crate::signals::Interrupt;
use crate::{network_access, systemd_notify};

/// show a test pattern, an image or a video as a camera
///
/// Serves a simulated camera, for programs of YARP 3.x and of 4.0: NAME streams images, NAME/rpc sets its features.
///
/// Ctrl-C ends it and unregisters its names.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// Name of the port with the images
    #[arg(long, value_name = "NAME", default_value = "/grabber")]
    name: String,
    /// Test pattern: line, ball, grid, rand (noise), none (black)
    #[arg(long, value_name = "PATTERN", default_value = "line", value_parser = pattern)]
    mode: Pattern,
    /// Image (ppm, pgm, png, jpeg), video (.mjpeg) or folder of images to show instead
    #[arg(long, value_name = "PATH")]
    src: Option<PathBuf>,
    /// Image width in pixels; files have their own size
    #[arg(long, default_value_t = 320)]
    width: usize,
    /// Image height in pixels
    #[arg(long, default_value_t = 240)]
    height: usize,
    /// Images per second
    #[arg(long, value_name = "HERTZ", default_value_t = 30.0)]
    freq: f64,
    /// Simulate an IEEE 1394 camera, with video modes, rates and windows
    #[arg(long)]
    firewire: bool,
    /// Stream grey images
    #[arg(long)]
    raw: bool,
    #[command(flatten)]
    bind: BindArgs,
}

fn pattern(word: &str) -> std::result::Result<Pattern, String> {
    let words: Vec<_> = Pattern::words().collect();
    Pattern::from_word(word).ok_or_else(|| format!("expected one of {}", words.join(", ")))
}

pub(super) async fn run(args: Args, out: &mut dyn Write) -> Result<ExitCode> {
    args.name.parse::<PortName>().map_err(PortError::from)?;
    let mut interrupt = Interrupt::listen();
    let network = args.bind.apply(network_access::network()?);
    network_access::follow_clock(&network, &mut interrupt).await?;
    let scene = match args.src {
        Some(path) => Scene::File(path),
        None => Scene::Pattern(args.mode),
    };
    let options = CameraOptions::new()
        .scene(scene)
        .size(args.width, args.height)
        .rate(args.freq)
        .firewire(args.firewire);
    let camera = Arc::new(SimulatedCamera::start(options)?);
    // Polls at twice the frame rate, at most 1000 times a second, so that no image is missed.
    let period = Duration::from_secs_f64(0.5 / args.freq).max(Duration::from_millis(1));
    let served = FrameGrabberOptions::new()
        .period(period.min(Duration::from_millis(33)))
        .capability(if args.raw {
            Capability::Raw
        } else {
            Capability::Colour
        });
    let opened = tokio::select! {
        biased;
        () = interrupt.interrupted() => return Ok(ExitCode::SUCCESS),
        opened = FrameGrabberServer::open(&network, camera, &args.name, served) => opened,
    };
    let server = opened?;
    let told = print_help(&args.name, out);
    if told.is_ok() {
        systemd_notify::notify_ready();
        interrupt.interrupted().await;
    }
    server.close().await;
    told.map(|()| ExitCode::SUCCESS)
}

/// Prints the names of the ports and examples.
fn print_help(name: &str, out: &mut dyn Write) -> Result<()> {
    writeln!(
        out,
        "Camera {name}: images on {name}, RPC (YARP 3.x and 4.0) on {name}/rpc

Try in another terminal:
  yarp name query {name}                                # then open http://ADDRESS:PORT/?action=stream in a browser
  echo '[fgc] [set] [feat] 0 0.8' | yarp rpc {name}/rpc   # brighter (feature 0 is brightness, 0.5 changes nothing)
  echo '[visr] [set] [res] 640 480' | yarp rpc {name}/rpc # larger

Ctrl-C ends it."
    )?;
    out.flush()?;
    Ok(())
}
