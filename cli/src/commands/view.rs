//! `yarp view`: a web page that shows a robot.

use std::io::Write;
use std::process::ExitCode;

use yarp_ports::{Network, PortError};
#[cfg(all(unix, feature = "table"))]
use yarp_view::LogLines;
use yarp_view::{View, ViewOptions};
use yarp_wire::PortName;

use crate::error::Result;
use crate::listen_addresses::BindArgs;
use crate::signals::Interrupt;
use crate::{network_access, stock_log, systemd_notify};

/// show a robot on a web page: 3D, camera, plots, network, log
///
/// Serves a web page that shows arm, hand, camera and table from their ports, wherever they run. `yarp up` and `yarp table`
/// serve it too.
///
/// Ctrl-C ends it and unregisters its names.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// Prefix of the arm's ports
    #[arg(long, value_name = "PREFIX", default_value = "/wam")]
    arm: String,
    /// Prefix of the hand's ports, as in /hand
    #[arg(long, value_name = "PREFIX")]
    hand: Option<String>,
    /// Port with the images of a camera, as in /camera
    #[arg(long, value_name = "PORT")]
    camera: Option<String>,
    /// Further port whose messages are shown: detections, plans, objects, log lines; may be given several times
    #[arg(long = "source", value_name = "PORT")]
    sources: Vec<String>,
    /// Name of the view's port; by default that of the arm and /view
    #[arg(long, value_name = "NAME")]
    name: Option<String>,
    /// Let the page command the robot: sliders, control modes, emergency stop
    #[arg(long)]
    control: bool,
    #[command(flatten)]
    bind: BindArgs,
}

/// Options of commands that serve a view besides a robot.
#[derive(Clone, Copy, Debug, clap::Args)]
pub(crate) struct ViewArgs {
    /// Let the page of the live view command the robot: sliders, control modes, emergency stop
    #[arg(long)]
    control: bool,
    /// Serve no live view
    #[arg(long, conflicts_with = "control")]
    no_view: bool,
}

impl ViewArgs {
    /// Returns the lines that the view shall show; `None` if there shall be no view.
    #[cfg(all(unix, feature = "table"))]
    pub(crate) fn log(self) -> Option<LogLines> {
        (!self.no_view).then(stock_log::show_in)
    }

    /// Returns whether the page may command the robot.
    #[cfg(all(unix, feature = "table"))]
    pub(crate) fn control(self) -> bool {
        self.control
    }

    /// Opens the view, if it is wanted.
    ///
    /// Errors: those of [`View::open`]; a view that cannot be opened is no reason to stop the robot.
    pub(crate) async fn open(
        self,
        network: &Network,
        options: ViewOptions,
    ) -> std::result::Result<Option<View>, PortError> {
        if self.no_view {
            return Ok(None);
        }
        let options = options.control(self.control).log(stock_log::show_in());
        View::open(network, options).await.map(Some)
    }
}

/// Warns that there is no view.
pub(crate) fn warn_missing(error: &PortError) {
    tracing::warn!("there is no live view: {}", error.error_chain());
}

pub(super) async fn run(args: Args, out: &mut dyn Write) -> Result<ExitCode> {
    let mut interrupt = Interrupt::listen();
    let network = args.bind.apply(network_access::network()?);
    let mut options = ViewOptions::new(&args.arm)
        .control(args.control)
        .log(stock_log::show_in());
    if let Some(name) = &args.name {
        name.parse::<PortName>().map_err(PortError::from)?;
        options = options.name(name);
    }
    if let Some(hand) = &args.hand {
        options = options.hand(hand);
    }
    if let Some(camera) = &args.camera {
        options = options.camera(camera);
    }
    for source in &args.sources {
        options = options.source(source);
    }
    let held = stock_log::hold_back();
    let view = View::open(&network, options).await?;
    writeln!(out, "Live view: {}", view.url())?;
    out.flush()?;
    drop(held);
    systemd_notify::notify_ready();
    interrupt.interrupted().await;
    view.close().await;
    Ok(ExitCode::SUCCESS)
}
