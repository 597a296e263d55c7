//! Several devices remapped into one board: it behaves as one device does, and names the device of a refusal.

use std::sync::Arc;
use std::time::Duration;

use yarp_devices::fake::AxisParameters;
use yarp_devices::remapper::{Named, Remapper};
use yarp_devices::wam::SimulatedWam;
use yarp_devices::{
    AmplifierControl, AmplifierLimit, Axes, AxisIndex, AxisInfo, Device, DeviceError,
    EncoderReading, Encoders, JointType, Limits, Mode, VariableValue, checks, offers,
};

const TEST_TIMEOUT: Duration = Duration::from_secs(60);

/// An arm whose joints are called `NAME0`, `NAME1` ...
fn arm(name: &str, joints: usize) -> Named {
    let axes = (0..joints).map(|joint| AxisParameters {
        name: format!("{name}{joint}"),
        joint_type: JointType::Revolute,
        limits: Limits::new(-12.0, 12.0 + joint as f64),
        max_speed: 100.0,
        max_acceleration: 1000.0,
        reference_speed: 30.0,
        reference_acceleration: 200.0,
        home: 0.0,
    });
    let arm = SimulatedWam::with_axes(axes);
    (name.to_owned(), Arc::new(arm))
}

fn indices(numbers: &[usize]) -> Vec<AxisIndex> {
    numbers.iter().copied().map(AxisIndex::from).collect()
}

fn of_names(devices: Vec<Named>, names: &str) -> Result<Remapper, String> {
    let names: Vec<String> = names.split_whitespace().map(str::to_owned).collect();
    Remapper::of_names(devices, &names).map_err(|error| error.to_string())
}

/// All joints of two arms, none beside its neighbour.
fn shuffled() -> Remapper {
    let arms = vec![arm("left", 3), arm("right", 2)];
    of_names(arms, "right1 left2 right0 left0 left1").expect("they fit")
}

/// One test per check, each with a board of its own.
macro_rules! check_each {
    ($($name:ident),* $(,)?) => {
        $(
            #[test]
            fn $name() {
                checks::$name(&shuffled(), TEST_TIMEOUT);
            }
        )*

        #[test]
        fn no_check_is_left_out() {
            let here = [$(stringify!($name)),*];
            let all = checks::ALL.iter().chain(checks::SINCE_4);
            let all: Vec<&str> = all.map(|(name, _)| *name).collect();
            assert_eq!(all, here);
        }
    };
}

yarp_devices::each_check_of_a_board_of_4! { check_each! {} }

/// The arms are queried for all their joints at once then.
#[test]
fn all_checks_in_a_row_on_two_arms_one_behind_the_other() {
    let arms = vec![arm("left", 2), arm("right", 2)];
    let arms = of_names(arms, "left0 left1 right0 right1").expect("they fit");
    for (_, check) in checks::ALL.iter().chain(checks::SINCE_4) {
        check(&arms, TEST_TIMEOUT);
    }
}

/// Two arms of one make have the same names of joints; on one board they have not.
#[test]
fn joints_of_the_same_name_are_told_apart() {
    let twins = [("left", arm("wam", 2).1), ("right", arm("wam", 2).1)];
    let twins = twins.map(|(name, arm)| (name.to_owned(), arm));
    let joints = [(1, 1.into()), (0, 1.into()), (0, 0.into())];
    let board = Remapper::of_joints(twins.into(), &joints).expect("they fit");
    let names = [0, 1, 2].map(|joint| board.axis_name(joint.into()).expect("it has a name"));
    assert_eq!(names, ["right_wam1", "left_wam1", "wam0"]);
}

/// A variable with a value for each joint has one for each joint of the board; others are prefixed with their device.
#[test]
fn variables_belong_to_the_board_or_to_a_device() {
    let (name, left) = arm("left", 3);
    let board = of_names(vec![(name, left), arm("right", 2)], "right0 left1").expect("they fit");
    let variables = board.remote_variables().expect("it has variables");
    let names = variables.variables().expect("it answers");
    for expected in ["friction", "left::friction", "right::friction"] {
        assert!(names.iter().any(|name| name == expected), "{names:?}");
    }
    let wanted = [2.5, 1.5].map(VariableValue::Number);
    variables
        .set_variable("friction", &wanted)
        .expect("it is allowed");
    assert_eq!(variables.variable("friction").expect("known"), wanted);
    let left = variables.variable("left::friction").expect("known");
    assert_eq!((left.len(), &left[1]), (3, &wanted[1]));
    assert_ne!(left[0], wanted[1], "the others keep theirs");
    variables
        .set_variable("left::friction", &left)
        .expect("it is allowed");
    let short = variables.set_variable("friction", &wanted[..1]);
    assert!(short.is_err());
}

#[test]
fn a_part_of_a_device_leaves_the_rest_alone() {
    let (name, left) = arm("left", 4);
    let part = of_names(vec![(name, Arc::clone(&left))], "left3 left1").expect("they fit");
    let moves = part.position_control().expect("it moves");
    moves
        .position_move(Axes::All, &[11.0, 10.0])
        .expect("it is allowed");
    let own = left.position_control().expect("it moves");
    let targets = own.target_positions(Axes::All).expect("it answers");
    assert_eq!(targets, [0.0, 10.0, 0.0, 11.0]);
    // These would move what is not here.
    let whole = part.control_calibration().expect("it is calibrated");
    for refused in [whole.park_robot(false), whole.calibrate_robot()] {
        let said = refused.unwrap_err().to_string();
        assert!(said.contains("a part of left is not supported"), "{said}");
    }
    let homing = part.remote_calibrator().expect("it has one");
    homing.park(Axes::All).expect("it is allowed");
    own.position_move(Axes::One(0.into()), &[5.0])
        .expect("it is allowed");
    let targets = own.target_positions(Axes::All).expect("it answers");
    assert_eq!(targets, [5.0, 0.0, 0.0, 0.0]);
}

/// Calls of one device, and its replies.
struct Witness {
    name: &'static str,
    axes: usize,
    refuses: bool,
    told: std::sync::Mutex<Vec<String>>,
}

fn witness(name: &'static str, axes: usize, refuses: bool) -> Arc<Witness> {
    Arc::new(Witness {
        name,
        axes,
        refuses,
        told: std::sync::Mutex::default(),
    })
}

impl Witness {
    fn hear(&self, what: String) -> Result<(), DeviceError> {
        self.told.lock().unwrap().push(what);
        if self.refuses {
            let joint = AxisIndex::from(self.axes - 1);
            return Err(DeviceError::Moving {
                joint,
                what: "do this",
            });
        }
        Ok(())
    }

    fn told(&self) -> Vec<String> {
        std::mem::take(&mut self.told.lock().unwrap())
    }
}

impl Device for Witness {
    offers! { axis_info: AxisInfo, encoders: Encoders, amplifier_control: AmplifierControl }
}

impl AxisInfo for Witness {
    fn axes(&self) -> usize {
        self.axes
    }

    fn axis_name(&self, axis: AxisIndex) -> Result<String, DeviceError> {
        Ok(format!("{}{axis}", self.name))
    }

    fn joint_type(&self, _: AxisIndex) -> Result<JointType, DeviceError> {
        Ok(JointType::Prismatic)
    }
}

impl Encoders for Witness {
    fn read_encoders(&self, axes: Axes<'_>, out: &mut [EncoderReading]) -> Result<(), DeviceError> {
        self.hear(format!("read {axes:?}"))?;
        for (slot, axis) in out.iter_mut().zip(axes.iter(self.axes)) {
            *slot = EncoderReading {
                position: axis.index() as f64,
                time: (self.name.len() * 100 + axis.index()) as f64,
                ..EncoderReading::default()
            };
        }
        Ok(())
    }

    fn set_encoders(&self, axes: Axes<'_>, positions: &[f64]) -> Result<(), DeviceError> {
        let joints: Vec<_> = axes.iter(self.axes).map(AxisIndex::index).collect();
        self.hear(format!("set {joints:?} {positions:?}"))
    }
}

impl AmplifierControl for Witness {
    fn enable_amplifiers(&self, _: Axes<'_>, enabled: bool) -> Result<(), DeviceError> {
        self.hear(format!("enable {enabled}"))
    }

    fn amplifier_status(&self, _: Axes<'_>) -> Result<Vec<i32>, DeviceError> {
        // One value, for any selection.
        Ok(vec![1])
    }

    fn amplifier_limit(&self, _: AmplifierLimit, _: AxisIndex) -> Result<f64, DeviceError> {
        Ok(1.0)
    }

    fn set_amplifier_limit(
        &self,
        _: AmplifierLimit,
        axis: AxisIndex,
        value: f64,
    ) -> Result<(), DeviceError> {
        self.hear(format!("limit {axis} {value}"))
    }

    fn amplifier_duty_cycle(&self, _: AxisIndex) -> Result<f64, DeviceError> {
        Ok(0.0)
    }

    fn supply_voltage(&self, _: AxisIndex) -> Result<f64, DeviceError> {
        Ok(24.0)
    }
}

/// Joints 1 and 0 of one witness and 0 and 2 of another, in turns.
fn watched(first: &Arc<Witness>, second: &Arc<Witness>) -> Remapper {
    let devices: Vec<Named> = vec![
        ("first".to_owned(), Arc::clone(first) as _),
        ("second".to_owned(), Arc::clone(second) as _),
    ];
    of_names(devices, "a1 b0 a0 b2").expect("they fit")
}

#[test]
fn each_device_gets_one_call_with_the_joints_that_are_its_own() {
    let (a, b) = (witness("a", 2, false), witness("b", 3, false));
    let board = watched(&a, &b);
    let encoders = board.encoders().expect("it has encoders");
    encoders
        .set_encoders(Axes::All, &[1.0, 2.0, 3.0, 4.0])
        .unwrap();
    assert_eq!(a.told(), ["set [1, 0] [1.0, 3.0]"]);
    assert_eq!(b.told(), ["set [0, 2] [2.0, 4.0]"]);
    let group = indices(&[3, 0, 1]);
    encoders
        .set_encoders(Axes::Group(&group), &[1.0, 2.0, 3.0])
        .unwrap();
    assert_eq!(a.told(), ["set [1] [2.0]"]);
    assert_eq!(b.told(), ["set [2, 0] [1.0, 3.0]"]);
    encoders.set_encoders(Axes::One(2.into()), &[9.0]).unwrap();
    assert_eq!(
        (a.told(), b.told()),
        (vec!["set [0] [9.0]".to_owned()], vec![])
    );
    // Inconsistent commands reach no device.
    let twice = indices(&[3, 3]);
    for (axes, values) in [
        (Axes::Group(&twice), &[1.0, 2.0][..]),
        (Axes::All, &[1.0]),
        (Axes::One(4.into()), &[1.0]),
    ] {
        assert!(encoders.set_encoders(axes, values).is_err());
    }
    assert_eq!((a.told(), b.told()), (vec![], vec![]));
}

/// The times are those of the devices, joint by joint.
#[test]
fn readings_come_in_the_order_asked_with_the_times_of_their_devices() {
    let (a, b) = (witness("a", 2, false), witness("b", 3, false));
    let board = watched(&a, &b);
    let read = |axes: Axes<'_>| {
        let readings = board.encoders().unwrap().encoder_readings(axes).unwrap();
        let shown = readings
            .iter()
            .map(|reading| (reading.position, reading.time));
        shown.collect::<Vec<_>>()
    };
    let expected = [(1.0, 101.0), (0.0, 100.0), (0.0, 100.0), (2.0, 102.0)];
    assert_eq!(read(Axes::All), expected);
    assert_eq!((a.told().len(), b.told().len()), (1, 1));
    let again = indices(&[3, 0, 3]);
    assert_eq!(
        read(Axes::Group(&again)),
        [expected[3], expected[0], expected[3]]
    );
    assert_eq!(read(Axes::One(3.into())), expected[3..]);
}

/// Joints in errors are numbered as on the board: the last of the second device is its last.
#[test]
fn a_refusal_names_the_device_and_says_what_was_done() {
    let all = [0.0; 4];
    let said = |a: &Arc<Witness>, b: &Arc<Witness>| {
        let refused = watched(a, b)
            .encoders()
            .unwrap()
            .set_encoders(Axes::All, &all);
        refused.unwrap_err().to_string()
    };
    let (a, b) = (witness("a", 2, false), witness("b", 3, true));
    assert_eq!(
        said(&a, &b),
        "second did not do it: joint 3 is moving, stop it to do this; done by first"
    );
    let (a, b) = (witness("a", 2, true), witness("b", 3, false));
    assert_eq!(
        said(&a, &b),
        "first did not do it: joint 0 is moving, stop it to do this; not done by second either"
    );
    assert_eq!(b.told(), Vec::<String>::new(), "it was left alone");
}

#[test]
fn what_brings_joints_to_rest_goes_to_every_device() {
    let (a, b) = (witness("a", 2, true), witness("b", 3, false));
    let board = watched(&a, &b);
    let amplifiers = board.amplifier_control().expect("it has amplifiers");
    let refused = amplifiers.enable_amplifiers(Axes::All, false).unwrap_err();
    assert_eq!(
        refused.to_string(),
        "first did not do it: joint 0 is moving, stop it to do this; done by second"
    );
    assert_eq!(b.told(), ["enable false"]);
    // Switching on is not of that kind.
    assert!(amplifiers.enable_amplifiers(Axes::All, true).is_err());
    assert_eq!(b.told(), Vec::<String>::new());
}

#[test]
fn an_answer_of_the_wrong_length_is_refused() {
    let board = watched(&witness("a", 2, false), &witness("b", 3, false));
    let refused = board
        .amplifier_control()
        .unwrap()
        .amplifier_status(Axes::All);
    assert_eq!(
        refused.unwrap_err().to_string(),
        "first did not do it: expected 2 values in an answer, got 1"
    );
}

/// The device that has it does nothing, since the whole command cannot be done.
#[test]
fn a_device_that_lacks_an_interface_is_named_with_the_joint() {
    let (name, left) = arm("left", 2);
    let dumb: Named = ("dumb".to_owned(), witness("a", 2, false));
    let board = of_names(vec![(name, Arc::clone(&left)), dumb], "left0 a1 left1 a0").expect("fits");
    let moves = board.position_control().expect("the arm has it");
    let refused = moves.position_move(Axes::All, &[10.0; 4]).unwrap_err();
    let said = "joint 1 (a1) belongs to dumb, which has no position control";
    assert_eq!(refused.to_string(), said);
    let own = left.position_control().unwrap();
    assert_eq!(own.target_positions(Axes::All).unwrap(), [0.0, 0.0]);
    let asked = moves.target_positions(Axes::One(3.into())).unwrap_err();
    assert_eq!(
        asked.to_string(),
        said.replace("joint 1 (a1)", "joint 3 (a0)")
    );
    moves
        .position_move(Axes::One(2.into()), &[10.0])
        .expect("the arm moves");
    assert_eq!(own.target_positions(Axes::All).unwrap(), [0.0, 10.0]);
    // The arm is stopped all the same.
    let stopped = moves.stop(Axes::All).unwrap_err().to_string();
    assert!(
        stopped.ends_with("no motion control; done by left"),
        "{stopped}"
    );
    assert!(board.torque_control().is_some() && board.hand().is_none());
}

/// A command that one device would refuse reaches none: the doubtful one is called first.
#[test]
fn what_one_device_will_refuse_moves_no_other() {
    let (first, left) = arm("left", 2);
    let (second, right) = arm("right", 2);
    let devices = vec![(first, Arc::clone(&left)), (second, Arc::clone(&right))];
    let board = of_names(devices, "left0 left1 right0 right1").expect("they fit");
    let modes = board.control_mode().unwrap();
    let untouched = |what: &str, refused: Result<(), DeviceError>| {
        let said = refused.expect_err(what).to_string();
        let ending = "; not done by left either";
        assert!(
            said.starts_with("right did not do it: joint ") && said.ends_with(ending),
            "{said}"
        );
    };
    modes
        .set_control_modes(Axes::All, &[Mode::Velocity; 4])
        .unwrap();
    let velocity = board.velocity_control().unwrap();
    for last in [1e6, f64::NAN] {
        untouched(
            "too fast",
            velocity.velocity_move(Axes::All, &[1.0, 1.0, 1.0, last]),
        );
    }
    let own = left
        .velocity_control()
        .unwrap()
        .reference_velocities(Axes::All)
        .unwrap();
    assert_eq!(own, [0.0, 0.0]);
    modes
        .set_control_modes(Axes::All, &[Mode::Torque; 4])
        .unwrap();
    let torque = board.torque_control().unwrap();
    untouched(
        "too hard",
        torque.set_reference_torques(Axes::All, &[0.0, 0.0, 0.0, 1e9]),
    );
    let last = AxisIndex::from(3);
    modes
        .set_control_modes(Axes::All, &[Mode::Position; 4])
        .unwrap();
    modes.set_control_modes(last.into(), &[Mode::Idle]).unwrap();
    let moves = board.position_control().unwrap();
    untouched("idle", moves.position_move(Axes::All, &[1.0; 4]));
    untouched("idle", moves.relative_move(Axes::All, &[1.0; 4]));
    modes
        .set_control_modes(last.into(), &[Mode::Position])
        .unwrap();
    untouched(
        "too far",
        moves.relative_move(Axes::All, &[1.0, 1.0, 1.0, 100.0]),
    );
    untouched(
        "no speed",
        moves.set_reference_speeds(Axes::All, &[1.0, 1.0, 1.0, 0.0]),
    );
    // A range that another client has changed meanwhile is no reason to refuse values that the device accepts.
    let wide = right.control_limits().unwrap();
    wide.set_position_limits(1.into(), Limits::new(-5.0, 5.0))
        .unwrap();
    untouched(
        "too far",
        moves.position_move(Axes::All, &[1.0, 1.0, 1.0, 8.0]),
    );
    wide.set_position_limits(1.into(), Limits::new(-12.0, 12.0))
        .unwrap();
    moves
        .position_move(Axes::All, &[1.0, 1.0, 1.0, 8.0])
        .expect("it is allowed again");
}

#[test]
fn boards_that_do_not_add_up_are_refused() {
    let two = || vec![arm("left", 2), arm("right", 2)];
    let check = |names: &str, expected: &str| {
        let error = of_names(two(), names).err().expect("it is refused");
        assert_eq!(error, expected);
    };
    check("", "expected one joint at least, got none");
    check(
        "left0 elbow",
        "no device has a joint elbow; there is left0, left1, right0, right1",
    );
    check("left0 right1 left0", "joint 0 of left is named twice");
    let again = of_names(vec![arm("left", 2), arm("left", 2)], "left0");
    let error = again.err().expect("it is refused");
    assert_eq!(
        error,
        "left and left both have a joint left0; name joints by networks instead"
    );
    let of_joints = |devices: Vec<Named>, joints: &[(usize, AxisIndex)]| {
        let board = Remapper::of_joints(devices, joints);
        board.err().expect("it is refused").to_string()
    };
    let error = of_joints(two(), &[(1, 2.into())]);
    assert_eq!(error, "right has no joint 2, it has 2, counted from 0");
    assert_eq!(of_joints(two(), &[(2, 0.into())]), "device 2 has no joints");
    let error = of_joints(vec![arm("left", 2), arm("left", 2)], &[(0, 0.into())]);
    assert_eq!(
        error,
        "two devices are called left, expected a name of its own for each"
    );
}

/// A stop that leaves a device moving would be none.
#[test]
fn a_board_stops_if_all_its_devices_can() {
    use yarp_devices::StopState;
    use yarp_devices::guard::{Guarded, GuardedOptions};

    let guarded = || -> Arc<dyn Device> {
        let arm = Arc::new(SimulatedWam::new());
        Arc::new(Guarded::around(arm, GuardedOptions::default()).unwrap())
    };
    let board = |right: Arc<dyn Device>| {
        let arms = vec![("left".to_owned(), guarded()), ("right".to_owned(), right)];
        Remapper::of_joints(arms, &[(0, 0.into()), (1, 0.into())]).unwrap()
    };
    assert!(
        board(Arc::new(SimulatedWam::new()))
            .software_stop()
            .is_none()
    );
    let right = guarded();
    let board = board(right.clone());
    let stop = board.software_stop().expect("both have one");
    stop.stop_motion().unwrap();
    assert_eq!(stop.stop_state(), StopState::Stopped);
    let moved = board
        .position_control()
        .unwrap()
        .position_move(Axes::All, &[5.0, 5.0]);
    assert!(moved.is_err());
    right.software_stop().unwrap().release();
    assert_eq!(
        stop.stop_state(),
        StopState::Released,
        "one arm moves again"
    );
    // Neither has a brake: both are stopped, and the caller is told.
    assert!(stop.brake().is_err());
    assert_eq!(stop.stop_state(), StopState::Stopped);
    stop.release();
    assert_eq!(
        right.software_stop().unwrap().stop_state(),
        StopState::Released
    );
}
