//! From a bus to an arm that is ready for control.

use std::time::Duration;

use tracing::{debug, info, warn};

use super::can_error::AtStep;
use super::control_cycle::ControlCycle;
use super::puck_bus::PuckBus;
use super::puck_health::puck_limit;
use super::zero_calibration::marks_at_home;
use super::{CanError, CanErrorKind, CanOptions, CanStep, OpenBus, PositionRecord};
use crate::can::puck::{Group, Node, PuckProperty, mode, role, status};
use crate::wam::{AXES, WamModel};

/// Between messages that configure the safety module (libbarrett).
const CONFIGURATION_INTERVAL: Duration = Duration::from_millis(10);
/// Time without frames after the commands to wake: pucks start their firmware, and frames meanwhile can drive the bus
/// into bus-off (libbarrett).
const WAKE_SILENCE: Duration = Duration::from_secs(1);
/// Minimum time between queries to a puck that is not awake.
const MIN_WAKE_POLL_INTERVAL: Duration = Duration::from_millis(1);
/// The firmware from which on properties have the numbers of [`PuckProperty`].
const MIN_FIRMWARE_VERSION: i32 = 65;
/// Velocities of the safety module are in m/s / 4096.
const VELOCITY_UNITS: f64 = 4096.0;
/// The largest property of 16 bits.
const MAX_PROPERTY_VALUE: f64 = i16::MAX as f64;
/// Distance by which a joint may seem to be outside its limits, rad: stops are outside too, and cables stretch.
const LIMIT_MARGIN: f64 = 0.2;
/// Maximum motion of a joint that is believed after the driver did not see it, rad: motors follow the last torque until
/// the safety module misses its heartbeat, and may reach its velocity limit until then.
const MAX_UNSEEN_MOTION: f64 = 1.0;
/// Firmware from which on `MECH` is the absolute angle of the rotor (libbarrett).
const MIN_ABSOLUTE_FIRMWARE_VERSION: i32 = 118;
/// Tolerance of the origin of a puck's position, whose two parts are read one after the other while the arm may sink: a
/// turn divided by this.
const ORIGIN_TOLERANCE_DIVISOR: i32 = 16;
/// Maximum distance from home of pucks that know their positions when somebody confirms home at the start, rad.
const HOME_TOLERANCE: f64 = 0.2;
/// Tolerance of a written position when it is read back: a turn divided by this.
const POSITION_TOLERANCE_DIVISOR: i32 = 4;

/// Units of a puck, and its groups.
#[derive(Clone, Copy, Debug)]
pub(super) struct PuckUnits {
    /// Units of torque per Nm of the motor.
    pub(super) per_newton_metre: f64,
    /// The largest torque it follows, in units.
    pub(super) largest: f64,
    /// Group of torque frames that it follows.
    pub(super) torque_group: Group,
    /// Its slot in there, from 0.
    pub(super) slot: usize,
    /// Group in which its position is queried.
    pub(super) group: Group,
    /// Maximum temperature of the puck, °C.
    pub(super) temperature_limit: i32,
}

/// The source of the arm's position.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Attempt<const N: usize> {
    /// The driver starts: the position is that of a confirmed home pose, or of pucks that were told before.
    First {
        /// The last known position, of an earlier driver.
        known: Option<PositionRecord<N>>,
    },
    /// The pucks have kept the position, which is compared with the last known one.
    Reconnect {
        /// The position when the arm was lost.
        known: PositionRecord<N>,
    },
    /// A person says that the arm is folded at home now.
    HomeConfirmed,
}

/// Prepares an arm for control; returns its position.
///
/// At the first attempt and after a confirmation the pucks are told where they are. After a loss they must know, and the
/// driver never tells the safety module that they do. The safety module is commanded to brake, except at the first
/// attempt, so that nothing moves until the pendant is pressed.
pub(super) fn connect<const N: usize>(
    open: &mut OpenBus,
    model: &WamModel<N>,
    options: &CanOptions<N>,
    attempt: Attempt<N>,
) -> Result<(ControlCycle<N>, PositionRecord<N>), CanError> {
    let bus = open().at_step(CanStep::Open)?;
    let mut bus = PuckBus::new(bus, options.property_timeout);
    if !matches!(attempt, Attempt::First { .. }) {
        // When the arm was lost the command to brake may have been lost as well, and the bus may be back before the
        // safety module misses a heartbeat.
        bus.set_property(Node::SAFETY, PuckProperty::MODE, mode::SAFETY_IDLE)
            .at_step(CanStep::Find)?;
    }
    let asleep = find::<N>(&mut bus, options.scan_interval)?;
    if matches!(attempt, Attempt::Reconnect { .. })
        && let Some(&node) = asleep.iter().find(|&&node| node != Node::SAFETY)
    {
        return Err(CanErrorKind::PositionLost { node }).at_step(CanStep::Wake);
    }
    wake(&mut bus, &asleep, options).at_step(CanStep::Wake)?;
    identify::<N>(&mut bus).at_step(CanStep::Identify)?;
    let units = read_units(&mut bus, model).at_step(CanStep::Units)?;
    set_limits(&mut bus, options).at_step(CanStep::Limits)?;
    zero(&mut bus, model, options, attempt, !asleep.is_empty()).at_step(CanStep::Zero)?;
    let counts = locate(&mut bus, model).at_step(CanStep::Locate)?;
    let origins = read_origins(&mut bus, model).at_step(CanStep::Locate)?;
    info!(?counts, "the arm on the CAN bus is there");
    let position = PositionRecord { counts, origins };
    let cycle = ControlCycle::new(bus, units, model, options, &position);
    Ok((cycle, position))
}

/// All nodes that the arm needs.
fn arm<const N: usize>() -> impl Iterator<Item = Node> {
    (0..N).map(Node::of_motor).chain([Node::SAFETY])
}

/// Asks every node whether it is there; answers which of the arm's are asleep.
fn find<const N: usize>(bus: &mut PuckBus, time: Duration) -> Result<Vec<Node>, CanError> {
    let mut states = [None; 32];
    for number in 1..32 {
        let Some(node) = Node::new(number) else {
            continue;
        };
        let state = bus
            .try_get_property(node, PuckProperty::STAT, time)
            .at_step(CanStep::Find)?;
        states[usize::from(number)] = state;
        if let Some(state) = state {
            debug!(%node, state, "on the bus");
        }
    }
    // An arm whose wrist nobody controls or compensates for would swing.
    for node in (N..AXES).map(Node::of_motor) {
        let joints = N;
        // A slow adapter answers after the scan.
        match bus.get_property(node, PuckProperty::STAT) {
            Err(CanErrorKind::Silent { .. }) => {}
            Ok(_) => {
                return Err(CanErrorKind::UnexpectedMotor { node, joints }).at_step(CanStep::Find);
            }
            Err(error) => return Err(error).at_step(CanStep::Find),
        }
    }
    let mut asleep = Vec::new();
    for node in arm::<N>() {
        let state = match states[usize::from(node.number())] {
            Some(state) => state,
            None => match bus.get_property(node, PuckProperty::STAT) {
                Err(CanErrorKind::Silent { .. }) if bus.is_stopped().at_step(CanStep::Find)? => {
                    return Err(CanErrorKind::EmergencyStop).at_step(CanStep::Find);
                }
                state => state.at_step(CanStep::Find)?,
            },
        };
        if state == status::ERROR {
            let code = ask_once(bus, node, PuckProperty::ERROR).at_step(CanStep::Find)?;
            let code = code.unwrap_or_default();
            return Err(CanErrorKind::PuckError { node, code }).at_step(CanStep::Find);
        }
        if state != status::READY {
            asleep.push(node);
        }
    }
    Ok(asleep)
}

/// Wakes pucks, waits a second, and asks each until it is awake, all of them within the timeout for waking.
///
/// Time is counted in queries, so that it is the time of the bus.
fn wake<const N: usize>(
    bus: &mut PuckBus,
    asleep: &[Node],
    options: &CanOptions<N>,
) -> Result<(), CanErrorKind> {
    if asleep.is_empty() {
        return Ok(());
    }
    for &node in asleep {
        bus.set_property(node, PuckProperty::STAT, status::READY)?;
        bus.discard_for(CONFIGURATION_INTERVAL)?;
    }
    bus.discard_for(WAKE_SILENCE)?;
    let interval = options.property_timeout.max(MIN_WAKE_POLL_INTERVAL);
    let mut left = options.wake_timeout;
    for &node in asleep {
        loop {
            let state = bus.try_get_property(node, PuckProperty::STAT, interval)?;
            match state {
                Some(status::READY) => break,
                Some(state) if left.is_zero() => {
                    return Err(unexpected(node, PuckProperty::STAT, "2, awake", state));
                }
                None if left.is_zero() => return Err(CanErrorKind::Silent { node }),
                Some(_) => {
                    // The command may have been lost.
                    bus.set_property(node, PuckProperty::STAT, status::READY)?;
                    bus.discard_for(interval)?;
                }
                None => {}
            }
            left = left.saturating_sub(interval);
        }
    }
    Ok(())
}

fn identify<const N: usize>(bus: &mut PuckBus) -> Result<(), CanErrorKind> {
    for node in arm::<N>() {
        let version = bus.get_property(node, PuckProperty::VERS)?;
        if version < MIN_FIRMWARE_VERSION {
            let expected = format!("a firmware of {MIN_FIRMWARE_VERSION} or newer");
            return Err(unexpected(node, PuckProperty::VERS, &expected, version));
        }
        let (wanted, expected) = match node {
            Node::SAFETY => (role::SAFETY, "the role of a safety module"),
            _ => (role::MOTOR, "the role of a motor"),
        };
        let got = bus.get_property(node, PuckProperty::ROLE)?;
        if got & role::MASK != wanted {
            return Err(unexpected(node, PuckProperty::ROLE, expected, got));
        }
    }
    Ok(())
}

fn read_units<const N: usize>(
    bus: &mut PuckBus,
    model: &WamModel<N>,
) -> Result<Vec<PuckUnits>, CanErrorKind> {
    let turn = model.transmission.counts_per_turn();
    let mut units: Vec<PuckUnits> = Vec::new();
    for node in (0..N).map(Node::of_motor) {
        let counts = bus.get_property(node, PuckProperty::CTS)?;
        if u32::try_from(counts) != Ok(turn) {
            let expected = format!("{turn} counts per turn as in the model");
            return Err(unexpected(node, PuckProperty::CTS, &expected, counts));
        }
        let per_newton_metre = positive(bus, node, PuckProperty::IPNM)?;
        let largest = positive(bus, node, PuckProperty::MT)?;
        let slot = bus.get_property(node, PuckProperty::PIDX)?;
        let torque_group = group(bus, node, PuckProperty::GRPB)?;
        let found = PuckUnits {
            per_newton_metre,
            largest,
            torque_group,
            slot: match slot {
                1..=4 => (slot - 1) as usize,
                _ => {
                    return Err(unexpected(
                        node,
                        PuckProperty::PIDX,
                        "a slot from 1 to 4",
                        slot,
                    ));
                }
            },
            group: group(bus, node, PuckProperty::GRPC)?,
            temperature_limit: puck_limit(ask_once(bus, node, PuckProperty::OTEMP)?),
        };
        let same_slot = |other: &PuckUnits| {
            (other.torque_group, other.slot) == (found.torque_group, found.slot)
        };
        if units.iter().any(same_slot) {
            let expected = "a slot that no other puck of its group has";
            return Err(unexpected(node, PuckProperty::PIDX, expected, slot));
        }
        units.push(found);
    }
    Ok(units)
}

/// Reads a property that a puck need not have; `None` without an answer.
fn ask_once(
    bus: &mut PuckBus,
    node: Node,
    property: PuckProperty,
) -> Result<Option<i32>, CanErrorKind> {
    match bus.get_property(node, property) {
        Err(CanErrorKind::Silent { .. }) => Ok(None),
        told => told.map(Some),
    }
}

fn positive(bus: &mut PuckBus, node: Node, property: PuckProperty) -> Result<f64, CanErrorKind> {
    match bus.get_property(node, property)? {
        value if value > 0 => Ok(f64::from(value)),
        value => Err(unexpected(node, property, "more than 0", value)),
    }
}

fn group(bus: &mut PuckBus, node: Node, property: PuckProperty) -> Result<Group, CanErrorKind> {
    let value = bus.get_property(node, property)?;
    u8::try_from(value)
        .ok()
        .and_then(Group::new)
        .ok_or_else(|| unexpected(node, property, "a group from 0 to 31", value))
}

/// Returns the limits of the safety module, in its units.
pub(super) fn limits_in_units<const N: usize>(options: &CanOptions<N>) -> [(PuckProperty, i32); 4] {
    let limits = options.limits;
    [
        (PuckProperty::VL1, limits.velocity_warning * VELOCITY_UNITS),
        (PuckProperty::VL2, limits.velocity_fault * VELOCITY_UNITS),
        (PuckProperty::TL1, limits.torque_warning),
        (PuckProperty::TL2, limits.torque_fault),
    ]
    .map(|(property, value)| (property, value.clamp(0.0, MAX_PROPERTY_VALUE) as i32))
}

fn set_limits<const N: usize>(
    bus: &mut PuckBus,
    options: &CanOptions<N>,
) -> Result<(), CanErrorKind> {
    for (property, value) in limits_in_units(options) {
        bus.set_property(Node::SAFETY, property, value)?;
        bus.discard_for(CONFIGURATION_INTERVAL)?;
        let got = bus.get_property(Node::SAFETY, property)?;
        if got != value {
            let expected = format!("{value}, which was written");
            return Err(unexpected(Node::SAFETY, property, &expected, got));
        }
    }
    Ok(())
}

/// Tells the pucks where they are, unless they know, and only when somebody has confirmed where that is.
fn zero<const N: usize>(
    bus: &mut PuckBus,
    model: &WamModel<N>,
    options: &CanOptions<N>,
    attempt: Attempt<N>,
    restarted: bool,
) -> Result<(), CanErrorKind> {
    let zeroed = bus.get_property(Node::SAFETY, PuckProperty::ZERO)? != 0;
    match attempt {
        Attempt::Reconnect { .. } if !zeroed => return Err(CanErrorKind::SafetyRestarted),
        Attempt::Reconnect { known } => return compare(bus, model, &known),
        Attempt::First { known } => {
            let kept = zeroed && !restarted && !look_restarted(bus, model)?;
            match (known.filter(|_| kept), options.home_confirmed) {
                (Some(known), confirmed) => match compare(bus, model, &known) {
                    Err(error) if confirmed && error.loses_position() => {}
                    compared => return compared,
                },
                (None, true) => {}
                (None, false) => return Err(CanErrorKind::HomeUnconfirmed),
            }
            if kept {
                return check_home(bus, model);
            }
        }
        Attempt::HomeConfirmed => {}
    }
    if bus.get_property(Node::SAFETY, PuckProperty::MODE)? == mode::TORQUE_OR_ACTIVE {
        return Err(CanErrorKind::Active);
    }
    // Rotors seem to jump while their positions are written.
    bus.set_property(Node::SAFETY, PuckProperty::IFAULT, N as i32 + 1)?;
    bus.discard_for(CONFIGURATION_INTERVAL)?;
    let turn = model.transmission.counts_per_turn() as i32;
    let home = model.transmission.counts(&model.home);
    let marks = marks(model, options);
    for (motor, &counts) in home.iter().enumerate() {
        let node = Node::of_motor(motor);
        let counts = counts + off_home(bus, node, marks[motor], turn)?;
        bus.set_property(node, PuckProperty::P, counts)?;
        bus.discard_for(CONFIGURATION_INTERVAL)?;
        let got = bus.get_position(node)?;
        if got.abs_diff(counts) > turn.unsigned_abs() / POSITION_TOLERANCE_DIVISOR as u32 {
            let expected = format!("{counts}, which was written");
            return Err(unexpected(node, PuckProperty::P, &expected, got));
        }
    }
    declare_zeroed(bus)
}

/// Returns whether all rotors are within their first turn, as after a power-up from which pucks woke by themselves.
fn look_restarted<const N: usize>(
    bus: &mut PuckBus,
    model: &WamModel<N>,
) -> Result<bool, CanErrorKind> {
    let turn = model.transmission.counts_per_turn() as i32;
    for motor in 0..N {
        if !(0..turn).contains(&bus.get_position(Node::of_motor(motor))?) {
            return Ok(false);
        }
    }
    Ok(true)
}

/// Compares positions with those before the connection was lost.
///
/// A puck that restarted is within its first turn, wherever it was before. The arm may have sunk or have been led
/// meanwhile; more than [`MAX_UNSEEN_MOTION`] is not believed.
pub(super) fn compare<const N: usize>(
    bus: &mut PuckBus,
    model: &WamModel<N>,
    record: &PositionRecord<N>,
) -> Result<(), CanErrorKind> {
    let turn = model.transmission.counts_per_turn() as i32;
    let known = &record.counts;
    let mut now = [0; N];
    for (motor, slot) in now.iter_mut().enumerate() {
        *slot = bus.get_position(Node::of_motor(motor))?;
    }
    let moved = model.transmission.joints(&now) - model.transmission.joints(known);
    for motor in 0..N {
        let far = now[motor].abs_diff(known[motor]) >= turn.unsigned_abs() / 2;
        let restarted = far && (0..turn).contains(&now[motor]);
        let turns = |joint: usize| model.transmission.turns(motor, joint);
        let mut joints = (0..N).filter(|&joint| turns(joint));
        if restarted || joints.any(|joint| moved[joint].abs() > MAX_UNSEEN_MOTION) {
            return Err(CanErrorKind::CountsChanged {
                node: Node::of_motor(motor),
                before: known[motor],
                now: now[motor],
            });
        }
    }
    let origins = read_origins(bus, model)?;
    for (motor, origins) in record.origins.into_iter().zip(origins).enumerate() {
        if let (Some(before), Some(now)) = origins
            && within_turn(now - before, turn).abs() > turn / ORIGIN_TOLERANCE_DIVISOR
        {
            let node = Node::of_motor(motor);
            return Err(CanErrorKind::OriginChanged { node });
        }
    }
    Ok(())
}

/// Returns the position of each puck minus the absolute angle of its rotor, within a turn.
fn read_origins<const N: usize>(
    bus: &mut PuckBus,
    model: &WamModel<N>,
) -> Result<[Option<i32>; N], CanErrorKind> {
    let turn = model.transmission.counts_per_turn() as i32;
    let mut origins = [None; N];
    for (motor, origin) in origins.iter_mut().enumerate() {
        let node = Node::of_motor(motor);
        if has_absolute_encoder(bus, node)? {
            let angle = bus.get_property(node, PuckProperty::MECH)?;
            let counts = bus.get_position(node)?;
            *origin = Some(counts.wrapping_sub(angle).rem_euclid(turn));
        }
    }
    Ok(origins)
}

/// Checks that pucks which know their positions are at home, as somebody confirmed.
fn check_home<const N: usize>(bus: &mut PuckBus, model: &WamModel<N>) -> Result<(), CanErrorKind> {
    let away = model.transmission.joints(&locate(bus, model)?) - model.home;
    match (0..N).find(|&joint| away[joint].abs() > HOME_TOLERANCE) {
        Some(joint) => Err(CanErrorKind::HomeContradicted {
            joint,
            degrees: away[joint].to_degrees(),
        }),
        None => Ok(()),
    }
}

/// Returns the value of `MECH` of each puck at home, where it is known.
fn marks<const N: usize>(model: &WamModel<N>, options: &CanOptions<N>) -> [Option<i32>; N] {
    match (&options.home_marks, &options.zero_angles) {
        (Some(marks), _) => marks.map(Some),
        (None, Some(zero_angles)) => marks_at_home(zero_angles, model),
        (None, None) => [None; N],
    }
}

/// Returns whether `MECH` of a puck is the absolute angle of its rotor (libbarrett, `low_level_wam`).
fn has_absolute_encoder(bus: &mut PuckBus, node: Node) -> Result<bool, CanErrorKind> {
    Ok(
        bus.get_property(node, PuckProperty::VERS)? >= MIN_ABSOLUTE_FIRMWARE_VERSION
            && bus.get_property(node, PuckProperty::ROLE)? & role::ABSOLUTE_ENCODER != 0,
    )
}

/// Returns a difference of angles as the smaller way round, counts.
fn within_turn(difference: i32, turn: i32) -> i32 {
    let off = difference.rem_euclid(turn);
    if off >= turn / 2 { off - turn } else { off }
}

/// Returns the distance of a rotor from its position at home, by its mark, within half a turn (libbarrett,
/// `low_level_wam`).
fn off_home(
    bus: &mut PuckBus,
    node: Node,
    mark: Option<i32>,
    turn: i32,
) -> Result<i32, CanErrorKind> {
    let Some(mark) = mark else {
        return Ok(0);
    };
    if !has_absolute_encoder(bus, node)? {
        warn!(%node, "no absolute encoder: its mark is ignored, and home assumed to be exact");
        return Ok(0);
    }
    let angle = bus.get_property(node, PuckProperty::MECH)?;
    if !(0..turn).contains(&angle) {
        let expected = format!("an angle from 0 to {}", turn - 1);
        return Err(unexpected(node, PuckProperty::MECH, &expected, angle));
    }
    Ok(within_turn(angle - mark.rem_euclid(turn), turn))
}

fn declare_zeroed(bus: &mut PuckBus) -> Result<(), CanErrorKind> {
    bus.set_property(Node::SAFETY, PuckProperty::ZERO, 1)?;
    bus.discard_for(CONFIGURATION_INTERVAL)?;
    match bus.get_property(Node::SAFETY, PuckProperty::ZERO)? {
        0 => Err(unexpected(
            Node::SAFETY,
            PuckProperty::ZERO,
            "1, which was written",
            0,
        )),
        _ => Ok(()),
    }
}

/// Reads the positions of all motors; they must be plausible for the joints.
fn locate<const N: usize>(
    bus: &mut PuckBus,
    model: &WamModel<N>,
) -> Result<[i32; N], CanErrorKind> {
    let mut counts = [0; N];
    for (motor, slot) in counts.iter_mut().enumerate() {
        *slot = bus.get_position(Node::of_motor(motor))?;
    }
    let joints = model.transmission.joints(&counts);
    for (joint, limits) in model.chain.limits().iter().enumerate() {
        let angle = joints[joint];
        if angle < limits.min - LIMIT_MARGIN || angle > limits.max + LIMIT_MARGIN {
            let degrees = angle.to_degrees();
            return Err(CanErrorKind::Implausible { joint, degrees });
        }
    }
    Ok(counts)
}

fn unexpected(node: Node, property: PuckProperty, expected: &str, got: i32) -> CanErrorKind {
    CanErrorKind::Unexpected {
        node,
        property,
        expected: expected.to_owned(),
        got,
    }
}
