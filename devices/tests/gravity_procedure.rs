//! The gravity calibration of an arm that carries something nobody told its driver of.

use std::convert::Infallible;

use yarp_devices::dynamics::{Body, GravityCalibration, HeldPose};
use yarp_devices::kinematics::Joints;
use yarp_devices::simulation::SimulatorOptions;
use yarp_devices::wam::{
    DynamicArm, GravityResult, MeasuredArm, WamModel, calibrate_gravity, gravity_poses,
};
use yarp_devices::{Axes, Mode};

/// Control periods in a second.
const RATE: usize = 500;

/// A simulated arm whose time passes as it is asked.
struct Stepped<const N: usize>(DynamicArm<N>);

impl<const N: usize> Stepped<N> {
    fn wait(&mut self, seconds: usize) {
        for _ in 0..seconds * RATE {
            self.0.tick();
        }
    }
}

impl<const N: usize> MeasuredArm<N> for Stepped<N> {
    type Error = Infallible;

    fn move_to(&mut self, joints: &Joints<N>, speed: f64) -> Result<(), Infallible> {
        let degrees = joints.map(f64::to_degrees);
        let speeds = [speed.to_degrees(); N];
        let points = self.0.set_points_mut();
        points.set_reference_speeds(Axes::All, &speeds).unwrap();
        self.0.position_move(Axes::All, degrees.as_slice()).unwrap();
        let mut left = 60 * RATE;
        while !self.0.motion_done(Axes::All).unwrap() && left > 0 {
            self.0.tick();
            left -= 1;
        }
        Ok(())
    }

    fn measure(&mut self) -> Result<HeldPose<N>, Infallible> {
        self.wait(2);
        let (mut joints, mut torques) = (Joints::zeros(), Joints::zeros());
        for _ in 0..RATE {
            self.0.tick();
            for joint in 0..N {
                joints[joint] += self.0.state(joint.into()).unwrap().position.to_radians();
            }
            torques += Joints::from_iterator(self.0.torques(Axes::All).unwrap());
        }
        let count = RATE as f64;
        Ok(HeldPose {
            joints: joints / count,
            torques: torques / count,
        })
    }
}

/// Returns an arm with a load of 1.2 kg that its gravity compensation does not know.
fn loaded<const N: usize>(calibration: GravityCalibration<N>) -> Stepped<N>
where
    WamModel<N>: Default,
{
    let mut model = WamModel::<N>::default().with_load(Body::point(1.2, [0.0, 0.0, 0.06].into()));
    model.calibration = calibration;
    let mut arm = DynamicArm::new(model, SimulatorOptions::default());
    arm.safety_mut().press_activate();
    arm.set_control_modes(Axes::All, &[Mode::Position; N])
        .unwrap();
    Stepped(arm)
}

fn calibrate<const N: usize>(arm: &mut Stepped<N>, model: &WamModel<N>) -> GravityResult<N> {
    let mut done = 0;
    let result = calibrate_gravity(arm, model, |count| done = count).unwrap();
    assert_eq!(done, gravity_poses());
    result
}

/// Returns how far the joints sink in two seconds with no torque but that of the compensation, rad.
fn sinks<const N: usize>(calibration: GravityCalibration<N>) -> f64
where
    WamModel<N>: Default,
{
    let mut arm = loaded(calibration);
    let pose = [0.0, 0.8, 0.0, 1.2, 0.0, 0.3, 0.0];
    let pose = Joints::<N>::from_fn(|joint, _| pose[joint]);
    arm.0.place(&pose);
    arm.0
        .set_control_modes(Axes::All, &[Mode::Torque; N])
        .unwrap();
    arm.wait(2);
    let place = |joint: usize| arm.0.state(joint.into()).unwrap().position.to_radians();
    (0..N)
        .map(|joint| (place(joint) - pose[joint]).abs())
        .fold(0.0, f64::max)
}

fn an_unknown_load_is_compensated<const N: usize>()
where
    WamModel<N>: Default,
{
    let model = WamModel::<N>::default();
    let mut arm = loaded(model.calibration);
    let result = calibrate(&mut arm, &model);
    assert!(result.is_verified(), "{result:?}");
    assert!(result.before[1] > 2.0 * result.friction[1], "{result:?}");
    assert!(sinks(model.calibration) > 0.2);
    assert!(sinks(result.calibration) < 0.02);
}

#[test]
fn an_unknown_load_is_compensated_after_a_calibration() {
    an_unknown_load_is_compensated::<7>();
}

#[test]
fn an_unknown_load_of_an_arm_without_a_wrist_is_compensated_after_a_calibration() {
    an_unknown_load_is_compensated::<4>();
}

/// Writes down where it is sent, and how fast.
#[derive(Default)]
struct Recorder(Vec<(Joints<7>, f64)>);

impl MeasuredArm for Recorder {
    type Error = Infallible;

    fn move_to(&mut self, joints: &Joints<7>, speed: f64) -> Result<(), Infallible> {
        self.0.push((*joints, speed));
        Ok(())
    }

    fn measure(&mut self) -> Result<HeldPose<7>, Infallible> {
        let joints = self.0.last().expect("it was moved").0;
        let torques = Joints::zeros();
        Ok(HeldPose { joints, torques })
    }
}

/// libbarrett, `gravitycal.cpp`: each pose is approached from 0.03 rad above and below, at 0.05 rad/s, so that friction
/// pulls both ways.
#[test]
fn each_pose_is_approached_slowly_from_both_sides() {
    let mut arm = Recorder::default();
    let model = WamModel::<7>::new();
    calibrate_gravity(&mut arm, &model, |_| ()).unwrap();
    assert_eq!(arm.0.len(), 4 * gravity_poses());
    for moves in arm.0.chunks(4) {
        let [(above, _), (pose, slow), (below, _), (again, slow_again)] = moves else {
            unreachable!("four moves");
        };
        assert_eq!((slow, slow_again), (&0.05, &0.05));
        assert_eq!(pose, again);
        let off = |from: &Joints<7>, by: f64| (from - pose).add_scalar(-by).amax();
        assert!(off(above, 0.03) < 1e-12 && off(below, -0.03) < 1e-12);
        assert!(model.chain.contains(pose), "{pose}");
    }
    // The first pose of `calibration.conf`.
    let right = std::f64::consts::FRAC_PI_2;
    let first = Joints::<7>::from([0.0, -right, 0.0, right, 0.0, 0.0, 0.0]);
    assert!((arm.0[1].0 - first).amax() < 1e-4);
}
