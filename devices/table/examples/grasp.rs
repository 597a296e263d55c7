//! Grasps and lifts a box, and prints what happens: `cargo run -p yarp-table --example grasp`.

use std::error::Error;
use std::time::{Duration, Instant};

use nalgebra::{Rotation3, Translation3, Vector3};
use yarp_devices::kinematics::{Joints, Pose, Solver};
use yarp_devices::{Axes, AxisIndex};
use yarp_table::{Finish, Scene, Shape, SimulationOptions, TableSimulation, arm_model};

fn reaching(x: f64, y: f64, z: f64) -> Result<[f64; 7], Box<dyn Error>> {
    let down = Rotation3::from_axis_angle(&Vector3::x_axis(), std::f64::consts::PI);
    let pose = Pose::from_parts(Translation3::new(x, y, z), down);
    let start = Joints::<7>::from([y.atan2(x), 0.6, 0.0, 2.0, 0.0, 0.5, 0.0]);
    let solved = Solver::new(arm_model().chain).solve(&pose, &start);
    Ok(solved.map_err(|error| error.to_string())?.joints.into())
}

fn tell(table: &TableSimulation, what: &str) {
    let arm = table.arm().simulator();
    println!(
        "{:6.3} s {what}: box z {:.4}, plate z {:.4}, fault {:?}, clutches {:?}",
        table.time().as_secs_f64(),
        table.scene().objects[0].pose.translation.z,
        arm.tool().translation.z,
        arm.safety().fault(),
        table.hand().clutches(),
    );
    println!(
        "         motors {:.0?}, torques {:.2?}",
        table.hand().positions(),
        arm.contact_torques().as_slice()
    );
    for contact in table.physics().contacts() {
        println!(
            "         part {} on {:?} at {:.3?}: {:.2?} N",
            contact.part,
            contact.other,
            contact.point.coords.as_slice(),
            contact.force.as_slice()
        );
    }
}

fn main() -> Result<(), Box<dyn Error>> {
    let mut scene = Scene::empty();
    let cuboid = Shape::Box {
        size: [0.06, 0.06, 0.10],
    };
    scene.put(cuboid, 0.5, 0.0, 0.0, Finish::default());
    let mut options = SimulationOptions::default();
    options.joints = Some(reaching(0.5, 0.0, 0.15)?);
    let mut table = TableSimulation::new(scene, options);
    tell(&table, "start");
    let start = Instant::now();
    for _ in 0..5 {
        table.run(Duration::from_millis(60));
        tell(&table, "holding");
    }
    println!("{}", table.command_hand("GC"));
    tell(&table, "closed");
    table.run(Duration::from_millis(300));
    tell(&table, "held");
    for (axis, angle) in reaching(0.5, 0.0, 0.25)?.into_iter().enumerate() {
        let axis = Axes::One(AxisIndex::from(axis));
        table.arm_mut().position_move(axis, &[angle.to_degrees()])?;
    }
    for _ in 0..4 {
        table.run(Duration::from_secs(1));
        tell(&table, "lifting");
    }
    println!("{:.2} s of wall clock", start.elapsed().as_secs_f64());
    Ok(())
}
