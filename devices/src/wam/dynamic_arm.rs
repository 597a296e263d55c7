//! The simulated machine under control; stepped by its owner.

use std::ops::{Deref, DerefMut};

use nalgebra::Vector3;

use super::arm_device::{ArmDevice, ControlledArm, count_word};
use super::{AXES, ArmControl, WamModel, dynamic_variables};
use crate::can::puck::PuckProperty;
use crate::kinematics::Joints;
use crate::simulation::{MAX_TEMPERATURE, SafetyMode, SafetyModule, Simulator, SimulatorOptions};
use crate::{Axes, AxisIndex, DeviceError, Mode, VariableValue};

/// The arm with `N` joints, with masses, friction, encoders and a PID per joint, in **degrees**, as pure model.
///
/// It is its [`ArmControl`], which has the calls of the interfaces, with a simulated machine under it: an idle joint
/// sinks gently; a fault of the safety module puts all joints into [`Mode::HardwareFault`], out of which
/// [`Mode::ForceIdle`] leads, as the pendant of the real arm would.
///
/// ```
/// use yarp_devices::simulation::SimulatorOptions;
/// use yarp_devices::wam::{DynamicArm, WamModel};
/// use yarp_devices::Axes;
///
/// # fn main() -> Result<(), yarp_devices::DeviceError> {
/// let mut arm = DynamicArm::new(WamModel::<7>::new(), SimulatorOptions::default());
/// let base = Axes::One(0.into());
/// arm.position_move(base, &[10.0])?;
/// while !arm.motion_done(base)? {
///     arm.tick();
/// }
/// assert!((arm.state(0.into())?.position - 10.0).abs() < 1.0);
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Debug)]
pub struct DynamicArm<const N: usize = AXES> {
    control: ArmControl<N>,
    simulator: Simulator<N>,
}

impl<const N: usize> DynamicArm<N> {
    /// An arm in its home pose, at rest, active, in position mode.
    pub fn new(model: WamModel<N>, options: SimulatorOptions) -> Self {
        let mut simulator = Simulator::new(model.clone(), options);
        simulator.safety_mut().press_activate();
        Self {
            control: ArmControl::new(model, options.period, simulator.counts()),
            simulator,
        }
    }

    /// Lets one control period pass.
    pub fn tick(&mut self) {
        self.poll_safety_module();
        for joint in 0..N {
            let idle = self.control.mode(AxisIndex::from(joint)) == Mode::Idle;
            self.simulator.set_idle(joint, idle);
        }
        let torques = self.control.drive();
        let counts = self.simulator.step(Some(&torques));
        self.control.take_counts(counts);
    }

    fn poll_safety_module(&mut self) {
        let active = self.simulator.safety().mode() == SafetyMode::Active;
        self.control.set_ready(active);
    }

    /// The machine.
    pub fn simulator(&self) -> &Simulator<N> {
        &self.simulator
    }

    /// The machine, to push and to twist it.
    pub fn simulator_mut(&mut self) -> &mut Simulator<N> {
        &mut self.simulator
    }

    /// The safety module, to press its buttons: the next period sees it.
    pub fn safety_mut(&mut self) -> &mut SafetyModule {
        self.simulator.safety_mut()
    }

    /// Puts the arm into another pose, at rest, as by hand; it holds there.
    pub fn place(&mut self, joints: &Joints<N>) {
        self.simulator.place(joints);
        self.control.forget_motion(self.simulator.counts());
        self.control.hold();
    }

    /// Pushes the tool with a force in the base frame, N, until the next call.
    pub fn push(&mut self, force: [f64; 3]) {
        self.simulator.push(Vector3::from(force));
    }

    /// Sets modes like [`ArmControl::set_control_modes`]; [`Mode::ForceIdle`] presses the buttons of the pendant if
    /// needed.
    pub fn set_control_modes(&mut self, axes: Axes<'_>, modes: &[Mode]) -> Result<(), DeviceError> {
        self.poll_safety_module();
        self.control.set_control_modes(axes, modes)?;
        if modes.contains(&Mode::ForceIdle) && !self.control.is_ready() {
            self.simulator.safety_mut().press_idle();
            self.simulator.safety_mut().press_activate();
            self.poll_safety_module();
        }
        Ok(())
    }
}

impl<const N: usize> Deref for DynamicArm<N> {
    type Target = ArmControl<N>;

    fn deref(&self) -> &ArmControl<N> {
        &self.control
    }
}

impl<const N: usize> DerefMut for DynamicArm<N> {
    fn deref_mut(&mut self) -> &mut ArmControl<N> {
        &mut self.control
    }
}

/// The machine has motors, and none of the other properties of a puck.
fn no_pucks<T>(what: &str) -> Result<T, DeviceError> {
    Err(DeviceError::NotSupported {
        what: format!("{what}, which the simulated machine has not,"),
    })
}

impl<const N: usize> ControlledArm<N> for DynamicArm<N> {
    fn description() -> String {
        let joints = count_word(N);
        format!("a simulated {joints}-joint WAM arm with masses, friction, motors and a controller")
    }

    fn control(&self) -> &ArmControl<N> {
        &self.control
    }

    fn control_mut(&mut self) -> &mut ArmControl<N> {
        &mut self.control
    }

    fn set_control_modes(&mut self, axes: Axes<'_>, modes: &[Mode]) -> Result<(), DeviceError> {
        Self::set_control_modes(self, axes, modes)
    }

    fn fault(&self) -> Option<String> {
        let safety = self.simulator.safety();
        match (safety.mode(), safety.fault()) {
            (_, Some(fault)) => Some(fault.to_string()),
            (SafetyMode::Active, None) => None,
            (SafetyMode::Idle, None) => Some("idle was pressed on the pendant".to_owned()),
            (SafetyMode::EmergencyStop, None) => Some("emergency stop".to_owned()),
        }
    }

    fn brake(&mut self) -> Result<(), DeviceError> {
        // Out of an emergency stop only a person leads.
        if self.simulator.safety().mode() == SafetyMode::Active {
            self.simulator.safety_mut().press_idle();
        }
        self.poll_safety_module();
        Ok(())
    }

    fn temperatures(&self) -> Result<[f64; N], DeviceError> {
        Ok(self.simulator.temperatures())
    }

    fn puck_property(
        device: &ArmDevice<Self, N>,
        _: AxisIndex,
        property: PuckProperty,
    ) -> Result<i32, DeviceError> {
        match property {
            PuckProperty::OTEMP => Ok(MAX_TEMPERATURE),
            PuckProperty::VBUS => Ok(device.with(|arm| arm.simulator.supply_voltage()) as i32),
            _ => no_pucks("what only a puck can tell"),
        }
    }

    fn variables() -> Vec<String> {
        dynamic_variables::NAMES.map(str::to_owned).to_vec()
    }

    fn variable(
        device: &ArmDevice<Self, N>,
        name: &str,
    ) -> Result<Vec<VariableValue>, DeviceError> {
        dynamic_variables::variable(device, name)
    }

    fn set_variable(
        device: &ArmDevice<Self, N>,
        name: &str,
        value: &[VariableValue],
    ) -> Result<(), DeviceError> {
        dynamic_variables::set_variable(device, name, value)
    }
}
