//! Inverse kinematics find joint angles for nearly every pose the arm can take.
//!
//! Poses are those of random joint angles inside the limits, so each can be reached. A solution counts when forward
//! kinematics put the tool within 0.1 mm and 0.05 degrees of the pose, with every joint inside its limits.

use yarp_devices::kinematics::{
    Chain, JacobianTranspose, Joints, Pose, Redundancy, Solver, SolverOptions, Task, Unsolved,
    rotation_vector,
};
use yarp_devices::pseudo_random::Random;
use yarp_devices::wam::WamModel;

/// Returns joint angles inside the limits.
fn random_joints<const N: usize>(random: &mut Random, chain: &Chain<N>) -> Joints<N> {
    Joints::<N>::from_fn(|joint, _| {
        let limits = chain.limits()[joint];
        random.between(limits.min, limits.max)
    })
}

fn reached<const N: usize>(
    chain: &Chain<N>,
    target: &Pose,
    joints: &Joints<N>,
    task: Task,
) -> bool {
    let pose = chain.forward(joints);
    let off = (target.translation.vector - pose.translation.vector).norm();
    let turned = rotation_vector(&(target.rotation * pose.rotation.inverse())).norm();
    let turned = if task == Task::Pose { turned } else { 0.0 };
    off <= 1e-4 && turned <= 0.05_f64.to_radians() && chain.contains(joints)
}

/// Returns the number of `total` random poses that are solved from the middle of the joints' ranges.
fn solved<const N: usize>(solver: &Solver<N>, task: Task, seed: u64, total: usize) -> usize {
    let chain = solver.chain();
    let middle = Joints::<N>::from_fn(|joint, _| {
        (chain.limits()[joint].min + chain.limits()[joint].max) / 2.0
    });
    let mut draw = Random::new(seed);
    (0..total)
        .filter(|_| {
            let target = chain.forward(&random_joints(&mut draw, chain));
            match solver.solve(&target, &middle) {
                Ok(found) => {
                    assert!(reached(chain, &target, &found.joints, task), "{found:?}");
                    true
                }
                Err(_) => false,
            }
        })
        .count()
}

#[test]
fn seven_joints_solve_995_of_1000_whole_poses() {
    const TOTAL: usize = 10_000;
    let solver = Solver::new(WamModel::<7>::new().chain);
    for seed in [20_260_101, 77, 4_242] {
        let found = solved(&solver, Task::Pose, seed, TOTAL);
        println!("seed {seed}: {found} of {TOTAL} solved");
        assert!(
            found * 1000 >= TOTAL * 995,
            "seed {seed}: {found} of {TOTAL}"
        );
    }
}

#[test]
fn seven_joints_with_a_long_tool_too() {
    const TOTAL: usize = 2_000;
    let arm = WamModel::<7>::new().with_tool(Pose::translation(0.0, 0.0, 0.38));
    let found = solved(&Solver::new(arm.chain), Task::Pose, 9, TOTAL);
    assert!(found * 1000 >= TOTAL * 995, "{found} of {TOTAL}");
}

#[test]
fn four_joints_reach_places_and_the_poses_they_can_take() {
    const TOTAL: usize = 2_000;
    for task in [Task::Position, Task::Pose] {
        let options = SolverOptions {
            task,
            ..SolverOptions::default()
        };
        let solver = Solver::with_options(WamModel::<4>::new().chain, options);
        let found = solved(&solver, task, 5, TOTAL);
        assert!(found * 1000 >= TOTAL * 995, "{task:?}: {found} of {TOTAL}");
    }
}

#[test]
fn the_redundant_joint_goes_where_it_is_wanted() {
    let chain = WamModel::<7>::new().chain;
    let comfort = |joints: &Joints<7>| {
        (0..7)
            .map(|joint| {
                let limits = chain.limits()[joint];
                let half = (limits.max - limits.min) / 2.0;
                ((joints[joint] - limits.min - half) / half).powi(2)
            })
            .sum::<f64>()
    };
    let with = |redundancy| {
        let options = SolverOptions {
            redundancy,
            ..SolverOptions::default()
        };
        Solver::with_options(chain.clone(), options)
    };
    let (free, away) = (with(Redundancy::Free), with(Redundancy::AwayFromLimits));
    let mut draw = Random::new(3);
    let (mut better, mut total) = (0, 0);
    for _ in 0..500 {
        let own = random_joints(&mut draw, &chain);
        let target = chain.forward(&own);
        let start = random_joints(&mut draw, &chain);
        let (Ok(one), Ok(other)) = (free.solve(&target, &start), away.solve(&target, &start))
        else {
            continue;
        };
        assert!(reached(&chain, &target, &other.joints, Task::Pose));
        assert!(comfort(&other.joints) <= comfort(&one.joints) + 1e-9);
        total += 1;
        better += usize::from(comfort(&other.joints) < comfort(&one.joints) - 1e-3);
        // Asked to stay near the joints the pose was made from, it comes nearer to them than without.
        let near = with(Redundancy::Near(own))
            .solve(&target, &start)
            .expect("as before");
        assert!((near.joints - own).norm() <= (one.joints - own).norm() + 1e-9);
    }
    assert!(
        total > 490 && better * 10 > total * 8,
        "{better} better of {total}"
    );
}

#[test]
fn what_is_out_of_reach_is_named_with_the_nearest() {
    let chain = WamModel::<7>::new().chain;
    let options = SolverOptions {
        attempts: 20,
        ..SolverOptions::default()
    };
    let target = Pose::translation(2.0, 0.0, 0.0);
    let solver = Solver::with_options(chain, options);
    let Unsolved { nearest } = solver.solve(&target, &Joints::<7>::zeros()).unwrap_err();
    // The arm is 0.91 m long.
    assert!((1.0..1.3).contains(&nearest.position_error), "{nearest:?}");
    let message = Unsolved { nearest }.to_string();
    assert!(
        message.contains("the nearest of 20 attempts stays"),
        "{message}"
    );
}

#[test]
fn the_same_seed_gives_the_same_solution() {
    let chain = WamModel::<7>::new().chain;
    let target = chain.forward(&[1.0, -1.2, 2.0, 2.5, -4.0, 1.0, -2.0].into());
    let solver = Solver::new(chain);
    let solve = || solver.solve(&target, &Joints::<7>::zeros());
    assert_eq!(solve(), solve());
}

/// The method of the thesis is good for what the thesis used it for: from a pose nearby.
#[test]
fn the_transposed_jacobian_solves_poses_nearby() {
    let chain = WamModel::<7>::new().chain;
    let method = JacobianTranspose::default();
    assert_eq!(method.position_tolerance, 1e-4);
    assert!((method.angle_tolerance.to_degrees() - 0.05).abs() < 1e-9);
    assert_eq!(method.steps, 10_000);
    let mut draw = Random::new(11);
    let mut found = 0;
    for _ in 0..200 {
        let own = random_joints(&mut draw, &chain) * 0.6;
        let own = chain.clamp(&own);
        let start = chain.clamp(&(own + Joints::<7>::from_fn(|_, _| 0.2 * (draw.unit() - 0.5))));
        let target = chain.forward(&own);
        if let Ok(solution) = method.solve(&chain, &target, &start) {
            assert!(reached(&chain, &target, &solution.joints, Task::Pose));
            // 0.1 mm and 0.05 degrees, as documented.
            let end = chain.forward(&solution.joints);
            let away = end.translation.vector - target.translation.vector;
            assert!(away.norm() < 1.01e-4, "{away}");
            let turned = end.rotation.angle_to(&target.rotation).to_degrees();
            assert!(turned < 0.0505, "{turned} degrees");
            found += 1;
        }
    }
    println!("{found} of 200 solved");
    assert!(found >= 150, "{found} of 200");
}
