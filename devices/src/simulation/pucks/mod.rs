//! An arm as seen on its CAN bus: the pucks of its motors and a safety module, with the mechanics behind them.

mod motor_puck;
mod puck_bus_server;
mod puck_start;
mod safety_puck;

use std::time::Duration;

use motor_puck::MotorPuck;
pub use puck_bus_server::serve_pucks;
use puck_start::PuckStart;
pub use puck_start::WakeUp;
use safety_puck::SafetyPuck;

use super::{SafetyMode, Simulator, SimulatorOptions};
use crate::can::CanFrame;
use crate::can::puck::{Address, Group, Node, PuckMessage, PuckProperty, Target, mode};
use crate::wam::{AXES, WamModel};

/// Interval between broadcasts of the safety module.
const BROADCAST_INTERVAL: Duration = Duration::from_secs(1);
/// To group 0 from node 10; the content is not published.
const BROADCAST_ID: u16 = 0x540;

/// The other end of an arm's CAN bus: frames in, frames out, stepped by its owner.
///
/// Pucks behave like their firmware, as far as it is published: switched on they only monitor, and they take their
/// time to wake ([`WakeUp`]); awake they answer
/// queries for properties, follow packed torques when the safety module has set their mode, and count their rotors'
/// positions from the position that was written. A query for a property that they do not have is not answered. The
/// safety module lets software only lower its mode, monitors speeds, torques and missing frames, and switches the
/// pucks.
///
/// For tests, pucks can stop answering or restart, and the pendant has buttons.
///
/// ```
/// use yarp_devices::can::CanFrame;
/// use yarp_devices::simulation::{SimulatedPucks, SimulatorOptions};
/// use yarp_devices::wam::WamModel;
///
/// let mut pucks = SimulatedPucks::new(WamModel::<7>::new(), SimulatorOptions::default());
/// let mut answers = Vec::new();
/// // Puck 1, what state are you in? Just switched on.
/// pucks.receive(&CanFrame::new(0x001, &[0x05]).unwrap(), &mut answers);
/// assert_eq!(answers[0].to_string(), "426: 85 00 00 00");
/// ```
#[derive(Clone, Debug)]
pub struct SimulatedPucks<const N: usize = AXES> {
    simulator: Simulator<N>,
    motors: [MotorPuck; N],
    safety: SafetyPuck,
    /// Mode for which the safety module last switched the pucks.
    switched: SafetyMode,
    silent: [bool; 32],
    commanded: bool,
    stop_cuts_power: bool,
    powered: bool,
    /// Number of frames of the host while a puck was waking, other than commands to wake.
    disturbances: u64,
    owed: Duration,
    since_broadcast: Duration,
}

impl SimulatedPucks {
    /// Returns whether a frame is the query that begins a control period: the positions of all motors.
    ///
    /// To let the arm's time advance with the traffic instead of the clock, advance one period for each.
    pub fn asks_for_positions(frame: &CanFrame) -> bool {
        matches!(
            PuckMessage::read(frame),
            Ok((
                Address { from: Node::HOST, to: Target::Group(_) },
                PuckMessage::Get(property),
            )) if property == PuckProperty::P
        )
    }
}

impl<const N: usize> SimulatedPucks<N> {
    /// An arm in its home pose that has just been switched on: pucks in monitor state, safety module idle.
    pub fn new(model: WamModel<N>, options: SimulatorOptions) -> Self {
        let simulator = Simulator::new(model, options);
        let counts = simulator.counts();
        let turn = simulator.model().transmission.counts_per_turn() as i32;
        Self {
            motors: std::array::from_fn(|motor| {
                MotorPuck::switched_on(
                    motor,
                    &simulator.model().motors[motor],
                    turn,
                    counts[motor],
                    WakeUp::default(),
                )
            }),
            safety: SafetyPuck::switched_on(WakeUp::default()),
            switched: simulator.safety().mode(),
            silent: [false; 32],
            commanded: false,
            stop_cuts_power: true,
            powered: true,
            disturbances: 0,
            owed: Duration::ZERO,
            since_broadcast: Duration::ZERO,
            simulator,
        }
    }

    /// Hears a frame; answers are added to `answers`.
    pub fn receive(&mut self, frame: &CanFrame, answers: &mut Vec<CanFrame>) {
        let Ok((address, message)) = PuckMessage::read(frame) else {
            return;
        };
        if address.from != Node::HOST {
            return;
        }
        let wakes = matches!(
            message,
            PuckMessage::Value {
                property: PuckProperty::STAT,
                ..
            }
        );
        if !wakes && self.starts().any(PuckStart::is_waking) {
            self.disturbances += 1;
        }
        let counts = self.simulator.counts();
        for (motor, puck) in self.motors.iter_mut().enumerate() {
            let node = Node::of_motor(motor);
            if self.silent[usize::from(node.number())] || !puck.listens(address.to, node) {
                continue;
            }
            self.commanded |= matches!(message, PuckMessage::Torques(_));
            if let Some((group, answer)) = puck.handle_message(message, counts[motor]) {
                answers.push(answer.frame(Address {
                    from: node,
                    to: group.into(),
                }));
            }
        }
        if self.silent[usize::from(Node::SAFETY.number())] {
            return;
        }
        if let PuckMessage::Value {
            property: PuckProperty::P,
            ..
        } = message
            && address.to != Target::Node(Node::SAFETY)
        {
            self.safety
                .see_position_written(self.simulator.safety_mut());
        }
        if address.to == Target::Node(Node::SAFETY)
            && let Some(answer) = self
                .safety
                .handle_message(message, self.simulator.safety_mut())
        {
            answers.push(answer.frame(Address {
                from: Node::SAFETY,
                to: Group::REPLIES.into(),
            }));
        }
        self.switch(answers);
    }

    /// Lets time pass, in whole control periods; the rest is kept. Frames that come of it are added to `frames`.
    pub fn advance(&mut self, time: Duration, frames: &mut Vec<CanFrame>) {
        self.advance_start(time);
        let period = self.simulator.options().period;
        self.owed += time;
        while !period.is_zero() && self.owed >= period {
            self.owed -= period;
            self.step();
            self.switch(frames);
        }
        self.since_broadcast += time;
        if self.since_broadcast >= BROADCAST_INTERVAL {
            self.since_broadcast = Duration::ZERO;
            frames.extend(CanFrame::new(BROADCAST_ID, &[0x2B, 0, 0]));
        }
    }

    /// Lets time pass for pucks between power-up and firmware, and for nothing else: [`advance`](Self::advance)
    /// does both.
    pub fn advance_start(&mut self, time: Duration) {
        for puck in &mut self.motors {
            puck.start_mut().advance(time);
        }
        self.safety.start_mut().advance(time);
    }

    fn starts(&self) -> impl Iterator<Item = &PuckStart> {
        let motors = self.motors.iter().map(MotorPuck::start);
        motors.chain([self.safety.start()])
    }

    /// Changes how a puck of a motor, or the safety module, starts: now and after later power-ups. Ignores other nodes.
    pub fn set_wake_up(&mut self, node: Node, wake_up: WakeUp) {
        if node == Node::SAFETY {
            self.safety.start_mut().set_wake_up(wake_up);
        } else if let Some(motor) = node.motor(N) {
            self.motors[motor].start_mut().set_wake_up(wake_up);
        }
    }

    /// Returns the number of frames that the host sent while a puck was waking, commands to wake excepted: real pucks
    /// may drive the bus into bus-off then (libbarrett).
    pub fn disturbances(&self) -> u64 {
        self.disturbances
    }

    fn step(&mut self) {
        for joint in 0..N {
            let transmission = &self.simulator.model().transmission;
            let mut motors = self.motors.iter().enumerate();
            let idle =
                motors.all(|(motor, puck)| !transmission.turns(motor, joint) || !puck.follows());
            self.simulator.set_idle(joint, idle);
        }
        let units = std::array::from_fn(|motor| self.motors[motor].units());
        let commanded = std::mem::take(&mut self.commanded);
        self.simulator.step_units(commanded.then_some(&units));
        let temperatures = self.simulator.temperatures();
        let volts = self.simulator.supply_voltage();
        for (puck, temperature) in self.motors.iter_mut().zip(temperatures) {
            puck.set_temperature(temperature);
            puck.set_voltage(volts);
        }
    }

    /// The safety module switches the motors when its mode has changed.
    fn switch(&mut self, frames: &mut Vec<CanFrame>) {
        let now = self.simulator.safety().mode();
        if now == self.switched {
            return;
        }
        let before = std::mem::replace(&mut self.switched, now);
        if self.stop_cuts_power && now == SafetyMode::EmergencyStop {
            for puck in &mut self.motors {
                puck.start_mut().switch_off();
            }
        } else if self.stop_cuts_power && before == SafetyMode::EmergencyStop {
            for motor in 0..N {
                self.restart_motor(motor);
            }
        }
        let value = match now {
            SafetyMode::Active => mode::TORQUE_OR_ACTIVE,
            _ => mode::IDLE_OR_STOPPED,
        };
        for (motor, puck) in self.motors.iter_mut().enumerate() {
            puck.switch(value);
            let order = PuckMessage::Value {
                property: PuckProperty::MODE,
                value,
            };
            frames.push(order.frame(Address {
                from: Node::SAFETY,
                to: Node::of_motor(motor).into(),
            }));
        }
    }

    /// Makes a node deaf and mute, as if its plug were pulled, or ends that.
    pub fn set_silent(&mut self, node: Node, silent: bool) {
        self.silent[usize::from(node.number())] = silent;
    }

    /// Gives a motor's puck a temperature of its own, °C, in place of that of the thermal model, or ends that.
    pub fn set_temperature(&mut self, motor: usize, temperature: Option<i32>) {
        if let Some(puck) = self.motors.get_mut(motor) {
            puck.force_temperature(temperature);
        }
    }

    /// Puts a motor's puck into its error state, in which its motor does not follow, with a value of `ERROR`; or ends that.
    pub fn set_error(&mut self, motor: usize, error: Option<i32>) {
        if let Some(puck) = self.motors.get_mut(motor) {
            puck.set_error(error);
        }
    }

    /// Switches a motor's puck off and on again: it monitors, and knows its angle only inside one turn.
    pub fn restart_motor(&mut self, motor: usize) {
        let counts = self.simulator.counts();
        let model = self.simulator.model();
        let turn = model.transmission.counts_per_turn() as i32;
        if let Some(puck) = self.motors.get_mut(motor) {
            let wake_up = puck.start().wake_up();
            *puck =
                MotorPuck::switched_on(motor, &model.motors[motor], turn, counts[motor], wake_up);
        }
    }

    /// Switches the safety module off and on again: it monitors, idle, and takes no position for true.
    pub fn restart_safety(&mut self) {
        self.safety = SafetyPuck::switched_on(self.safety.start().wake_up());
        self.simulator.safety_mut().press_idle();
    }

    /// Sets whether the emergency stop cuts the power of the motors' pucks, as on the real arm, which is the default:
    /// they are silent until idle is pressed, and have lost their positions then.
    pub fn set_stop_cuts_power(&mut self, cuts: bool) {
        self.stop_cuts_power = cuts;
    }

    /// Switches the whole arm off, so that no puck answers, or on again: then pucks and safety module monitor, the arm is
    /// idle, and its positions are lost.
    pub fn set_power(&mut self, powered: bool) {
        if powered == self.powered {
            return;
        }
        self.powered = true;
        self.press_idle();
        self.powered = powered;
        if powered {
            for motor in 0..N {
                self.restart_motor(motor);
            }
            self.restart_safety();
        } else {
            for puck in &mut self.motors {
                puck.start_mut().switch_off();
            }
            self.safety.start_mut().switch_off();
        }
    }

    /// Returns whether the arm is switched on.
    pub fn is_powered(&self) -> bool {
        self.powered
    }

    /// Shift and idle on the pendant, which is dark while the arm is switched off.
    pub fn press_idle(&mut self) {
        if self.powered {
            self.simulator.safety_mut().press_idle();
            self.switch(&mut Vec::new());
        }
    }

    /// Shift and activate on the pendant.
    pub fn press_activate(&mut self) {
        if self.powered {
            self.simulator.safety_mut().press_activate();
        }
    }

    /// The red button.
    pub fn press_stop(&mut self) {
        self.simulator.safety_mut().press_stop();
        self.switch(&mut Vec::new());
    }

    /// The machine.
    pub fn simulator(&self) -> &Simulator<N> {
        &self.simulator
    }

    /// The machine, to push it.
    pub fn simulator_mut(&mut self) -> &mut Simulator<N> {
        &mut self.simulator
    }
}
