//! Visual servoing: convergence in spite of an error of the calibration, one correction per image, and a tool that holds
//! whenever something fails.

use std::time::Duration;

use nalgebra::{Rotation3, Vector3};
use yarp_devices::kinematics::Joints;
use yarp_devices::wam::WamModel;
use yarp_vision::Pose;
use yarp_vision::servoing::{
    Correction, Observation, Servo, ServoError, ServoOptions, ServoStep, ServoedTool, follow_goal,
    joint_step,
};

const INTERVAL: Duration = Duration::from_millis(100);

fn pose(x: f64, y: f64, z: f64, yaw: f64) -> Pose {
    let turn = Rotation3::from_axis_angle(&Vector3::z_axis(), yaw);
    Pose::from_parts(Vector3::new(x, y, z).into(), turn)
}

/// A tool that moves exactly, seen by a camera whose calibration is wrong, one image late.
struct Fake {
    tool: Pose,
    goal: Pose,
    /// Error of the calibration: of everything that is seen.
    wrong: Pose,
    number: u64,
    /// Number of the first image that does not show the goal, and of the first that does not show the tool.
    hides_goal: u64,
    hides_tool: u64,
    /// Number of the first image that does not come.
    stops: u64,
    fails: Option<&'static str>,
    image: Option<Observation>,
    corrections: Vec<Correction>,
    holds: u32,
}

impl Fake {
    fn new() -> Self {
        Self {
            tool: pose(0.5, 0.0, 0.1, 0.0),
            goal: pose(0.52, -0.01, 0.08, 0.05),
            wrong: pose(0.004, -0.003, 0.002, 0.009),
            number: 0,
            hides_goal: u64::MAX,
            hides_tool: u64::MAX,
            stops: u64::MAX,
            fails: None,
            image: None,
            corrections: Vec::new(),
            holds: 0,
        }
    }

    fn fail(&self, action: &str) -> Result<(), Box<dyn std::error::Error + Send + Sync>> {
        match self.fails == Some(action) {
            true => Err(format!("no {action}").into()),
            false => Ok(()),
        }
    }
}

impl ServoedTool for Fake {
    fn observe(
        &mut self,
    ) -> Result<(Duration, Option<Observation>), Box<dyn std::error::Error + Send + Sync>> {
        self.fail("image")?;
        self.number += 1;
        let now = Observation {
            number: self.number.min(self.stops),
            tool: (self.number < self.hides_tool).then(|| self.wrong * self.tool),
            goal: (self.number < self.hides_goal).then(|| self.wrong * self.goal),
        };
        Ok((INTERVAL * self.number as u32, self.image.replace(now)))
    }

    fn correct(
        &mut self,
        correction: &Correction,
    ) -> Result<(), Box<dyn std::error::Error + Send + Sync>> {
        self.fail("correction")?;
        self.tool = correction.of(&self.tool);
        self.corrections.push(*correction);
        Ok(())
    }

    fn hold(&mut self) -> Result<(), Box<dyn std::error::Error + Send + Sync>> {
        self.holds += 1;
        self.fail("hold")
    }
}

#[test]
fn the_tool_arrives_though_the_calibration_is_wrong() {
    let mut fake = Fake::new();
    let options = ServoOptions::default();
    let servoed = follow_goal(&mut fake, &options).unwrap();
    let left = (fake.tool.translation.vector - fake.goal.translation.vector).norm();
    assert!(left < 0.0006, "{left}");
    assert!(fake.tool.rotation.angle_to(&fake.goal.rotation) < 0.0035);
    assert!(servoed.distance <= options.tolerance[0] && servoed.angle <= options.tolerance[1]);
    assert_eq!(servoed.corrections as usize, fake.corrections.len());
    assert_eq!(fake.holds, 1);
    // Bounded, and the bound is used at the start.
    let longest = |of: fn(&Correction) -> f64| fake.corrections.iter().map(of).fold(0.0, f64::max);
    let step = longest(|correction| correction.translation.norm());
    assert!((step - options.max_step).abs() < 1e-9, "{step}");
    let turn = longest(|correction| correction.rotation.norm());
    assert!(
        (turn - options.max_turn).abs() < 1e-3 && turn <= options.max_turn + 1e-9,
        "{turn}"
    );
}

#[test]
fn a_correction_is_the_gain_times_the_difference() {
    let mut servo = Servo::new(ServoOptions::default()).unwrap();
    let image = Observation {
        number: 1,
        tool: Some(pose(0.5, 0.0, 0.1, 0.0)),
        goal: Some(pose(0.505, 0.0, 0.1, 0.01)),
    };
    let step = servo.step(Duration::ZERO, Some(&image)).unwrap();
    let ServoStep::Move(correction) = step else {
        panic!("{step:?}");
    };
    assert!((correction.translation - Vector3::new(0.002, 0.0, 0.0)).norm() < 1e-12);
    assert!((correction.rotation - Vector3::new(0.0, 0.0, 0.004)).norm() < 1e-12);
    // The same image again is no new one, nor does it settle a tool at its goal.
    let again = servo.step(INTERVAL, Some(&image)).unwrap();
    assert_eq!(again, ServoStep::Hold);
}

#[test]
fn a_tool_has_arrived_after_three_images_in_a_row() {
    let mut servo = Servo::new(ServoOptions::default()).unwrap();
    let goal = pose(0.5, 0.0, 0.1, 0.0);
    let mut step = |number: u64, away: f64| {
        let image = Observation {
            number,
            tool: Some(pose(0.5 + away, 0.0, 0.1, 0.0)),
            goal: Some(goal),
        };
        servo.step(INTERVAL * number as u32, Some(&image)).unwrap()
    };
    assert_eq!(step(1, 0.0004), ServoStep::Hold);
    assert_eq!(step(2, 0.0004), ServoStep::Hold);
    assert!(matches!(step(3, 0.0006), ServoStep::Move(_)));
    assert_eq!(step(4, 0.0), ServoStep::Hold);
    assert_eq!(step(5, 0.0), ServoStep::Hold);
    assert_eq!(step(6, 0.0), ServoStep::Arrived);
}

#[test]
fn a_goal_that_the_tool_hides_is_remembered_for_a_second() {
    let mut options = ServoOptions::default();
    options.goal_memory = Duration::from_secs(3);
    let mut fake = Fake::new();
    fake.hides_goal = 5;
    follow_goal(&mut fake, &options).unwrap();
    let mut fake = Fake::new();
    // Too far to arrive within the memory.
    fake.goal = pose(0.57, 0.0, 0.1, 0.0);
    fake.hides_goal = 3;
    let error = follow_goal(&mut fake, &ServoOptions::default()).unwrap_err();
    assert!(
        matches!(
            error,
            ServoError::Lost {
                what: "the goal",
                ..
            }
        ),
        "{error}"
    );
    // Images 2 and those of one second show where it was.
    assert!(
        (8..=14).contains(&fake.corrections.len()),
        "{}",
        fake.corrections.len()
    );
}

#[test]
fn whatever_is_lost_or_fails_the_tool_holds() {
    let timeout = |error: &ServoError| matches!(error, ServoError::Timeout { .. });
    let lost = |what: &'static str| move |error: &ServoError| matches!(error, ServoError::Lost { what: w, .. } if *w == what);
    type Check = Box<dyn Fn(&ServoError) -> bool>;
    let failed = |error: &ServoError| matches!(error, ServoError::Failed { .. });
    type Case = (&'static str, fn(&mut Fake), Check);
    let cases: Vec<Case> = vec![
        (
            "tool hidden",
            |fake| fake.hides_tool = 4,
            Box::new(lost("the tool")),
        ),
        (
            "stream stops",
            |fake| fake.stops = 4,
            Box::new(lost("a new image")),
        ),
        (
            "goal never seen",
            |fake| fake.hides_goal = 0,
            Box::new(lost("the goal")),
        ),
        (
            "no image",
            |fake| fake.fails = Some("image"),
            Box::new(failed),
        ),
        (
            "arm fails",
            |fake| fake.fails = Some("correction"),
            Box::new(failed),
        ),
        (
            "does not hold",
            |fake| fake.fails = Some("hold"),
            Box::new(failed),
        ),
        (
            "too far",
            |fake| fake.goal = pose(0.581, 0.0, 0.1, 0.0),
            Box::new(|error| matches!(error, ServoError::TooFar { .. })),
        ),
        (
            "no number",
            |fake| fake.goal = pose(f64::NAN, 0.0, 0.1, 0.0),
            Box::new(|error| matches!(error, ServoError::TooFar { .. })),
        ),
    ];
    for (name, prepare, is_expected) in cases {
        let mut fake = Fake::new();
        prepare(&mut fake);
        let error = follow_goal(&mut fake, &ServoOptions::default()).unwrap_err();
        assert!(is_expected(&error), "{name}: {error}");
        assert_eq!(fake.holds, 1, "{name}");
    }
    // A goal that flees is never reached: the servoing ends.
    let mut options = ServoOptions::default();
    options.timeout = Duration::from_secs(1);
    options.gain = 0.001;
    let mut fake = Fake::new();
    let error = follow_goal(&mut fake, &options).unwrap_err();
    assert!(timeout(&error), "{error}");
    assert!(fake.number <= 12 && fake.holds == 1, "{}", fake.number);
}

#[test]
fn options_out_of_range_are_refused() {
    let refused = |change: fn(&mut ServoOptions)| {
        let mut options = ServoOptions::default();
        change(&mut options);
        matches!(Servo::new(options), Err(ServoError::Option { .. }))
    };
    assert!(refused(|options| options.gain = 0.0));
    assert!(refused(|options| options.gain = 1.01));
    assert!(refused(|options| options.gain = f64::NAN));
    assert!(refused(|options| options.max_step = 0.0));
    assert!(refused(|options| options.max_turn = f64::INFINITY));
    assert!(refused(|options| options.tolerance[0] = -1.0));
    assert!(refused(|options| options.tolerance[1] = 0.0));
    assert!(refused(|options| options.max_distance = f64::NAN));
    assert!(!refused(|options| options.gain = 1.0));
}

#[test]
fn a_joint_step_moves_the_tool_as_corrected_or_not_at_all() {
    let chain = WamModel::<7>::new()
        .chain
        .with_tool(pose(0.1, 0.0, 0.05, 0.3));
    let joints = Joints::<7>::from([0.2, 0.4, 0.1, 1.8, 0.2, 0.7, 0.1]);
    let correction = Correction {
        translation: Vector3::new(0.003, -0.002, 0.001),
        rotation: Vector3::new(0.002, 0.004, -0.006),
    };
    let there = chain.forward(&joint_step(&chain, &joints, &correction).unwrap());
    let wanted = correction.of(&chain.forward(&joints));
    assert!((there.translation.vector - wanted.translation.vector).norm() < 2e-4);
    assert!(there.rotation.angle_to(&wanted.rotation) < 1e-3);
    // Stretched out, the arm cannot reach farther.
    let error = joint_step(&chain, &Joints::<7>::zeros(), &correction).unwrap_err();
    assert!(matches!(error, ServoError::Singular { .. }), "{error}");
    let mut at_limit = joints;
    at_limit[3] = chain.limits()[3].max - 1e-4;
    let up = |by: f64| Correction {
        translation: (chain.forward(&at_limit).translation.vector.normalize()) * by,
        rotation: Vector3::zeros(),
    };
    let results = [0.005, -0.005].map(|by| joint_step(&chain, &at_limit, &up(by)));
    assert!(
        results
            .iter()
            .any(|result| matches!(result, Err(ServoError::Joint { joint: 3, .. }))),
        "{results:?}"
    );
    let far = Correction {
        translation: Vector3::new(0.2, 0.0, 0.0),
        rotation: Vector3::zeros(),
    };
    let error = joint_step(&chain, &joints, &far).unwrap_err();
    assert!(matches!(error, ServoError::Joint { .. }), "{error}");
}
