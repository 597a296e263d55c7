//! Without effects of a real arm the simulation gives the numbers that it gave before it had any.

use std::time::Duration;

use nalgebra::Vector3;
use yarp_devices::kinematics::Joints;
use yarp_devices::simulation::{
    ArmEffects, SimulatedArm, SimulatorOptions, Stiction, TorqueVariation,
};
use yarp_devices::trajectory::JointLimits;
use yarp_devices::wam::WamModel;

/// A move, a push at the tool, an idle joint and the loss of power: every force of the simulation takes part.
fn script(options: SimulatorOptions) -> Vec<Joints<7>> {
    let mut arm = SimulatedArm::new(WamModel::<7>::new(), options);
    let mut seen = Vec::new();
    let target = Joints::<7>::from([0.3, -1.5, 0.1, 2.5, -0.2, 0.4, 0.5]);
    arm.move_joints(&target, &JointLimits::uniform(0.75, 0.5))
        .unwrap();
    arm.run(Duration::from_secs(1));
    seen.push(arm.simulator().angles());
    arm.finish(Duration::from_millis(500));
    seen.push(arm.simulator().angles());
    arm.simulator_mut().push(Vector3::new(5.0, 20.0, -10.0));
    arm.run(Duration::from_millis(500));
    seen.push(arm.simulator().angles());
    arm.simulator_mut().set_idle(3, true);
    arm.run(Duration::from_millis(500));
    seen.push(arm.simulator().angles());
    arm.simulator_mut().safety_mut().press_stop();
    arm.run(Duration::from_millis(500));
    seen.push(arm.simulator().angles());
    seen
}

/// Angles of the script before the simulation had effects, rad.
const BEFORE: [[f64; 7]; 5] = [
    [
        0.11579153133843662,
        -1.8026930428215298,
        0.03652880452808035,
        2.8809405545859623,
        -0.07153654855076406,
        0.1488917833120023,
        0.18722819042071173,
    ],
    [
        0.29731662201295733,
        -1.5014585940512315,
        0.09686285346377704,
        2.501325751737442,
        -0.19303079923968194,
        0.390694694532744,
        0.48881814427689274,
    ],
    [
        0.2959136846741962,
        -1.5011513707723991,
        0.10815946137222768,
        2.509873294170847,
        -0.19303079923909286,
        0.39854956872385694,
        0.4888812016584202,
    ],
    [
        0.2959136847303278,
        -1.5011251711005855,
        0.10815946137199713,
        2.6652399464890997,
        -0.19303079923860464,
        0.39854956872385694,
        0.4889923937241946,
    ],
    [
        0.2902441091242868,
        -1.570851433928029,
        0.1424033573911553,
        2.822462723309675,
        -0.15256732952010554,
        0.399625921348988,
        0.4889923937241946,
    ],
];

/// Recorded before the arm had effects. A mathematical library with another sine gives other last digits.
#[test]
fn the_numbers_are_those_of_before() {
    let found = script(SimulatorOptions::default());
    for (found, before) in found.iter().zip(BEFORE) {
        let off = (found - Joints::<7>::from(before)).amax();
        assert!(off < 1e-9, "{off} rad: {found}");
    }
}

#[test]
fn effects_of_size_zero_change_no_bit() {
    let none = TorqueVariation {
        periods_per_turn: 36.0,
        ..TorqueVariation::default()
    };
    let options = SimulatorOptions {
        effects: ArmEffects {
            torque_variation: [none; 7],
            stiction: Stiction {
                breakaway: 1.0,
                stribeck_speed: 0.1,
            },
            supply_voltage: 48.0,
            ..ArmEffects::default()
        },
        ..SimulatorOptions::default()
    };
    assert_eq!(script(options), script(SimulatorOptions::default()));
}

#[test]
fn the_same_seed_gives_the_same_numbers_with_all_effects() {
    let with_seed = |seed| {
        script(SimulatorOptions {
            seed,
            ..SimulatorOptions::real_arm()
        })
    };
    assert_eq!(with_seed(7), with_seed(7));
    assert_ne!(with_seed(7), with_seed(8));
}
