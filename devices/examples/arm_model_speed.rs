//! Measures the speed of inverse kinematics and of the simulation on this machine.
//!
//! ```sh
//! cargo run --release -p yarp-devices --example arm_model_speed
//! ```
//!
//! Prints the share of random reachable poses solved with the median and the 99th percentile of the time for one, and how
//! many seconds of an arm in motion are simulated per second.

use std::time::{Duration, Instant};

use yarp_devices::kinematics::{Joints, Redundancy, Solver, SolverOptions};
use yarp_devices::simulation::{SimulatedArm, SimulatorOptions};
use yarp_devices::trajectory::JointLimits;
use yarp_devices::wam::WamModel;

fn main() {
    for redundancy in [Redundancy::Free, Redundancy::AwayFromLimits] {
        inverse_kinematics(redundancy);
    }
    simulation();
}

fn inverse_kinematics(redundancy: Redundancy<7>) {
    const POSES: u32 = 10_000;
    let options = SolverOptions {
        redundancy,
        ..SolverOptions::default()
    };
    let solver = Solver::with_options(WamModel::<7>::new().chain, options);
    let chain = solver.chain();
    // Angles spread over the ranges of the joints by the golden ratio of seven dimensions (R. Alexander).
    let spread = |number: u32| {
        Joints::<7>::from_fn(|joint, _| {
            let share = (0.5 + f64::from(number) * 1.107_34_f64.powi(-(joint as i32 + 1))).fract();
            let limits = chain.limits()[joint];
            limits.min + share * (limits.max - limits.min)
        })
    };
    let mut solved = 0;
    let mut times: Vec<Duration> = (1..=POSES)
        .map(|number| {
            let target = chain.forward(&spread(number));
            let start = Instant::now();
            let found = solver.solve(&target, &Joints::<7>::zeros());
            let time = start.elapsed();
            solved += u32::from(found.is_ok());
            time
        })
        .collect();
    times.sort();
    let at = |percent: usize| times[times.len() * percent / 100];
    println!(
        "inverse kinematics, redundancy {redundancy:?}: {solved} of {POSES} poses solved, p50 {:?}, p99 {:?}",
        at(50),
        at(99)
    );
}

fn simulation() {
    const MOVES: u32 = 20;
    let mut arm = SimulatedArm::new(WamModel::<7>::new(), SimulatorOptions::default());
    let limits = JointLimits::uniform(0.75, 0.5);
    let poses = [
        [0.5, -1.0, 0.3, 2.0, -0.5, 0.5, 0.5],
        [-0.5, 0.5, -0.3, 1.0, 0.5, -0.5, -0.5],
    ];
    let start = Instant::now();
    for number in 0..MOVES {
        let target = Joints::<7>::from(poses[number as usize % 2]);
        arm.move_joints(&target, &limits)
            .expect("the poses are inside the limits");
        arm.finish(Duration::from_secs(1));
    }
    let simulated = arm.simulator().time();
    let factor = simulated.as_secs_f64() / start.elapsed().as_secs_f64();
    println!("simulation: {simulated:.1?} of an arm in motion, {factor:.0} times real time");
}
