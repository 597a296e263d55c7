//! `yarp up`: a whole network with a simulated arm.

use std::io::Write;
use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::Arc;

use yarp_devices::Device;
use yarp_devices::embedded::{LinkAddresses, LinkMode};
use yarp_hosting::ConfiguredArm;
use yarp_nameserver::{Server, ServerOptions};
use yarp_ports::config::{self, Configuration, NameServer};
use yarp_ports::{Network, PortError, addresses};
use yarp_view::{View, ViewOptions};
use yarp_wire::PortName;
use yarp_wrappers::{
    CartesianServer, CartesianServerOptions, CartesianVersion, ControlBoardOptions,
    ControlBoardServer, StopServer,
};

use crate::arm_selection::{Arm, ArmArgs, LinkModeArgs};
use crate::error::{Failure, Result};
use crate::listen_addresses::{self, BindArgs};
use crate::signals::Interrupt;
use crate::{network_access, stock_log, systemd_notify};

use super::view::{ViewArgs, warn_missing};

/// Ports of the arm, with their purposes.
const PORTS: [(&str, &str); 7] = [
    ("rpc:i", "RPC (YARP 3.x)"),
    ("nws/rpc:i", "RPC (YARP 4.0)"),
    ("command:i", "streaming commands"),
    ("state:o", "joint positions in degrees, 50 times a second"),
    ("stateExt:o", "the whole state, 50 times a second"),
    ("async:o", "motion completion events"),
    ("stop/rpc:i", "software stop"),
];

/// Prefix of the port names of the tool controller, as on iCub.
const TOOL_PREFIX: &str = "/cartController";

/// Ports of the tool controller, with their purposes.
const TOOL_PORTS: [(&str, &str); 4] = [
    ("rpc:i", "RPC of the tool controller"),
    ("command:i", "targets and velocities of the tool"),
    ("state:o", "its pose, 100 times a second"),
    ("events:o", "motion start and completion events"),
];

/// bring up a whole network with a simulated arm
///
/// Brings up a whole network: a name server unless one answers, and a simulated WAM arm on it.
///
/// Ctrl-C ends both and unregisters every name.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// Prefix of the names of the arm's ports
    #[arg(long, value_name = "PREFIX", default_value = "/wam")]
    name: String,
    /// Type of the simulation
    #[arg(long, value_enum, conflicts_with = "arm")]
    simulation: Option<Simulation>,
    /// Kind of arm: simulated, dynamic (with masses and friction), simulated-can (--simulation real), embedded (behind its own PC, which runs `yarp wam-node`),
    /// or can:INTERFACE (on a CAN bus of this machine that is up, as in can:can0)
    #[arg(long, default_value_t = Arm::Simulated)]
    arm: Arm,
    /// Also serve a controller of the arm's tool, like iCub's, as /cartController and PREFIX; works
    /// with every arm. Clients of icub-main 1.x need 1.1, later ones 2.0
    #[arg(long, value_name = "VERSION", num_args = 0..=1, require_equals = true, default_missing_value = "2.0",
          value_parser = cartesian_version)]
    cartesian: Option<CartesianVersion>,
    #[command(flatten)]
    bind: BindArgs,
    #[command(flatten)]
    link_mode: LinkModeArgs,
    #[command(flatten)]
    view: ViewArgs,
    #[command(flatten)]
    configuration: ArmArgs,
}

#[derive(Clone, Copy, Debug, clap::ValueEnum)]
enum Simulation {
    /// Moves exactly as commanded
    Ideal,
    /// Has masses, friction, encoders and a controller: ends near its targets, sinks when idle
    Dynamic,
    /// Is brought up like a real arm, with its driver: asks for the confirmation of home, and moves once `yarp wam press activate`
    /// has pressed the pendant. Has latency, noise, cogging, elastic cables, stiction, and motors that heat up
    Real,
}

impl Args {
    fn arm(&self) -> Arm {
        match self.simulation {
            None => self.arm.clone(),
            Some(Simulation::Ideal) => Arm::Simulated,
            Some(Simulation::Dynamic) => Arm::Dynamic,
            Some(Simulation::Real) => Arm::SimulatedCan,
        }
    }
}

fn cartesian_version(text: &str) -> std::result::Result<CartesianVersion, &'static str> {
    CartesianVersion::from_text(text).ok_or("expected 2.0 or 1.1")
}

pub(super) async fn run(args: Args, out: &mut dyn Write) -> Result<ExitCode> {
    args.name.parse::<PortName>().map_err(PortError::from)?;
    let arm = args.arm();
    let link_mode = args.link_mode.link_mode(true).map_err(Failure::LinkMode)?;
    let configuration = args.configuration.configuration(&arm, link_mode)?;
    let mut interrupt = Interrupt::listen();
    // The first line is the address of the view.
    // A wait for a clock is reported at once.
    let held = (!network_access::names_clock()).then(stock_log::hold_back);
    let base = NameServerAccess::find(args.bind).await?;
    stock_log::start_forwarding(&base.network);
    if let Err(failure) = network_access::follow_clock(&base.network, &mut interrupt).await {
        base.close().await;
        return Err(failure);
    }
    let options = ViewOptions::new(&args.name);
    let (view, missing) = match args.view.open(&base.network, options).await {
        Ok(view) => (view, None),
        Err(error) => (None, Some(error)),
    };
    if let Some(view) = &view {
        writeln!(out, "Live view: {}", view.url())?;
        out.flush()?;
    }
    drop(held);
    let opened = tokio::select! {
        biased;
        () = interrupt.interrupted() => None,
        opened = open(&base.network, &args.name, &configuration, args.cartesian) => Some(opened),
    };
    let base = Base { access: base, view };
    let served = match opened {
        Some(Ok(served)) => {
            missing.iter().for_each(warn_missing);
            served
        }
        Some(Err(failure)) => {
            base.close().await;
            return Err(failure);
        }
        None => {
            base.close().await;
            return Ok(ExitCode::SUCCESS);
        }
    };
    let told = print_summary(
        &base.access,
        &args.name,
        arm,
        configuration.joints(),
        link_mode,
        args.cartesian.is_some(),
        out,
    )
    .await;
    if told.is_ok() {
        listen_addresses::warn_if_open(&base.access.network, &args.name);
        systemd_notify::notify_ready();
        interrupt.interrupted().await;
    }
    served.close().await;
    base.close().await;
    told.map(|()| ExitCode::SUCCESS)
}

/// Everything but the arm.
struct Base {
    access: NameServerAccess,
    view: Option<View>,
}

impl Base {
    async fn close(self) {
        if let Some(view) = self.view {
            view.close().await;
        }
        self.access.close().await;
    }
}

/// The network, and its name server if this command started it.
pub(super) struct NameServerAccess {
    pub(super) network: Network,
    server: Option<Server>,
    /// The configuration file that was written for it.
    written: Option<PathBuf>,
}

impl NameServerAccess {
    /// The configured name server if it answers, else one of our own where the configuration says.
    ///
    /// A server of our own listens where its place is, if `bind` names an address; its ports listen at that address.
    pub(super) async fn find(bind: BindArgs) -> Result<Self> {
        let configuration = Configuration::from_process()?;
        let network = bind.apply(Network::from_process()?);
        if let Some((namespace, _)) = configuration.name_server()
            && network_access::serves(&network, namespace).await
        {
            return Ok(Self {
                network,
                server: None,
                written: None,
            });
        }
        let held = &configuration.namespaces()[0];
        let place = match &held.server {
            Some(server) if is_here(&server.host) => server.clone(),
            Some(server) => {
                return Err(Failure::Elsewhere {
                    place: format!("{}:{}", server.host, server.port),
                });
            }
            None => NameServer::at(&host_for(bind), configuration.default_port()),
        };
        let mut options = ServerOptions::default()
            .at(&place.host, place.port)
            .namespace(&held.name)
            .multicast(configuration.default_port())
            .key(configuration.key().cloned())
            .tls(configuration.tls().cloned())
            .roles(configuration.roles().clone())
            .gate(configuration.gate().clone());
        options.bind = match bind.address() {
            Some(address) if !address.is_unspecified() => place.host.parse().ok(),
            asked => asked,
        };
        let server = Server::start(options).await?;
        let is_new = held.server.is_none();
        if is_new && let Err(error) = config::write(&held.file, &place.to_string()) {
            server.close().await;
            return Err(error.into());
        }
        Ok(Self {
            // The configuration that every other program will use.
            network: bind.apply(Network::from_process()?),
            server: Some(server),
            written: is_new.then(|| held.file.clone()),
        })
    }

    /// Ends the name server if this command started it.
    pub(super) async fn close(self) {
        if let Some(server) = self.server {
            server.close().await;
        }
    }
}

/// Returns the address of a new name server: the one that ports are to listen at, else the best of this machine.
fn host_for(bind: BindArgs) -> String {
    let one = bind.address().filter(|address| !address.is_unspecified());
    one.map_or_else(addresses::best, |address| address.to_string())
}

fn is_here(host: &str) -> bool {
    host == "localhost"
        || host.starts_with("127.")
        || addresses::own().iter().any(|own| own == host)
}

async fn open(
    network: &Network,
    name: &str,
    configuration: &ConfiguredArm,
    cartesian: Option<CartesianVersion>,
) -> Result<Served> {
    let configured = configuration.clone();
    let starting = tokio::task::spawn_blocking(move || configured.start());
    let arm = starting.await.expect("starting an arm does not panic")?;
    let options = ControlBoardOptions::new();
    let board = ControlBoardServer::open(network, arm.clone(), name, options).await?;
    let stop = match StopServer::open(network, arm.clone(), name).await {
        Ok(stop) => stop,
        Err(failure) => {
            board.close().await;
            return Err(failure.into());
        }
    };
    let served = Served {
        stop,
        board,
        tool: None,
    };
    let Some(version) = cartesian else {
        return Ok(served);
    };
    match open_tool(network, name, configuration.start_tool(arm)?, version).await {
        Ok(tool) => Ok(Served {
            tool: Some(tool),
            ..served
        }),
        Err(failure) => {
            served.close().await;
            Err(failure)
        }
    }
}

async fn open_tool(
    network: &Network,
    name: &str,
    tool: Arc<dyn Device>,
    version: CartesianVersion,
) -> Result<CartesianServer> {
    let options = CartesianServerOptions::new().version(version);
    let name = format!("{TOOL_PREFIX}{name}");
    Ok(CartesianServer::open(network, tool, &name, options).await?)
}

/// The arm, its software stop, and the controller of its tool, if any.
struct Served {
    stop: StopServer,
    board: ControlBoardServer,
    tool: Option<CartesianServer>,
}

impl Served {
    async fn close(self) {
        if let Some(tool) = self.tool {
            tool.close().await;
        }
        self.board.close().await;
        self.stop.close().await;
    }
}

/// Describes the connection to the PC of an arm.
fn describe_link(link_mode: LinkMode) -> String {
    let at = |places: LinkAddresses| format!("{} and {}", places.arm, places.packets);
    match link_mode {
        LinkMode::Listen(places) => {
            format!(
                "waiting for it at {}; run `yarp wam-node` on it",
                at(places)
            )
        }
        LinkMode::Connect(places) => format!(
            "connecting to it at {}; run `yarp wam-node --listen` on it",
            at(places)
        ),
    }
}

/// Prints the ports and examples.
async fn print_summary(
    base: &NameServerAccess,
    name: &str,
    arm: Arm,
    joints: usize,
    link_mode: LinkMode,
    cartesian: bool,
    out: &mut dyn Write,
) -> Result<()> {
    let network = &base.network;
    let (host, port) = network.server().unwrap_or_default();
    let namespace = network.namespace();
    let whose = match base.server {
        Some(_) => "started here",
        None => "was there",
    };
    if let Some(file) = &base.written {
        writeln!(out, "Wrote {}", file.display())?;
    }
    writeln!(out, "\nName server {namespace} at {host}:{port} ({whose})")?;
    match arm {
        Arm::Embedded => writeln!(
            out,
            "WAM arm {name} behind its PC: {}\n",
            describe_link(link_mode)
        )?,
        Arm::Can(interface) => writeln!(out, "WAM arm {name} on the CAN bus {interface}\n")?,
        Arm::Simulated | Arm::Dynamic => {
            let joints = yarp_devices::wam::count_word(joints);
            writeln!(out, "Simulated WAM arm {name}, {joints} joints\n")?;
        }
        Arm::SimulatedCan => writeln!(
            out,
            "Simulated WAM arm {name} behind the driver of its CAN bus: like a real one it moves once home is confirmed\n\
             (`yarp wam home --name {name}`) and the pendant pressed (`yarp wam press activate --name {name}`)\n"
        )?,
    }
    let tool = format!("{TOOL_PREFIX}{name}");
    let mut ports: Vec<_> = PORTS
        .map(|(suffix, purpose)| (format!("{name}/{suffix}"), purpose))
        .into();
    if cartesian {
        ports.extend(TOOL_PORTS.map(|(suffix, purpose)| (format!("{tool}/{suffix}"), purpose)));
    }
    let width = ports
        .iter()
        .map(|(port, _)| port.len())
        .max()
        .unwrap_or_default();
    writeln!(out, "{:<width$}  {:<26}  what it is for", "port", "address")?;
    for (port, purpose) in ports {
        let place = network.query(&port).await?;
        let address = format!("tcp://{}:{}/", place.host, place.port);
        writeln!(out, "{port:<width$}  {address:<26}  {purpose}")?;
    }
    writeln!(
        out,
        "
Try in another terminal:
  yarp read ... {name}/state:o                          # watch the joints
  echo '[get] [encs]' | yarp rpc {name}/rpc:i           # ask where they are
  echo '[set] [pos] 3 90.0' | yarp rpc {name}/rpc:i     # move the elbow to 90 degrees
  yarp wam stop --name {name}                           # stop it, whatever it does"
    )?;
    if cartesian {
        writeln!(
            out,
            "  echo '[go] [xyz] 2.0 (0.4 0.1 0.4)' | yarp rpc {tool}/rpc:i   # bring the tool there"
        )?;
    }
    writeln!(out, "\nCtrl-C ends it.")?;
    Ok(())
}
