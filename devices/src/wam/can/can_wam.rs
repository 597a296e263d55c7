//! The arm on the bus as a device.

use std::collections::VecDeque;
use std::fmt;
use std::sync::mpsc::{SyncSender, sync_channel};
use std::thread;
use std::time::{Duration, Instant};

use tracing::{info, warn};

use super::arm_startup::{Attempt, connect};
use super::control_cycle::ControlCycle;
use super::property_request::PropertyRequest;
use super::{
    CanError, CanErrorKind, CanOptions, PositionRecord, can_variables, position_file,
    property_request,
};
use crate::can::puck::{Lamp, Node, Pendant, PuckProperty};
use crate::can::{BusError, CanBus};
use crate::periodic_timer::{DelayHistogram, MissedCycles, PeriodicTimer};
use crate::simulation::SafetyMode;
use crate::wam::arm_device::{ArmDevice, ControlledArm, Shared, count_word};
use crate::wam::{AXES, ArmControl, ArmError, WamModel};
use crate::{AxisIndex, DeviceError, VariableValue};

/// Longer than a start takes with pucks that wake late.
const CONFIRMATION_TIMEOUT: Duration = Duration::from_secs(30);
/// Interval at which a thread without an arm looks for a confirmation.
const CONFIRMATION_POLL_INTERVAL: Duration = Duration::from_millis(20);

/// Receives the outcome of a start that a person confirmed.
type StartOutcome = SyncSender<Result<(), CanError>>;

/// Name of the peer, for errors and the log.
pub(super) const PEER: &str = "the arm on the CAN bus";

/// Opens the bus, at the start and after it failed.
pub type OpenBus = Box<dyn FnMut() -> Result<Box<dyn CanBus>, BusError> + Send>;

/// A WAM arm with `N` joints on its CAN bus.
///
/// * It must be folded in its home pose when the pucks have been switched on and the driver starts, and somebody must
///   say so: [`CanOptions::home_confirmed`] or [`confirm_home`](Self::confirm_home). Pucks whose positions have been set
///   keep them as long as they have power, and [`CanOptions::position_file`] tells the next driver which they were.
/// * Once the position is lost - pucks or safety module restarted, the emergency stop cut their power, or counts changed
///   while the bus was away - commands and readings are refused until [`confirm_home`](Self::confirm_home), also when
///   the pucks are back by themselves.
/// * The safety module decides: the arm is driven as soon as Shift and Activate are pressed on the pendant, and holds
///   its position then. Until then, and after a fault, all joints are in `Mode::HardwareFault`.
/// * When the bus fails or a puck stops answering, the driver commands the safety module to brake, refuses commands
///   and readings with the step that failed, and reconnects by itself.
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
pub type CanWam<const N: usize = AXES> = ArmDevice<CanArm<N>, N>;

/// Control of an arm on a bus, and its state.
#[derive(Clone, Debug)]
pub struct CanArm<const N: usize = AXES> {
    control: ArmControl<N>,
    status: CanStatus<N>,
    options: CanOptions<N>,
    /// Origins of the pucks' positions, as last known.
    origins: [Option<i32>; N],
    /// True once the position has been known: counts of before mean nothing.
    located: bool,
    /// Pending queries of callers to pucks.
    property_requests: VecDeque<PropertyRequest>,
    /// The pending confirmation of a person, and where its result goes.
    confirmation: Option<StartOutcome>,
    /// The safety module is to brake the arm in the next period.
    brake_requested: bool,
}

/// State of the connection between driver and arm.
#[derive(Clone, Debug, PartialEq)]
pub struct CanStatus<const N: usize = AXES> {
    /// True if control runs, with the arm active or not.
    pub connected: bool,
    /// Mode that the safety module allows; `None` before its first reply.
    pub safety: Option<SafetyMode>,
    /// State of the pendant while the arm is not active.
    pub pendant: Option<Pendant>,
    /// The last error, which may be of an attempt to reconnect; kept when the arm is connected again.
    pub last_error: Option<CanError>,
    /// The error with which the arm was lost; kept too.
    pub loss: Option<CanError>,
    /// The reason why the position is unknown, until somebody confirms the home pose; the driver does not reconnect
    /// by itself meanwhile.
    pub position_lost: Option<CanError>,
    /// Number of successful connections.
    pub connections: u64,
    /// Control periods since then.
    pub periods: u64,
    /// Number of them that began more than a period late: the machine was busy.
    pub late_periods: u64,
    /// Number of control periods by how late they began, since the arm was last connected.
    pub delays: DelayHistogram,
    /// Real-time settings of the control thread, in words; empty before it has any.
    pub scheduling: String,
    /// Number of positions that did not arrive in time since then.
    pub missed_replies: u64,
    /// Last temperatures of the pucks, °C: queried one after the other, some times a second.
    pub temperatures: [Option<i32>; N],
    /// The reason why every joint holds and commands are refused although the arm is active: a puck is too hot.
    pub held: Option<String>,
}

impl<const N: usize> Default for CanStatus<N> {
    fn default() -> Self {
        Self {
            connected: false,
            safety: None,
            pendant: None,
            last_error: None,
            loss: None,
            position_lost: None,
            connections: 0,
            periods: 0,
            late_periods: 0,
            delays: DelayHistogram::default(),
            scheduling: String::new(),
            missed_replies: 0,
            temperatures: [None; N],
            held: None,
        }
    }
}

/// In words, for people.
impl<const N: usize> fmt::Display for CanStatus<N> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match (&self.last_error, self.safety) {
            (Some(error), _) if !self.connected => {
                write!(f, "{error}")?;
                match &self.position_lost {
                    Some(lost) if lost != error => write!(f, "; before that, {lost}"),
                    _ => Ok(()),
                }
            }
            (_, Some(SafetyMode::Active)) => match &self.held {
                Some(reason) => write!(f, "active, but it holds: {reason}"),
                None => write!(f, "active"),
            },
            (_, mode) => {
                let mode = match mode {
                    Some(SafetyMode::EmergencyStop) => "stopped by the emergency stop",
                    _ => "idle",
                };
                write!(f, "the safety module keeps the arm {mode}")?;
                if let Some(pendant) = self.pendant {
                    write!(f, " ({pendant})")?;
                }
                if let Some(reason) = &self.held {
                    write!(f, "; {reason}")?;
                }
                if self
                    .pendant
                    .is_some_and(|pendant| pendant.voltage() == Lamp::Fault)
                {
                    write!(
                        f,
                        "; check the power supply of the arm first: variable safety.VBUS is its voltage, safety.VOLTL2 and safety.VOLTH2 are the limits, in V"
                    )?;
                }
                write!(
                    f,
                    "; try Shift and Idle, then Shift and Activate on the pendant"
                )
            }
        }
    }
}

impl<const N: usize> ControlledArm<N> for CanArm<N> {
    fn description() -> String {
        format!("a {}-joint WAM arm on its CAN bus", count_word(N))
    }

    fn control(&self) -> &ArmControl<N> {
        &self.control
    }

    fn control_mut(&mut self) -> &mut ArmControl<N> {
        &mut self.control
    }

    fn fault(&self) -> Option<String> {
        let fine = self.status.connected && self.control.is_ready() && self.status.held.is_none();
        (!fine).then(|| self.status.to_string())
    }

    fn brake(&mut self) -> Result<(), DeviceError> {
        self.control.reachable()?;
        self.brake_requested = true;
        Ok(())
    }

    /// Errors: [`DeviceError::Remote`], [`DeviceError::NoDataYet`] in the first second.
    fn temperatures(&self) -> Result<[f64; N], DeviceError> {
        self.control.reachable()?;
        let mut known = [0.0; N];
        for (known, measured) in known.iter_mut().zip(self.status.temperatures) {
            let what = "temperature";
            *known = f64::from(measured.ok_or(DeviceError::NoDataYet { what })?);
        }
        Ok(known)
    }

    fn puck_property(
        device: &ArmDevice<Self, N>,
        motor: AxisIndex,
        property: PuckProperty,
    ) -> Result<i32, DeviceError> {
        property_request::run(device, Node::of_motor(motor.index()), property, None)
    }

    fn variables() -> Vec<String> {
        can_variables::names().collect()
    }

    fn variable(
        device: &ArmDevice<Self, N>,
        name: &str,
    ) -> Result<Vec<VariableValue>, DeviceError> {
        can_variables::variable(device, name)
    }

    fn set_variable(
        device: &ArmDevice<Self, N>,
        name: &str,
        value: &[VariableValue],
    ) -> Result<(), DeviceError> {
        let options = device.with(|arm| arm.options.clone());
        can_variables::set_variable(device, &options, name, value)
    }
}

impl<const N: usize> CanArm<N> {
    fn connected(&mut self, link: &ControlCycle<N>, position: &PositionRecord<N>) {
        let counts = position.counts;
        self.origins = position.origins;
        self.located = true;
        let motors = link.motors(self.control.model());
        self.control.set_motors(motors);
        self.control.set_error(None);
        self.control.set_refusal(None);
        self.brake_requested = false;
        self.control.set_ready(false);
        self.control.forget_motion(counts);
        self.status = CanStatus {
            connected: true,
            connections: self.status.connections + 1,
            last_error: self.status.last_error.take(),
            loss: self.status.loss.take(),
            scheduling: std::mem::take(&mut self.status.scheduling),
            ..CanStatus::default()
        };
    }

    /// Handles a lost or missing arm; the log has the reason, once for each loss and once for a repeated failure.
    fn failed(&mut self, error: &CanError) {
        self.control.set_ready(false);
        self.control.set_error(Some(error.to_arm_error(PEER)));
        if std::mem::take(&mut self.status.connected) {
            warn!(peer = PEER, %error, "lost the arm; it is braked");
            self.status.loss = Some(error.clone());
        } else if self.status.last_error.as_ref() != Some(error) {
            warn!(peer = PEER, %error, "the arm is still not reachable");
        }
        if error.kind.loses_position() {
            self.status.position_lost = Some(error.clone());
        }
        self.status.safety = None;
        self.status.last_error = Some(error.clone());
        self.property_requests.clear();
    }

    /// Returns the next attempt to connect, and where its result goes; `None` while the arm waits for a person.
    fn next_attempt(&mut self) -> Option<(Attempt<N>, Option<StartOutcome>)> {
        if let Some(answer) = self.confirmation.take() {
            return Some((Attempt::HomeConfirmed, Some(answer)));
        }
        let known = self.known_position()?;
        Some((Attempt::Reconnect { known }, None))
    }

    /// Returns the last known position; `None` once it is lost.
    pub(super) fn known_position(&self) -> Option<PositionRecord<N>> {
        (self.located && self.status.position_lost.is_none()).then(|| PositionRecord {
            counts: self.control.motor_counts(),
            origins: self.origins,
        })
    }

    /// Returns the angles of the rotors with the joints at zero, rad.
    pub(super) fn zero_angles(&self) -> Option<[f64; N]> {
        self.options.zero_angles
    }

    /// Sets them, for the next confirmation of the home pose.
    pub(super) fn set_zero_angles(&mut self, angles: [f64; N]) {
        self.options.zero_angles = Some(angles);
    }

    /// Queues a query for the thread of the bus, if the arm is connected.
    pub(super) fn queue_property_request(
        &mut self,
        property_request: PropertyRequest,
    ) -> Result<(), DeviceError> {
        self.control.reachable()?;
        self.property_requests.push_back(property_request);
        Ok(())
    }

    /// Stops the joints and refuses commands while a puck is too hot, and has the arm braked when it is much too hot.
    fn follow_health(&mut self, link: &ControlCycle<N>) {
        let health = link.health();
        if health.is_too_hot() != self.status.held.is_some() {
            self.status.held = health.too_hot();
            self.control.set_refusal(
                self.status.held.as_ref().map(|reason| ArmError {
                    peer: PEER.to_owned(),
                    step: format!("a command ({reason})"),
                    advice: "again when the puck has cooled; Shift and Idle lets the motors rest"
                        .to_owned(),
                }),
            );
        }
        self.brake_requested |= health.brakes() && self.control.is_ready();
    }

    /// From counts to torques, Nm.
    fn period(&mut self, link: &ControlCycle<N>, counts: [i32; N]) -> crate::kinematics::Joints<N> {
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
        self.follow_health(link);
        self.status.safety = link.safety();
        self.status.pendant = link.pendant();
        self.status.missed_replies = link.missed_replies();
        self.status.temperatures = link.temperatures();
        self.status.periods += 1;
        self.control.drive()
    }
}

impl CanWam {
    /// Connects Barrett's arm on an interface of the kernel, like `can0`, which is up at 1 Mbit/s.
    ///
    /// Blocks until the arm is found, a second or so. Errors: as [`start`](Self::start).
    #[cfg(target_os = "linux")]
    pub fn on_interface(interface: &str, options: CanOptions) -> Result<Self, DeviceError> {
        Self::on_interface_with(WamModel::<AXES>::new(), interface, options)
    }
}

impl<const N: usize> CanWam<N> {
    /// Connects an arm of this model on an interface of the kernel; as [`on_interface`](Self::on_interface).
    #[cfg(target_os = "linux")]
    pub fn on_interface_with(
        model: WamModel<N>,
        interface: &str,
        options: CanOptions<N>,
    ) -> Result<Self, DeviceError> {
        let interface = interface.to_owned();
        let open = move || {
            let bus = crate::can::SocketCan::open(&interface)?;
            Ok(Box::new(bus) as Box<dyn CanBus>)
        };
        Self::start(model, options, Box::new(open))
    }

    /// Connects an arm on a bus.
    ///
    /// Blocks until the arm is found, a second or so. Errors: [`DeviceError::Remote`] with the step that failed,
    /// [`DeviceError::Start`] when the machine has no thread left.
    pub fn start(
        model: WamModel<N>,
        options: CanOptions<N>,
        mut open: OpenBus,
    ) -> Result<Self, DeviceError> {
        let known = options.position_file.as_deref();
        let known = known.and_then(PositionRecord::load);
        let found = connect(&mut open, &model, &options, Attempt::First { known });
        let counts = match &found {
            Ok((_, position)) => position.counts,
            // The arm is there, and waits for a person.
            Err(error) if waits_for_person(&error.kind) => model.transmission.counts(&model.home),
            Err(error) => return Err(DeviceError::from(&error.to_arm_error(PEER))),
        };
        let mut arm = CanArm {
            control: ArmControl::new(model, options.period, counts),
            status: CanStatus::default(),
            options: options.clone(),
            origins: [None; N],
            located: false,
            property_requests: VecDeque::new(),
            confirmation: None,
            brake_requested: false,
        };
        let link = match found {
            Ok((link, position)) => {
                arm.connected(&link, &position);
                Some(link)
            }
            Err(error) => {
                arm.failed(&error);
                None
            }
        };
        Self::spawn(arm, "can-wam", move |shared| {
            thread::scope(|scope| {
                if let Some(path) = &options.position_file {
                    let keeper = thread::Builder::new().name("can-wam-position".into());
                    let started = keeper.spawn_scoped(scope, || position_file::keep(shared, path));
                    if let Err(error) = started {
                        warn!(%error, "no thread to keep the last known position of the arm");
                    }
                }
                #[cfg(target_os = "linux")]
                {
                    let applied = options.real_time.apply().to_string();
                    shared.lock().arm.status.scheduling = applied;
                }
                run(shared, link, open, &options);
            });
        })
    }

    /// Confirms that the arm is folded in its home pose now, after its position was lost or when it was never known.
    ///
    /// The driver connects and tells the pucks where they are. Whoever calls this looks at the arm: a wrong confirmation
    /// makes it swing. Blocks until the arm is connected, seconds when pucks have to wake. A confirmation is for one
    /// attempt.
    ///
    /// Errors: [`DeviceError::NotSupported`] while the position is known; [`DeviceError::Remote`] with the step that
    /// failed, then the position stays lost.
    pub fn confirm_home(&self) -> Result<(), DeviceError> {
        let (answer, result) = sync_channel(1);
        self.with(|arm| {
            if arm.status.position_lost.is_none() {
                return Err(DeviceError::NotSupported {
                    what: "confirming the home pose of an arm that knows its position".to_owned(),
                });
            }
            arm.confirmation = Some(answer);
            Ok(())
        })?;
        match result.recv_timeout(CONFIRMATION_TIMEOUT) {
            Ok(result) => result.map_err(|error| DeviceError::from(&error.to_arm_error(PEER))),
            Err(_) => {
                self.with(|arm| arm.confirmation = None);
                Err(DeviceError::Remote {
                    peer: PEER.to_owned(),
                    step: "confirming the home pose (no attempt ended in time)".to_owned(),
                    advice: "again, and the state of the bus".to_owned(),
                    source: None,
                })
            }
        }
    }

    /// Returns the state of the connection.
    pub fn status(&self) -> CanStatus<N> {
        self.with(|arm| arm.status.clone())
    }
}

/// Returns whether a start that failed so leaves an arm that waits for a person.
fn waits_for_person(error: &CanErrorKind) -> bool {
    matches!(
        error,
        CanErrorKind::HomeUnconfirmed
            | CanErrorKind::CountsChanged { .. }
            | CanErrorKind::OriginChanged { .. }
            | CanErrorKind::HomeContradicted { .. }
    )
}

/// Drives the arm, and reconnects after a loss, until stopped. Once the position is lost, a person has to confirm it.
fn run<const N: usize>(
    shared: &Shared<CanArm<N>>,
    mut link: Option<ControlCycle<N>>,
    mut open: OpenBus,
    options: &CanOptions<N>,
) {
    let model = shared.lock().arm.control.model().clone();
    while !shared.is_ending() {
        let error = match link.take() {
            Some(mut link) => match drive(shared, &mut link, &model, options) {
                Ok(()) => return link.brake(),
                Err(error) => {
                    link.brake();
                    link.explain(error)
                }
            },
            None => {
                let next = shared.lock().arm.next_attempt();
                let Some((attempt, answer)) = next else {
                    wait(shared, options.retry_interval);
                    continue;
                };
                let current = shared.lock().arm.options.clone();
                let found = connect(&mut open, &model, &current, attempt);
                let result = match found {
                    Ok((found, position)) => {
                        shared.lock().arm.connected(&found, &position);
                        link = Some(found);
                        Ok(())
                    }
                    Err(error) => Err(error),
                };
                if let Err(error) = &result {
                    shared.lock().arm.failed(error);
                }
                if let Some(answer) = answer {
                    // The caller may have stopped waiting.
                    let _ = answer.try_send(result.clone());
                }
                if result.is_err() {
                    wait(shared, options.retry_interval);
                }
                continue;
            }
        };
        shared.lock().arm.failed(&error);
        wait(shared, options.retry_interval);
    }
}

/// Waits for the next attempt: until stopped, until somebody confirms the home pose, or for this long.
fn wait<const N: usize>(shared: &Shared<CanArm<N>>, time: Duration) {
    let again = Instant::now() + time;
    while !shared.is_ending() && shared.lock().arm.confirmation.is_none() {
        let left = again.saturating_duration_since(Instant::now());
        if left.is_zero() {
            return;
        }
        thread::park_timeout(left.min(CONFIRMATION_POLL_INTERVAL));
    }
}

/// Runs control periods until stopped, or until a step fails.
fn drive<const N: usize>(
    shared: &Shared<CanArm<N>>,
    link: &mut ControlCycle<N>,
    model: &WamModel<N>,
    options: &CanOptions<N>,
) -> Result<(), CanError> {
    let mut timer = PeriodicTimer::new(Instant::now(), options.period, MissedCycles::CatchUp);
    while timer.wait(|| shared.is_ending()) {
        let counts = link.positions()?;
        let (torques, property_request, brakes) = {
            let mut timed = shared.lock();
            timed.stamp();
            timed.arm.status.late_periods = timer.statistics().late;
            timed.arm.status.delays = timer.statistics().delays;
            let torques = timed.arm.period(link, counts);
            let brakes = std::mem::take(&mut timed.arm.brake_requested);
            let property_request = link
                .is_free()
                .then(|| timed.arm.property_requests.pop_front());
            (torques, property_request.flatten(), brakes)
        };
        if brakes {
            warn!("the safety module is told to brake the arm");
            link.brake();
        }
        link.drive(model, &torques)?;
        if let Some(property_request) = property_request {
            link.run(property_request)?;
        }
    }
    Ok(())
}
