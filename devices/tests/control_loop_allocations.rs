//! Code that runs in every control period allocates nothing: kinematics, dynamics, controller, simulator.

use std::hint::black_box;
use std::time::Duration;

use allocation_counter::measure;
use yarp_devices::kinematics::{JacobianTranspose, Joints, Redundancy, Solver, SolverOptions};
use yarp_devices::simulation::{
    JointCommand, JointControllers, SimulatedArm, Simulator, SimulatorOptions,
};
use yarp_devices::trajectory::JointLimits;
use yarp_devices::wam::{DynamicArm, WamModel};

type Seven = Joints<7>;

/// Checks that the calls of `work` do not allocate.
fn check(what: &str, work: impl FnMut()) {
    let counted = measure(work);
    assert_eq!(counted.count_total, 0, "{what}: {counted:?}");
}

#[test]
fn the_counter_counts() {
    assert_eq!(measure(|| drop(black_box(vec![1, 2, 3]))).count_total, 1);
}

#[test]
fn kinematics_and_dynamics() {
    let model = WamModel::<7>::new();
    let dynamics = model.dynamics();
    let joints = Seven::from([0.3, 0.6, 0.1, 1.2, -0.2, 0.4, 0.5]);
    check("forward", || {
        black_box(model.chain.forward_and_jacobian(&joints));
    });
    check("dynamics", || {
        black_box(dynamics.inverse(&joints, &joints, &joints));
        black_box(dynamics.forward(&joints, &joints, &joints));
    });
    let target = model.chain.forward(&joints);
    // From a far start, so that restarts are part of it; and a target out of reach, for all of them.
    for redundancy in [
        Redundancy::Free,
        Redundancy::AwayFromLimits,
        Redundancy::Near(joints),
    ] {
        let options = SolverOptions {
            redundancy,
            attempts: 5,
            ..SolverOptions::default()
        };
        let solver = Solver::with_options(model.chain.clone(), options);
        let far = yarp_devices::kinematics::Pose::translation(2.0, 0.0, 0.0);
        check("inverse kinematics", || {
            black_box(solver.solve(&target, &Seven::zeros())).unwrap();
            black_box(solver.solve(&far, &Seven::zeros())).unwrap_err();
        });
    }
    check("transposed Jacobian", || {
        let near = joints * 0.95;
        let _ = black_box(JacobianTranspose::default().solve(&model.chain, &target, &near));
    });
}

#[test]
fn the_control_period() {
    check_control_period(SimulatorOptions::default());
}

#[test]
fn the_control_period_with_the_effects_of_a_real_arm() {
    check_control_period(SimulatorOptions::real_arm());
}

fn check_control_period(options: SimulatorOptions) {
    let model = WamModel::<7>::new();
    let mut simulator = Simulator::new(model.clone(), options);
    simulator.safety_mut().press_activate();
    let mut controller = JointControllers::new(model.clone(), Duration::from_millis(2));
    let mut counts = simulator.counts();
    check("controller and simulator", || {
        for _ in 0..100 {
            let torques = controller.step(&counts, &[JointCommand::At(0.0); 7]);
            counts = simulator.step(Some(&torques));
        }
    });
    let mut arm = SimulatedArm::new(model.clone(), options);
    let target = Seven::from([0.3, -1.5, 0.1, 2.5, -0.2, 0.4, 0.5]);
    let limits = JointLimits::uniform(0.5, 0.5);
    arm.move_joints(&target, &limits)
        .expect("the target is inside the limits");
    check("an arm in motion", || {
        for _ in 0..100 {
            arm.tick();
        }
    });
    let mut arm = DynamicArm::new(model, options);
    check("the arm behind the interfaces", || {
        for _ in 0..100 {
            arm.tick();
        }
    });
}
