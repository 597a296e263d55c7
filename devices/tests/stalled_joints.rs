//! A joint that pushes and does not get on is stopped and held, and named.

use std::time::Duration;

use yarp_devices::kinematics::Joints;
use yarp_devices::simulation::SimulatorOptions;
use yarp_devices::wam::{ArmControl, DynamicArm, WamModel};
use yarp_devices::{Axes, AxisIndex, Interaction, Mode};

const PERIOD: Duration = Duration::from_millis(2);
const ELBOW: AxisIndex = AxisIndex::new(3);
const BASE: AxisIndex = AxisIndex::new(0);
/// Away from every limit, rad.
const POSE: [f64; 7] = [0.2, 0.5, 0.1, 1.5, 0.3, 0.2, 0.1];

/// Control of an arm that nothing moves: each joint stays where it is, whatever its motors do.
fn rigid(model: WamModel<7>) -> ArmControl {
    let counts = model.transmission.counts(&Joints::from(POSE));
    let mut arm = ArmControl::new(model, PERIOD, counts);
    arm.hold();
    arm
}

/// Returns the time until a joint that is to go this far, deg, stalls; `None` if it does not in 2 s.
fn time_to_stall(arm: &mut ArmControl, joint: AxisIndex, degrees: f64) -> Option<Duration> {
    arm.set_control_modes(joint.into(), &[Mode::PositionDirect])
        .unwrap();
    let target = arm.state(joint).unwrap().position + degrees;
    arm.set_direct_positions(joint.into(), &[target]).unwrap();
    let counts = arm.motor_counts();
    (1..=1000).map(|period| PERIOD * period).find(|_| {
        arm.drive();
        arm.take_counts(counts);
        arm.stall(joint).is_some()
    })
}

#[test]
fn each_joint_stalls_at_its_torque() {
    let model = WamModel::<7>::new();
    // owd's torques, or the limits of libbarrett's loops where these are lower.
    for (joint, torque) in [15.0, 20.0, 10.0, 15.0, 3.0, 3.0].into_iter().enumerate() {
        let axis = AxisIndex::from(joint);
        let degrees = |share: f64| (share * torque / model.gains[joint].proportional).to_degrees();
        assert!(degrees(1.1) < 9.0, "its error alone would be a stall");
        for side in [1.0, -1.0] {
            let stalled =
                |share| time_to_stall(&mut rigid(model.clone()), axis, side * degrees(share));
            assert_eq!(stalled(0.9), None, "joint {joint}");
            assert!(stalled(1.1).is_some(), "joint {joint}");
        }
    }
}

/// The loop of the last joint is so soft that ten degrees come before its torque.
#[test]
fn a_joint_stalls_far_from_its_set_point() {
    let stalled = |degrees| time_to_stall(&mut rigid(WamModel::<7>::new()), 6.into(), degrees);
    assert_eq!((stalled(9.5), stalled(-9.5)), (None, None));
    assert!(stalled(10.5).is_some() && stalled(-10.5).is_some());
}

#[test]
fn a_stall_takes_its_time_and_can_be_switched_off() {
    let time = time_to_stall(&mut rigid(WamModel::<7>::new()), ELBOW, 9.8).expect("a stall");
    // Its set point leaves at 2.5 rad/s: the loop (500 Nm/rad, 2 Nm s/rad) reaches its 15 Nm after 8 ms.
    let rise = Duration::from_millis(8);
    let expected = Duration::from_millis(200) + rise;
    assert!(time.abs_diff(expected) <= PERIOD, "{time:?}");
    let mut model = WamModel::<7>::new();
    let limits = model.stall.as_mut().expect("by default");
    let limits_time = Duration::from_millis(500);
    limits.time = limits_time;
    let time = time_to_stall(&mut rigid(model.clone()), ELBOW, 9.8).expect("a stall");
    assert!(time.abs_diff(limits_time + rise) <= PERIOD, "{time:?}");
    model.stall = None;
    assert_eq!(time_to_stall(&mut rigid(model), ELBOW, 40.0), None);
}

/// Not where they were sent, 1 degree further.
#[test]
fn joints_hold_where_they_are_when_another_stalls() {
    let mut arm = rigid(WamModel::<7>::new());
    arm.set_control_modes(ELBOW.into(), &[Mode::PositionDirect])
        .unwrap();
    let here = arm.state(ELBOW).unwrap().position;
    arm.set_direct_positions(ELBOW.into(), &[here + 1.0])
        .unwrap();
    time_to_stall(&mut arm, BASE, 9.8).expect("a stall");
    assert!(arm.stall(ELBOW).is_none());
    let held = arm.set_points().state(ELBOW).unwrap().position;
    assert!((held - here).abs() < 0.01, "{held}, not {here}");
}

/// Returns the time until an elbow that is to go 9.8 degrees further, and moves at this speed, deg/s, stalls; `None` if it
/// does not in 0.4 s.
fn time_to_stall_at(speed: f64) -> Option<Duration> {
    let mut arm = rigid(WamModel::<7>::new());
    arm.set_control_modes(ELBOW.into(), &[Mode::PositionDirect])
        .unwrap();
    let target = arm.state(ELBOW).unwrap().position + 9.8;
    arm.set_direct_positions(ELBOW.into(), &[target]).unwrap();
    let start = arm.motor_counts();
    (1..=200).map(|period| PERIOD * period).find(|time| {
        arm.drive();
        let mut counts = start;
        // 18 turns of the motor, the other way, with 4096 counts each.
        let way = speed * time.as_secs_f64() / 360.0 * 18.0 * 4096.0;
        counts[3] -= way.round() as i32;
        arm.take_counts(counts);
        arm.stall(ELBOW).is_some()
    })
}

/// A joint that creeps, or is pushed back, stalls; one that gets on does not.
#[test]
fn only_a_joint_that_gets_on_does_not_stall() {
    for speed in [0.0, 1.0, -1.0, -6.0] {
        assert!(time_to_stall_at(speed).is_some(), "{speed} deg/s");
    }
    assert_eq!(time_to_stall_at(6.0), None);
}

/// An arm with an obstacle in the way of its elbow, rad, below which it pushes back like a hard spring.
struct Blocked {
    arm: DynamicArm,
    obstacle: Option<f64>,
}

impl Blocked {
    fn new(model: WamModel<7>) -> Self {
        let mut arm = DynamicArm::new(model, SimulatorOptions::default());
        arm.safety_mut().press_activate();
        arm.place(&Joints::from(POSE));
        Self {
            arm,
            obstacle: Some(1.4),
        }
    }

    /// Lets time pass.
    fn pass(&mut self, time: Duration) {
        for _ in 0..time.as_millis() / PERIOD.as_millis() {
            let simulator = self.arm.simulator();
            let (angle, speed) = (simulator.angles()[3], simulator.velocities()[3]);
            let mut twist = Joints::<7>::zeros();
            if let Some(depth) = self.obstacle.map(|obstacle| obstacle - angle)
                && depth > 0.0
            {
                twist[3] = (3000.0 * depth - 30.0 * speed).max(0.0);
            }
            self.arm.simulator_mut().twist(twist);
            self.arm.tick();
        }
    }

    fn mode(&self, axis: AxisIndex) -> Mode {
        let mut mode = [Mode::UNKNOWN];
        self.arm.read_control_modes(axis.into(), &mut mode).unwrap();
        mode[0]
    }

    fn place(&self, axis: AxisIndex) -> f64 {
        self.arm.state(axis).unwrap().position
    }
}

#[test]
fn a_collision_stops_the_whole_motion_and_names_the_joint() {
    let mut blocked = Blocked::new(WamModel::<7>::new());
    let base = blocked.place(BASE);
    let references = blocked.arm.set_points_mut();
    references
        .set_reference_speeds(BASE.into(), &[4.0])
        .unwrap();
    blocked
        .arm
        .position_move(Axes::Group(&[BASE, ELBOW]), &[base + 60.0, 40.0])
        .unwrap();
    let mut waited = Duration::ZERO;
    while blocked.arm.stall(ELBOW).is_none() {
        assert!(waited < Duration::from_secs(10), "no stall");
        blocked.pass(Duration::from_millis(10));
        waited += Duration::from_millis(10);
    }
    blocked.pass(Duration::from_secs(2));
    let reason = blocked
        .arm
        .stall(ELBOW)
        .expect("it is told until the next command");
    assert!(reason.contains("joint 3 has stalled"), "{reason}");
    assert!(blocked.arm.stall(BASE).is_none());
    assert!(blocked.arm.motion_done(Axes::All).unwrap());
    assert_eq!(
        (blocked.mode(ELBOW), blocked.mode(BASE)),
        (Mode::Position, Mode::Position)
    );
    let pushes = blocked.arm.loop_output(ELBOW).unwrap();
    assert!(pushes.abs() < 5.0, "it still pushes with {pushes} Nm");
    assert!((blocked.place(ELBOW) - 1.4_f64.to_degrees()).abs() < 2.0);
    assert!(blocked.place(BASE) < base + 55.0, "the base went on");
    // The next command is accepted.
    blocked.arm.position_move(ELBOW.into(), &[100.0]).unwrap();
    assert!(blocked.arm.stall(ELBOW).is_none());
    blocked.pass(Duration::from_secs(5));
    assert!(
        (blocked.place(ELBOW) - 100.0).abs() < 1.0,
        "{}",
        blocked.place(ELBOW)
    );
}

#[test]
fn a_velocity_that_meets_an_obstacle_ends() {
    let mut blocked = Blocked::new(WamModel::<7>::new());
    let modes = [Mode::Velocity];
    blocked.arm.set_control_modes(ELBOW.into(), &modes).unwrap();
    blocked.arm.velocity_move(ELBOW.into(), &[-10.0]).unwrap();
    blocked.pass(Duration::from_secs(5));
    assert!(blocked.arm.stall(ELBOW).is_some());
    assert_eq!(blocked.mode(ELBOW), Mode::Position);
    assert!(blocked.arm.velocity_move(ELBOW.into(), &[-10.0]).is_err());
}

/// A torque pushes because it is told to, and a compliant joint yields.
#[test]
fn what_is_to_push_does_not_stall() {
    let mut blocked = Blocked::new(WamModel::<7>::new());
    let elbow = Axes::One(ELBOW);
    blocked
        .arm
        .set_control_modes(elbow, &[Mode::Torque])
        .unwrap();
    blocked.arm.set_reference_torques(elbow, &[-6.0]).unwrap();
    blocked.pass(Duration::from_secs(3));
    assert!(blocked.arm.stall(ELBOW).is_none());
    blocked
        .arm
        .set_control_modes(elbow, &[Mode::Position])
        .unwrap();
    let compliant = [Interaction::Compliant];
    blocked.arm.set_interactions(elbow, &compliant).unwrap();
    blocked.arm.position_move(elbow, &[60.0]).unwrap();
    blocked.pass(Duration::from_secs(8));
    assert!(blocked.place(ELBOW) > 70.0, "the obstacle is in its way");
    assert!(blocked.arm.stall(ELBOW).is_none());
}

/// An obstacle that gives way under the largest torque of the loop, and free moves.
#[test]
fn what_gets_on_does_not_stall() {
    let mut blocked = Blocked::new(WamModel::<7>::new());
    blocked.arm.position_move(ELBOW.into(), &[40.0]).unwrap();
    let pushes = |blocked: &Blocked| blocked.arm.loop_output(ELBOW).unwrap().abs() >= 15.0;
    while !pushes(&blocked) {
        blocked.pass(PERIOD);
    }
    blocked.pass(Duration::from_millis(100));
    let mut periods = 0;
    for _ in 0..500 {
        // 20 deg/s.
        *blocked.obstacle.as_mut().expect("it is there") -= 0.0007;
        blocked.pass(PERIOD);
        periods += u32::from(pushes(&blocked));
    }
    assert!(periods > 200, "it pushed for {periods} periods only");
    assert_eq!(blocked.arm.stall(ELBOW), None);
    let mut free = Blocked::new(WamModel::<7>::new());
    free.obstacle = None;
    let poses = [
        [60.0, 40.0, 50.0, 60.0, -90.0, 60.0, 90.0],
        [-60.0, -20.0, -50.0, 120.0, 30.0, -60.0, -90.0],
    ];
    for pose in poses.iter().cycle().take(4) {
        free.arm.position_move(Axes::All, pose).unwrap();
        free.pass(Duration::from_secs(12));
        for joint in (0..7).map(AxisIndex::from) {
            assert_eq!(free.arm.stall(joint), None);
        }
        assert!(free.arm.motion_done(Axes::All).unwrap());
    }
}
