//! Forward kinematics and the Jacobian agree with the crate `k` on an independently written description of the arm.

use k::SerialChain;
use nalgebra::{Rotation3, Translation3, Vector3};
use proptest::prelude::*;
use yarp_devices::kinematics::{Chain, Joints, Pose, rotation_vector};
use yarp_devices::wam::WamModel;

fn oracle(joints: usize) -> SerialChain<f64> {
    let file = format!(
        "{}/tests/oracle/wam{joints}.urdf",
        env!("CARGO_MANIFEST_DIR")
    );
    let chain = k::Chain::<f64>::from_urdf_file(file).expect("the description is well-formed");
    SerialChain::from_end(chain.find("tool_mount").expect("it has a tool"))
}

/// Returns the pose of the tool by the other library: position, and rotation by rows.
fn oracle_pose(chain: &SerialChain<f64>, angles: &[f64]) -> ([f64; 3], [[f64; 3]; 3]) {
    chain.set_joint_positions_unchecked(angles);
    let pose = chain.end_transform();
    let place = pose.translation.vector;
    let turn = pose.rotation.to_rotation_matrix();
    let rows = [0, 1, 2].map(|row| [0, 1, 2].map(|column| turn[(row, column)]));
    ([place.x, place.y, place.z], rows)
}

fn check_forward<const N: usize>(chain: &Chain<N>, oracle: &SerialChain<f64>, angles: [f64; N]) {
    let pose = chain.forward(&Joints::<N>::from(angles));
    let (place, rows) = oracle_pose(oracle, &angles);
    assert!(
        (pose.translation.vector - Vector3::from(place)).norm() < 1e-9,
        "{angles:?}"
    );
    for (row, expected) in rows.iter().enumerate() {
        for (column, expected) in expected.iter().enumerate() {
            let ours = pose.rotation.matrix()[(row, column)];
            assert!((ours - expected).abs() < 1e-9, "{angles:?}");
        }
    }
}

/// Central differences of the tool's pose, and the Jacobian, which must agree to 1e-7.
fn check_jacobian<const N: usize>(chain: &Chain<N>, angles: Joints<N>) {
    const STEP: f64 = 1e-5;
    let (pose, jacobian) = chain.forward_and_jacobian(&angles);
    assert_eq!(pose, chain.forward(&angles));
    for joint in 0..N {
        let moved = |by: f64| {
            let mut angles = angles;
            angles[joint] += by;
            chain.forward(&angles)
        };
        let (before, after) = (moved(-STEP), moved(STEP));
        let velocity = (after.translation.vector - before.translation.vector) / (2.0 * STEP);
        let spin = rotation_vector(&(after.rotation * before.rotation.inverse())) / (2.0 * STEP);
        let column = jacobian.column(joint);
        for row in 0..3 {
            assert!((column[row] - velocity[row]).abs() < 1e-7, "{angles:?}");
            assert!((column[row + 3] - spin[row]).abs() < 1e-7, "{angles:?}");
        }
    }
}

fn four() -> Chain<4> {
    // The description follows Barrett's manual, where the outer link is 0.35 m long.
    let end = Pose::translation(0.0, 0.0, 0.35);
    WamModel::<4>::new().chain.with_tool(end)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(500))]

    #[test]
    fn with_seven_joints(angles in prop::array::uniform7(-3.2..3.2)) {
        let chain = WamModel::<7>::new().chain;
        check_forward(&chain, &oracle(7), angles);
        check_jacobian(&chain, angles.into());
    }

    #[test]
    fn with_four_joints(angles in prop::array::uniform4(-3.2..3.2)) {
        check_forward(&four(), &oracle(4), angles);
        check_jacobian(&four(), angles.into());
    }

    #[test]
    fn with_a_tool(angles in prop::array::uniform7(-3.2..3.2), turn in prop::array::uniform3(-1.0..1.0)) {
        let tool = Pose::from_parts(
            Translation3::new(0.02, -0.03, 0.18),
            Rotation3::new(Vector3::from(turn)),
        );
        let arm = WamModel::<7>::new();
        let plate = arm.chain.forward(&angles.into());
        let with_tool = arm.with_tool(tool).chain;
        let expected = plate * tool;
        let pose = with_tool.forward(&angles.into());
        prop_assert!((pose.translation.vector - expected.translation.vector).norm() < 1e-12);
        prop_assert!((pose.rotation.matrix() - expected.rotation.matrix()).norm() < 1e-12);
        check_jacobian(&with_tool, angles.into());
    }
}

#[test]
fn at_the_published_poses() {
    let chain = WamModel::<7>::new().chain;
    let check = |angles: [f64; 7], place: [f64; 3]| {
        let found = chain.forward(&angles.into()).translation.vector;
        assert!((found - Vector3::from(place)).norm() < 1e-5, "{found}");
    };
    check([0.0; 7], [0.0, 0.0, 0.9109]);
    check(
        [0.0, 0.0, 0.0, std::f64::consts::FRAC_PI_2, 0.0, 0.0, 0.0],
        [0.4059, 0.0, 0.595],
    );
    check(
        [0.0, -2.0, 0.0, 3.13, 0.0, 0.0, 0.0],
        [-0.21164, 0.0, 0.00672],
    );
    check(
        [0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7],
        [0.31864, 0.09762, 0.83001],
    );
    let folded = four()
        .forward(&[0.0, -2.0, 0.0, 3.13].into())
        .translation
        .vector;
    assert!((folded - Vector3::new(-0.2215, 0.0, 0.00207)).norm() < 1e-4);
}
