//! `yarp wam`: what a person does beside a WAM arm.

mod measure_gravity;

use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::Duration;

use yarp_devices::wam::can::ZeroCalibration;
use yarp_devices::wam::{PendantButton, WamModel};
use yarp_devices::{Axes, AxisInfo, Device, DeviceError, Encoders, RemoteVariables, VariableValue};
use yarp_ports::{AdminClient, Network, PortError};
use yarp_wire::carrier::Carrier;
use yarp_wire::message::Command;
use yarp_wire::{Bottle, Contact, PortName, Value, Vocab32};
use yarp_wrappers::{RemoteControlBoard, RemoteControlBoardOptions, software_stop};

use crate::error::{Failure, Result};
use crate::network_access;
use crate::stdin_lines::Lines;

/// Timeout of a confirmation: the driver wakes and checks all pucks meanwhile.
const CONFIRMATION_TIMEOUT: Duration = Duration::from_secs(40);
/// Timeout of the connection to the port of the software stop, and of its reply.
const STOP_TIMEOUT: Duration = Duration::from_secs(10);
/// Variables of the driver.
const CONFIRM_HOME: &str = "confirm_home";
const ZERO_ANGLES: &str = "zero_angles";
const STATUS: &str = "status";
const TIMING: &str = "timing";
/// Variable of a simulated arm.
const PENDANT: &str = "pendant";
/// Answer that confirms.
const YES: &str = "yes";

const INSTRUCTIONS: &str = "
The position of the arm is not known. Bring it into its home pose by hand:

  1. Nobody but you is within reach of the arm. The pendant is in your hand.
  2. Release the red button if it is pressed, and press Shift and Idle.
  3. Fold the arm: joint 1 (base) and joint 3 (upper arm) straight ahead, joint 2 (shoulder) on its
     stop at the back, joint 4 (elbow) folded onto its stop, the wrist straight.
  4. Look at each joint once more. A wrong confirmation makes the arm swing when it is activated.
";

/// tell a WAM arm on its CAN bus where it is
///
/// Things that a person does beside a WAM arm.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    #[command(subcommand)]
    task: Task,
}

#[derive(Debug, clap::Subcommand)]
enum Task {
    /// Confirm that the arm is folded in its home pose, step by step
    ///
    /// Connects to the program that drives the arm, explains how to fold it, asks, and has the driver tell the pucks where
    /// they are. Nothing moves: the arm is activated with the pendant afterwards.
    Home(HomeArgs),
    /// Measure the moments of the gravity compensation, with all that the arm carries
    ///
    /// Moves the arm through twelve poses, each from both sides, for about three minutes; three of them only verify the result.
    CalibrateGravity(measure_gravity::Args),
    /// Print the state of the arm
    Status(BoardArgs),
    /// Press a button of the pendant of a simulated arm (`yarp up --simulation real`), or switch it off and on
    ///
    /// The pendant of a real arm has buttons of its own.
    Press(PressArgs),
    /// Stop the arm: every joint comes to rest and holds, and commands are refused until `yarp wam release`
    ///
    /// This is no emergency stop, for it needs the program that drives the arm and its machine. Press the red button of the
    /// pendant in an emergency.
    Stop(BoardArgs),
    /// Have the arm brake: its safety module falls back to idle, and only the pendant activates it again
    ///
    /// An arm without a brake, such as the ideal simulation, is stopped.
    Brake(BoardArgs),
    /// Have the arm take commands again after `yarp wam stop` or `brake`; nothing moves until the next one
    Release(BoardArgs),
}

#[derive(Debug, clap::Args)]
struct BoardArgs {
    /// Prefix of the names of the arm's ports
    #[arg(long, value_name = "PREFIX", default_value = "/wam")]
    name: String,
}

#[derive(Debug, clap::Args)]
struct PressArgs {
    /// idle, activate, stop (the red button), power-off or power-on
    button: PendantButton,
    #[command(flatten)]
    board: BoardArgs,
}

#[derive(Debug, clap::Args)]
struct HomeArgs {
    #[command(flatten)]
    board: BoardArgs,
    /// Correct the folded pose by the angles of the rotors in this zerocal.conf of libbarrett
    #[arg(long, value_name = "FILE")]
    zero_calibration: Option<PathBuf>,
}

pub(super) async fn run(args: Args, out: &mut dyn Write) -> Result<ExitCode> {
    match args.task {
        Task::Home(args) => home(args, out).await,
        Task::CalibrateGravity(args) => measure_gravity::run(args, out).await,
        Task::Press(args) => press(args, out).await,
        Task::Stop(args) => request_stop(args, software_stop::STOP, out).await,
        Task::Brake(args) => request_stop(args, software_stop::BRAKE, out).await,
        Task::Release(args) => request_stop(args, software_stop::RELEASE, out).await,
        Task::Status(args) => {
            let board = connect(args.name).await?;
            let status = variable(&board, STATUS).await?;
            writeln!(out, "{}", text(&status))?;
            // Only an arm on a bus has it.
            if let Ok(timing) = variable(&board, TIMING).await {
                writeln!(out, "{}", text(&timing))?;
            }
            Ok(ExitCode::SUCCESS)
        }
    }
}

/// Sends a request to the port of the software stop, which is not that of the control board.
async fn request_stop(args: BoardArgs, word: &str, out: &mut dyn Write) -> Result<ExitCode> {
    let port = software_stop::port_of(&args.name);
    let network = network_access::network()?;
    let contact = Contact::parse(&port);
    let Some(place) = network_access::find(&network, &contact).await? else {
        writeln!(
            out,
            "No port {port}: does the program that drives the arm run? Press the red button of the pendant to stop the arm."
        )?;
        return Ok(ExitCode::FAILURE);
    };
    let network = network.with_timeout(STOP_TIMEOUT);
    let own = format!("{port}/attendant-{}", std::process::id());
    let address = (place.host.as_str(), place.port);
    let carrier = Carrier::by_name("tcp").expect("tcp is in the table");
    let mut client = AdminClient::open(&place.name, address, carrier, &own, &network).await?;
    let request = Bottle::of(word);
    let reply = client.call(&Command::data(true), &request).await?;
    let text = |index| reply.get(index).and_then(Value::as_str).unwrap_or_default();
    if reply.get(0).and_then(Value::as_vocab) == Some(Vocab32::OK) {
        writeln!(out, "{}: {}", args.name, text(1))?;
        return Ok(ExitCode::SUCCESS);
    }
    writeln!(out, "{}: {}; state: {}", args.name, text(1), text(2))?;
    Ok(ExitCode::FAILURE)
}

/// Connects to the program that drives the arm.
async fn connect(name: String) -> Result<std::sync::Arc<RemoteControlBoard>> {
    let remote: PortName = name.parse().map_err(PortError::from)?;
    let network: Network = network_access::network()?;
    let local = format!("{remote}/attendant-{}", std::process::id());
    let options =
        RemoteControlBoardOptions::new(remote.to_string(), local).rpc_timeout(CONFIRMATION_TIMEOUT);
    let opened = blocking(move || RemoteControlBoard::open(&network, options)).await;
    Ok(std::sync::Arc::new(opened?))
}

/// Presses a button of the pendant, and prints what the arm is then.
async fn press(args: PressArgs, out: &mut dyn Write) -> Result<ExitCode> {
    let board = connect(args.board.name).await?;
    let theirs = board.clone();
    let word = VariableValue::Text(args.button.to_string());
    blocking(move || theirs.set_variable(PENDANT, &[word])).await?;
    let mode = variable(&board, PENDANT).await?;
    writeln!(
        out,
        "pressed {}; the pendant shows: {}",
        args.button,
        text(&mode)
    )?;
    Ok(ExitCode::SUCCESS)
}

async fn home(args: HomeArgs, out: &mut dyn Write) -> Result<ExitCode> {
    let board = connect(args.board.name).await?;
    let angles = match &args.zero_calibration {
        Some(path) if board.axes() == 4 => zero_angles::<4>(path)?,
        Some(path) => zero_angles::<7>(path)?,
        None => None,
    };
    if variable(&board, CONFIRM_HOME).await? == [VariableValue::Integer(1)] {
        writeln!(
            out,
            "The arm knows its position: there is nothing to confirm."
        )?;
        return Ok(ExitCode::SUCCESS);
    }
    let status = variable(&board, STATUS).await?;
    writeln!(out, "{}\n{INSTRUCTIONS}", text(&status))?;
    writeln!(
        out,
        "Is the arm folded in its home pose? Type {YES} to confirm."
    )?;
    out.flush()?;
    let answer = Lines::open().next().await.unwrap_or_default();
    if answer.trim() != YES {
        writeln!(out, "Not confirmed. The arm stays unreachable.")?;
        return Ok(ExitCode::FAILURE);
    }
    let theirs = board.clone();
    blocking(move || confirm(&theirs, angles)).await?;
    writeln!(
        out,
        "The arm is at home. Press Shift and Activate on the pendant: it holds its position then."
    )?;
    let board = board.clone();
    let readings = blocking(move || board.encoder_readings(Axes::All)).await;
    if let Ok(readings) = readings {
        let joints: Vec<_> = readings
            .iter()
            .map(|joint| format!("{:.1}", joint.position))
            .collect();
        writeln!(out, "Joints, degrees: {}", joints.join(" "))?;
    }
    Ok(ExitCode::SUCCESS)
}

/// Reads the angles of a calibration, whose home pose has to be that of the driver.
fn zero_angles<const N: usize>(path: &Path) -> Result<Option<Vec<f64>>>
where
    WamModel<N>: Default,
{
    let refused = |error: &dyn std::fmt::Display| {
        let problem = format!("{}: {error}", path.display());
        Failure::ArmFile(std::io::Error::new(
            std::io::ErrorKind::InvalidData,
            problem,
        ))
    };
    let found = ZeroCalibration::<N>::read(path).map_err(|error| refused(&error))?;
    let standard = WamModel::<N>::default().home;
    if found
        .home
        .is_some_and(|home| home != <[f64; N]>::from(standard))
    {
        return Err(refused(
            &"it has a home pose of its own, with which the driver must be started (--zero-calibration of yarp up)",
        ));
    }
    Ok(found.zero_angles.map(|angles| angles.to_vec()))
}

fn confirm(
    board: &RemoteControlBoard,
    angles: Option<Vec<f64>>,
) -> std::result::Result<(), DeviceError> {
    if let Some(angles) = angles {
        let angles: Vec<_> = angles.into_iter().map(VariableValue::Number).collect();
        board.set_variable(ZERO_ANGLES, &angles)?;
    }
    board.set_variable(CONFIRM_HOME, &[VariableValue::Integer(1)])
}

async fn variable(
    board: &std::sync::Arc<RemoteControlBoard>,
    name: &'static str,
) -> Result<Vec<VariableValue>> {
    let board = board.clone();
    let told = blocking(move || match board.remote_variables() {
        Some(variables) => variables.variable(name),
        None => Err(DeviceError::NotSupported {
            what: "a variable of the arm".to_owned(),
        }),
    });
    Ok(told.await?)
}

fn text(value: &[VariableValue]) -> String {
    let words = value.iter().map(|part| match part {
        VariableValue::Text(text) => text.clone(),
        other => format!("{other:?}"),
    });
    words.collect::<Vec<_>>().join(" ")
}

/// Runs calls of a device on a thread that may block.
async fn blocking<T: Send + 'static>(work: impl FnOnce() -> T + Send + 'static) -> T {
    match tokio::task::spawn_blocking(work).await {
        Ok(done) => done,
        Err(panicked) => std::panic::resume_unwind(panicked.into_panic()),
    }
}
