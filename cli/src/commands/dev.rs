//! `yarp dev`: one device, as stock's `yarpdev` hosts it.

use std::io::Write;
use std::process::ExitCode;
use std::time::Duration;

use serde_json::json;
use tokio::sync::watch;
use yarp_hosting::{Hosted, RunningService, device_types, open_wrapped, opened_types, park};
use yarp_ports::{Answer, Network, Port, PortOptions, Received};
use yarp_wire::settings::{Origin, Parameters, Settings};
use yarp_wire::{Bottle, Value, Vocab32};

use super::robotinterface;
use crate::error::Result;
use crate::listen_addresses::{self, BindArgs};
use crate::signals::Interrupt;
use crate::{network_access, output, systemd_notify};

const COMPONENT: &str = "yarp.dev.Drivers";
/// Exit code of stock's yarpdev without a name server.
const NO_NETWORK: u8 = 255;
/// Options of the command; all others belong to the device.
const OURS: [&str; 12] = [
    "bind",
    "device",
    "dryrun",
    "json",
    "from",
    "context",
    "name",
    "nested",
    "lispy",
    "verbose",
    "allow-deprecated-devices",
    "nopark",
];

const USAGE: &str = "Welcome to yarp dev, a program to create YARP devices
To see the devices available, try:
   yarp dev --list
To create a device whose name you know, call yarp dev like this:
   yarp dev --device DEVICENAME --OPTION VALUE ...
   For example:
   yarp dev --device simulatedWam --name /wam
You can always move options to a configuration file:
   yarp dev [--device DEVICENAME] --from CONFIG_FILENAME
To see what would be opened, without a network:
   yarp dev --device DEVICENAME --OPTION VALUE ... --dryrun";

/// host a device, as stock's yarpdev
///
/// Opens a device with its server, until `quit` arrives at its port NAME/quit or a signal at the
/// process. Then the device is parked and closed; a second signal ends at once.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// --device NAME, --from FILE, --context CONTEXT, --list, --nested "(a b) ...", --nopark, --dryrun, --json (with --dryrun), --bind ADDRESS, and the options of the
    /// device: --key value, --group::key value
    #[arg(
        value_name = "OPTION",
        allow_hyphen_values = true,
        trailing_var_arg = true
    )]
    words: Vec<String>,
}

pub(super) async fn run(args: Args, out: &mut dyn Write) -> Result<ExitCode> {
    let finder = network_access::finder(&args.words, None)?;
    let mut settings = finder.settings().clone();
    let nested = settings.get("nested").or_else(|| settings.get("lispy"));
    if let Some(text) = nested.map(|text| text.to_plain_string()) {
        settings = Settings::new();
        if let Err(error) = settings.add_lists(&text, &Origin::CommandLine) {
            tracing::error!(target: COMPONENT, "--nested: {error}");
            return Ok(ExitCode::FAILURE);
        }
    }
    if settings.has("list") && !settings.has("device") {
        output::serve_nobody();
        list(out)?;
        return Ok(ExitCode::SUCCESS);
    }
    let Some(device) = settings
        .get("device")
        .map(|device| device.to_plain_string())
    else {
        writeln!(out, "{USAGE}")?;
        match settings.get("from") {
            Some(from) => {
                let from = from.to_plain_string();
                tracing::error!(target: COMPONENT, "Unable to find --device option in file {from}. Closing.");
            }
            None => tracing::warn!(target: COMPONENT, "--device option not specified. Closing."),
        }
        return Ok(ExitCode::SUCCESS);
    };
    if settings.has("dryrun") {
        return describe(&device, settings, out);
    }
    let network = match BindArgs::from_settings(finder.settings()) {
        Ok(bind) => bind.apply(network_access::unreported_network()?),
        Err(problem) => {
            tracing::error!(target: COMPONENT, "{problem}");
            return Ok(ExitCode::FAILURE);
        }
    };
    if !network_access::serves(&network, network.namespace()).await {
        tracing::error!(target: COMPONENT, "YARP network not available, check if yarp server is reachable");
        return Ok(ExitCode::from(NO_NETWORK));
    }
    let mut interrupt = Interrupt::listen_with(1, Duration::ZERO);
    network_access::follow_clock(&network, &mut interrupt).await?;
    let parks = !settings.has("nopark");
    let origin = settings.origin("device").cloned();
    let parameters = Parameters::new(&device, settings, origin.unwrap_or(Origin::CommandLine));
    let opened = tokio::select! {
        biased;
        () = interrupt.interrupted() => return Ok(ExitCode::SUCCESS),
        opened = open_wrapped(&network, &device, &parameters) => opened,
    };
    let hosted = match opened {
        Ok(hosted) => hosted,
        Err(error) => {
            tracing::error!(target: COMPONENT, "{}", yarp_ports::error_chain(&error));
            tracing::error!(target: COMPONENT, "yarpdev: ***ERROR*** device not available.");
            return Ok(ExitCode::FAILURE);
        }
    };
    report_unused(&parameters);
    let code = serve(
        &network,
        hosted,
        &device,
        &quit_name(&parameters, &device),
        parks,
        &mut interrupt,
    )
    .await?;
    tracing::info!(target: COMPONENT, "yarpdev is finished.");
    Ok(code)
}

/// Prints the devices that would be opened, with their parameters.
///
/// Fails for an unknown type, and for a bundle without its parameters.
fn describe(device: &str, settings: Settings, out: &mut dyn Write) -> Result<ExitCode> {
    output::serve_nobody();
    let is_json = settings.has("json");
    let origin = settings.origin("device").cloned();
    let parameters = Parameters::new(device, settings, origin.unwrap_or(Origin::CommandLine));
    let types = match opened_types(device, &parameters) {
        Ok(types) => types,
        Err(error) => {
            tracing::error!(target: COMPONENT, "{}", yarp_ports::error_chain(&error));
            return Ok(ExitCode::FAILURE);
        }
    };
    let types: Vec<&str> = types.iter().map(|known| known.name).collect();
    let settings = parameters.settings();
    match is_json {
        true => {
            let params = robotinterface::parameters_as_json(settings);
            let device = json!({"device": device, "types": types, "params": params});
            writeln!(out, "{device:#}")?;
        }
        false => {
            writeln!(out, "device {device} of type {}", types.join(", "))?;
            robotinterface::print_parameters(settings, out)?;
        }
    }
    Ok(ExitCode::SUCCESS)
}

/// Prints every device type, one per line.
fn list(out: &mut dyn Write) -> Result<()> {
    let bundler = (
        device_types::BUNDLER,
        &[][..],
        "one device attached to another; wrapper_device, attached_device",
        None,
    );
    let all = device_types::DEVICE_TYPES
        .iter()
        .map(|kind| (kind.name, kind.aliases, kind.about, kind.wrapper));
    for (name, aliases, about, wrapper) in all.chain([bundler]) {
        write!(out, "Device \"{name}\", {about}")?;
        if let Some(wrapper) = wrapper {
            write!(out, ", wrapped by \"{wrapper}\"")?;
        }
        if !aliases.is_empty() {
            write!(out, ", also called {}", aliases.join(", "))?;
        }
        writeln!(out)?;
    }
    Ok(())
}

fn report_unused(parameters: &Parameters) {
    for name in OURS {
        parameters.has(name);
    }
    for (name, origin) in parameters.unused() {
        let device = parameters.device();
        tracing::warn!(target: COMPONENT, "{origin}: device {device} ignores parameter {name}");
    }
}

/// Returns the name of the port that accepts `quit`, as in stock.
fn quit_name(parameters: &Parameters, device: &str) -> String {
    let name = parameters
        .settings()
        .get("name")
        .map(|name| name.to_plain_string());
    let name = name.unwrap_or_else(|| device.to_owned());
    format!("/{}/quit", name.trim_start_matches('/'))
}

/// Runs the device until the end is requested, parks it and closes it.
async fn serve(
    network: &Network,
    hosted: Box<dyn Hosted>,
    device: &str,
    quit: &str,
    parks: bool,
    interrupt: &mut Interrupt,
) -> Result<ExitCode> {
    let (sender, mut told) = watch::channel(false);
    let port = match quit_port(network, quit, sender).await {
        Ok(Some(port)) => port,
        refused => {
            tracing::error!(target: COMPONENT, "Failed to create terminator port");
            hosted.close().await;
            return refused.map(|_| ExitCode::FAILURE);
        }
    };
    let mut service = match start_service(hosted.as_ref(), device).await {
        Ok(service) => service,
        Err(error) => {
            tracing::error!(target: COMPONENT, "{}", yarp_ports::error_chain(&error));
            port.close().await;
            hosted.close().await;
            return Ok(ExitCode::FAILURE);
        }
    };
    tracing::info!(target: COMPONENT, "device active in background...");
    if hosted.machine().is_some() {
        listen_addresses::warn_if_open(network, quit.trim_end_matches("/quit"));
    }
    systemd_notify::notify_ready();
    tokio::select! {
        () = interrupt.interrupted() => {}
        _ = told.wait_for(|told| *told) => {}
        // As in stock, the program ends with the service.
        _ = service_ended(&mut service) => {}
    }
    let well = match service {
        Some(service) => service.stop().await,
        None => true,
    };
    if let Some(machine) = hosted.machine().filter(|_| parks) {
        tracing::info!(target: COMPONENT, "parking");
        if let Err(error) = park(machine).await {
            tracing::warn!(target: COMPONENT, "cannot park: {}", yarp_ports::error_chain(&error));
        }
    }
    // Closed before the device, so that clients learn of the end.
    port.close().await;
    hosted.close().await;
    Ok(super::code(well))
}

/// Starts the service of a device that has one.
async fn start_service(
    hosted: &dyn Hosted,
    device: &str,
) -> std::result::Result<Option<RunningService>, yarp_hosting::HostError> {
    match hosted.service() {
        Some(service) => RunningService::start(device, service).await.map(Some),
        None => Ok(None),
    }
}

/// Waits until the service ends by itself; without a service for ever.
async fn service_ended(service: &mut Option<RunningService>) -> bool {
    match service {
        Some(service) => service.ended().await,
        None => std::future::pending().await,
    }
}

/// Opens the port that accepts `quit`, like stock's `Terminee`, once the device is active.
async fn quit_port(
    network: &Network,
    name: &str,
    quit: watch::Sender<bool>,
) -> Result<Option<Port>> {
    let answer = move |received: &mut Received| {
        let asked = received.bottle().unwrap_or_default();
        let word = match asked.get(0).and_then(Value::as_str) {
            Some("quit") => {
                quit.send_replace(true);
                Vocab32::OK
            }
            _ => Vocab32::new("huh?"),
        };
        Answer::reply(Bottle::of(word))
    };
    network_access::open(
        network,
        name,
        PortOptions::new().handler(answer).input_only(),
    )
    .await
}
