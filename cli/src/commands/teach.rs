//! `yarp teach` and `yarp play`: poses that an arm was guided to, and their replay.

use std::io::Write;
use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use yarp_demos::teaching::{Boards, MotionFile, MotionFileError, PlayError, Player, Step};
use yarp_devices::{Axes, Encoders, Mode};
use yarp_ports::Network;
use yarp_wrappers::{RemoteControlBoard, RemoteControlBoardOptions, wait_first_value};

use crate::error::{Failure, Result};
use crate::network_access;
use crate::signals::Interrupt;
use crate::stdin_lines::Lines;

/// Maximum wait for the first state of a board.
const FIRST_STATE_TIMEOUT: Duration = Duration::from_secs(5);

/// Error of teaching or playing.
#[derive(Debug, thiserror::Error)]
pub(crate) enum TeachFailure {
    /// The file cannot be used.
    #[error(transparent)]
    File(#[from] MotionFileError),
    /// The motion was not played to its end.
    #[error(transparent)]
    Play(#[from] PlayError),
    /// An axis cannot be guided.
    #[error("axis {axis} is in mode {mode}: release the stop or set position mode first")]
    NotGuidable {
        /// The axis.
        axis: usize,
        /// Its mode.
        mode: Mode,
    },
}

/// Arm and hand.
#[derive(Debug, clap::Args)]
struct RobotArgs {
    /// Prefix of the arm's ports
    #[arg(long, value_name = "PREFIX", default_value = "/wam")]
    arm: String,
    /// Prefix of the hand's ports, as in /hand
    #[arg(long, value_name = "PREFIX")]
    hand: Option<String>,
}

/// store poses that the arm is guided to in a text file
///
/// Reads lines: NAME stores the pose of the arm under that name, `grasp NAME` the positions of the hand, `wait SECONDS` a pause; `quit`
/// or Ctrl-C ends it. Guide a simulated arm by dragging its tool in the live view (`yarp up --control`), a real one by hand with --guide.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// File that the steps are appended to
    #[arg(value_name = "FILE")]
    file: PathBuf,
    #[command(flatten)]
    robot: RobotArgs,
    /// Let the arm be led by hand: torque mode, in which only gravity is compensated
    #[arg(long)]
    guide: bool,
}

/// play poses of `yarp teach`
///
/// Checks all steps against the limits of arm and hand, then moves through them. Ctrl-C stops the arm.
#[derive(Debug, clap::Args)]
pub(crate) struct PlayArgs {
    /// File of `yarp teach`
    #[arg(value_name = "FILE")]
    file: PathBuf,
    #[command(flatten)]
    robot: RobotArgs,
    /// Speed relative to the joints' maximum speed, 0.01 to 1
    #[arg(long, value_name = "FACTOR", default_value_t = 0.25, value_parser = speed)]
    speed: f64,
    /// Play so many times
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..))]
    repeat: u32,
}

fn speed(word: &str) -> std::result::Result<f64, &'static str> {
    let speed = word
        .parse()
        .ok()
        .filter(|speed| (0.01..=1.0).contains(speed));
    speed.ok_or("expected 0.01 to 1")
}

/// The boards of a robot on the network.
struct Robot {
    arm: Arc<RemoteControlBoard>,
    hand: Option<Arc<RemoteControlBoard>>,
}

impl Robot {
    async fn open(network: &Network, args: &RobotArgs) -> Result<Self> {
        let arm = open(network, &args.arm).await?;
        let hand = match &args.hand {
            Some(prefix) => Some(open(network, prefix).await?),
            None => None,
        };
        Ok(Self { arm, hand })
    }
}

async fn open(network: &Network, prefix: &str) -> Result<Arc<RemoteControlBoard>> {
    let local = format!("/yarp/teach/{}{prefix}", std::process::id());
    let options = RemoteControlBoardOptions::new(prefix, local);
    let network = network.clone();
    let opening = blocking(move || {
        let board = RemoteControlBoard::open(&network, options)?;
        wait_first_value(FIRST_STATE_TIMEOUT, || board.encoder_readings(Axes::All))?;
        Ok(board)
    });
    opening.await.map(Arc::new)
}

/// Runs calls that block.
async fn blocking<T: Send + 'static>(work: impl FnOnce() -> T + Send + 'static) -> T {
    let working = tokio::task::spawn_blocking(work);
    working.await.expect("calls of boards do not panic")
}

pub(super) async fn run(args: Args, out: &mut dyn Write) -> Result<ExitCode> {
    let mut interrupt = Interrupt::listen();
    if args.file.exists() {
        MotionFile::read(&args.file).map_err(TeachFailure::from)?;
    }
    let robot = Robot::open(&network_access::network()?, &args.robot).await?;
    if args.guide {
        let arm = robot.arm.clone();
        blocking(move || let_go(&*arm)).await?;
        writeln!(out, "The arm can be led by hand.")?;
    }
    writeln!(
        out,
        "NAME stores the pose, grasp NAME the hand, wait SECONDS a pause; quit ends it."
    )?;
    out.flush()?;
    let mut lines = Lines::open();
    let result = loop {
        let line = tokio::select! {
            biased;
            () = interrupt.interrupted() => break Ok(()),
            line = lines.next() => line,
        };
        match line.as_deref().map(str::trim) {
            None | Some("quit") => break Ok(()),
            Some(line) => {
                if let Err(failure) = store(&robot, &args, line, out).await {
                    break Err(failure);
                }
            }
        }
    };
    if args.guide {
        let arm = robot.arm.clone();
        blocking(move || hold(&*arm)).await?;
        writeln!(out, "The arm holds its place.")?;
    }
    result.map(|()| ExitCode::SUCCESS)
}

/// Stores a step; a line that is none is refused, and the next one may be better.
async fn store(robot: &Robot, args: &Args, line: &str, out: &mut dyn Write) -> Result<()> {
    let step = match line.split_whitespace().collect::<Vec<_>>()[..] {
        ["wait", ..] => Step::parse(line),
        ["grasp", name] => match &robot.hand {
            Some(hand) => Step::grasp(name, positions(hand).await?),
            None => Err("there is no hand: start with --hand PREFIX".to_owned()),
        },
        [] => Step::pose("pose", positions(&robot.arm).await?),
        [name] => Step::pose(name, positions(&robot.arm).await?),
        _ => Err("expected NAME, grasp NAME or wait SECONDS".to_owned()),
    };
    match step {
        Ok(step) => {
            MotionFile::append(&args.file, &step).map_err(TeachFailure::from)?;
            writeln!(out, "{step}")?;
        }
        Err(reason) => writeln!(out, "not stored: {reason}")?,
    }
    out.flush()?;
    Ok(())
}

async fn positions(board: &Arc<RemoteControlBoard>) -> Result<Vec<f64>> {
    let board = board.clone();
    let readings = blocking(move || board.encoder_readings(Axes::All)).await?;
    Ok(readings.iter().map(|reading| reading.position).collect())
}

/// Lets the joints be led by hand; those that are idle or at fault stay as they are.
fn let_go(arm: &dyn Boards) -> Result<()> {
    let modes = arm.control_modes(Axes::All)?;
    if let Some(axis) = modes
        .iter()
        .position(|mode| !matches!(mode, Mode::Position | Mode::Torque))
    {
        let mode = modes[axis];
        return Err(TeachFailure::NotGuidable { axis, mode }.into());
    }
    Ok(arm.set_control_modes(Axes::All, &vec![Mode::Torque; modes.len()])?)
}

/// Has the joints hold their places, unless somebody has stopped them meanwhile.
fn hold(arm: &dyn Boards) -> Result<()> {
    let modes = arm.control_modes(Axes::All)?;
    // The state may be older than the change to torque mode.
    let is_guided = |mode: &Mode| matches!(mode, Mode::Torque | Mode::Position);
    if !modes.iter().all(is_guided) {
        return Ok(());
    }
    Ok(arm.set_control_modes(Axes::All, &vec![Mode::Position; modes.len()])?)
}

pub(super) async fn play(args: PlayArgs, out: &mut dyn Write) -> Result<ExitCode> {
    let mut interrupt = Interrupt::listen();
    let motion = MotionFile::read(&args.file).map_err(TeachFailure::from)?;
    let robot = Robot::open(&network_access::network()?, &args.robot).await?;
    let stop = Arc::new(AtomicBool::new(false));
    let (sender, mut told) = tokio::sync::mpsc::channel::<String>(64);
    let button = stop.clone();
    let mut playing = tokio::task::spawn_blocking(move || {
        let hand = robot.hand.as_deref().map(|hand| hand as &dyn Boards);
        let player = Player::new(&*robot.arm, hand, args.speed, &button);
        for _ in 0..args.repeat {
            // Nobody waits for a slow terminal.
            player.play(&motion, |step| drop(sender.try_send(step.to_string())))?;
        }
        Ok::<_, PlayError>(())
    });
    let result = loop {
        tokio::select! {
            biased;
            () = interrupt.interrupted(), if !stop.load(Ordering::Relaxed) => {
                stop.store(true, Ordering::Relaxed);
            }
            Some(line) = told.recv() => {
                writeln!(out, "{line}")?;
                out.flush()?;
            }
            played = &mut playing => break played.expect("the player does not panic"),
        }
    };
    match result {
        Ok(()) => Ok(ExitCode::SUCCESS),
        Err(PlayError::Stopped) => {
            writeln!(out, "The arm was stopped.")?;
            Ok(ExitCode::FAILURE)
        }
        Err(error) => Err(TeachFailure::from(error).into()),
    }
}

impl From<TeachFailure> for Failure {
    fn from(failure: TeachFailure) -> Self {
        Self::Teach(failure)
    }
}
