//! Configuration of a WAM arm: the same parameters in ini files, in XML, and on the command line.
//!
//! | parameter | value |
//! | --- | --- |
//! | `joints` | 4 or 7, default 7; lists below have a number for each joint |
//! | `homeConfirmed` | the arm is folded in its home pose now; CAN bus only |
//! | `zeroCalibration` | path of libbarrett's `zerocal.conf`: home pose and angles of the rotors |
//! | `homeMarks` | `MECH` of each puck at home, instead of the angles of that file |
//! | `positionFile` | path for the last known position, or `none`; default in the user's state directory |
//! | `payload` | mass and centre at the tool plate, kg and m: `(1.2 0 0 0.06)` |
//! | `tool` | place of the tool in the frame of the tool plate, m: `(0 0 0.12)` |
//! | `gravityMoments` | `mu` of libbarrett's gravity calibration: three numbers for each joint, kg m |
//! | `jointToMotor` | transmission, a number for each joint, motor by motor: `j2mp` of libbarrett |
//! | `jointMin`, `jointMax` | position limits, degrees; within those of the arm |
//! | `positionKp`, `positionKi`, `positionKd` | gains of the position loops, Nm per rad, as in libbarrett |
//! | `maxTorques` | torque limits of the joints, Nm |
//! | `stallTorques` | torques of the position loops at which joints stall, Nm; default those of owd |
//! | `stallError` | distance from the set point at which a joint stalls, degrees; default 10 |
//! | `stallTime` | time for which a joint shows one of these without getting on, s; default 0.2 |
//! | `noStallDetection` | no joint is stopped because it stalls |
//! | `realTimePriority` | priority of control under `SCHED_FIFO`, 1 to 99, 0 for none; default 40; CAN bus only |
//! | `processor` | the only processor on which control runs, counted from 0; CAN bus only |
//! | `noMemoryLock` | memory may be paged out; CAN bus only |
//! | `guard`, `noGuard` | puts guards in front of an ideal simulation; removes those in front of any other arm |
//! | `velocityTimeout` | time after which a velocity without a new command ends, s; default 1 |
//! | `effortTimeout` | the same for torques, currents and duty cycles, s; default 0.2 |

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;

use yarp_devices::dynamics::Body;
use yarp_devices::guard::{
    DEFAULT_EFFORT_TIMEOUT, DEFAULT_VELOCITY_TIMEOUT, Guarded, GuardedOptions,
};
use yarp_devices::kinematics::Pose;
#[cfg(target_os = "linux")]
use yarp_devices::real_time::{MAX_PRIORITY, RealTime};
use yarp_devices::simulation::SimulatorOptions;
use yarp_devices::wam::can::{CanOptions, ZeroCalibration};
use yarp_devices::wam::{StallLimits, Transmission, WamModel};
use yarp_devices::{Device, DeviceError, Limits};
use yarp_wire::settings::Parameters;

use crate::HostError;
use crate::shared_parameters::{flag, numbers, numbers_of};
use crate::simulator_configuration::simulator_options;

/// Maximum payload, kg (Barrett's data sheet of the arm with four joints), and distance of its centre, m.
const MAX_PAYLOAD: f64 = 4.0;
const MAX_PAYLOAD_DISTANCE: f64 = 1.0;
/// Maximum distance from the set point, deg, and time of a stall.
const MAX_STALL_ERROR: f64 = 360.0;
const MAX_STALL_TIME: Duration = Duration::from_secs(10);
/// Maximum length of a tool, m.
const MAX_TOOL: f64 = 2.0;

/// Configuration of an arm with `N` joints.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct ArmConfiguration<const N: usize> {
    /// Model of the arm with its payload and tool.
    pub model: WamModel<N>,
    /// Options of the driver on the CAN bus.
    pub can: CanOptions<N>,
    /// Options of a simulated arm: those of [`with_simulator`](Self::with_simulator).
    pub simulator: SimulatorOptions,
    guards: GuardConfiguration,
}

#[derive(Clone, Copy, Debug)]
struct GuardConfiguration {
    /// Overrides the default of the arm.
    wanted: Option<bool>,
    velocity_timeout: Duration,
    effort_timeout: Duration,
}

impl<const N: usize> ArmConfiguration<N> {
    /// Reads the parameters of an arm; `bus` is the interface of an arm on a CAN bus, after which its default position
    /// file is named.
    ///
    /// Errors: [`HostError::Parameter`] with the position of the parameter and the expected value.
    pub fn from_parameters(parameters: &Parameters, bus: Option<&str>) -> Result<Self, HostError>
    where
        WamModel<N>: Default,
    {
        let mut model = WamModel::<N>::default();
        let mut can = CanOptions {
            home_confirmed: flag(parameters, "homeConfirmed")?,
            position_file: position_file(parameters, bus)?,
            ..CanOptions::default()
        };
        if let Some(path) = parameters.get::<String>("zeroCalibration")? {
            let refused = |error: &dyn std::fmt::Display| {
                let expected = format!("a zerocal.conf of libbarrett ({error})");
                HostError::from(parameters.refuse("zeroCalibration", expected))
            };
            let found = ZeroCalibration::read(Path::new(&path)).map_err(|error| refused(&error))?;
            model = found.apply(model).map_err(|error| refused(&error))?;
            can.zero_angles = found.zero_angles;
        }
        if let Some(marks) = parameters.list::<usize>("homeMarks")? {
            let marks: Option<Vec<i32>> = marks.iter().map(|&mark| mark.try_into().ok()).collect();
            let marks = marks.and_then(|marks| marks.try_into().ok());
            let expected = format!("the values of MECH of {N} pucks at home");
            can.home_marks = Some(marks.ok_or_else(|| parameters.refuse("homeMarks", expected))?);
        }
        #[cfg(target_os = "linux")]
        {
            can.real_time = real_time(parameters)?;
        }
        model = with_payload(model, parameters)?;
        model = with_mechanics(model, parameters)?;
        with_loops(&mut model, parameters)?;
        model.stall = stall_limits(model.stall, parameters)?;
        Ok(Self {
            model,
            can,
            simulator: SimulatorOptions::default(),
            guards: guards(parameters)?,
        })
    }

    /// Reads the parameters of a simulated arm too, which change `default`; `simulator_configuration.rs` lists them.
    ///
    /// Errors: as [`from_parameters`](Self::from_parameters).
    pub fn with_simulator(
        self,
        parameters: &Parameters,
        default: SimulatorOptions,
    ) -> Result<Self, HostError> {
        Ok(Self {
            simulator: simulator_options(parameters, N, default)?,
            ..self
        })
    }

    /// Puts guards in front of an arm at its own limits if they are wanted, or by default unless they are not; the software
    /// stop in any case. Wider settings are logged.
    ///
    /// Errors: those of [`Guarded::around`].
    pub fn guard(
        &self,
        arm: Arc<dyn Device>,
        by_default: bool,
    ) -> Result<Arc<dyn Device>, DeviceError> {
        if !self.guards.wanted.unwrap_or(by_default) {
            if by_default {
                tracing::warn!(
                    "no guards in front of the arm: a velocity or torque holds until told otherwise"
                );
            }
            // Without limits and watchdogs it offers the software stop.
            let none = GuardedOptions::default();
            return Ok(Arc::new(Guarded::around(arm, none)?));
        }
        let mut options = GuardedOptions::of_device(arm.as_ref())?;
        options.watchdog = Some(self.guards.velocity_timeout);
        options.effort_watchdog = Some(self.guards.effort_timeout);
        if self.guards.velocity_timeout > DEFAULT_VELOCITY_TIMEOUT {
            let timeout = self.guards.velocity_timeout;
            tracing::warn!(?timeout, "velocities hold for longer than by default");
        }
        if self.guards.effort_timeout > DEFAULT_EFFORT_TIMEOUT {
            let timeout = self.guards.effort_timeout;
            tracing::warn!(
                ?timeout,
                "torques, currents and duty cycles hold for longer than by default"
            );
        }
        Ok(Arc::new(Guarded::around(arm, options)?))
    }

    /// Narrows the position limits of a device to those of the model, for devices that have limits of their own.
    ///
    /// Errors: those of the device.
    pub fn narrow(&self, arm: &dyn Device) -> Result<(), DeviceError> {
        let Some(control) = arm.control_limits() else {
            return Ok(());
        };
        for (joint, own) in self.model.chain.limits().iter().enumerate() {
            let device = control.position_limits(joint.into())?;
            let ours = Limits::new(own.min.to_degrees(), own.max.to_degrees());
            let narrowed = Limits::new(device.min.max(ours.min), device.max.min(ours.max));
            // Rounding between radians and degrees is no change.
            if (narrowed.min - device.min).max(device.max - narrowed.max) > 1e-6 {
                control.set_position_limits(joint.into(), narrowed)?;
            }
        }
        Ok(())
    }
}

fn position_file(parameters: &Parameters, bus: Option<&str>) -> Result<Option<PathBuf>, HostError> {
    if let Some(path) = parameters.get::<String>("positionFile")? {
        return Ok((path != "none").then(|| PathBuf::from(path)));
    }
    let state = std::env::var_os("XDG_STATE_HOME").map(PathBuf::from);
    let home = || Some(PathBuf::from(std::env::var_os("HOME")?).join(".local/state"));
    let folder = state.filter(|path| path.is_absolute()).or_else(home);
    Ok(bus.and_then(|bus| Some(folder?.join("yarp").join(format!("wam-{bus}.position")))))
}

fn with_payload<const N: usize>(
    mut model: WamModel<N>,
    parameters: &Parameters,
) -> Result<WamModel<N>, HostError> {
    let far = Limits::new(-MAX_TOOL, MAX_TOOL);
    let expected = "the place of the tool, x y z in m, at most 2 m away";
    if let Some([x, y, z]) = numbers(parameters, "tool", far, expected)? {
        model = model.with_tool(Pose::translation(x, y, z));
    }
    let expected = "a mass of at most 4 kg and x y z of its centre in m, at most 1 m away";
    let any = Limits::new(-MAX_PAYLOAD, MAX_PAYLOAD);
    if let Some([mass, place @ ..]) = numbers::<4>(parameters, "payload", any, expected)? {
        if mass < 0.0 || place.iter().any(|part| part.abs() > MAX_PAYLOAD_DISTANCE) {
            return Err(parameters.refuse("payload", expected).into());
        }
        model = model.with_load(Body::point(mass, place.into()));
    }
    Ok(model)
}

/// Reads transmission, limits and the gravity calibration.
fn with_mechanics<const N: usize>(
    mut model: WamModel<N>,
    parameters: &Parameters,
) -> Result<WamModel<N>, HostError> {
    let expected = format!(
        "{} numbers in kg m: x y z of each joint, as mu of libbarrett",
        3 * N
    );
    let range = Limits::new(-100.0, 100.0);
    let moments = numbers_of(parameters, "gravityMoments", 3 * N, range, &expected)?;
    if let Some(moments) = moments {
        for (moment, numbers) in model.calibration.moments.iter_mut().zip(moments.chunks(3)) {
            moment.copy_from_slice(numbers);
        }
    }
    let expected = format!(
        "{} numbers, a row per motor, that can be inverted, as j2mp of libbarrett",
        N * N
    );
    let range = Limits::new(-1000.0, 1000.0);
    let matrix = numbers_of(parameters, "jointToMotor", N * N, range, &expected)?;
    if let Some(matrix) = matrix {
        let counts = model.transmission.counts_per_turn();
        model.transmission = Transmission::from_rows(&matrix, counts)
            .ok_or_else(|| parameters.refuse("jointToMotor", expected))?;
    }
    let mut limits = *model.chain.limits();
    let circle = Limits::new(-360.0, 360.0);
    for (name, is_min) in [("jointMin", true), ("jointMax", false)] {
        let expected = format!("{N} angles in degrees within the limits of the arm");
        let Some(angles) = numbers::<N>(parameters, name, circle, &expected)? else {
            continue;
        };
        for (own, angle) in limits.iter_mut().zip(angles.map(f64::to_radians)) {
            if angle < own.min - 1e-3 || angle > own.max + 1e-3 {
                return Err(parameters.refuse(name, expected).into());
            }
            let angle = angle.clamp(own.min, own.max);
            *(if is_min { &mut own.min } else { &mut own.max }) = angle;
        }
    }
    model.chain = model.chain.with_limits(limits);
    Ok(model)
}

/// Reads gains and torque limits of the position loops.
fn with_loops<const N: usize>(
    model: &mut WamModel<N>,
    parameters: &Parameters,
) -> Result<(), HostError> {
    let range = Limits::new(0.0, 1e5);
    let expected = format!("{N} gains in Nm per rad, not negative");
    let list = |name| numbers::<N>(parameters, name, range, &expected);
    let (kp, ki, kd) = (
        list("positionKp")?,
        list("positionKi")?,
        list("positionKd")?,
    );
    let expected = format!("{N} torques in Nm, each within what the motors of its joint have");
    let torques = numbers::<N>(parameters, "maxTorques", range, &expected)?;
    for joint in 0..N {
        let most = model.largest_torque(joint);
        let gains = &mut model.gains[joint];
        gains.proportional = kp.map_or(gains.proportional, |kp| kp[joint]);
        gains.integral = ki.map_or(gains.integral, |ki| ki[joint]);
        gains.derivative = kd.map_or(gains.derivative, |kd| kd[joint]);
        let Some(torque) = torques.map(|torques| torques[joint]) else {
            continue;
        };
        if torque > most {
            return Err(parameters.refuse("maxTorques", expected).into());
        }
        if torque > gains.limit {
            let default = gains.limit;
            tracing::warn!(
                joint,
                torque,
                default,
                "a torque limit is wider than libbarrett's"
            );
        }
        gains.limit = torque;
    }
    Ok(())
}

/// Reads the real-time settings of control.
#[cfg(target_os = "linux")]
fn real_time(parameters: &Parameters) -> Result<RealTime, HostError> {
    let mut settings = RealTime::default();
    if let Some(priority) = parameters.get::<usize>("realTimePriority")? {
        let known = u8::try_from(priority)
            .ok()
            .filter(|&priority| priority <= MAX_PRIORITY);
        let Some(priority) = known else {
            let expected = "a priority of 1 to 99, or 0 for none";
            return Err(parameters.refuse("realTimePriority", expected).into());
        };
        settings.priority = Some(priority).filter(|&priority| priority > 0);
    }
    settings.processor = parameters.get::<usize>("processor")?;
    settings.lock_memory = !flag(parameters, "noMemoryLock")?;
    Ok(settings)
}

/// Reads the signs of a stalled joint; wider ones than the default are logged.
fn stall_limits<const N: usize>(
    default: Option<StallLimits<N>>,
    parameters: &Parameters,
) -> Result<Option<StallLimits<N>>, HostError> {
    let expected = format!("{N} torques of the position loops in Nm, above 0");
    let range = Limits::new(1e-3, 1e5);
    let torques = numbers::<N>(parameters, "stallTorques", range, &expected)?;
    let error = parameters.get::<f64>("stallError")?;
    let time = parameters.get::<Duration>("stallTime")?;
    if flag(parameters, "noStallDetection")? {
        tracing::warn!("a joint that stalls or collides is not stopped");
        return Ok(None);
    }
    let Some(default) = default else {
        return Ok(None);
    };
    if error.is_some_and(|error| !(0.1..=MAX_STALL_ERROR).contains(&error)) {
        let expected = "a distance of 0.1 to 360 degrees";
        return Err(parameters.refuse("stallError", expected).into());
    }
    if time.is_some_and(|time| time > MAX_STALL_TIME) {
        let expected = "a time of at most 10 seconds";
        return Err(parameters.refuse("stallTime", expected).into());
    }
    let asked = StallLimits {
        torques: torques.unwrap_or(default.torques),
        error: error.unwrap_or(default.error),
        time: time.unwrap_or(default.time),
    };
    let widens = asked.error > default.error || asked.time > default.time;
    let pushes = asked.torques.iter().zip(default.torques);
    if widens || pushes.into_iter().any(|(asked, default)| *asked > default) {
        tracing::warn!(?asked, "joints stall later than by default");
    }
    Ok(Some(asked))
}

fn guards(parameters: &Parameters) -> Result<GuardConfiguration, HostError> {
    let (guard, none) = (flag(parameters, "guard")?, flag(parameters, "noGuard")?);
    if guard && none {
        return Err(parameters
            .refuse("noGuard", "either guard or noGuard")
            .into());
    }
    Ok(GuardConfiguration {
        wanted: (guard || none).then_some(guard),
        velocity_timeout: parameters.get_or("velocityTimeout", DEFAULT_VELOCITY_TIMEOUT)?,
        effort_timeout: parameters.get_or("effortTimeout", DEFAULT_EFFORT_TIMEOUT)?,
    })
}

#[cfg(test)]
mod tests {
    use yarp_wire::settings::{NoSource, Origin, Settings};

    use super::*;

    const AXES: usize = 7;

    fn read(text: &str) -> Result<ArmConfiguration<AXES>, String> {
        let mut settings = Settings::new();
        settings.read_text("f.ini", text, &NoSource);
        let parameters = Parameters::new("arm", settings, Origin::line("f.ini", 1));
        let configuration = ArmConfiguration::from_parameters(&parameters, None);
        configuration.map_err(|error| error.to_string())
    }

    fn of(text: &str) -> Result<Option<StallLimits<AXES>>, String> {
        read(text).map(|configuration| configuration.model.stall)
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn real_time_settings_are_parameters() {
        let of = |text: &str| read(text).map(|found| found.can.real_time);
        assert_eq!(of(""), Ok(RealTime::default()));
        let asked = RealTime {
            priority: Some(99),
            processor: Some(1),
            lock_memory: false,
        };
        assert_eq!(
            of("realTimePriority 99\nprocessor 1\nnoMemoryLock\n"),
            Ok(asked)
        );
        let none = of("realTimePriority 0\n").unwrap();
        assert_eq!(none.priority, None);
        let refused = of("realTimePriority 100\n").unwrap_err();
        assert!(refused.contains("1 to 99"), "{refused}");
    }

    #[test]
    fn signs_of_a_stall_are_parameters() {
        let usual = of("").unwrap().expect("by default");
        assert_eq!(Some(usual), WamModel::<AXES>::new().stall);
        let text = "stallTorques (1 2 3 4 5 6 7)\nstallError 20\nstallTime 0.5\n";
        let asked = of(text).unwrap().expect("it is on");
        assert_eq!(asked.torques, [1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0]);
        assert_eq!(
            (asked.error, asked.time),
            (20.0, Duration::from_millis(500))
        );
        assert_eq!(of("noStallDetection\n"), Ok(None));
        for (text, expected) in [
            ("stallTorques (1 2)", "7 torques of the position loops"),
            ("stallTorques (0 1 1 1 1 1 1)", "above 0"),
            ("stallError 0", "0.1 to 360 degrees"),
            ("stallError 361", "0.1 to 360 degrees"),
            ("stallTime 11", "at most 10 seconds"),
        ] {
            let refused = of(text).expect_err(text);
            assert!(refused.contains(expected), "{text}: {refused}");
        }
    }
}
