//! From a bus to an arm that is ready for control.

use std::time::Duration;

use tracing::{debug, info};

use super::cycle::Link;
use super::line::Line;
use super::trouble::During;
use super::{CanOptions, CanTrouble, OpenBus, Problem, Step};
use crate::can::puck::{Group, Node, Property, mode, role, status};
use crate::wam::{AXES, WamModel};

/// Between messages that configure the safety module (libbarrett).
const SETTLE: Duration = Duration::from_millis(10);
/// How often a puck is asked whether it is awake: it takes up to a second (libbarrett), three questions each.
const WAKE_TRIES: usize = 10;
/// The firmware from which on properties have the numbers of [`Property`].
const OLDEST_FIRMWARE: i32 = 65;
/// Velocities of the safety module are in m/s / 4096.
const VELOCITY_UNITS: f64 = 4096.0;
/// The largest property of 16 bits.
const LARGEST: f64 = i16::MAX as f64;
/// How far outside its limits a joint may seem to stand, rad: stops are outside too, and cables stretch.
const SLACK: f64 = 0.2;
/// How far a position that was written may be off when it is read, in parts of a turn.
const MOVED: i32 = 4;

/// In which units a puck speaks, and where it listens.
#[derive(Clone, Copy, Debug)]
pub(super) struct PuckUnits {
    /// Units of torque per Nm of the motor.
    pub(super) per_newton_metre: f64,
    /// The largest torque it follows, in units.
    pub(super) largest: f64,
    /// Which frame of torques it follows.
    pub(super) torque_group: Group,
    /// Its slot in there, from 0.
    pub(super) slot: usize,
    /// In which group it is asked for its position.
    pub(super) group: Group,
}

/// Brings an arm to the point where its control can begin; answers where it stands.
///
/// `first`: the arm may be told that it stands folded at home. Later it must know by itself where it is, and the
/// safety module is told to brake, so that nothing moves until the pendant is pressed.
pub(super) fn connect(
    open: &mut OpenBus,
    model: &WamModel<AXES>,
    options: &CanOptions,
    first: bool,
) -> Result<(Link, [i32; AXES]), CanTrouble> {
    let bus = open().during(Step::Open)?;
    let mut line = Line::new(bus, options.patience);
    if !first {
        // When the arm was lost the order to brake may have been lost as well, and the bus may be back before the safety
        // module misses anything.
        line.tell(Node::SAFETY, Property::MODE, mode::SAFETY_IDLE)
            .during(Step::Find)?;
    }
    let asleep = find(&mut line, options.scan)?;
    if !first && let Some(&node) = asleep.iter().find(|&&node| node != Node::SAFETY) {
        return Err(Problem::PositionLost { node }).during(Step::Wake);
    }
    wake(&mut line, &asleep).during(Step::Wake)?;
    identify(&mut line).during(Step::Identify)?;
    let units = read_units(&mut line, model).during(Step::Units)?;
    set_limits(&mut line, options).during(Step::Limits)?;
    zero(&mut line, model, options, first, !asleep.is_empty()).during(Step::Zero)?;
    let counts = locate(&mut line, model).during(Step::Locate)?;
    info!(?counts, "the arm on the CAN bus is there");
    Ok((Link::new(line, units, options, counts), counts))
}

/// All whom the arm needs.
fn arm() -> impl Iterator<Item = Node> {
    (0..AXES).map(Node::of_motor).chain([Node::SAFETY])
}

/// Asks every node whether it is there; answers which of the arm's are asleep.
fn find(line: &mut Line, time: Duration) -> Result<Vec<Node>, CanTrouble> {
    let mut states = [None; 32];
    for number in 1..32 {
        let Some(node) = Node::new(number) else {
            continue;
        };
        let state = line
            .ask_once(node, Property::STAT, time)
            .during(Step::Find)?;
        states[usize::from(number)] = state;
        if let Some(state) = state {
            debug!(%node, state, "on the bus");
        }
    }
    let mut asleep = Vec::new();
    for node in arm() {
        let state = match states[usize::from(node.number())] {
            Some(state) => state,
            None => line.ask(node, Property::STAT).during(Step::Find)?,
        };
        if state != status::READY {
            asleep.push(node);
        }
    }
    Ok(asleep)
}

fn wake(line: &mut Line, asleep: &[Node]) -> Result<(), Problem> {
    for &node in asleep {
        line.tell(node, Property::STAT, status::READY)?;
        line.pause(SETTLE)?;
    }
    for &node in asleep {
        let mut state = line.ask(node, Property::STAT)?;
        for _ in 0..WAKE_TRIES {
            if state == status::READY {
                break;
            }
            line.pause(SETTLE * 10)?;
            state = line.ask(node, Property::STAT)?;
        }
        if state != status::READY {
            return Err(unexpected(node, Property::STAT, "2, awake", state));
        }
    }
    Ok(())
}

fn identify(line: &mut Line) -> Result<(), Problem> {
    for node in arm() {
        let version = line.ask(node, Property::VERS)?;
        if version < OLDEST_FIRMWARE {
            let expected = format!("a firmware of {OLDEST_FIRMWARE} or newer");
            return Err(unexpected(node, Property::VERS, &expected, version));
        }
        let (wanted, expected) = match node {
            Node::SAFETY => (role::SAFETY, "the role of a safety module"),
            _ => (role::MOTOR, "the role of a motor"),
        };
        let got = line.ask(node, Property::ROLE)?;
        if got & role::MASK != wanted {
            return Err(unexpected(node, Property::ROLE, expected, got));
        }
    }
    Ok(())
}

fn read_units(line: &mut Line, model: &WamModel<AXES>) -> Result<Vec<PuckUnits>, Problem> {
    let turn = model.transmission.counts_per_turn();
    let mut units: Vec<PuckUnits> = Vec::new();
    for node in (0..AXES).map(Node::of_motor) {
        let counts = line.ask(node, Property::CTS)?;
        if u32::try_from(counts) != Ok(turn) {
            let expected = format!("{turn} counts per turn as in the model");
            return Err(unexpected(node, Property::CTS, &expected, counts));
        }
        let per_newton_metre = positive(line, node, Property::IPNM)?;
        let largest = positive(line, node, Property::MT)?;
        let slot = line.ask(node, Property::PIDX)?;
        let torque_group = group(line, node, Property::GRPB)?;
        let found = PuckUnits {
            per_newton_metre,
            largest,
            torque_group,
            slot: match slot {
                1..=4 => (slot - 1) as usize,
                _ => return Err(unexpected(node, Property::PIDX, "a slot from 1 to 4", slot)),
            },
            group: group(line, node, Property::GRPC)?,
        };
        let same_slot = |other: &PuckUnits| {
            (other.torque_group, other.slot) == (found.torque_group, found.slot)
        };
        if units.iter().any(same_slot) {
            let expected = "a slot that no other puck of its group has";
            return Err(unexpected(node, Property::PIDX, expected, slot));
        }
        units.push(found);
    }
    Ok(units)
}

fn positive(line: &mut Line, node: Node, property: Property) -> Result<f64, Problem> {
    match line.ask(node, property)? {
        value if value > 0 => Ok(f64::from(value)),
        value => Err(unexpected(node, property, "more than 0", value)),
    }
}

fn group(line: &mut Line, node: Node, property: Property) -> Result<Group, Problem> {
    let value = line.ask(node, property)?;
    u8::try_from(value)
        .ok()
        .and_then(Group::new)
        .ok_or_else(|| unexpected(node, property, "a group from 0 to 31", value))
}

/// What the safety module shall allow, in its units.
pub(super) fn limits_in_units(options: &CanOptions) -> [(Property, i32); 4] {
    let limits = options.limits;
    [
        (Property::VL1, limits.velocity_warning * VELOCITY_UNITS),
        (Property::VL2, limits.velocity_fault * VELOCITY_UNITS),
        (Property::TL1, limits.torque_warning),
        (Property::TL2, limits.torque_fault),
    ]
    .map(|(property, value)| (property, value.clamp(0.0, LARGEST) as i32))
}

fn set_limits(line: &mut Line, options: &CanOptions) -> Result<(), Problem> {
    for (property, value) in limits_in_units(options) {
        line.tell(Node::SAFETY, property, value)?;
        line.pause(SETTLE)?;
        let got = line.ask(Node::SAFETY, property)?;
        if got != value {
            let expected = format!("{value}, which it was told");
            return Err(unexpected(Node::SAFETY, property, &expected, got));
        }
    }
    Ok(())
}

/// Tells the pucks where they are, unless they know.
fn zero(
    line: &mut Line,
    model: &WamModel<AXES>,
    options: &CanOptions,
    first: bool,
    restarted: bool,
) -> Result<(), Problem> {
    let zeroed = line.ask(Node::SAFETY, Property::ZERO)? != 0;
    if zeroed && !restarted {
        return Ok(());
    }
    if !first {
        // The safety module has restarted; the pucks have not, so that they are right.
        return declare_zeroed(line);
    }
    if line.ask(Node::SAFETY, Property::MODE)? == mode::TORQUE_OR_ACTIVE {
        return Err(Problem::Active);
    }
    // Rotors seem to jump while their positions are written.
    line.tell(Node::SAFETY, Property::IFAULT, AXES as i32 + 1)?;
    line.pause(SETTLE)?;
    let turn = model.transmission.counts_per_turn() as i32;
    let home = model.transmission.counts(&model.home);
    for (motor, &counts) in home.iter().enumerate() {
        let node = Node::of_motor(motor);
        let counts = counts + off_home(line, node, options.marks.map(|marks| marks[motor]), turn)?;
        line.tell(node, Property::P, counts)?;
        line.pause(SETTLE)?;
        let got = line.ask_position(node)?;
        if got.abs_diff(counts) > turn.unsigned_abs() / MOVED as u32 {
            let expected = format!("{counts}, which it was told");
            return Err(unexpected(node, Property::P, &expected, got));
        }
    }
    declare_zeroed(line)
}

/// How far a rotor is from where it is at home, by its mark, within half a turn (libbarrett, `low_level_wam`).
fn off_home(line: &mut Line, node: Node, mark: Option<i32>, turn: i32) -> Result<i32, Problem> {
    let Some(mark) = mark else {
        return Ok(0);
    };
    let angle = line.ask(node, Property::MECH)?;
    if !(0..turn).contains(&angle) {
        let expected = format!("an angle from 0 to {}", turn - 1);
        return Err(unexpected(node, Property::MECH, &expected, angle));
    }
    let off = (angle - mark.rem_euclid(turn)).rem_euclid(turn);
    Ok(if off >= turn / 2 { off - turn } else { off })
}

fn declare_zeroed(line: &mut Line) -> Result<(), Problem> {
    line.tell(Node::SAFETY, Property::ZERO, 1)?;
    line.pause(SETTLE)?;
    match line.ask(Node::SAFETY, Property::ZERO)? {
        0 => Err(unexpected(
            Node::SAFETY,
            Property::ZERO,
            "1, which it was told",
            0,
        )),
        _ => Ok(()),
    }
}

/// Where all motors are; the joints must be able to stand there.
fn locate(line: &mut Line, model: &WamModel<AXES>) -> Result<[i32; AXES], Problem> {
    let mut counts = [0; AXES];
    for (motor, slot) in counts.iter_mut().enumerate() {
        *slot = line.ask_position(Node::of_motor(motor))?;
    }
    let joints = model.transmission.joints(&counts);
    for (joint, limits) in model.chain.limits().iter().enumerate() {
        let angle = joints[joint];
        if angle < limits.min - SLACK || angle > limits.max + SLACK {
            let degrees = angle.to_degrees();
            return Err(Problem::Implausible { joint, degrees });
        }
    }
    Ok(counts)
}

fn unexpected(node: Node, property: Property, expected: &str, got: i32) -> Problem {
    Problem::Unexpected {
        node,
        property,
        expected: expected.to_owned(),
        got,
    }
}
