//! `yarp wam calibrate-gravity`: moves an arm through some poses, and writes the moments of its gravity compensation.

use std::fmt::Write as _;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::result::Result as Outcome;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::Duration;

use tokio::sync::mpsc::unbounded_channel;
use yarp_devices::clock::TimeSource;
use yarp_devices::dynamics::HeldPose;
use yarp_devices::kinematics::Joints;
use yarp_devices::wam::{GravityResult, MeasuredArm, WamModel, calibrate_gravity, gravity_poses};
use yarp_devices::{
    Axes, AxisInfo, ControlMode, DeviceError, Encoders, Mode, MotionControl, PositionControl,
    TorqueControl,
};
use yarp_wrappers::RemoteControlBoard;

use super::{BoardArgs, YES, connect};
use crate::error::{Failure, Result};
use crate::network_access;
use crate::signals::Interrupt;
use crate::stdin_lines::Lines;

/// Timeout of one motion.
const MOTION_TIMEOUT: Duration = Duration::from_secs(60);
/// Time in which the arm comes to rest in a pose, and for which it is measured there.
const SETTLE_TIME: Duration = Duration::from_secs(2);
const MEASURE_TIME: Duration = Duration::from_secs(1);
/// Interval between two looks at the arm.
const POLL_INTERVAL: Duration = Duration::from_millis(10);

const INSTRUCTIONS: &str = "
The arm moves through some poses, slowly, and measures what its motors need to hold it:

  1. Whatever it will carry is mounted: hand, tool, cables.
  2. Nothing is within its reach, all around and above the base, and nobody touches it.
  3. The arm is active, and the pendant is in your hand.

Ctrl-C stops it.";

#[derive(Debug, clap::Args)]
pub(super) struct Args {
    #[command(flatten)]
    board: BoardArgs,
    /// File to write, for --arm-config
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
    /// Begin without asking: somebody who looks at the arm has confirmed it
    #[arg(long)]
    confirmed: bool,
}

/// Reason why a measurement ended.
#[derive(Debug)]
enum Ended {
    Interrupted,
    Device(DeviceError),
}

impl From<DeviceError> for Ended {
    fn from(error: DeviceError) -> Self {
        Self::Device(error)
    }
}

/// The arm behind its control board.
struct RemoteArm {
    board: Arc<RemoteControlBoard>,
    name: String,
    time: TimeSource,
    is_interrupted: Arc<AtomicBool>,
}

impl RemoteArm {
    /// Calls `look` until it returns true, at most for `most`; returns whether it did.
    fn watch(
        &self,
        most: Duration,
        mut look: impl FnMut() -> Outcome<bool, DeviceError>,
    ) -> Outcome<bool, Ended> {
        let deadline = self.time.instant() + most;
        while self.time.instant() < deadline {
            if self.is_interrupted.load(Ordering::Acquire) {
                return Err(Ended::Interrupted);
            }
            if look()? {
                return Ok(true);
            }
            thread::sleep(POLL_INTERVAL);
        }
        Ok(false)
    }

    fn read<const N: usize>(&self) -> Outcome<HeldPose<N>, DeviceError> {
        let readings = self.board.encoder_readings(Axes::All)?;
        let torques = self.board.torques(Axes::All)?;
        let numbers = |values: &mut dyn Iterator<Item = f64>| Joints::from_iterator(values.take(N));
        Ok(HeldPose {
            joints: numbers(&mut readings.iter().map(|reading| reading.position.to_radians())),
            torques: numbers(&mut torques.into_iter()),
        })
    }
}

impl<const N: usize> MeasuredArm<N> for RemoteArm {
    type Error = Ended;

    fn move_to(&mut self, joints: &Joints<N>, speed: f64) -> Outcome<(), Ended> {
        let degrees = joints.map(f64::to_degrees);
        self.board
            .set_reference_speeds(Axes::All, &[speed.to_degrees(); N])?;
        self.board.position_move(Axes::All, degrees.as_slice())?;
        let arrived = self.watch(MOTION_TIMEOUT, || self.board.motion_done(Axes::All))?;
        match arrived {
            true => Ok(()),
            false => Err(Ended::Device(DeviceError::Remote {
                peer: self.name.clone(),
                step: "moving to a pose of the gravity calibration".to_owned(),
                advice: "something may be in its way; look at the arm, and at `yarp wam status`"
                    .to_owned(),
                source: None,
            })),
        }
    }

    fn measure(&mut self) -> Outcome<HeldPose<N>, Ended> {
        self.watch(SETTLE_TIME, || Ok(false))?;
        let mut sum = HeldPose {
            joints: Joints::zeros(),
            torques: Joints::zeros(),
        };
        let mut count = 0.0;
        self.watch(MEASURE_TIME, || {
            let now = self.read()?;
            sum.joints += now.joints;
            sum.torques += now.torques;
            count += 1.0;
            Ok(false)
        })?;
        Ok(HeldPose {
            joints: sum.joints / f64::max(count, 1.0),
            torques: sum.torques / f64::max(count, 1.0),
        })
    }
}

pub(super) async fn run(args: Args, out: &mut dyn Write) -> Result<ExitCode> {
    let mut interrupt = Interrupt::listen();
    network_access::follow_clock(&network_access::network()?, &mut interrupt).await?;
    let board = connect(args.board.name.clone()).await?;
    let axes = board.axes();
    if ![4, 7].contains(&axes) {
        writeln!(
            out,
            "This arm has {axes} joints; the calibration is one of four or seven."
        )?;
        return Ok(ExitCode::FAILURE);
    }
    writeln!(out, "{INSTRUCTIONS}\n")?;
    if !args.confirmed {
        writeln!(out, "Is the arm free to move? Type {YES} to begin.")?;
        out.flush()?;
        let answer = Lines::open().next().await.unwrap_or_default();
        if answer.trim() != YES {
            writeln!(out, "Not confirmed. The arm does not move.")?;
            return Ok(ExitCode::FAILURE);
        }
    }
    match axes {
        4 => calibrate::<4>(&board, args, &mut interrupt, out).await,
        _ => calibrate::<7>(&board, args, &mut interrupt, out).await,
    }
}

/// Measures an arm with `N` joints, and writes the result.
async fn calibrate<const N: usize>(
    board: &Arc<RemoteControlBoard>,
    args: Args,
    interrupt: &mut Interrupt,
    out: &mut dyn Write,
) -> Result<ExitCode>
where
    WamModel<N>: Default,
{
    match measure::<N>(board, args.board.name, interrupt, out).await? {
        Some(result) => finish(&result, &args.out, out),
        None => {
            writeln!(
                out,
                "Stopped. The arm holds its position; nothing is written."
            )?;
            Ok(ExitCode::FAILURE)
        }
    }
}

/// Measures the arm; `None` if somebody stopped it.
async fn measure<const N: usize>(
    board: &Arc<RemoteControlBoard>,
    name: String,
    interrupt: &mut Interrupt,
    out: &mut dyn Write,
) -> Result<Option<GravityResult<N>>>
where
    WamModel<N>: Default,
{
    let is_interrupted = Arc::<AtomicBool>::default();
    let (told, mut progress) = unbounded_channel();
    let mut arm = RemoteArm {
        board: board.clone(),
        name,
        time: TimeSource::current(),
        is_interrupted: is_interrupted.clone(),
    };
    let mut running = tokio::task::spawn_blocking(move || {
        let model = WamModel::<N>::default();
        let modes = [Mode::Position; N];
        arm.board.set_control_modes(Axes::All, &modes)?;
        let before = arm.board.reference_speeds(Axes::All)?;
        // Nobody listens any more once the command ends.
        let tell = |count| {
            let _ = told.send(count);
        };
        let measured = calibrate_gravity(&mut arm, &model, tell);
        if measured.is_err() {
            // The first error is the one to report.
            let _ = arm.board.stop(Axes::All);
        }
        let restored = arm.board.set_reference_speeds(Axes::All, &before);
        let result = measured?;
        restored?;
        Ok::<_, Ended>(result)
    });
    loop {
        tokio::select! {
            biased;
            () = interrupt.interrupted(), if !is_interrupted.load(Ordering::Acquire) => {
                is_interrupted.store(true, Ordering::Release);
            }
            Some(count) = progress.recv() => {
                writeln!(out, "pose {count} of {}", gravity_poses())?;
                out.flush()?;
            }
            ended = &mut running => {
                return match ended.expect("the measurement does not panic") {
                    Ok(result) => Ok(Some(result)),
                    Err(Ended::Interrupted) => Ok(None),
                    Err(Ended::Device(error)) => Err(error.into()),
                };
            }
        }
    }
}

/// Prints the result, and writes the moments if they explain the torques of other poses.
fn finish<const N: usize>(
    result: &GravityResult<N>,
    path: &Path,
    out: &mut dyn Write,
) -> Result<ExitCode> {
    writeln!(
        out,
        "\nunexplained torques in poses that were not used, Nm:"
    )?;
    for (name, torques) in [
        ("before", &result.before),
        ("now", &result.verified),
        ("friction", &result.friction),
    ] {
        let numbers: Vec<_> = torques
            .iter()
            .map(|torque| format!("{torque:6.3}"))
            .collect();
        writeln!(out, "{name:>9} {}", numbers.join(" "))?;
    }
    if !result.is_verified() {
        writeln!(
            out,
            "Nothing is written: a joint has more than its friction. Was the arm touched, or does a cable pull?"
        )?;
        return Ok(ExitCode::FAILURE);
    }
    std::fs::write(path, arm_file(result)).map_err(|error| {
        let path = path.display();
        Failure::ArmFile(std::io::Error::new(
            error.kind(),
            format!("{path}: {error}"),
        ))
    })?;
    writeln!(
        out,
        "Written to {0}: start the driver with --arm-config {0}, without --payload.",
        path.display()
    )?;
    Ok(ExitCode::SUCCESS)
}

/// Returns the text of the file.
fn arm_file<const N: usize>(result: &GravityResult<N>) -> String {
    let mut text = String::from(
        "// Moments of the gravity compensation, kg m, measured by `yarp wam calibrate-gravity`.\ngravityMoments (",
    );
    for (index, number) in result
        .calibration
        .moments
        .iter()
        .flat_map(|moment| moment.iter())
        .enumerate()
    {
        let space = if index > 0 { " " } else { "" };
        // Writing to a string does not fail.
        let _ = write!(text, "{space}{number:.6}");
    }
    text.push_str(")\n");
    text
}
