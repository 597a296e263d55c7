//! Both arms under control, the simulated one and the one on its bus: compliant joints, and current commands.

use std::time::Duration;

use yarp_devices::simulation::Simulator;
use yarp_devices::wam::DynamicWam;
use yarp_devices::wam::can::CanWam;
use yarp_devices::{Axes, AxisIndex, Device, DeviceError, Impedance, Interaction, Limits, Mode};

use crate::can;

use can::memory::Memory;
use can::scenarios::{activate, active};
use can::{Rig, until};

const BASE: AxisIndex = AxisIndex::new(0);
const AT_BASE: Axes<'static> = Axes::One(BASE);
/// Maximum friction of the base, Nm: 2.7 that varies by a tenth, and encoder rounding.
const FRICTION: f64 = 3.1;
/// Nm/deg.
const SOFT: f64 = 1.0;

/// An arm, and the machine at the other end.
trait Bench {
    fn device(&self) -> &dyn Device;
    fn look(&self, at: &mut dyn FnMut(&mut Simulator<7>));
    /// Has the red button pressed and, once that was seen, released.
    fn stop_and_go_on(&self);
}

impl Bench for DynamicWam {
    fn device(&self) -> &dyn Device {
        self
    }

    fn look(&self, at: &mut dyn FnMut(&mut Simulator<7>)) {
        self.with(|arm| at(arm.simulator_mut()));
    }

    fn stop_and_go_on(&self) {
        self.with(|arm| arm.safety_mut().press_stop());
        until("a stopped arm", || mode(self) == Mode::HardwareFault);
        let modes = self.control_mode().unwrap();
        modes
            .set_control_modes(Axes::All, &[Mode::ForceIdle; 7])
            .unwrap();
        modes
            .set_control_modes(Axes::All, &[Mode::Position; 7])
            .unwrap();
    }
}

struct OnBus {
    rig: Memory,
    arm: CanWam,
}

impl Bench for OnBus {
    fn device(&self) -> &dyn Device {
        &self.arm
    }

    fn look(&self, at: &mut dyn FnMut(&mut Simulator<7>)) {
        at(self.rig.pucks().lock().simulator_mut());
    }

    fn stop_and_go_on(&self) {
        self.rig.pucks().lock().press_stop();
        until("a stopped arm", || mode(self) == Mode::HardwareFault);
        // The button cut the power of the pucks, so the position is lost until somebody confirms it.
        {
            let mut pucks = self.rig.pucks().lock();
            pucks.press_idle();
            pucks.advance_start(Duration::from_secs(3));
        }
        until("home is confirmed", || self.arm.confirm_home().is_ok());
        activate(&self.rig, &self.arm);
    }
}

fn simulated() -> Box<dyn Bench> {
    Box::new(DynamicWam::start().expect("the arm starts"))
}

fn on_bus() -> Box<dyn Bench> {
    let rig = Memory::new();
    let arm = active(&rig);
    Box::new(OnBus { rig, arm })
}

/// Runs a behaviour on both arms.
macro_rules! on_both_arms {
    ($($name:ident)*) => {$(
        mod $name {
            #[test]
            fn of_the_simulated_arm() {
                super::behaviours::$name(super::simulated().as_ref());
            }

            #[test]
            fn of_the_arm_on_its_bus() {
                super::behaviours::$name(super::on_bus().as_ref());
            }
        }
    )*};
}

on_both_arms! {
    a_compliant_joint_yields_by_force_over_stiffness
    a_joint_made_stiff_holds_where_it_was_pushed_to
    an_offset_pushes_a_compliant_joint
    a_compliant_joint_still_moves
    after_a_fault_all_joints_are_stiff
    a_current_pushes_a_joint
    motors_that_share_joints_take_currents_together
    duty_cycles_are_refused_in_words
}

fn mode(bench: &dyn Bench) -> Mode {
    let modes = bench.device().control_mode().unwrap();
    modes.control_modes(AT_BASE).unwrap()[0]
}

fn set_mode(bench: &dyn Bench, axis: usize, mode: Mode) {
    let modes = bench.device().control_mode().unwrap();
    modes
        .set_control_modes(Axes::One(axis.into()), &[mode])
        .unwrap();
}

fn interact(bench: &dyn Bench, interaction: Interaction) {
    let control = bench.device().interaction_mode().unwrap();
    control.set_interactions(AT_BASE, &[interaction]).unwrap();
}

/// Makes the base compliant.
fn soften(bench: &dyn Bench, stiffness: f64) {
    let control = bench.device().impedance_control().unwrap();
    let damping = control.impedance_limits(BASE).unwrap().damping.max;
    let impedance = Impedance { stiffness, damping };
    control.set_impedance(BASE, impedance).unwrap();
    interact(bench, Interaction::Compliant);
}

/// Returns true position and velocity of the base, degrees.
fn base(bench: &dyn Bench) -> (f64, f64) {
    let mut found = (0.0, 0.0);
    bench.look(&mut |arm| {
        found = (
            arm.angles()[0].to_degrees(),
            arm.velocities()[0].to_degrees(),
        )
    });
    found
}

/// Pushes the tool sideways, N.
fn push(bench: &dyn Bench, force: f64) {
    bench.look(&mut |arm| arm.push([0.0, force, 0.0].into()));
}

/// Returns the torque of a sideways push on the base, Nm.
fn twisted_by(bench: &dyn Bench, force: f64) -> f64 {
    let mut torque = 0.0;
    bench.look(&mut |arm| torque = arm.tool().translation.x * force);
    torque
}

/// Lets simulated time pass.
fn pass(bench: &dyn Bench, time: Duration) {
    let now = || {
        let mut now = Duration::ZERO;
        bench.look(&mut |arm| now = arm.time());
        now
    };
    let end = now() + time;
    until("the passing of time", || now() >= end);
}

/// Waits until the base is at rest where spring and outside force are equal, up to friction; returns the position.
fn balanced(bench: &dyn Bench, stiffness: f64, torque: impl Fn() -> f64) -> f64 {
    let mut place = 0.0;
    until("forces in balance", || {
        let (angle, speed) = base(bench);
        place = angle;
        speed.abs() < 0.1 && (stiffness * angle - torque()).abs() < FRICTION
    });
    place
}

mod behaviours {
    use super::*;

    pub(super) fn a_compliant_joint_yields_by_force_over_stiffness(bench: &dyn Bench) {
        soften(bench, SOFT);
        // 8.5 Nm.
        push(bench, 40.0);
        let far = balanced(bench, SOFT, || twisted_by(bench, 40.0));
        assert!(far < -4.0, "it gives way: {far}");
        soften(bench, 8.0 * SOFT);
        let near = balanced(bench, 8.0 * SOFT, || twisted_by(bench, 40.0));
        assert!(near > far / 2.0, "stiffer, it gives way less: {near}");
        push(bench, 0.0);
        balanced(bench, 8.0 * SOFT, || 0.0);
    }

    pub(super) fn a_joint_made_stiff_holds_where_it_was_pushed_to(bench: &dyn Bench) {
        push(bench, 40.0);
        pass(bench, Duration::from_secs(1));
        // 16 Nm/deg.
        let stiff = base(bench).0;
        assert!(stiff.abs() < 1.0, "a stiff joint holds: {stiff}");
        soften(bench, SOFT);
        balanced(bench, SOFT, || twisted_by(bench, 40.0));
        interact(bench, Interaction::Stiff);
        let pushed = base(bench).0;
        push(bench, 0.0);
        pass(bench, Duration::from_secs(1));
        let held = base(bench).0;
        assert!((held - pushed).abs() < 1.0, "from {pushed} to {held}");
    }

    pub(super) fn an_offset_pushes_a_compliant_joint(bench: &dyn Bench) {
        let control = bench.device().impedance_control().unwrap();
        let most = control.set_impedance_offset(BASE, 26.0).unwrap_err();
        assert_eq!(
            most.to_string(),
            "joint 0 asked for impedance offset 26 Nm, allowed -25 to 25 Nm"
        );
        control.set_impedance_offset(BASE, 8.0).unwrap();
        soften(bench, SOFT);
        balanced(bench, SOFT, || 8.0);
        let loops = bench.device().torque_control().unwrap();
        assert!(loops.torques(AT_BASE).unwrap()[0].abs() < FRICTION + 0.5);
    }

    pub(super) fn a_compliant_joint_still_moves(bench: &dyn Bench) {
        soften(bench, SOFT);
        let motion = bench.device().position_control().unwrap();
        motion.position_move(AT_BASE, &[15.0]).unwrap();
        until("the end of the move", || {
            motion.motion_done(AT_BASE).unwrap()
        });
        balanced(bench, SOFT, || SOFT * 15.0);
    }

    pub(super) fn after_a_fault_all_joints_are_stiff(bench: &dyn Bench) {
        soften(bench, SOFT);
        let control = bench.device().interaction_mode().unwrap();
        assert_eq!(
            control.interactions(AT_BASE).unwrap(),
            [Interaction::Compliant]
        );
        bench.stop_and_go_on();
        assert_eq!(
            control.interactions(Axes::All).unwrap(),
            [Interaction::Stiff; 7]
        );
        assert_eq!(
            bench
                .device()
                .impedance_control()
                .unwrap()
                .impedance(BASE)
                .unwrap()
                .stiffness,
            SOFT
        );
    }

    pub(super) fn a_current_pushes_a_joint(bench: &dyn Bench) {
        let control = bench.device().current_control().unwrap();
        let Limits { max, .. } = control.current_ranges(AT_BASE).unwrap()[0];
        // 25 Nm at the joint by 42 turns of a motor with 1024 / 2700 Nm/A.
        assert!((max - 25.0 / 42.0 * 2700.0 / 1024.0).abs() < 1e-9, "{max}");
        // 3.6 Nm, which a base that turns freely does not get too fast with; its motor turns the other way.
        let asked = max * 3.6 / 25.0;
        let early = control.set_reference_currents(AT_BASE, &[asked]);
        assert!(matches!(early, Err(DeviceError::WrongMode { .. })));
        set_mode(bench, 0, Mode::Current);
        for wrong in [f64::NAN, 1.01 * max] {
            assert!(control.set_reference_currents(AT_BASE, &[wrong]).is_err());
        }
        assert_eq!(control.reference_currents(AT_BASE).unwrap(), [0.0]);
        control.set_reference_currents(AT_BASE, &[asked]).unwrap();
        assert_eq!(control.reference_currents(AT_BASE).unwrap(), [asked]);
        until("a base that turns", || base(bench).0 < -3.0);
        // It turns about the vertical, so that gravity takes nothing.
        let flows = control.currents(AT_BASE).unwrap()[0];
        assert!((flows - asked).abs() < 1e-9, "{flows}");
        bench
            .device()
            .position_control()
            .unwrap()
            .stop(AT_BASE)
            .unwrap();
        assert_eq!(control.reference_currents(AT_BASE).unwrap(), [0.0]);
        until("a base that stands", || base(bench).1.abs() < 0.1);
        set_mode(bench, 0, Mode::Position);
        assert_eq!(mode(bench), Mode::Position);
    }

    pub(super) fn motors_that_share_joints_take_currents_together(bench: &dyn Bench) {
        let control = bench.device().current_control().unwrap();
        let wrist = [AxisIndex::new(4), AxisIndex::new(5)];
        set_mode(bench, 4, Mode::Current);
        let refused = control.set_reference_currents(Axes::One(wrist[0]), &[0.01]);
        assert_eq!(
            refused.unwrap_err().to_string(),
            "joint 5 is in position mode, the current of a motor that turns it needs current mode"
        );
        set_mode(bench, 5, Mode::Current);
        let both = Axes::Group(&wrist);
        // Less than friction.
        control
            .set_reference_currents(both, &[0.01, -0.01])
            .unwrap();
        assert_eq!(control.reference_currents(both).unwrap(), [0.01, -0.01]);
        // Either has both motors.
        set_mode(bench, 4, Mode::Position);
        assert_eq!(control.reference_currents(both).unwrap(), [0.0; 2]);
        // Both motors together take a joint to the end of its range of torques.
        let range = control.current_ranges(both).unwrap();
        let torque = 2.0 * 9.7 * range[0].max * 1024.0 / 6500.0;
        assert!(torque <= 5.0 + 1e-9, "{torque}");
    }

    pub(super) fn duty_cycles_are_refused_in_words(bench: &dyn Bench) {
        let control = bench.device().pwm_control().unwrap();
        set_mode(bench, 0, Mode::Position);
        for refused in [
            control.duty_cycles(AT_BASE).map(drop),
            control.reference_duty_cycles(AT_BASE).map(drop),
            control.set_reference_duty_cycles(AT_BASE, &[1.0]),
        ] {
            let why = refused.unwrap_err().to_string();
            assert!(why.contains("try current mode"), "{why}");
        }
        let modes = bench.device().control_mode().unwrap();
        assert!(modes.set_control_modes(AT_BASE, &[Mode::Pwm]).is_err());
    }
}
