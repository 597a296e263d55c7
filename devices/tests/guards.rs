//! A guarded arm behaves like the arm within its guards, refuses by name beyond them, and holds when a stream stops.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use yarp_devices::guard::{Guarded, GuardedOptions, JointLimits, RateLimits, TorqueLimits};
use yarp_devices::wam::SimulatedWam;
use yarp_devices::{
    Axes, AxisIndex, AxisInfo, ControlLimits, ControlMode, Device, DeviceError, EncoderReading,
    Encoders, JointType, Limits, Mode, PidValue, PositionControl, VelocityControl, checks,
};
use yarp_testing::eventually;

const TEST_TIMEOUT: Duration = Duration::from_secs(60);
const BASE: Axes<'static> = Axes::One(AxisIndex::new(0));

fn guarded(options: GuardedOptions) -> Guarded {
    let arm = SimulatedWam::new();
    Guarded::around(Arc::new(arm), options).expect("the guards start")
}

fn narrow() -> GuardedOptions {
    GuardedOptions {
        joint_limits: JointLimits(vec![Limits::new(-20.0, 20.0)]),
        rate_limits: RateLimits {
            speeds: vec![25.0],
            accelerations: vec![50.0],
        },
        torque_limits: TorqueLimits(vec![10.0]),
        ..GuardedOptions::default()
    }
}

fn position(arm: &dyn Device) -> f64 {
    arm.encoders().unwrap().encoder_readings(BASE).unwrap()[0].position
}

fn speed(arm: &dyn Device) -> f64 {
    arm.encoders().unwrap().encoder_readings(BASE).unwrap()[0].speed
}

fn in_velocity_mode(arm: &dyn Device) {
    let modes = arm.control_mode().unwrap();
    modes.set_control_modes(BASE, &[Mode::Velocity]).unwrap();
}

/// Wide guards change nothing.
#[test]
fn behaves_like_the_arm_inside_its_guards() {
    let options = GuardedOptions {
        joint_limits: JointLimits(vec![Limits::new(-1000.0, 1000.0); 7]),
        rate_limits: RateLimits {
            speeds: vec![1000.0; 7],
            accelerations: vec![1000.0; 7],
        },
        ..GuardedOptions::default()
    };
    for check in [
        checks::axes_have_names,
        checks::readings_carry_fresh_times,
        checks::a_relative_move_adds_up,
        checks::a_group_move_leaves_the_others_alone,
        checks::a_new_target_replaces_the_old,
        checks::a_stop_ends_a_move,
        checks::a_malformed_command_is_refused,
        checks::references_are_kept,
        checks::too_hard_is_as_hard_as_it_can,
        checks::modes_are_kept,
        checks::position_moves_need_position_mode,
        checks::a_velocity_holds_until_told_otherwise,
        checks::a_velocity_ends_at_the_position_limit,
        checks::limits_are_kept,
    ] {
        check(&guarded(options.clone()), TEST_TIMEOUT);
    }
}

#[test]
fn refusals_name_the_guard() {
    let arm = guarded(narrow());
    let arm: &dyn Device = &arm;
    let position = arm.position_control().unwrap();
    let velocity = arm.velocity_control().unwrap();
    let limits = arm.control_limits().unwrap();
    let refused = |outcome: Result<(), DeviceError>, expected: &str| {
        let message = outcome.unwrap_err().to_string();
        assert_eq!(message, format!("the {expected}"));
    };
    refused(
        position.position_move(BASE, &[21.0]),
        "joint limits of the guard forbid it: joint 0 asked for position 21 deg, allowed -20 to 20 deg",
    );
    refused(
        position.relative_move(BASE, &[-21.0]),
        "joint limits of the guard forbid it: joint 0 asked for position -21 deg, allowed -20 to 20 deg",
    );
    refused(
        position.set_reference_speeds(BASE, &[26.0]),
        "rate limits of the guard forbid it: joint 0 asked for speed 26 deg/s, allowed -inf to 25 deg/s",
    );
    in_velocity_mode(arm);
    refused(
        velocity.velocity_move(BASE, &[-26.0]),
        "rate limits of the guard forbid it: joint 0 asked for velocity -26 deg/s, allowed -25 to 25 deg/s",
    );
    refused(
        limits.set_position_limits(0.into(), Limits::new(-30.0, 10.0)),
        "joint limits of the guard forbid it: joint 0 asked for lower position limit -30 deg, allowed -20 to 20 deg",
    );
    assert_eq!(
        limits.position_limits(0.into()).unwrap(),
        Limits::new(-20.0, 20.0)
    );
    assert_eq!(limits.velocity_limits(0.into()).unwrap().max, 25.0);
    // The references were reduced at the start, those of unguarded joints were not.
    let speeds = position.reference_speeds(Axes::All).unwrap();
    assert_eq!(speeds[0], 25.0);
    assert!(speeds[1] > 25.0);
    // What is no number is refused by the device, as ever.
    assert!(matches!(
        position.position_move(Axes::One(1.into()), &[f64::NAN]),
        Err(DeviceError::NotFinite { .. })
    ));
}

/// Accelerations beyond the guard were refused, and with them the velocity mode of stock's windows, which send
/// 100000.
#[test]
fn accelerations_are_brought_down_to_the_guard() {
    let arm = guarded(narrow());
    let position = arm.position_control().unwrap();
    for (asked, in_force) in [(51.0, 50.0), (20.0, 20.0), (1e5, 50.0)] {
        position
            .set_reference_accelerations(BASE, &[asked])
            .unwrap();
        assert_eq!(position.reference_accelerations(BASE).unwrap(), [in_force]);
    }
    for bad in [f64::NAN, f64::INFINITY, -1.0] {
        assert!(position.set_reference_accelerations(BASE, &[bad]).is_err());
    }
    assert!(
        position
            .set_reference_accelerations(BASE, &[1.0, 2.0])
            .is_err()
    );
    assert_eq!(position.reference_accelerations(BASE).unwrap(), [50.0]);
}

#[test]
fn torques_are_checked_for_every_joint_of_a_command() {
    let arm = guarded(narrow());
    assert!(
        arm.check_torques(Axes::All, &[10.0, 99.0, 0.0, 0.0, 0.0, 0.0, 0.0])
            .is_ok()
    );
    let refused = arm.check_torques(BASE, &[-10.5]).unwrap_err();
    assert_eq!(
        refused.to_string(),
        "the torque limits of the guard forbid it: joint 0 asked for torque -10.5 Nm, allowed -10 to 10 Nm"
    );
    assert!(matches!(
        arm.check_torques(Axes::All, &[0.0]),
        Err(DeviceError::WrongCount { .. })
    ));
}

/// Exactly at a limit, too, and in both directions.
#[test]
fn a_joint_at_its_limit_may_only_come_back() {
    let limits = JointLimits(vec![Limits::new(-20.0, 20.0)]);
    let moves = |velocity, position| {
        let checked = limits.check_velocity(0.into(), velocity, position, "deg/s");
        checked.is_ok()
    };
    for (end, outward) in [(20.0, 1.0), (-20.0, -1.0), (20.1, 1.0), (-20.1, -1.0)] {
        assert!(!moves(outward, end), "{outward} at {end}");
        assert!(moves(-outward, end) && moves(0.0, end), "{end}");
    }
    assert!(moves(1.0, 19.9) && moves(-1.0, -19.9));
}

/// A direct position is no farther away than the joint may go in 0.1 s.
#[test]
fn a_step_is_as_far_as_the_speed_allows_in_a_tenth_of_a_second() {
    let rates = RateLimits {
        speeds: vec![25.0],
        ..RateLimits::default()
    };
    let fits = |asked| rates.check_step(0.into(), asked, 40.0, "deg").is_ok();
    assert!(fits(42.5) && fits(37.5));
    assert!(!fits(42.51) && !fits(37.49));
}

#[test]
fn direct_velocities_are_within_the_guards_limits() {
    let arm = guarded(narrow());
    let modes = arm.control_mode().unwrap();
    modes
        .set_control_modes(BASE, &[Mode::VelocityDirect])
        .unwrap();
    let control = arm.velocity_direct().unwrap();
    for beyond in [25.1, -25.1] {
        let refused = control.set_direct_velocities(BASE, &[beyond]);
        assert!(
            matches!(refused, Err(DeviceError::Guarded { .. })),
            "{refused:?}"
        );
    }
    assert_eq!(speed(&arm), 0.0);
    control.set_direct_velocities(BASE, &[25.0]).unwrap();
}

/// libbarrett's 28.6 deg/s² are more than this guard allows.
#[test]
fn accelerations_are_reduced_at_the_start() {
    let arm = guarded(GuardedOptions {
        rate_limits: RateLimits {
            speeds: vec![],
            accelerations: vec![20.0],
        },
        ..GuardedOptions::default()
    });
    let position = arm.position_control().unwrap();
    let accelerations = position.reference_accelerations(Axes::All).unwrap();
    assert_eq!(accelerations[0], 20.0);
    assert!(accelerations[1] > 20.0);
}

/// Ranges of currents and torques are those of the guard at both ends.
#[test]
fn ranges_are_narrowed_at_both_ends() {
    let arm = guarded(GuardedOptions {
        torque_limits: TorqueLimits(vec![0.5]),
        current_limits: vec![0.25],
        ..GuardedOptions::default()
    });
    let torques = arm.torque_control().unwrap();
    let range = torques.torque_ranges(BASE).unwrap();
    assert_eq!(range, [Limits::new(-0.5, 0.5)]);
    let currents = arm.current_control().unwrap();
    let range = currents.current_ranges(BASE).unwrap();
    assert_eq!(range, [Limits::new(-0.25, 0.25)]);
}

/// A client that sets torque mode once more does not get rid of the watchdog.
#[test]
fn a_torque_ends_although_its_mode_is_set_again() {
    for commanded in [Mode::Torque, Mode::Current, Mode::Pwm] {
        let arm = guarded(GuardedOptions {
            effort_watchdog: Some(Duration::from_secs(1)),
            ..GuardedOptions::default()
        });
        let modes = arm.control_mode().unwrap();
        modes.set_control_modes(BASE, &[commanded]).unwrap();
        match commanded {
            Mode::Torque => {
                let control = arm.torque_control().unwrap();
                control.set_reference_torques(BASE, &[0.1]).unwrap();
            }
            Mode::Current => {
                let control = arm.current_control().unwrap();
                control.set_reference_currents(BASE, &[0.1]).unwrap();
            }
            _ => {
                let control = arm.pwm_control().unwrap();
                control.set_reference_duty_cycles(BASE, &[1.0]).unwrap();
            }
        }
        modes.set_control_modes(BASE, &[commanded]).unwrap();
        eventually("position mode", || {
            modes.control_modes(BASE).unwrap() == [Mode::Position]
        });
    }
}

/// However slow it is, here 5 deg/s.
#[test]
fn a_joint_that_creeps_under_a_torque_is_held_at_its_limit() {
    let arm = guarded(GuardedOptions {
        joint_limits: narrow().joint_limits,
        ..GuardedOptions::default()
    });
    let control = arm.position_control().unwrap();
    control.position_move(BASE, &[18.0]).unwrap();
    eventually("arrival", || control.motion_done(BASE).unwrap());
    let modes = arm.control_mode().unwrap();
    modes.set_control_modes(BASE, &[Mode::Torque]).unwrap();
    let torques = arm.torque_control().unwrap();
    let limits = arm.control_limits().unwrap();
    // Full torque holds the largest speed in the end.
    let fastest = limits.velocity_limits(0.into()).unwrap().max;
    let torque = torques.torque_ranges(BASE).unwrap()[0].max * 5.0 / fastest;
    torques.set_reference_torques(BASE, &[torque]).unwrap();
    let mode = || modes.control_modes(BASE).unwrap()[0];
    eventually("the limit", || {
        mode() == Mode::Position || position(&arm) > 22.0
    });
    assert_eq!(mode(), Mode::Position);
    assert!(position(&arm) < 21.0, "held at {}", position(&arm));
}

/// An arm whose encoders can fail.
struct Blind {
    arm: SimulatedWam,
    is_blind: AtomicBool,
}

impl AxisInfo for Blind {
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

impl Encoders for Blind {
    fn read_encoders(&self, axes: Axes<'_>, out: &mut [EncoderReading]) -> Result<(), DeviceError> {
        if self.is_blind.load(Ordering::SeqCst) {
            return Err(DeviceError::NoDataYet { what: "encoder" });
        }
        self.arm.read_encoders(axes, out)
    }

    fn set_encoders(&self, axes: Axes<'_>, positions: &[f64]) -> Result<(), DeviceError> {
        Encoders::set_encoders(&self.arm, axes, positions)
    }
}

impl Device for Blind {
    fn axis_info(&self) -> Option<&dyn AxisInfo> {
        Some(self)
    }

    fn encoders(&self) -> Option<&dyn Encoders> {
        Some(self)
    }

    fn position_control(&self) -> Option<&dyn PositionControl> {
        self.arm.position_control()
    }

    fn velocity_control(&self) -> Option<&dyn VelocityControl> {
        self.arm.velocity_control()
    }

    fn control_mode(&self) -> Option<&dyn ControlMode> {
        self.arm.control_mode()
    }

    fn control_limits(&self) -> Option<&dyn ControlLimits> {
        self.arm.control_limits()
    }
}

#[test]
fn a_joint_that_moves_unseen_is_stopped() {
    let device = Arc::new(Blind {
        arm: SimulatedWam::new(),
        is_blind: AtomicBool::new(false),
    });
    let arm = Guarded::around(Arc::clone(&device) as _, narrow()).expect("the guards start");
    in_velocity_mode(&arm);
    let velocity = arm.velocity_control().unwrap();
    velocity.velocity_move(BASE, &[1.0]).unwrap();
    eventually("motion", || speed(&device.arm) > 0.0);
    device.is_blind.store(true, Ordering::SeqCst);
    eventually("rest", || speed(&device.arm) == 0.0);
    assert!(position(&device.arm) < 19.0, "its limit ended the motion");
}

/// The device's own limit is far away, the guard's is near.
#[test]
fn a_velocity_ends_inside_the_guards_limit() {
    let arm = guarded(narrow());
    let velocity = arm.velocity_control().unwrap();
    in_velocity_mode(&arm);
    velocity.velocity_move(BASE, &[20.0]).unwrap();
    eventually("motion", || position(&arm) > 5.0);
    eventually("rest", || speed(&arm) == 0.0);
    let rest = position(&arm);
    assert!((10.0..=20.0).contains(&rest), "it came to rest at {rest}");
    // It can go back.
    velocity.velocity_move(BASE, &[-20.0]).unwrap();
    eventually("the way back", || position(&arm) < 0.0);
    velocity.stop(BASE).unwrap();
}

#[test]
fn a_joint_beyond_its_limit_may_only_come_back() {
    let arm: Arc<dyn Device> = Arc::new(SimulatedWam::new());
    let position = arm.position_control().unwrap();
    position.position_move(BASE, &[25.0]).unwrap();
    eventually("arrival", || position.motion_done(BASE).unwrap());
    let arm = Guarded::around(arm, narrow()).unwrap();
    in_velocity_mode(&arm);
    let velocity = arm.velocity_control().unwrap();
    assert_eq!(
        velocity
            .velocity_move(BASE, &[5.0])
            .unwrap_err()
            .to_string(),
        "the joint limits of the guard forbid it: \
         joint 0 asked for velocity at its upper limit 5 deg/s, allowed -inf to 0 deg/s"
    );
    velocity.velocity_move(BASE, &[-20.0]).unwrap();
    eventually("the way back", || self::position(&arm) < 20.0);
}

#[test]
fn a_stream_that_stops_leads_to_hold() {
    let options = GuardedOptions {
        watchdog: Some(Duration::from_millis(300)),
        ..GuardedOptions::default()
    };
    let arm = guarded(options);
    in_velocity_mode(&arm);
    let velocity = arm.velocity_control().unwrap();
    velocity.velocity_move(BASE, &[10.0]).unwrap();
    eventually("motion", || speed(&arm) > 0.0);
    // Nothing more comes: it comes to rest by itself, and can be moved again.
    eventually("rest", || speed(&arm) == 0.0);
    assert_eq!(velocity.reference_velocities(BASE).unwrap(), [0.0]);
    let held = position(&arm);
    velocity.velocity_move(BASE, &[10.0]).unwrap();
    eventually("motion again", || position(&arm) > held + 0.1);
}

#[test]
fn a_stream_that_goes_on_is_not_stopped() {
    let options = GuardedOptions {
        watchdog: Some(Duration::from_secs(5)),
        ..GuardedOptions::default()
    };
    let arm = guarded(options);
    in_velocity_mode(&arm);
    let velocity = arm.velocity_control().unwrap();
    let start = position(&arm);
    eventually("progress", || {
        velocity.velocity_move(BASE, &[10.0]).unwrap();
        position(&arm) > start + 20.0
    });
    assert_eq!(velocity.reference_velocities(BASE).unwrap(), [10.0]);
}

/// The software stop stands in front of an arm without limits, too; stock's clients notice nothing of it.
#[test]
fn without_limits_everything_is_passed_on() {
    let arm = Arc::new(SimulatedWam::new());
    let guarded = Guarded::around(arm.clone(), GuardedOptions::default()).unwrap();
    let joint = AxisIndex::from(0);
    let modes = |device: &dyn Device| {
        let modes = device.control_mode().unwrap();
        modes.available_control_modes(joint).unwrap()
    };
    assert_eq!(modes(&guarded), modes(arm.as_ref()));
    let loops = guarded.pid_control().unwrap();
    let kinds = loops.available_pids(joint).unwrap();
    assert!(kinds.len() > 1, "{kinds:?}");
    for kind in kinds {
        let reference = loops.set_pid_values(kind, PidValue::Reference, joint.into(), &[12.0]);
        assert!(reference.is_ok(), "{kind:?}: {reference:?}");
    }
}
