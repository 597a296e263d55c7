//! The driver of the arm on its bus, with a simulated arm at the other end.

mod in_process_bus;
mod pendant_button;

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use in_process_bus::{InProcessBus, PucksInTime};
pub use pendant_button::PendantButton;

use super::can::{CanOptions, CanWam};
use super::{AXES, WamModel};
use crate::can::CanBus;
use crate::simulation::{SafetyMode, SimulatedPucks, SimulatorOptions};
use crate::{AxisIndex, AxisInfo, Device, DeviceError, JointType, RemoteVariables, VariableValue};

/// Variable with the mode of the safety module; setting it presses a button of the pendant.
const PENDANT: &str = "pendant";

/// A simulated WAM arm that is brought up like a real one: the driver of the CAN bus in front of simulated pucks.
///
/// * It is switched on and folded at home when it starts; its pucks wake like real ones, somebody has to confirm that it is folded,
///   and nothing moves before [`PendantButton::Activate`].
/// * The emergency stop cuts the power of the pucks, and with it the driver loses the position; so does switching the
///   arm off.
/// * The bus is in this process, and time at its other end passes in whole control periods with the queries of the driver. A driver that is
///   interrupted leaves the arm without commands for as long.
/// * The variable `pendant` presses the buttons: [`PendantButton`] lists the words.
///
/// ```
/// use yarp_devices::simulation::SimulatorOptions;
/// use yarp_devices::wam::can::CanOptions;
/// use yarp_devices::wam::{PendantButton, SimulatedCanWam, WamModel};
///
/// # fn main() -> Result<(), yarp_devices::DeviceError> {
/// let options = CanOptions { home_confirmed: true, ..CanOptions::default() };
/// let arm = SimulatedCanWam::start(WamModel::<7>::new(), options, SimulatorOptions::real_arm())?;
/// arm.press(PendantButton::Activate);
/// # Ok(())
/// # }
/// ```
#[derive(Debug)]
pub struct SimulatedCanWam {
    arm: CanWam,
    pucks: Arc<Mutex<PucksInTime>>,
}

impl SimulatedCanWam {
    /// Switches a simulated arm on and starts its driver, without real-time settings.
    ///
    /// Blocks until the pucks are awake, two seconds or so. Errors: those of [`CanWam::start`].
    pub fn start(
        model: WamModel<AXES>,
        options: CanOptions,
        simulator: SimulatorOptions,
    ) -> Result<Self, DeviceError> {
        let pucks = SimulatedPucks::new(model.clone(), simulator);
        let pucks = Arc::new(Mutex::new(PucksInTime::new(pucks)));
        let theirs = Arc::clone(&pucks);
        let open = move || {
            let bus = InProcessBus::new(Arc::clone(&theirs));
            Ok(Box::new(bus) as Box<dyn CanBus>)
        };
        let options = CanOptions {
            #[cfg(target_os = "linux")]
            real_time: crate::real_time::RealTime::NONE,
            ..options
        };
        let arm = CanWam::start(model, options, Box::new(open))?;
        Ok(Self { arm, pucks })
    }

    /// Presses a button of the pendant, or switches the arm on or off.
    pub fn press(&self, button: PendantButton) {
        self.with_pucks(|pucks| match button {
            PendantButton::Idle => pucks.press_idle(),
            PendantButton::Activate => pucks.press_activate(),
            PendantButton::Stop => pucks.press_stop(),
            PendantButton::PowerOff => pucks.set_power(false),
            PendantButton::PowerOn => pucks.set_power(true),
        });
    }

    /// Does something with the arm at the other end of the bus, as it is now.
    pub fn with_pucks<T>(&self, what: impl FnOnce(&mut SimulatedPucks) -> T) -> T {
        let mut pucks = self.lock();
        pucks.pass();
        what(pucks.pucks_mut())
    }

    /// Returns the driver.
    pub fn driver(&self) -> &CanWam {
        &self.arm
    }

    fn lock(&self) -> MutexGuard<'_, PucksInTime> {
        self.pucks.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Delegates interfaces to the driver.
macro_rules! of_driver {
    ($($method:ident: $interface:ident),* $(,)?) => {
        $(fn $method(&self) -> Option<&dyn crate::$interface> {
            self.arm.$method()
        })*
    };
}

impl Device for SimulatedCanWam {
    of_driver! {
        axis_info: AxisInfo,
        position_control: PositionControl,
        velocity_control: VelocityControl,
        encoders: Encoders,
        control_mode: ControlMode,
        control_limits: ControlLimits,
        position_direct: PositionDirect,
        torque_control: TorqueControl,
        current_control: CurrentControl,
        pwm_control: PwmControl,
        interaction_mode: InteractionMode,
        impedance_control: ImpedanceControl,
        pid_control: PidControl,
        motor_encoders: MotorEncoders,
        motor: Motor,
        amplifier_control: AmplifierControl,
        control_calibration: ControlCalibration,
        joint_fault: JointFault,
        machine_brake: MachineBrake,
    }

    fn remote_variables(&self) -> Option<&dyn RemoteVariables> {
        Some(self)
    }
}

impl AxisInfo for SimulatedCanWam {
    fn axes(&self) -> usize {
        self.arm.axes()
    }

    fn axis_name(&self, axis: AxisIndex) -> Result<String, DeviceError> {
        self.arm.axis_name(axis)
    }

    fn joint_type(&self, axis: AxisIndex) -> Result<JointType, DeviceError> {
        self.arm.joint_type(axis)
    }
}

impl RemoteVariables for SimulatedCanWam {
    fn variables(&self) -> Result<Vec<String>, DeviceError> {
        let mut names = self.arm.variables()?;
        names.push(PENDANT.to_owned());
        Ok(names)
    }

    fn variable(&self, name: &str) -> Result<Vec<VariableValue>, DeviceError> {
        if name != PENDANT {
            return self.arm.variable(name);
        }
        let mode = self.with_pucks(|pucks| match pucks.is_powered() {
            false => "off",
            true => match pucks.simulator().safety().mode() {
                SafetyMode::EmergencyStop => "stop",
                SafetyMode::Idle => "idle",
                SafetyMode::Active => "active",
            },
        });
        Ok(vec![VariableValue::Text(mode.to_owned())])
    }

    fn set_variable(&self, name: &str, value: &[VariableValue]) -> Result<(), DeviceError> {
        if name != PENDANT {
            return self.arm.set_variable(name, value);
        }
        let button = match value {
            [VariableValue::Text(word)] => word.parse(),
            _ => Err(PendantButton::expected()),
        };
        self.press(button.map_err(|expected| DeviceError::Unsuitable {
            what: PENDANT,
            asked: format!("{value:?}"),
            expected,
        })?);
        Ok(())
    }
}
