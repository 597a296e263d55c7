//! The driver of the arm on its bus, with a simulated arm at the other end.

mod in_process_bus;
mod pendant_button;

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread;
use std::time::{Duration, Instant};

use in_process_bus::{InProcessBus, PucksInTime};
pub use pendant_button::PendantButton;

use super::arm_variables::numbers;
use super::can::{CanOptions, CanWam};
use super::{AXES, WamModel};
use crate::can::CanBus;
use crate::clock::TimeSource;
use crate::kinematics::Joints;
use crate::simulation::{SafetyMode, SimulatedPucks, SimulatorOptions};
use crate::{AxisIndex, AxisInfo, Device, DeviceError, JointType, RemoteVariables, VariableValue};

/// Variable with the mode of the safety module; setting it presses a button of the pendant.
const PENDANT: &str = "pendant";
/// Variable with the supply voltage of the arm, V.
const SUPPLY_VOLTAGE: &str = "supply_voltage";
/// Supply voltages that can be set, V.
const SUPPLY_VOLTAGES: (f64, f64) = (1.0, 100.0);
/// Variable of the driver by which somebody confirms that the arm is folded at home.
const CONFIRM_HOME: &str = "confirm_home";

/// Reason for refusing the time of a clock on the network, and the remedy.
const NETWORK_TIME_REFUSAL: &str = "the driver of the CAN bus and its safety module measure the time of this machine, and cannot follow a clock on \
    the network (YARP_CLOCK); start it without YARP_CLOCK, or use the device dynamicWam with `effects real` \
    (yarp up: --simulation dynamic), which follows the clock";

/// Timeout of the activation.
const ACTIVATION_TIMEOUT: Duration = Duration::from_secs(10);
/// Interval between looks at the state of the arm.
const POLL_INTERVAL: Duration = Duration::from_millis(20);

/// A simulated WAM arm that is brought up like a real one: the driver of the CAN bus in front of simulated pucks.
///
/// * It is switched on and folded at home when it starts; its pucks wake like real ones, somebody has to confirm that it is folded,
///   and nothing moves before [`PendantButton::Activate`].
/// * The emergency stop cuts the power of the pucks, and with it the driver loses the position; so does switching the
///   arm off.
/// * The bus is in this process, and time at its other end passes in whole control periods with the queries of the driver. A driver that is
///   interrupted leaves the arm without commands for as long.
/// * Who confirms that the arm is folded folds it, and holds it so until the driver knows, unless it is active.
/// * The variable `pendant` presses the buttons: [`PendantButton`] lists the words. `supply_voltage`, 1 to 100 V, is what the power
///   supply gives: the safety module trips when it is too low or too high ([`VoltageLimits`](crate::simulation::VoltageLimits)).
/// * It runs in the time of this machine, as the driver of a real arm does, and does not start in a process that follows a clock on the
///   network.
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
pub struct SimulatedCanWam<const N: usize = AXES> {
    arm: CanWam<N>,
    pucks: Arc<Mutex<PucksInTime<N>>>,
}

impl<const N: usize> SimulatedCanWam<N> {
    /// Switches a simulated arm on and starts its driver, without real-time settings.
    ///
    /// Blocks until the pucks are awake, two seconds or so. Errors: those of [`CanWam::start`]; [`DeviceError::Start`] in a process that
    /// follows a clock on the network.
    pub fn start(
        model: WamModel<N>,
        options: CanOptions<N>,
        simulator: SimulatorOptions,
    ) -> Result<Self, DeviceError> {
        Self::start_among(model, options, simulator, |_| None)
    }

    /// Starts an arm among other bodies: `surroundings` is called after each control period with the true joint angles, rad, and returns
    /// the torques that contact puts on the joints during the next, Nm, or `None` to leave them.
    ///
    /// Errors: those of [`start`](Self::start).
    pub fn start_among(
        model: WamModel<N>,
        options: CanOptions<N>,
        simulator: SimulatorOptions,
        surroundings: impl FnMut(&Joints<N>) -> Option<Joints<N>> + Send + 'static,
    ) -> Result<Self, DeviceError> {
        Self::start_on(
            TimeSource::current(),
            model,
            options,
            simulator,
            surroundings,
        )
    }

    /// Starts an arm like [`start_among`](Self::start_among), on the time of `source`, which has to be that of the machine.
    ///
    /// Errors: those of [`start`](Self::start).
    pub fn start_on(
        source: TimeSource,
        model: WamModel<N>,
        options: CanOptions<N>,
        simulator: SimulatorOptions,
        surroundings: impl FnMut(&Joints<N>) -> Option<Joints<N>> + Send + 'static,
    ) -> Result<Self, DeviceError> {
        if source.is_network() {
            let source = std::io::Error::other(NETWORK_TIME_REFUSAL);
            let what = "the simulated arm on its CAN bus";
            return Err(DeviceError::Start { what, source });
        }
        let pucks = SimulatedPucks::new(model.clone(), simulator);
        let pucks = PucksInTime::new(pucks, Box::new(surroundings));
        let pucks = Arc::new(Mutex::new(pucks));
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
        if options.home_confirmed {
            // Whoever confirms that it is folded holds it so until the driver knows: a wrist with a hand sinks while pucks wake.
            lock(&pucks).hold(Some(model.home));
        }
        let arm = CanWam::start(model, options, Box::new(open));
        lock(&pucks).hold(None);
        Ok(Self { arm: arm?, pucks })
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

    /// Presses idle and activate, and waits until the driver has seen it.
    ///
    /// Before, somebody has to have confirmed that the arm is at home. Errors: [`DeviceError::Start`] if it is not active
    /// within ten seconds.
    pub fn activate(&self) -> Result<(), DeviceError> {
        self.press(PendantButton::Idle);
        self.press(PendantButton::Activate);
        let deadline = Instant::now() + ACTIVATION_TIMEOUT;
        while self.arm.status().safety != Some(SafetyMode::Active) {
            if Instant::now() >= deadline {
                let source = std::io::Error::other("its safety module does not become active");
                let what = "the simulated arm";
                return Err(DeviceError::Start { what, source });
            }
            thread::sleep(POLL_INTERVAL);
        }
        Ok(())
    }

    /// Loses this share of all frames on the bus from now on, in both directions, 0 to 1.
    pub fn lose_frames(&self, share: f64) {
        self.lock().lose(share);
    }

    /// Returns the number of frames that were lost.
    pub fn lost_frames(&self) -> u64 {
        self.lock().lost()
    }

    /// Does something with the arm at the other end of the bus, as it is now.
    pub fn with_pucks<T>(&self, what: impl FnOnce(&mut SimulatedPucks<N>) -> T) -> T {
        let mut pucks = self.lock();
        pucks.pass();
        what(pucks.pucks_mut())
    }

    /// Returns the driver.
    pub fn driver(&self) -> &CanWam<N> {
        &self.arm
    }

    fn lock(&self) -> MutexGuard<'_, PucksInTime<N>> {
        lock(&self.pucks)
    }
}

fn lock<const N: usize>(pucks: &Mutex<PucksInTime<N>>) -> MutexGuard<'_, PucksInTime<N>> {
    pucks.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Makes the methods of [`Device`] by the list of all interfaces: those of the driver, but for the variables.
macro_rules! device_of_driver {
    ($($(#[$about:meta])* $method:ident: $interface:ident;)*) => {
        impl<const N: usize> Device for SimulatedCanWam<N> {
            $(interface_of_driver! { $method $interface })*
        }
    };
}

macro_rules! interface_of_driver {
    (remote_variables $interface:ident) => {
        crate::offers! { remote_variables: $interface }
    };
    ($method:ident $interface:ident) => {
        fn $method(&self) -> Option<&dyn crate::$interface> {
            self.arm.$method()
        }
    };
}

crate::device_interfaces!(device_of_driver);

impl<const N: usize> AxisInfo for SimulatedCanWam<N> {
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

impl<const N: usize> RemoteVariables for SimulatedCanWam<N> {
    fn variables(&self) -> Result<Vec<String>, DeviceError> {
        let mut names = self.arm.variables()?;
        names.extend([PENDANT, SUPPLY_VOLTAGE].map(str::to_owned));
        Ok(names)
    }

    fn variable(&self, name: &str) -> Result<Vec<VariableValue>, DeviceError> {
        if name == SUPPLY_VOLTAGE {
            let volts = self.with_pucks(|pucks| pucks.simulator().supply_voltage());
            return Ok(vec![VariableValue::Number(volts)]);
        }
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
        if name == CONFIRM_HOME {
            self.with_pucks(|pucks| {
                if pucks.simulator().safety().mode() != SafetyMode::Active {
                    let home = pucks.simulator().model().home;
                    pucks.simulator_mut().place(&home);
                }
            });
        }
        if name == SUPPLY_VOLTAGE {
            let [volts] = numbers(SUPPLY_VOLTAGE, value, [SUPPLY_VOLTAGES])?;
            self.with_pucks(|pucks| pucks.simulator_mut().set_supply_voltage(volts));
            return Ok(());
        }
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
