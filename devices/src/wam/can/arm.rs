//! The arm on the bus as a device.

use std::collections::VecDeque;
use std::fmt;
use std::thread;
use std::time::Instant;

use tracing::{info, warn};

use super::connect::connect;
use super::cycle::Link;
use super::errand::Errand;
use super::{CanOptions, CanTrouble, errand, variables};
use crate::can::puck::{Node, Pendant, Property};
use crate::can::{BusError, CanBus};
use crate::simulation::SafetyMode;
use crate::wam::arm_device::{ArmDevice, Shared, SteeredArm};
use crate::wam::pace::Pace;
use crate::wam::{AXES, ArmControl, WamModel};
use crate::{AxisIndex, DeviceError, VariableValue};

/// Who it is, for errors and the log.
pub(super) const PEER: &str = "the arm on the CAN bus";

/// Opens the bus, at the start and after it failed.
pub type OpenBus = Box<dyn FnMut() -> Result<Box<dyn CanBus>, BusError> + Send>;

/// A seven-joint WAM arm on its CAN bus.
///
/// * It must lie folded in its home pose when the pucks have been switched on and the driver starts; pucks
///   that have been told where they are keep it as long as they have power.
/// * The safety module decides: the arm is driven from when Shift and Activate are pressed on the pendant, and holds
///   where it is then. Until then, and after a fault, all joints are in `Mode::HardwareFault`.
/// * When the bus fails or a puck falls silent the safety module is told to brake, commands and readings are refused
///   with the step that failed, and the driver connects again by itself.
/// * An idle joint is not braked but floats: gravity stays compensated, a hand can lead it. Barrett warns against
///   switching single motors beside the safety module.
/// * Dropping the device has the arm braked.
///
/// ```no_run
/// # #[cfg(target_os = "linux")]
/// # fn main() -> Result<(), yarp_devices::DeviceError> {
/// use yarp_devices::wam::can::{CanOptions, CanWam};
///
/// let arm = CanWam::on_interface("can0", CanOptions::default())?;
/// println!("{:?}", arm.status());
/// # Ok(())
/// # }
/// # #[cfg(not(target_os = "linux"))]
/// # fn main() {}
/// ```
pub type CanWam = ArmDevice<CanArm>;

/// Control of an arm on a bus, and how things stand there.
#[derive(Clone, Debug)]
pub struct CanArm {
    control: ArmControl,
    status: CanStatus,
    options: CanOptions,
    /// What callers want to know of pucks.
    errands: VecDeque<Errand>,
}

/// How things stand between driver and arm.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct CanStatus {
    /// Whether control runs, with the arm active or not.
    pub connected: bool,
    /// What the safety module lets the arm do; `None` before its first answer.
    pub safety: Option<SafetyMode>,
    /// What the pendant shows while the arm is not active.
    pub pendant: Option<Pendant>,
    /// What failed last, which may be an attempt to connect again; stays when the arm is there again.
    pub trouble: Option<CanTrouble>,
    /// What failed when the arm was lost; stays too.
    pub loss: Option<CanTrouble>,
    /// How often the arm was found.
    pub connections: u64,
    /// Control periods since then.
    pub periods: u64,
    /// How many of them began more than a period late: the machine was busy.
    pub late: u64,
    /// How many positions did not come in time since then.
    pub left_out: u64,
    /// How warm the pucks were when they were last asked, °C: one after the other, some times a second.
    pub temperatures: [Option<i32>; AXES],
}

/// In words, for people.
impl fmt::Display for CanStatus {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match (&self.trouble, self.safety) {
            (Some(trouble), _) if !self.connected => write!(f, "{trouble}"),
            (_, Some(SafetyMode::Active)) => write!(f, "active"),
            (_, mode) => {
                let mode = match mode {
                    Some(SafetyMode::EmergencyStop) => "stopped by the emergency stop",
                    _ => "idle",
                };
                write!(f, "the safety module keeps the arm {mode}")?;
                if let Some(pendant) = self.pendant {
                    write!(f, " ({pendant})")?;
                }
                write!(
                    f,
                    "; try Shift and Idle, then Shift and Activate on the pendant"
                )
            }
        }
    }
}

impl SteeredArm for CanArm {
    const DESCRIPTION: &'static str = "a seven-joint WAM arm on its CAN bus";

    fn control(&self) -> &ArmControl {
        &self.control
    }

    fn control_mut(&mut self) -> &mut ArmControl {
        &mut self.control
    }

    fn fault(&self) -> Option<String> {
        let fine = self.status.connected && self.control.is_ready();
        (!fine).then(|| self.status.to_string())
    }

    /// Errors: [`DeviceError::Remote`], [`DeviceError::NoDataYet`] in the first second.
    fn temperatures(&self) -> Result<[f64; AXES], DeviceError> {
        self.control.reachable()?;
        let mut known = [0.0; AXES];
        for (known, told) in known.iter_mut().zip(self.status.temperatures) {
            let what = "temperature";
            *known = f64::from(told.ok_or(DeviceError::NoDataYet { what })?);
        }
        Ok(known)
    }

    fn puck_property(
        device: &ArmDevice<Self>,
        motor: AxisIndex,
        property: Property,
    ) -> Result<i32, DeviceError> {
        errand::run(device, Node::of_motor(motor.index()), property, None)
    }

    fn variables() -> Vec<String> {
        variables::names().collect()
    }

    fn variable(device: &ArmDevice<Self>, name: &str) -> Result<Vec<VariableValue>, DeviceError> {
        variables::variable(device, name)
    }

    fn set_variable(
        device: &ArmDevice<Self>,
        name: &str,
        value: &[VariableValue],
    ) -> Result<(), DeviceError> {
        let options = device.with(|arm| arm.options);
        variables::set_variable(device, &options, name, value)
    }
}

impl CanArm {
    fn connected(&mut self, link: &Link, counts: [i32; AXES]) {
        let motors = link.motors(self.control.model());
        self.control.set_motors(motors);
        self.control.set_trouble(None);
        self.control.set_ready(false);
        self.control.forget_motion(counts);
        self.status = CanStatus {
            connected: true,
            connections: self.status.connections + 1,
            trouble: self.status.trouble.take(),
            loss: self.status.loss.take(),
            ..CanStatus::default()
        };
    }

    /// The arm is lost, or still not found; the log has why, once for each loss and once for what keeps it from being found.
    fn failed(&mut self, trouble: &CanTrouble) {
        self.control.set_ready(false);
        self.control.set_trouble(Some(trouble.for_callers(PEER)));
        if std::mem::take(&mut self.status.connected) {
            warn!(peer = PEER, %trouble, "lost the arm; it is braked");
            self.status.loss = Some(trouble.clone());
        } else if self.status.trouble.as_ref() != Some(trouble) {
            warn!(peer = PEER, %trouble, "the arm is still not found");
        }
        self.status.safety = None;
        self.status.trouble = Some(trouble.clone());
        self.errands.clear();
    }

    /// Takes a question for the thread of the bus, if the arm is there.
    pub(super) fn hand_over(&mut self, errand: Errand) -> Result<(), DeviceError> {
        self.control.reachable()?;
        self.errands.push_back(errand);
        Ok(())
    }

    /// From counts to torques, Nm.
    fn period(&mut self, link: &Link, counts: [i32; AXES]) -> crate::kinematics::Joints<AXES> {
        let active = link.safety() == Some(SafetyMode::Active);
        self.control.take_counts(counts);
        if active && !self.control.is_ready() {
            info!("the arm is active and holds where it is");
            self.control.forget_motion(counts);
            self.control.hold();
        }
        if !active && self.control.is_ready() {
            warn!(mode = ?link.safety(), "the safety module stopped the arm");
        }
        self.control.set_ready(active);
        self.status.safety = link.safety();
        self.status.pendant = link.pendant();
        self.status.left_out = link.left_out();
        self.status.temperatures = link.temperatures();
        self.status.periods += 1;
        self.control.drive()
    }
}

impl ArmDevice<CanArm> {
    /// Connects Barrett's arm on an interface of the kernel, like `can0`, which is up at 1 Mbit/s.
    ///
    /// Blocks until the arm is found, a second or so. Errors: as [`start`](Self::start).
    #[cfg(target_os = "linux")]
    pub fn on_interface(interface: &str, options: CanOptions) -> Result<Self, DeviceError> {
        let interface = interface.to_owned();
        let open = move || {
            let bus = crate::can::SocketCan::open(&interface)?;
            Ok(Box::new(bus) as Box<dyn CanBus>)
        };
        Self::start(WamModel::<AXES>::new(), options, Box::new(open))
    }

    /// Connects an arm on a bus.
    ///
    /// Blocks until the arm is found, a second or so. Errors: [`DeviceError::Remote`] with the step that failed,
    /// [`DeviceError::Start`] when the machine has no thread left.
    pub fn start(
        model: WamModel<AXES>,
        options: CanOptions,
        mut open: OpenBus,
    ) -> Result<Self, DeviceError> {
        let (link, counts) = connect(&mut open, &model, &options, true)
            .map_err(|trouble| DeviceError::from(&trouble.for_callers(PEER)))?;
        let mut arm = CanArm {
            control: ArmControl::new(model, options.period, counts),
            status: CanStatus::default(),
            options,
            errands: VecDeque::new(),
        };
        arm.connected(&link, counts);
        Self::spawn(arm, "can-wam", move |shared| {
            run(shared, link, open, &options);
        })
    }

    /// How things stand on the bus.
    pub fn status(&self) -> CanStatus {
        self.with(|arm| arm.status.clone())
    }
}

/// Drives the arm, and finds it again when it was lost, until told to end.
fn run(shared: &Shared<CanArm>, link: Link, mut open: OpenBus, options: &CanOptions) {
    let model = shared.lock().arm.control.model().clone();
    let mut link = Some(link);
    while !shared.is_ending() {
        let trouble = match link.take() {
            Some(mut link) => match drive(shared, &mut link, &model, options) {
                Ok(()) => return link.brake(),
                Err(trouble) => {
                    link.brake();
                    trouble
                }
            },
            None => match connect(&mut open, &model, options, false) {
                Ok((found, counts)) => {
                    shared.lock().arm.connected(&found, counts);
                    link = Some(found);
                    continue;
                }
                Err(trouble) => trouble,
            },
        };
        shared.lock().arm.failed(&trouble);
        let again = Instant::now() + options.retry;
        while !shared.is_ending() && Instant::now() < again {
            thread::park_timeout(again.saturating_duration_since(Instant::now()));
        }
    }
}

/// Control periods until told to end, or until something fails.
fn drive(
    shared: &Shared<CanArm>,
    link: &mut Link,
    model: &WamModel<AXES>,
    options: &CanOptions,
) -> Result<(), CanTrouble> {
    let mut pace = Pace::new(options.period);
    while pace.wait(|| shared.is_ending()) {
        let counts = link.positions()?;
        let (torques, errand) = {
            let mut timed = shared.lock();
            timed.stamp();
            timed.arm.status.late = pace.late();
            let torques = timed.arm.period(link, counts);
            let errand = link.is_free().then(|| timed.arm.errands.pop_front());
            (torques, errand.flatten())
        };
        link.drive(model, &torques)?;
        if let Some(errand) = errand {
            link.run(errand)?;
        }
    }
    Ok(())
}
