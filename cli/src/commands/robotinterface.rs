//! `yarp robotinterface`: a robot of several devices, as stock's `yarprobotinterface` hosts it.

use std::io::Write;
use std::process::ExitCode;
use std::time::Duration;

use serde_json::{Value as Json, json};
use tokio::sync::watch;
use yarp_hosting::robot::{
    DeviceEntry, Phase, Problem, Progress, ReadOptions, Robot, RunningRobot, Substitutions,
};
use yarp_ports::{Answer, Network, Port, PortOptions, Received};
use yarp_wire::settings::{Setting, Settings};
use yarp_wire::{Bottle, Value, Vocab32};
use yarp_wrappers::thrift::{Item, Message};

use crate::error::Result;
use crate::listen_addresses::{self, BindArgs};
use crate::signals::Interrupt;
use crate::{network_access, output, systemd_notify};

const COMPONENT: &str = "yarprobotinterface";
/// File that names the description if the command line does not.
const DEFAULT_INI: &str = "yarprobotinterface.ini";
/// One signal for the shutdown, and two for the phases of later interrupts.
const MAX_SIGNALS: u32 = 3;

const HELP: [(&str, &str); 8] = [
    ("get_phase", "Returns current phase."),
    ("get_level", "Returns current level."),
    ("get_robot", "Returns robot name."),
    (
        "is_ready",
        "Returns true if all startup actions are done, and no interrupt came.",
    ),
    ("quit", "Ends the program."),
    ("bye", "Ends the program."),
    ("exit", "Ends the program."),
    ("help", "Lists the commands, or explains one."),
];

/// host a robot of several devices, as stock's yarprobotinterface
///
/// Reads the description of a robot (XML, or TOML), opens its devices and attaches them, until
/// `quit` arrives at its port PREFIX/yarprobotinterface or a signal at the process. Then all
/// devices are parked and closed.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// --config FILE (or `config FILE` in yarprobotinterface.ini), --context CONTEXT, --portprefix /P, --dryrun, --json (with
    /// --dryrun), --strict (reports what stock reads without a word and is most likely a mistake, and ends with 1 if there is anything), --substitute FILE (other devices in the place of those of the robot), --nopark, --enable_tags "(a b)", --disable_tags "(a b)", --allow-deprecated-dtd, --bind ADDRESS, and values for parameters that
    /// have an extern-name
    #[arg(
        value_name = "OPTION",
        allow_hyphen_values = true,
        trailing_var_arg = true
    )]
    words: Vec<String>,
}

pub(super) async fn run(args: Args, out: &mut dyn Write) -> Result<ExitCode> {
    let finder = network_access::finder(&args.words, Some(DEFAULT_INI))?;
    let settings = finder.settings();
    if !settings.has("config") {
        tracing::error!(target: COMPONENT, "Missing \"config\" argument: expected --config FILE, or config FILE in {DEFAULT_INI}");
        return Ok(ExitCode::FAILURE);
    }
    let Some(file) = finder.find_file("config") else {
        let config = settings
            .get("config")
            .map(|config| config.to_plain_string());
        tracing::error!(target: COMPONENT, "Cannot find {}", config.unwrap_or_default());
        return Ok(ExitCode::FAILURE);
    };
    let options = ReadOptions {
        given: settings.clone(),
    };
    let (mut robot, lints) = Robot::read_with_lints(&file, &options)?;
    if settings.has("substitute") {
        let Some(rules) = finder.find_file("substitute") else {
            let name = settings.get("substitute").map(Setting::to_plain_string);
            tracing::error!(target: COMPONENT, "Cannot find {}", name.unwrap_or_default());
            return Ok(ExitCode::FAILURE);
        };
        for omitted in robot.substitute(&Substitutions::read(&rules)?) {
            tracing::warn!(target: COMPONENT, "{omitted}");
        }
    }
    let dry = settings.has("dryrun");
    let lints = settings.has("strict").then_some(lints);
    for lint in lints.iter().flatten() {
        tracing::warn!(target: COMPONENT, "{lint}");
    }
    if dry {
        output::serve_nobody();
        match settings.has("json") {
            true => writeln!(out, "{:#}", as_json(&robot, lints.as_deref()))?,
            false => describe(&robot, out)?,
        }
    }
    if let Some(lints) = lints {
        let count = lints.len() + robot.problems().len();
        if count > 0 {
            tracing::error!(target: COMPONENT, "{count} problems found: expected none with --strict");
            return Ok(ExitCode::FAILURE);
        }
    }
    if dry {
        return Ok(ExitCode::SUCCESS);
    }
    let parks = !settings.has("nopark");
    let network = match BindArgs::from_settings(settings) {
        Ok(bind) => bind.apply(network_access::unreported_network()?),
        Err(problem) => {
            tracing::error!(target: COMPONENT, "{problem}");
            return Ok(ExitCode::FAILURE);
        }
    };
    if !network_access::serves(&network, network.namespace()).await {
        tracing::error!(target: COMPONENT, "Sorry YARP network does not seem to be available, is the yarp server available?");
        return Ok(ExitCode::FAILURE);
    }
    let mut interrupt = Interrupt::listen_with(MAX_SIGNALS, Duration::ZERO);
    network_access::follow_clock(&network, &mut interrupt).await?;
    let (sender, told) = watch::channel(false);
    let progress = Progress::default();
    let name = format!("{}/yarprobotinterface", robot.port_root());
    let Some(port) = rpc(&network, &name, &robot.name, progress.clone(), sender).await? else {
        return Ok(ExitCode::FAILURE);
    };
    let well = live(&network, robot, progress, parks, &mut interrupt, told).await;
    port.close().await;
    Ok(super::code(well))
}

/// Prints the devices that would be hosted with their parameters and actions, and logs what would fail.
fn describe(robot: &Robot, out: &mut dyn Write) -> Result<()> {
    for problem in robot.problems() {
        tracing::warn!(target: COMPONENT, "{problem}");
    }
    writeln!(out, "robot {}, ports {}", robot.name, robot.port_root())?;
    for device in &robot.devices {
        writeln!(out, "device {} of type {}", device.name, device.kind)?;
        if let Ok(parameters) = robot.parameters(device) {
            print_parameters(parameters.settings(), out)?;
        }
        for action in &device.actions {
            writeln!(out, "  {} {}: {}", action.phase, action.level, action.kind)?;
        }
    }
    Ok(())
}

/// Prints parameters as lists, each with its name first.
pub(super) fn print_parameters(parameters: &Settings, out: &mut dyn Write) -> Result<()> {
    for entry in &parameters.to_bottle() {
        let entry = entry.as_list().map(ToString::to_string);
        writeln!(out, "  param {}", entry.unwrap_or_default())?;
    }
    Ok(())
}

/// Returns the robot with its devices, resolved parameters and actions, and what would fail.
///
/// A parameter is an array of its values; lists and groups in it are arrays, too. `lints` are those of `--strict`.
fn as_json(robot: &Robot, lints: Option<&[Problem]>) -> Json {
    let actions = |device: &DeviceEntry| {
        let actions = device.actions.iter().map(|action| {
            json!({
                "phase": action.phase.to_string(),
                "level": action.level,
                "type": action.kind.to_string(),
                "params": action.to_bottle().iter().map(value_as_json).collect::<Vec<_>>(),
                "origin": action.origin.to_string(),
            })
        });
        Json::from_iter(actions)
    };
    let devices = robot.devices.iter().map(|device| {
        let params = robot.parameters(device);
        json!({
            "name": device.name,
            "type": device.kind,
            "params": params.map_or_else(|_| json!({}), |known| parameters_as_json(known.settings())),
            "actions": actions(device),
            "origin": device.origin.to_string(),
        })
    });
    let list = |problems: &[Problem]| {
        let entry =
            |problem: &Problem| json!({"origin": problem.origin.to_string(), "what": problem.what});
        Json::from_iter(problems.iter().map(entry))
    };
    let mut whole = json!({
        "name": robot.name,
        "build": robot.build,
        "portprefix": robot.port_prefix,
        "devices": Json::from_iter(devices),
        "problems": list(&robot.problems()),
    });
    if let Some(lints) = lints {
        whole["lints"] = list(lints);
    }
    whole
}

/// Returns parameters as an object: of each name an array of its values.
pub(super) fn parameters_as_json(parameters: &Settings) -> Json {
    let mut object = serde_json::Map::new();
    for entry in &parameters.to_bottle() {
        let values = entry.as_list().map(Bottle::as_slice).unwrap_or_default();
        if let Some((name, values)) = values.split_first() {
            let values = values.iter().map(value_as_json).collect();
            object.insert(name.to_plain_string(), values);
        }
    }
    object.into()
}

fn value_as_json(value: &Value) -> Json {
    match value {
        Value::Int32(number) => (*number).into(),
        Value::Int64(number) => (*number).into(),
        Value::Float64(number) => (*number).into(),
        Value::List(list) => list.iter().map(value_as_json).collect(),
        other => other.to_plain_string().into(),
    }
}

/// Runs the robot until the end is requested; returns true on success.
async fn live(
    network: &Network,
    robot: Robot,
    progress: Progress,
    parks: bool,
    interrupt: &mut Interrupt,
    mut told: watch::Receiver<bool>,
) -> bool {
    let name = format!("/{}", robot.port_prefix);
    let mut starting = std::pin::pin!(RunningRobot::start(network, robot, progress.clone()));
    let mut heard = false;
    let started = loop {
        tokio::select! {
            started = &mut starting => break started,
            () = interrupt.interrupted(), if !heard => {
                heard = true;
                progress.interrupt();
            }
        }
    };
    let Some(mut robot) = started else {
        return false;
    };
    let mut well = robot.is_ready();
    if well {
        tracing::info!(target: COMPONENT, "running happily");
        if robot.has_machine() {
            listen_addresses::warn_if_open(network, &name);
        }
        systemd_notify::notify_ready();
        tokio::select! {
            () = interrupt.interrupted() => {}
            _ = told.wait_for(|told| *told) => {}
        }
    } else if !heard {
        tracing::error!(target: COMPONENT, "Error in startup phase... see previous messages for more info");
    }
    well &= shut_down_on_interrupts(&mut robot, parks, interrupt).await;
    well & robot.close().await
}

/// Runs the interrupt phases and the shutdown.
async fn shut_down_on_interrupts(
    robot: &mut RunningRobot,
    parks: bool,
    interrupt: &mut Interrupt,
) -> bool {
    tokio::select! {
        well = robot.shut_down(parks) => return well,
        () = interrupt.interrupted_times(2) => {}
    }
    robot.phase(Phase::Interrupt2).await;
    tokio::select! {
        well = robot.phase(Phase::Shutdown) => return well,
        () = interrupt.interrupted_times(3) => {}
    }
    robot.phase(Phase::Interrupt3).await;
    robot.phase(Phase::Shutdown).await
}

/// Opens the port that reports the phase of the robot and accepts the request to end.
async fn rpc(
    network: &Network,
    name: &str,
    robot: &str,
    progress: Progress,
    quit: watch::Sender<bool>,
) -> Result<Option<Port>> {
    let robot = robot.to_owned();
    let answer = move |received: &mut Received| {
        let asked = received.bottle().unwrap_or_default();
        let one = |item| Answer::reply(Message(vec![item]));
        let (command, rest) = command(&asked);
        match command.as_str() {
            "get_phase" => {
                let phase = progress.phase().map(|phase| phase.to_string());
                one(Item::Text(phase.unwrap_or_else(|| "unknown".to_owned())))
            }
            "get_level" => one(Item::I32(progress.level() as i32)),
            "get_robot" => one(Item::Text(robot.clone())),
            "is_ready" => one(Item::Bool(progress.phase() == Some(Phase::Run))),
            "quit" | "bye" | "exit" => {
                quit.send_replace(true);
                one(Item::Text("bye".to_owned()))
            }
            "help" => Answer::reply(help(rest.and_then(Value::as_str))),
            _ => Answer::reply(Bottle::of(Vocab32::FAIL)),
        }
    };
    network_access::open(
        network,
        name,
        PortOptions::new().handler(answer).input_only(),
    )
    .await
}

/// Returns the command, given as one word or several (`get_phase`, `get phase`), and its argument.
fn command(asked: &Bottle) -> (String, Option<&Value>) {
    let mut words = String::new();
    for (at, word) in asked.iter().enumerate() {
        words.push_str(&word.to_plain_string());
        if HELP.iter().any(|(known, _)| *known == words) {
            return (words, asked.get(at + 1));
        }
        words.push('_');
    }
    (String::new(), None)
}

fn help(command: Option<&str>) -> Bottle {
    let lines: Vec<Value> = match command {
        None | Some("--all") => {
            let names = HELP.iter().map(|(name, _)| *name);
            let all = std::iter::once("*** Available commands:").chain(names);
            all.map(Value::from).collect()
        }
        Some(asked) => match HELP.iter().find(|(name, _)| *name == asked) {
            Some((name, about)) => vec![(*name).into(), (*about).into()],
            None => vec!["Command not found".into()],
        },
    };
    Bottle::of(Vocab32::new("many")).with(Value::List(lines.into()))
}
