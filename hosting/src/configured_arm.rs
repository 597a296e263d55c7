//! A WAM arm of any kind with four or seven joints, from its parameters to a running device.

use std::sync::Arc;

use yarp_devices::cartesian::{CartesianController, CartesianOptions};
use yarp_devices::embedded::{DriverOptions, EmbeddedWam, LinkMode};
use yarp_devices::simulation::SimulatorOptions;
use yarp_devices::wam::can::CanWam;
use yarp_devices::wam::{DynamicWam, SimulatedCanWam, SimulatedWam, WamModel, parameters_of};
use yarp_devices::{Device, DeviceError};
use yarp_wire::settings::Parameters;

use crate::{ArmConfiguration, HostError};

/// Kind of an arm: a simulation, or a driver with the way to the arm.
#[derive(Clone, Debug, Eq, PartialEq)]
pub enum ArmKind {
    /// Moves exactly as commanded.
    Ideal,
    /// Has masses, friction, encoders and a controller.
    Dynamic,
    /// The driver of the CAN bus in front of a simulated arm, with the effects of a real one.
    SimulatedCan,
    /// An arm behind its embedded PC.
    Embedded(LinkMode),
    /// An arm on a CAN bus of this machine, by the name of the interface.
    Can(String),
}

impl ArmKind {
    /// Returns the default options of a simulated arm with masses.
    fn simulator(&self) -> Option<SimulatorOptions> {
        match self {
            Self::Dynamic => Some(SimulatorOptions::default()),
            Self::SimulatedCan => Some(SimulatorOptions::real_arm()),
            _ => None,
        }
    }

    /// Returns the interface of an arm on a CAN bus.
    fn bus(&self) -> Option<&str> {
        match self {
            Self::Can(interface) => Some(interface),
            _ => None,
        }
    }

    /// Returns whether guards stand in front of the arm by default.
    fn is_guarded(&self) -> bool {
        *self != Self::Ideal
    }
}

/// An arm whose parameters have been read.
#[derive(Clone, Debug)]
pub struct ConfiguredArm {
    kind: ArmKind,
    configuration: AnyConfiguration,
}

/// The configuration of an arm with one of the numbers of joints that Barrett builds.
#[derive(Clone, Debug)]
enum AnyConfiguration {
    Four(Box<ArmConfiguration<4>>),
    Seven(Box<ArmConfiguration<7>>),
}

impl ConfiguredArm {
    /// Reads the parameters of an arm of this kind, `joints` among them: 4 or 7, which is the default.
    ///
    /// Errors: [`HostError::Parameter`] with the position of the parameter and the expected value.
    pub fn from_parameters(kind: ArmKind, parameters: &Parameters) -> Result<Self, HostError> {
        let configuration = match parameters.get::<usize>("joints")? {
            None | Some(7) => AnyConfiguration::Seven(Box::new(read(&kind, parameters)?)),
            Some(4) => AnyConfiguration::Four(Box::new(read(&kind, parameters)?)),
            Some(_) => return Err(parameters.refuse("joints", "4 or 7").into()),
        };
        Ok(Self {
            kind,
            configuration,
        })
    }

    /// Returns the number of joints.
    pub fn joints(&self) -> usize {
        match &self.configuration {
            AnyConfiguration::Four(_) => 4,
            AnyConfiguration::Seven(_) => 7,
        }
    }

    /// Starts the arm, with guards in front of any but the ideal simulation unless configured otherwise.
    ///
    /// Blocks until the arm is found. Errors: those of the drivers, and of
    /// [`Guarded::around`](yarp_devices::guard::Guarded::around).
    pub fn start(&self) -> Result<Arc<dyn Device>, DeviceError> {
        match &self.configuration {
            AnyConfiguration::Four(configuration) => start(&self.kind, configuration),
            AnyConfiguration::Seven(configuration) => start(&self.kind, configuration),
        }
    }

    /// Starts a controller of the tool of an arm that [`start`](Self::start) returned.
    ///
    /// Errors: those of [`CartesianController::start`].
    pub fn start_tool(&self, arm: Arc<dyn Device>) -> Result<Arc<dyn Device>, DeviceError> {
        match &self.configuration {
            AnyConfiguration::Four(configuration) => tool_of(arm, &configuration.model),
            AnyConfiguration::Seven(configuration) => tool_of(arm, &configuration.model),
        }
    }
}

/// Starts a controller of the tool of an arm with the kinematics of a WAM with `joints` joints, or with as many as the arm has.
///
/// Errors: those of [`CartesianController::start`], such as for an arm with other joints.
pub(crate) fn start_standard_tool(
    arm: Arc<dyn Device>,
    joints: Option<usize>,
) -> Result<Arc<dyn Device>, DeviceError> {
    match joints.or_else(|| arm.axis_info().map(|info| info.axes())) {
        Some(4) => tool_of(arm, &WamModel::<4>::new()),
        _ => tool_of(arm, &WamModel::<7>::new()),
    }
}

fn tool_of<const N: usize>(
    arm: Arc<dyn Device>,
    model: &WamModel<N>,
) -> Result<Arc<dyn Device>, DeviceError> {
    let options = CartesianOptions::new().part_type(format!("wam{N}"));
    let tool = CartesianController::start(arm, model.chain.clone(), options)?;
    Ok(Arc::new(tool))
}

fn read<const N: usize>(
    kind: &ArmKind,
    parameters: &Parameters,
) -> Result<ArmConfiguration<N>, HostError>
where
    WamModel<N>: Default,
{
    let configuration = ArmConfiguration::from_parameters(parameters, kind.bus())?;
    match kind.simulator() {
        Some(default) => configuration.with_simulator(parameters, default),
        None => Ok(configuration),
    }
}

fn start<const N: usize>(
    kind: &ArmKind,
    configuration: &ArmConfiguration<N>,
) -> Result<Arc<dyn Device>, DeviceError> {
    let model = configuration.model.clone();
    let can = configuration.can.clone();
    let simulator = configuration.simulator;
    let arm: Arc<dyn Device> = match kind {
        ArmKind::Ideal => Arc::new(SimulatedWam::with_axes(parameters_of::<N>())),
        ArmKind::Dynamic => Arc::new(DynamicWam::start_with(model, simulator)?),
        ArmKind::SimulatedCan => Arc::new(SimulatedCanWam::start(model, can, simulator)?),
        ArmKind::Embedded(link_mode) => {
            let options = DriverOptions {
                joints: parameters_of::<N>().to_vec(),
                ..DriverOptions::new(*link_mode)
            };
            Arc::new(EmbeddedWam::start(options)?)
        }
        ArmKind::Can(interface) => Arc::new(CanWam::on_interface_with(model, interface, can)?),
    };
    configuration.narrow(arm.as_ref())?;
    configuration.guard(arm, kind.is_guarded())
}
