//! The fingers' kinematics against printed places, finite differences, plane geometry, and back.

use nalgebra::Vector3;
use proptest::prelude::*;
use yarp_devices::hand::gcl::Finger;
use yarp_devices::hand::{FingerJoints, Links, finger_coupling, finger_kinematics};

fn engaged(spread: f64, inner: f64) -> FingerJoints {
    let outer = inner * finger_coupling::RATIO;
    FingerJoints {
        spread,
        links: Links { inner, outer },
    }
}

fn tip(finger: Finger, joints: &FingerJoints) -> Vector3<f64> {
    finger_kinematics::tip(finger, joints).translation.vector
}

/// Places worked out by hand from the manual's table, at spread 0, to a tenth of a millimetre.
#[test]
fn tips_are_where_the_table_puts_them() {
    let check = |degrees: f64, joint: [f64; 3], first: [f64; 3], third: [f64; 3]| {
        let joints = engaged(0.0, degrees.to_radians());
        let close = |place: Vector3<f64>, expected: [f64; 3]| {
            assert!(
                (place - Vector3::from(expected)).norm() < 1e-4,
                "{degrees}: {place:?}, expected {expected:?}"
            );
        };
        close(finger_kinematics::outer_joint(Finger::F1, &joints), joint);
        close(tip(Finger::F1, &joints), first);
        close(tip(Finger::F3, &joints), third);
    };
    check(
        0.0,
        [-0.025, -0.1199, 0.0790],
        [-0.025, -0.1490, 0.1208],
        [0.0, 0.1490, 0.1208],
    );
    check(
        45.0,
        [-0.025, -0.0973, 0.1276],
        [-0.025, -0.0756, 0.1736],
        [0.0, 0.0756, 0.1736],
    );
    check(
        90.0,
        [-0.025, -0.0470, 0.1459],
        [-0.025, 0.0037, 0.1502],
        [0.0, -0.0037, 0.1502],
    );
}

/// The first two fingers are mirror images; spread by half a turn they are beside the third.
#[test]
fn the_spread_turns_two_fingers_in_opposite_directions() {
    for degrees in [0.0, 30.0, 90.0, 135.0, 180.0_f64] {
        let joints = engaged(degrees.to_radians(), 0.8);
        let (one, other) = (tip(Finger::F1, &joints), tip(Finger::F2, &joints));
        assert!((one.x + other.x).abs() < 1e-12 && (one.y - other.y).abs() < 1e-12);
    }
    let joints = engaged(std::f64::consts::PI, 0.8);
    let (first, third) = (tip(Finger::F1, &joints), tip(Finger::F3, &joints));
    assert!((first.y - third.y).abs() < 1e-12 && (first.x + 0.025).abs() < 1e-12);
}

fn any_finger() -> impl Strategy<Value = Finger> {
    prop::sample::select(Finger::ALL.to_vec())
}

/// Joints that a motor can reach: the outer link at least as far closed as the coupling turns it.
fn any_joints() -> impl Strategy<Value = FingerJoints> {
    (0.0..std::f64::consts::PI, 0.0..1.0f64, 0.0..1.0f64).prop_map(|(spread, inner, more)| {
        let inner = inner * finger_coupling::INNER_LIMIT;
        let least = inner * finger_coupling::RATIO;
        let outer = least + more * (finger_coupling::OUTER_LIMIT - least);
        FingerJoints {
            spread,
            links: Links { inner, outer },
        }
    })
}

proptest! {
    /// An independent way to the same place: the finger is two links in a plane, and the plane turns.
    #[test]
    fn plane_geometry_agrees(finger in any_finger(), joints in any_joints()) {
        let (side, heading) = match finger {
            Finger::F1 => (-0.025, -90f64.to_radians() - joints.spread),
            Finger::F2 => (0.025, -90f64.to_radians() + joints.spread),
            Finger::F3 => (0.0, 90f64.to_radians()),
        };
        let first = joints.links.inner + 2.46f64.to_radians();
        let second = first + joints.links.outer + 42f64.to_radians();
        let reach = 0.05 + 0.07 * first.cos() + 0.05 * second.cos() - 0.0095 * second.sin();
        let height = 0.076 + 0.07 * first.sin() + 0.05 * second.sin() + 0.0095 * second.cos();
        let expected = Vector3::new(side + reach * heading.cos(), reach * heading.sin(), height);
        prop_assert!((tip(finger, &joints) - expected).norm() < 1e-12);
    }

    #[test]
    fn the_jacobian_is_the_difference_of_places(finger in any_finger(), joints in any_joints()) {
        const STEP: f64 = 1e-6;
        let moved = |column: usize, by: f64| {
            let mut joints = joints;
            match column {
                0 => joints.spread += by,
                1 => joints.links.inner += by,
                _ => joints.links.outer += by,
            }
            tip(finger, &joints)
        };
        let jacobian = finger_kinematics::jacobian(finger, &joints);
        for column in 0..3 {
            let slope = (moved(column, STEP) - moved(column, -STEP)) / (2.0 * STEP);
            prop_assert!((jacobian.column(column) - slope).norm() < 1e-8);
        }
    }

    /// Any reachable tip position is found again, by joints that the motor can reach.
    #[test]
    fn the_inverse_brings_the_tip_back(finger in any_finger(), joints in any_joints()) {
        let point = tip(finger, &joints);
        let solution = finger_kinematics::inverse(finger, &point);
        prop_assert!(solution.distance < 1e-9, "{solution:?} of {joints:?}");
        prop_assert!((tip(finger, &solution.joints) - point).norm() < 1e-9);
        prop_assert!(finger_coupling::motor(solution.joints.links).is_some());
        prop_assert!((0.0..=std::f64::consts::PI).contains(&solution.joints.spread));
    }

    #[test]
    fn with_the_clutch_engaged_the_tip_comes_back_too(
        finger in any_finger(),
        spread in 0.0..std::f64::consts::PI,
        part in 0.0..1.0f64,
    ) {
        let joints = engaged(spread, part * finger_coupling::INNER_LIMIT);
        let point = tip(finger, &joints);
        let solution = finger_kinematics::inverse_engaged(finger, &point);
        prop_assert!(solution.distance < 1e-7, "{solution:?} of {joints:?}");
        let links = solution.joints.links;
        prop_assert!((links.outer - links.inner * finger_coupling::RATIO).abs() < 1e-12);
    }

    /// For any target, the solution is inside the limits, and reports its distance.
    #[test]
    fn a_place_out_of_reach_is_neared(
        finger in any_finger(),
        x in -1.0..1.0f64,
        y in -1.0..1.0f64,
        z in -1.0..1.0f64,
    ) {
        let point = Vector3::new(x, y, z);
        for solution in [finger_kinematics::inverse(finger, &point), finger_kinematics::inverse_engaged(finger, &point)] {
            let left = (tip(finger, &solution.joints) - point).norm();
            prop_assert!((left - solution.distance).abs() < 1e-12);
            prop_assert!(finger_coupling::motor(solution.joints.links).is_some());
        }
    }
}
