//! The equations of motion obey mechanics, checked by ways that do not use them.

use nalgebra::{Matrix3, Vector3};
use proptest::prelude::*;
use yarp_devices::dynamics::Body;
use yarp_devices::kinematics::Joints;
use yarp_devices::wam::WamModel;

type Seven = Joints<7>;

fn angles() -> impl Strategy<Value = Seven> {
    prop::array::uniform7(-3.0..3.0).prop_map(Seven::from)
}

fn arm() -> WamModel<7> {
    WamModel::<7>::new()
}

/// A hand on the arm, so that nothing happens to vanish by symmetry.
fn arm_with_hand() -> WamModel<7> {
    arm().with_load(Body {
        mass: 1.2,
        centre: Vector3::new(0.01, -0.02, 0.07),
        inertia: Matrix3::from_diagonal(&Vector3::new(2.5e-3, 2.6e-3, 1.2e-3)),
    })
}

/// The mass matrix another way: from the kinetic energy of each link, by the Jacobian of its centre of mass.
fn mass_by_energy(model: &WamModel<7>, joints: &Seven) -> nalgebra::SMatrix<f64, 7, 7> {
    let frames = model.chain.frames(joints);
    let mut mass = nalgebra::SMatrix::<f64, 7, 7>::from_diagonal(&model.rotors);
    for (link, (body, frame)) in model.bodies.iter().zip(&frames).enumerate() {
        let centre = frame.rotation * body.centre + frame.translation.vector;
        let jacobian = model.chain.jacobian_of(&frames, &centre, link + 1);
        let (linear, angular) = (jacobian.fixed_rows::<3>(0), jacobian.fixed_rows::<3>(3));
        let turn = frame.rotation.matrix();
        let inertia = turn * body.inertia * turn.transpose();
        mass += linear.transpose() * linear * body.mass;
        mass += angular.transpose() * inertia * angular;
    }
    mass
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(300))]

    #[test]
    fn the_mass_matrix_is_symmetric_positive_definite_and_that_of_the_energy(joints in angles()) {
        for model in [arm(), arm_with_hand()] {
            let mass = model.dynamics().mass_matrix(&joints);
            prop_assert!((mass - mass.transpose()).amax() < 1e-12);
            prop_assert!(mass.cholesky().is_some());
            prop_assert!(mass.symmetric_eigenvalues().min() > 0.0);
            prop_assert!((mass - mass_by_energy(&model, &joints)).amax() < 1e-10);
        }
    }

    #[test]
    fn gravity_is_the_slope_of_the_potential_energy(joints in angles()) {
        const STEP: f64 = 1e-5;
        for model in [arm(), arm_with_hand()] {
            let dynamics = model.dynamics();
            let gravity = dynamics.gravity(&joints);
            for joint in 0..7 {
                let energy = |by: f64| {
                    let mut joints = joints;
                    joints[joint] += by;
                    dynamics.potential_energy(&joints)
                };
                let slope = (energy(STEP) - energy(-STEP)) / (2.0 * STEP);
                prop_assert!((gravity[joint] - slope).abs() < 1e-7, "joint {}", joint);
            }
        }
    }

    #[test]
    fn forward_dynamics_undo_inverse_dynamics(
        joints in angles(),
        velocities in angles(),
        accelerations in prop::array::uniform7(-10.0..10.0),
    ) {
        let dynamics = arm_with_hand().dynamics();
        let accelerations = Seven::from(accelerations);
        let torques = dynamics.inverse(&joints, &velocities, &accelerations);
        let back = dynamics.forward(&joints, &velocities, &torques).expect("every joint has a mass");
        prop_assert!((back - accelerations).amax() < 1e-8, "{}", back - accelerations);
    }

    /// The power of the torques is the change of the energy: Coriolis and centrifugal terms included.
    #[test]
    fn power_is_the_change_of_energy(
        joints in angles(),
        velocities in angles(),
        accelerations in prop::array::uniform7(-10.0..10.0),
    ) {
        const STEP: f64 = 1e-5;
        let dynamics = arm_with_hand().dynamics();
        let accelerations = Seven::from(accelerations);
        let power = dynamics.inverse(&joints, &velocities, &accelerations).dot(&velocities);
        let energy = |time: f64| {
            let joints = joints + velocities * time + accelerations * (time * time / 2.0);
            let velocities = velocities + accelerations * time;
            dynamics.kinetic_energy(&joints, &velocities) + dynamics.potential_energy(&joints)
        };
        let change = (energy(STEP) - energy(-STEP)) / (2.0 * STEP);
        prop_assert!((power - change).abs() < 1e-5 * (1.0 + power.abs()), "{} {}", power, change);
    }

    /// Centrifugal, Coriolis and gyroscopic torques are those of Lagrange: `dM/dt q̇ - ½ ∂(q̇ᵀ M q̇)/∂q`, with the mass
    /// matrix of the energy. Energy alone would not see a missing gyroscopic torque, which does no work.
    #[test]
    fn velocities_need_the_torques_of_lagrange(joints in angles(), velocities in angles()) {
        const STEP: f64 = 1e-5;
        let model = arm_with_hand();
        let dynamics = model.dynamics();
        let found = dynamics.bias(&joints, &velocities) - dynamics.gravity(&joints);
        let along = |time: f64| mass_by_energy(&model, &(joints + velocities * time));
        let mut expected = (along(STEP) - along(-STEP)) / (2.0 * STEP) * velocities;
        for joint in 0..7 {
            let energy = |by: f64| {
                let mut joints = joints;
                joints[joint] += by;
                velocities.dot(&(mass_by_energy(&model, &joints) * velocities)) / 2.0
            };
            expected[joint] -= (energy(STEP) - energy(-STEP)) / (2.0 * STEP);
        }
        prop_assert!((found - expected).amax() < 1e-6, "{}", found - expected);
    }

    #[test]
    fn a_new_calibration_with_a_load_finds_the_load(joints in angles()) {
        // The moments computed from the masses give the same torques as the masses.
        let mut model = arm_with_hand();
        let (bare, loaded) = (arm(), model.clone());
        let before = bare.calibration.torques(&bare.chain, &joints);
        let after = loaded.calibration.torques(&loaded.chain, &joints);
        let by_masses = loaded.dynamics().gravity(&joints) - bare.dynamics().gravity(&joints);
        prop_assert!((after - before - by_masses).amax() < 1e-9);
        model.calibration.gravity = 0.0;
        prop_assert_eq!(model.calibration.torques(&model.chain, &joints), Seven::zeros());
    }
}

#[test]
fn gravity_is_the_published_one() {
    let model = arm();
    let check = |joints: [f64; 7], by_masses: [f64; 7], by_moments: Option<[f64; 7]>| {
        let joints = Seven::from(joints);
        let found = model.dynamics().gravity(&joints);
        assert!((found - Seven::from(by_masses)).amax() < 1e-5, "{found}");
        if let Some(expected) = by_moments {
            let found = model.calibration.torques(&model.chain, &joints);
            assert!((found - Seven::from(expected)).amax() < 1e-5, "{found}");
        }
    };
    check(
        [0.0, -2.0, 0.0, 3.13, 0.0, 0.0, 0.0],
        [
            0.0, 17.32646, 0.05494, -4.05392, -0.05643, -0.12624, 0.00005,
        ],
        Some([
            0.0, 16.02619, -0.41298, -4.38798, -0.05391, -0.22606, -0.00067,
        ]),
    );
    let right = std::f64::consts::FRAC_PI_2;
    check(
        [0.0, -right, 0.0, right, 0.0, 0.0, 0.0],
        [0.0, 24.10302, 0.06042, 1.21183, 0.0, 0.00013, 0.0],
        None,
    );
    check(
        [0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7],
        [
            0.0, -7.70117, 0.13706, -1.87666, -0.00358, -0.11831, 0.00011,
        ],
        Some([
            0.0, -7.98280, 0.21968, -2.11162, 0.02292, -0.21193, -0.00063,
        ]),
    );
}

/// A free swing from stretched out, integrated by Runge and Kutta in small steps.
#[test]
fn a_free_swing_keeps_its_energy() {
    const STEP: f64 = 2e-4;
    let dynamics = arm_with_hand().dynamics();
    let mut joints = Seven::from([0.3, 1.2, 0.2, 0.7, -0.4, 0.5, 0.1]);
    let mut velocities = Seven::zeros();
    let energy = |joints: &Seven, velocities: &Seven| {
        dynamics.kinetic_energy(joints, velocities) + dynamics.potential_energy(joints)
    };
    let pull = |joints: &Seven, velocities: &Seven| {
        dynamics
            .forward(joints, velocities, &Seven::zeros())
            .expect("every joint has a mass")
    };
    let start = energy(&joints, &velocities);
    let (mut fastest, mut worst) = (0.0_f64, 0.0_f64);
    for _ in 0..10_000 {
        let (v1, a1) = (velocities, pull(&joints, &velocities));
        let v2 = velocities + a1 * (STEP / 2.0);
        let a2 = pull(&(joints + v1 * (STEP / 2.0)), &v2);
        let v3 = velocities + a2 * (STEP / 2.0);
        let a3 = pull(&(joints + v2 * (STEP / 2.0)), &v3);
        let v4 = velocities + a3 * STEP;
        let a4 = pull(&(joints + v3 * STEP), &v4);
        joints += (v1 + v2 * 2.0 + v3 * 2.0 + v4) * (STEP / 6.0);
        velocities += (a1 + a2 * 2.0 + a3 * 2.0 + a4) * (STEP / 6.0);
        fastest = fastest.max(dynamics.kinetic_energy(&joints, &velocities));
        worst = worst.max((energy(&joints, &velocities) - start).abs());
    }
    assert!(fastest > 10.0, "it did swing: {fastest} J");
    assert!(worst < 1e-6 * fastest, "{worst} J of {fastest} J");
}
