//! Bodies obey mechanics: rest, weight, friction, and what they do to the robot.

use std::time::Duration;

use yarp_devices::hand::simulated::BREAKAWAY_TORQUE;
use yarp_devices::kinematics::{Joints, Pose, Solver};
use yarp_devices::{Axes, AxisIndex};
use yarp_table::{
    Finish, Other, Placement, Scene, Shape, SimulationOptions, TableSimulation, arm_model,
};

use nalgebra::{Rotation3, Translation3, Vector3};

fn simulated(scene: Scene, joints: Option<[f64; 7]>) -> TableSimulation {
    let mut options = SimulationOptions::default();
    options.joints = joints;
    TableSimulation::new(scene, options)
}

/// Joint angles that bring the tool plate to a place above the table, with the palm down and the fingers closing along
/// the arm's y axis (`yaw` 0) or turned.
fn reaching(x: f64, y: f64, z: f64, yaw: f64) -> [f64; 7] {
    let model = arm_model();
    let down = Rotation3::from_axis_angle(&Vector3::x_axis(), std::f64::consts::PI)
        * Rotation3::from_axis_angle(&Vector3::z_axis(), yaw);
    let pose = Pose::from_parts(Translation3::new(x, y, z), down);
    let start = Joints::<7>::from([y.atan2(x), 0.6, 0.0, 2.0, 0.0, 0.5, 0.0]);
    let solved = Solver::new(model.chain.clone()).solve(&pose, &start);
    let joints = solved.expect("the pose is in reach").joints;
    joints.into()
}

/// Commands all joints and waits until they are there.
fn go(table: &mut TableSimulation, joints: [f64; 7]) {
    let degrees = joints.map(f64::to_degrees);
    for (axis, target) in degrees.into_iter().enumerate() {
        let axis = Axes::One(AxisIndex::from(axis));
        table.arm_mut().position_move(axis, &[target]).unwrap();
    }
    for _ in 0..5000 {
        table.step();
        if table.arm().motion_done(Axes::All).unwrap() {
            break;
        }
    }
    table.run(Duration::from_millis(500));
}

#[test]
fn what_rests_stays_at_rest() {
    let scene = Scene::random(5, &Placement::default()).unwrap();
    let before = scene.objects.clone();
    let mut table = simulated(scene, None);
    table.run(Duration::from_secs(3));
    for (one, other) in before.iter().zip(&table.scene().objects) {
        let moved = (one.pose.translation.vector - other.pose.translation.vector).norm();
        let turned = one.pose.rotation.angle_to(&other.pose.rotation);
        assert!(
            moved < 5e-4 && turned < 5e-3,
            "{}: {moved} m, {turned} rad",
            one.class()
        );
    }
}

#[test]
fn what_falls_obeys_gravity() {
    let mut scene = Scene::empty();
    scene.put(
        Shape::Box { size: [0.05; 3] },
        0.5,
        0.0,
        0.0,
        Finish::default(),
    );
    scene.objects[0].pose.translation.z = 1.0;
    let mut table = simulated(scene, None);
    table.run(Duration::from_millis(300));
    let fallen = 1.0 - table.scene().objects[0].pose.translation.z;
    assert!((fallen - 0.5 * 9.805 * 0.09).abs() < 0.01, "{fallen}");
}

#[test]
fn the_same_seed_gives_the_same_motion() {
    let run = |seed| {
        let scene = Scene::random(2, &Placement::default()).unwrap();
        let mut options = SimulationOptions::default();
        options.seed = seed;
        options.joints = Some(reaching(0.5, 0.0, 0.20, 0.0));
        let mut table = TableSimulation::new(scene, options);
        go(&mut table, reaching(0.5, 0.1, 0.06, 0.0));
        (
            table.arm().simulator().angles(),
            table.scene().objects.clone(),
        )
    };
    assert_eq!(run(1), run(1));
    assert_ne!(run(1).0, run(2).0);
}

#[test]
fn pressing_on_the_table_is_felt_in_the_joints() {
    let above = reaching(0.5, 0.0, 0.22, 0.0);
    let mut table = simulated(Scene::empty(), Some(above));
    table.run(Duration::from_millis(200));
    assert_eq!(
        table.arm().simulator().contact_torques(),
        Joints::<7>::zeros()
    );
    // Half-closed fingers, then some 25 mm lower than the table lets them.
    table.command_hand("GM 9000");
    let tip = table.physics().contacts().len();
    assert_eq!(tip, 0);
    go(&mut table, reaching(0.5, 0.0, 0.10, 0.0));
    let torques = table.arm().simulator().contact_torques();
    assert!(torques.amax() > 2.0, "{torques}");
    let pushes: f64 = table
        .physics()
        .contacts()
        .iter()
        .filter(|contact| contact.other == Other::Table)
        .map(|contact| contact.force.z)
        .sum();
    assert!((5.0..200.0).contains(&pushes), "{pushes}");
}

/// A box of this friction between the fingers, lifted by 0.1 m: how far it came along.
fn lifted(friction: f64) -> (f64, TableSimulation) {
    let mut scene = Scene::empty();
    let cuboid = Shape::Box {
        size: [0.06, 0.06, 0.10],
    };
    scene.put(cuboid, 0.5, 0.0, 0.0, Finish::default());
    scene.objects[0].mass = 0.2;
    scene.objects[0].friction = friction;
    // Fingertips reach 0.12 to 0.15 m beyond the plate.
    let mut table = simulated(scene, Some(reaching(0.5, 0.0, 0.15, 0.0)));
    table.run(Duration::from_millis(300));
    table.command_hand("GC");
    table.run(Duration::from_millis(300));
    let before = table.scene().objects[0].pose.translation.z;
    go(&mut table, reaching(0.5, 0.0, 0.25, 0.0));
    table.run(Duration::from_secs(1));
    (table.scene().objects[0].pose.translation.z - before, table)
}

#[test]
fn friction_holds_a_box_and_nothing_else_does() {
    let (up, table) = lifted(0.6);
    assert!((up - 0.10).abs() < 0.015, "came along by {up}");
    // The hand carries its weight.
    let weight: f64 = table
        .physics()
        .contacts()
        .iter()
        .map(|contact| contact.force.z)
        .sum();
    assert!((weight + 0.2 * 9.805).abs() < 0.4, "{weight}");
    let (up, _) = lifted(0.0);
    assert!(up < 0.02, "came along without friction by {up}");
}

#[test]
fn a_hard_grip_opens_the_clutches() {
    let (_, table) = lifted(0.6);
    let clutches = table.hand().clutches();
    assert!(clutches.iter().any(Option::is_some), "{clutches:?}");
    const { assert!(BREAKAWAY_TORQUE > 0.0) };
}
