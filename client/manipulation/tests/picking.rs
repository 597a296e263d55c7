//! Objects are picked and placed by contact and friction alone; failures are reported and leave a safe state.

mod support;

use std::collections::VecDeque;
use std::sync::{Arc, Mutex};

use nalgebra::{Rotation3, Vector3};
use support::{Intercepted, Interceptor, Shared, SimulatedCell, Truth, item, shared};
use yarp_devices::kinematics::{Joints, Pose};
use yarp_devices::{Axes, Mode};
use yarp_manipulation::{
    DetectError, Detector, GraspOptions, GraspScripts, Item, ItemShape, PickError, Picker,
    PickerOptions, Step, Stop, Surroundings, TaskEvent, TidyOptions, Workcell, WorkcellError,
    grasps, tidy,
};
use yarp_table::{BrickKind, Finish, Random, Scene, Shape, SimulationOptions, arm_model};

/// A box that a hand takes from any side.
const BOX: Shape = Shape::Box {
    size: [0.06, 0.09, 0.08],
};

fn table(shape: Shape, x: f64, y: f64) -> (Shared, Picker<SimulatedCell>, Item) {
    table_from([0.0, 0.2, 0.0, 2.2, 0.0, 0.7, 0.0], shape, x, y)
}

/// Returns a table with an arm that begins in this posture, rad.
fn table_from(
    posture: [f64; 7],
    shape: Shape,
    x: f64,
    y: f64,
) -> (Shared, Picker<SimulatedCell>, Item) {
    let mut scene = Scene::empty();
    scene.put(shape, x, y, 0.3, Finish::default());
    let found = item(&scene.objects[0]).expect("an object to grasp");
    let mut options = SimulationOptions::default();
    options.joints = Some(posture);
    let table = shared(scene, options);
    table.borrow_mut().step(0.3);
    let cell = SimulatedCell(table.clone());
    let picker = support::picker(cell);
    (table, picker.expect("the simulated arm is ready"), found)
}

fn height(table: &Shared) -> f64 {
    table.borrow().simulation.scene().objects[0]
        .pose
        .translation
        .z
}

#[track_caller]
fn check_placed(shape: Shape, container: usize) {
    let (table, mut picker, item) = table(shape, 0.55, 0.05);
    picker
        .pick_and_place(&item, &[], container, 0)
        .expect("it is placed");
    table.borrow_mut().step(1.0);
    let table = table.borrow();
    let scene = table.simulation.scene();
    let place = scene.objects[0].pose.translation.vector;
    assert!(scene.baskets[container].contains(&place), "{place}");
    assert_eq!(table.touched, 0, "the robot touched table or baskets");
}

/// The inner links of the open fingers came down on its edges, and the arm stopped.
#[test]
fn a_wide_box_is_placed() {
    let size = [0.1, 0.108, 0.107];
    check_placed(Shape::Box { size }, 0);
}

#[test]
fn a_box_is_placed() {
    check_placed(
        Shape::Box {
            size: [0.06, 0.09, 0.08],
        },
        0,
    );
}

#[test]
fn a_prism_is_placed() {
    check_placed(
        Shape::Prism {
            side: 0.09,
            height: 0.06,
        },
        0,
    );
}

/// No finger fits between them: both were left.
#[test]
fn prisms_that_face_each_other_are_placed() {
    let (side, gap) = (0.09, 0.021);
    let apothem = side / (2.0 * 3.0_f64.sqrt());
    let prism = Shape::Prism { side, height: 0.06 };
    let mut scene = Scene::empty();
    // The side of each that is at its negative x is towards the other.
    for (sign, yaw) in [(1.0, 0.0), (-1.0, std::f64::consts::PI)] {
        let x = 0.55 + sign * (apothem + gap / 2.0);
        scene.put(prism, x, 0.05, yaw, Finish::default());
    }
    let table = shared(scene, SimulationOptions::default());
    table.borrow_mut().step(0.3);
    let mut picker = support::picker(SimulatedCell(table.clone())).unwrap();
    let mut detector = Truth {
        table: table.clone(),
        random: Random::new(1),
        noise: 0.001,
    };
    let report = tidy(&mut picker, &mut detector, &TidyOptions::default());
    assert_eq!((report.released, report.attempts), (2, 2), "{report:?}");
    table.borrow_mut().step(1.0);
    let table = table.borrow();
    let scene = table.simulation.scene();
    assert!(
        scene
            .objects
            .iter()
            .all(|object| support::is_placed(scene, object))
    );
    assert_eq!(table.touched, 0, "the robot touched table or baskets");
}

#[test]
fn a_glass_is_placed() {
    check_placed(
        Shape::Glass {
            radius: 0.036,
            height: 0.11,
            wall: 0.003,
        },
        1,
    );
}

#[test]
fn plates_stay_in_the_hand_on_the_way() {
    for (radius, height) in [(0.0905, 0.016), (0.0945, 0.020), (0.0995, 0.024)] {
        check_placed(Shape::Plate { radius, height }, 2);
    }
}

/// Notes what the hand is told.
struct Told {
    cell: SimulatedCell,
    lines: Arc<Mutex<Vec<String>>>,
}

impl Interceptor for Told {
    fn cell(&mut self) -> &mut SimulatedCell {
        &mut self.cell
    }

    fn command_hand(&mut self, line: &str) -> Result<String, WorkcellError> {
        self.lines.lock().unwrap().push(line.to_owned());
        self.cell.command_hand(line)
    }

    fn start_hand(&mut self, lines: &[String]) -> Result<(), WorkcellError> {
        self.lines.lock().unwrap().extend_from_slice(lines);
        self.cell.start_hand(lines)
    }
}

/// A glass is taken as its script says: with a spread that no computed grasp of it has. One without a script is taken as usual.
#[test]
fn a_listed_script_is_preferred_to_the_grasps_of_the_shape() {
    let glass = Shape::Glass {
        radius: 0.036,
        height: 0.11,
        wall: 0.003,
    };
    for (label, is_listed) in [("glass", true), ("vase", false)] {
        let (table, _, item) = table(glass, 0.55, 0.05);
        let usual = &grasps(&item, &GraspOptions::default())[0];
        let spread = usual.spread + 60;
        let away = usual.hand.translation.vector - item.pose.translation.vector;
        // In the frame of the object, which is turned by its yaw; the direction of the usual grasp is 0.
        let yaw = item.yaw();
        let (x, y) = (
            away.x * yaw.cos() + away.y * yaw.sin(),
            away.y * yaw.cos() - away.x * yaw.sin(),
        );
        let database = format!(
            r#"<objects><object name="{label}"><grasp name="rim" position="{x} {y} {}" turn="{}"
                spread="{spread}" open="{}" contact="{}"/></object></objects>"#,
            usual.hand.translation.z - item.top(),
            -yaw.to_degrees(),
            usual.open,
            usual.contact
        );
        let lines = Arc::<Mutex<Vec<String>>>::default();
        let told = Told {
            cell: SimulatedCell(table.clone()),
            lines: lines.clone(),
        };
        let mut picker = support::picker(Intercepted(told)).expect("the simulated arm is ready");
        picker.prefer_scripts(GraspScripts::parse(&database, "test.xml").expect("it is complete"));
        picker
            .pick_and_place(&item, &[], 1, 0)
            .expect("it is placed");
        table.borrow_mut().step(1.0);
        let table = table.borrow();
        let scene = table.simulation.scene();
        let place = scene.objects[0].pose.translation.vector;
        assert!(scene.baskets[1].contains(&place), "{place}");
        let by_script = lines.lock().unwrap().contains(&format!("SM {spread}"));
        assert_eq!(by_script, is_listed, "{label}");
    }
}

/// Counts the set points that the arm gets while the hand takes the shape of the first grasp.
struct Overlap {
    cell: SimulatedCell,
    shaping: bool,
    count: Arc<Mutex<Option<usize>>>,
}

impl Interceptor for Overlap {
    fn cell(&mut self) -> &mut SimulatedCell {
        &mut self.cell
    }

    fn command(&mut self, joints: &Joints<7>) -> Result<(), WorkcellError> {
        if let (true, Some(count)) = (self.shaping, &mut *self.count.lock().unwrap()) {
            *count += 1;
        }
        self.cell.command(joints)
    }

    fn start_hand(&mut self, lines: &[String]) -> Result<(), WorkcellError> {
        let mut count = self.count.lock().unwrap();
        self.shaping = count.is_none();
        count.get_or_insert(0);
        self.cell.start_hand(lines)
    }

    fn finish_hand(&mut self) -> Result<(), WorkcellError> {
        self.shaping = false;
        self.cell.finish_hand()
    }
}

/// Picks a box beside a post, whose distance is given, m; returns the number of set points on the way to it during which the hand
/// changed its shape.
fn overlap(post: f64) -> Option<usize> {
    let (table, _, item) = table(BOX, 0.55, 0.05);
    let count = Arc::<Mutex<Option<usize>>>::default();
    let cell = Overlap {
        cell: SimulatedCell(table.clone()),
        shaping: false,
        count: count.clone(),
    };
    let mut picker = support::picker(Intercepted(cell)).expect("the simulated arm is ready");
    let place = item.pose * nalgebra::Point3::new(0.0, post, 0.09);
    let beside = Item {
        id: 99,
        label: "post".to_owned(),
        shape: ItemShape::Cuboid {
            size: [0.02, 0.02, 0.28],
        },
        pose: Pose::from_parts(place.into(), item.pose.rotation),
        ..item.clone()
    };
    picker.pick_and_place(&item, &[beside], 0, 0).ok()?;
    *count.lock().unwrap()
}

/// The fingers sweep more room than they need in the shape of the grasp.
#[test]
fn the_hand_takes_its_shape_on_the_way_only_where_there_is_room() {
    assert_eq!(overlap(0.11), Some(0));
    let far = overlap(0.30).expect("it is placed");
    assert!(far > 20, "{far}");
}

/// The detector looks while the hand opens: nobody waits for it.
#[test]
fn objects_are_detected_while_the_hand_opens() {
    struct Watching {
        truth: Truth,
        told: Vec<(&'static str, bool)>,
    }
    impl Watching {
        /// Notes a call, and whether the hand is busy.
        fn note(&mut self, call: &'static str) {
            let is_busy = self.truth.table.borrow().simulation.hand().is_busy();
            self.told.push((call, is_busy));
        }
    }
    impl Detector for Watching {
        fn name(&self) -> &'static str {
            self.truth.name()
        }

        fn detect(&mut self) -> Result<Vec<Item>, DetectError> {
            self.note("detect");
            self.truth.detect()
        }

        fn begin_detection(&mut self) {
            self.note("begin");
        }

        fn finish_detection(&mut self) -> Result<Vec<Item>, DetectError> {
            self.note("finish");
            self.truth.detect()
        }
    }
    let (table, mut picker, _) = table(BOX, 0.55, 0.05);
    let mut detector = Watching {
        truth: Truth {
            table: table.clone(),
            random: Random::for_purpose(1, 1),
            noise: 0.0,
        },
        told: Vec::new(),
    };
    let report = tidy(&mut picker, &mut detector, &TidyOptions::default());
    assert_eq!((report.released, report.left.len()), (1, 0), "{report:?}");
    // At first, from the arrival to the release, and once more before an empty table is believed.
    let expected = [
        ("detect", false),
        ("begin", false),
        ("finish", true),
        ("detect", false),
    ];
    assert_eq!(detector.told, expected);
    // The containers are measured while the fingers close.
    assert_eq!(table.borrow().looks_of_a_busy_hand, 1);
}

/// A carton of 1.05 kg slipped in every sixth grasp; a small box would be turned by fingers that curl below it.
#[test]
fn large_cuboids_are_held_with_controlled_torque_and_small_ones_are_not() {
    let volume = |kind: &BrickKind| kind.size().iter().product::<f64>();
    let largest = BrickKind::all().max_by(|one, other| volume(one).total_cmp(&volume(other)));
    let kind = largest.expect("there are cartons");
    for (shape, is_firm) in [(Shape::Brick { kind }, true), (BOX, false)] {
        let (table, _, item) = table(shape, 0.55, 0.05);
        let lines = Arc::<Mutex<Vec<String>>>::default();
        let told = Told {
            cell: SimulatedCell(table.clone()),
            lines: lines.clone(),
        };
        let mut picker = support::picker(Intercepted(told)).expect("the simulated arm is ready");
        picker
            .pick_and_place(&item, &[], 0, 0)
            .expect("it is placed");
        table.borrow_mut().step(1.0);
        let place = table.borrow().simulation.scene().objects[0]
            .pose
            .translation
            .vector;
        assert!(
            table.borrow().simulation.scene().baskets[0].contains(&place),
            "{place}"
        );
        // Torque until the object is lifted, and no longer: it heats the fingers.
        let lines = lines.lock().unwrap();
        let torque: Vec<&str> = lines
            .iter()
            .map(String::as_str)
            .filter(|line| matches!(*line, "GTC" | "GT"))
            .collect();
        let expected: &[&str] = match is_firm {
            true => &["GTC", "GT"],
            false => &[],
        };
        assert_eq!(torque, expected, "{shape:?}");
    }
}

/// It stands where it shall, with its sides along x and y.
#[track_caller]
fn check_set_down(shape: Shape, place: [f64; 2]) {
    let is_round = matches!(shape, Shape::Glass { .. } | Shape::Plate { .. });
    let (table, mut picker, item) = table(shape, 0.55, 0.05);
    picker
        .pick_and_set_down(&item, &[], place, 0)
        .expect("it is set down");
    table.borrow_mut().step(1.0);
    let table = table.borrow();
    let pose = table.simulation.scene().objects[0].pose;
    let away = (pose.translation.x - place[0]).hypot(pose.translation.y - place[1]);
    assert!(away < 0.015, "{}", pose.translation);
    let along = pose.rotation * Vector3::x();
    let upright = (pose.rotation * Vector3::z()).z;
    assert!(upright > 0.99, "{upright}");
    let aligned = along.x.abs().max(along.y.abs());
    assert!(is_round || aligned > 0.99, "{along}");
    assert_eq!(table.touched, 0, "the robot touched table or baskets");
}

#[test]
fn a_box_is_set_down_at_a_place_along_the_axes() {
    let size = [0.06, 0.09, 0.08];
    check_set_down(Shape::Box { size }, [0.45, -0.2]);
}

#[test]
fn a_glass_is_set_down_at_a_place() {
    let glass = Shape::Glass {
        radius: 0.036,
        height: 0.11,
        wall: 0.003,
    };
    check_set_down(glass, [0.70, 0.15]);
}

#[test]
fn an_object_whose_place_is_out_of_reach_is_put_back() {
    let size = [0.06, 0.09, 0.08];
    let (table, mut picker, item) = table(Shape::Box { size }, 0.55, 0.05);
    let error = picker.pick_and_set_down(&item, &[], [1.4, 0.0], 0);
    let error = error.unwrap_err();
    let step = Step::Transport;
    assert!(
        matches!(error, PickError::Plan { step: at, .. } if at == step),
        "{error}"
    );
    table.borrow_mut().step(1.0);
    let pose = table.borrow().simulation.scene().objects[0].pose;
    assert!((pose.translation.x - 0.55).hypot(pose.translation.y - 0.05) < 0.015);
}

#[test]
fn an_object_that_is_out_of_reach_moves_nothing() {
    let (_table, mut picker, item) = table(
        Shape::Box {
            size: [0.06, 0.09, 0.08],
        },
        1.3,
        0.0,
    );
    let before = picker.cell().joints().unwrap();
    let error = picker.pick_and_place(&item, &[], 0, 0).unwrap_err();
    assert!(matches!(error, PickError::Unreachable { .. }), "{error}");
    assert!(error.to_string().contains("out of reach"), "{error}");
    assert!((picker.cell().joints().unwrap() - before).amax() < 0.01);
}

#[test]
fn an_object_that_is_too_wide_has_no_grasp() {
    let (_table, mut picker, item) = table(
        Shape::Box {
            size: [0.30, 0.30, 0.08],
        },
        0.55,
        0.0,
    );
    let error = picker.pick_and_place(&item, &[], 0, 0).unwrap_err();
    assert!(matches!(error, PickError::NoGrasp { .. }), "{error}");
}

#[test]
fn fingers_that_close_on_nothing_are_noticed() {
    let (table, mut picker, mut item) = table(
        Shape::Box {
            size: [0.06, 0.09, 0.08],
        },
        0.55,
        0.2,
    );
    item.pose.translation.y -= 0.3;
    let error = picker.pick_and_place(&item, &[], 0, 0).unwrap_err();
    assert!(matches!(error, PickError::Missed { .. }), "{error}");
    assert!(
        table
            .borrow()
            .simulation
            .hand()
            .clutches()
            .iter()
            .all(Option::is_none)
    );
}

/// A cell in which something happens before each set point.
struct Disturbed<F> {
    cell: SimulatedCell,
    before: F,
}

impl<F: FnMut(&Shared)> Interceptor for Disturbed<F> {
    fn cell(&mut self) -> &mut SimulatedCell {
        &mut self.cell
    }

    fn command(&mut self, joints: &Joints<7>) -> Result<(), WorkcellError> {
        (self.before)(&self.cell.0);
        self.cell.command(joints)
    }
}

/// A loss was not noticed: the arm carried nothing to the basket and counted it as released.
#[test]
fn an_object_that_is_lost_on_the_way_is_noticed() {
    let high: fn(&Vector3<f64>) -> bool = |place| place.z > 0.06;
    for (takes, step) in [
        (high, Step::Lift),
        (|place| place.y < -0.1, Step::Transport),
    ] {
        let (table, _, item) = table(
            Shape::Box {
                size: [0.06, 0.09, 0.08],
            },
            0.55,
            0.05,
        );
        let cell = Intercepted(Disturbed {
            cell: SimulatedCell(table.clone()),
            before: |table: &Shared| {
                let mut pose = table.borrow().simulation.scene().objects[0].pose;
                if takes(&pose.translation.vector) {
                    pose.translation.vector = Vector3::new(0.75, 0.25, -0.01);
                    table.borrow_mut().simulation.place(0, pose);
                }
            },
        });
        let mut picker = support::picker(cell).expect("the simulated arm is ready");
        let error = picker.pick_and_place(&item, &[], 0, 0).unwrap_err();
        match error {
            PickError::Lost { step: when, .. } => assert_eq!(when, step),
            other => panic!("{other}"),
        }
    }
}

/// Interrupts a lift and returns the error; the object must stay in the hand for two seconds.
fn interrupted(stop: Option<Stop>) -> (Shared, PickError) {
    let (table, _, item) = table(BOX, 0.55, 0.05);
    let button = stop.clone().unwrap_or_default();
    let mut broken = false;
    let cell = Intercepted(Disturbed {
        cell: SimulatedCell(table.clone()),
        before: move |table: &Shared| {
            if height(table) > 0.06 {
                match &stop {
                    Some(stop) => stop.halt(),
                    None if !broken => {
                        broken = true;
                        table.borrow_mut().fails_after = Some(0);
                    }
                    None => {}
                }
            }
        },
    });
    let options = PickerOptions::default();
    let mut picker = Picker::new(cell, arm_model(), Surroundings::default(), options, button)
        .expect("the simulated arm is ready");
    let error = picker.pick_and_place(&item, &[], 0, 0).unwrap_err();
    let before = height(&table);
    table.borrow_mut().step(2.0);
    assert!(
        before > 0.05 && (height(&table) - before).abs() < 0.02,
        "{before}"
    );
    (table, error)
}

#[test]
fn a_stop_holds_the_arm_and_the_object() {
    let (_, error) = interrupted(Some(Stop::default()));
    assert!(
        matches!(error, PickError::Stopped { step: Step::Lift }),
        "{error}"
    );
}

#[test]
fn a_device_that_fails_leaves_the_object_in_the_hand() {
    let (_, error) = interrupted(None);
    assert!(
        matches!(
            error,
            PickError::Workcell {
                step: Step::Lift,
                ..
            }
        ),
        "{error}"
    );
    assert!(error.to_string().contains("the simulated table"), "{error}");
}

/// A cell that hears set points late, and some of them not at all until it is told to hold.
struct Deaf<F> {
    cell: SimulatedCell,
    hears: F,
    /// Number of times that it must be told.
    holds: usize,
    /// Number of set points by which it is late, and those that are on their way.
    delay: usize,
    late: VecDeque<Joints<7>>,
}

impl<F: FnMut(&Shared) -> bool> Interceptor for Deaf<F> {
    fn cell(&mut self) -> &mut SimulatedCell {
        &mut self.cell
    }

    fn command(&mut self, joints: &Joints<7>) -> Result<(), WorkcellError> {
        self.late.push_back(*joints);
        let heard = self.holds == 0 || (self.hears)(&self.cell.0);
        match (self.late.len() > self.delay).then(|| self.late.pop_front()) {
            Some(Some(joints)) if heard => self.cell.command(&joints),
            _ => Ok(()),
        }
    }

    fn hold(&mut self) -> Result<(), WorkcellError> {
        self.holds = self.holds.saturating_sub(1);
        self.cell.hold()
    }
}

type DeafPicker<F> = (Shared, Picker<Intercepted<Deaf<F>>>, Item);

fn deaf<F: FnMut(&Shared) -> bool>(delay: usize, hears: F) -> DeafPicker<F> {
    deaf_until(1, delay, hears)
}

fn deaf_until<F: FnMut(&Shared) -> bool>(holds: usize, delay: usize, hears: F) -> DeafPicker<F> {
    let (table, _, item) = table(BOX, 0.55, 0.05);
    let cell = Intercepted(Deaf {
        cell: SimulatedCell(table.clone()),
        hears,
        holds,
        delay,
        late: VecDeque::new(),
    });
    let picker = support::picker(cell);
    (table, picker.expect("the simulated arm is ready"), item)
}

/// Returns true for the first set points.
fn first(number: usize) -> impl FnMut(&Shared) -> bool {
    let mut count = 0;
    move |_| {
        count += 1;
        count <= number
    }
}

/// An arm that was 0.27 rad late over the network ended the run, although it was on its way.
#[test]
fn a_motion_waits_for_an_arm_that_is_late() {
    let (_table, mut picker, _) = deaf(14, |_| true);
    let moved = picker.clear_view(&[]);
    assert!(moved.expect("the arm arrives"));
}

#[test]
fn an_arm_that_does_not_follow_is_blocked_and_used_again() {
    let (table, mut picker, item) = deaf(0, first(30));
    let error = picker.pick_and_place(&item, &[], 0, 0).unwrap_err();
    match error {
        PickError::Blocked {
            step: Step::PreGrasp,
            error,
            ..
        } => assert!(error < PickerOptions::default().max_tracking_error),
        other => panic!("{other}"),
    }
    let time = table.borrow().simulation.time();
    assert!(time.as_secs() < 10, "{time:?}");
    let placed = picker.pick_and_place(&item, &[], 0, 0);
    placed.expect("it is placed");
}

/// An arm that sank after a fault stood so near to itself that no plan began there: every object was left.
#[test]
fn an_arm_that_is_folded_unfolds() {
    let folded = [0.5, -1.6, 0.2, 3.1, 0.0, 1.2, 0.0];
    let (table, mut picker, item) = table_from(folded, BOX, 0.55, 0.05);
    picker
        .pick_and_place(&item, &[], 0, 0)
        .expect("it is placed");
    assert_eq!(table.borrow().touched, 0);
}

/// Something is where the hand would come by: it stays, and says why.
#[test]
fn an_arm_does_not_unfold_into_something() {
    let folded = Joints::<7>::from([1.2, -1.6, 0.2, 3.1, 0.0, 1.2, 0.0]);
    let unfolded = Joints::<7>::from([0.0, -1.9, 0.0, 2.7, 0.0, 0.0, 0.0]);
    let (table, mut picker, item) = table_from(folded.into(), BOX, 0.55, 0.05);
    let middle = arm_model().chain.forward(&((folded + unfolded) / 2.0));
    let size = [0.1; 3];
    let in_the_way = Item {
        id: 99,
        label: "something".to_owned(),
        shape: ItemShape::Cuboid { size },
        pose: Pose::from_parts(middle.translation, Rotation3::identity()),
        ..item.clone()
    };
    let joints = || {
        let joints = SimulatedCell(table.clone()).joints();
        joints.expect("the simulation has joints")
    };
    let before = joints();
    let error = picker
        .pick_and_place(&item, &[in_the_way], 0, 0)
        .unwrap_err();
    assert!(
        error.to_string().contains("start is in collision"),
        "{error}"
    );
    assert!((joints() - before).amax() < 0.02, "{}", joints());
}

/// The program made the arm move again after an emergency stop.
#[test]
fn an_arm_that_was_switched_off_stays_off() {
    let mut count = 0;
    let (table, mut picker, item) = deaf(0, move |table: &Shared| {
        count += 1;
        if count == 30 {
            let mut table = table.borrow_mut();
            let arm = table.simulation.arm_mut();
            let set = arm.set_control_modes(Axes::All, &[Mode::Idle; 7]);
            set.expect("the mode is set");
        }
        true
    });
    let error = picker.pick_and_place(&item, &[], 0, 0).unwrap_err();
    assert!(
        matches!(error, PickError::Workcell { .. }) && error.to_string().contains("idle"),
        "{error}"
    );
    let error = picker.pick_and_place(&item, &[], 0, 0).unwrap_err();
    assert!(matches!(error, PickError::Workcell { .. }), "{error}");
    let mut modes = [Mode::UNKNOWN; 7];
    let table = table.borrow();
    let read = table
        .simulation
        .arm()
        .read_control_modes(Axes::All, &mut modes);
    read.expect("the simulation has modes");
    assert_eq!(modes, [Mode::Idle; 7]);
}

/// The arm was so far behind when set points came again that its safety module stopped it.
#[test]
fn set_points_that_are_lost_for_a_while_stop_no_arm() {
    for begin in [60, 90, 120, 150] {
        let mut count = 0;
        let (table, mut picker, item) = deaf(0, move |_| {
            count += 1;
            !(begin..begin + 20).contains(&count)
        });
        let placed = picker.pick_and_place(&item, &[], 0, 0);
        placed.unwrap_or_else(|error| panic!("lost from {begin} on: {error}"));
        let fault = table.borrow().simulation.arm().simulator().safety().fault();
        assert_eq!(fault, None, "lost from {begin} on");
    }
}

/// A cell whose program is late for 0.3 s now and then, and the greatest speed of its elbow and wrist.
struct Late {
    cell: SimulatedCell,
    every: usize,
    count: usize,
    fastest: Arc<Mutex<f64>>,
}

impl Interceptor for Late {
    fn cell(&mut self) -> &mut SimulatedCell {
        &mut self.cell
    }

    fn wait(&mut self, seconds: f64) -> Result<f64, WorkcellError> {
        self.count += 1;
        let seconds = match self.count.is_multiple_of(self.every) {
            true => seconds + 0.3,
            false => seconds,
        };
        let waited = self.cell.wait(seconds);
        let table = self.cell.0.borrow();
        let speed = table.simulation.arm().simulator().speed();
        let mut fastest = self.fastest.lock().unwrap();
        *fastest = fastest.max(speed);
        waited
    }
}

/// The arm came to rest meanwhile, and overshot when its set point went on at full speed: its safety module stopped it.
#[test]
fn a_motion_begins_anew_after_its_program_was_late() {
    for every in [20, 35, 50] {
        let (table, _, item) = table(BOX, 0.55, 0.05);
        let fastest = Arc::<Mutex<f64>>::default();
        let cell = Late {
            cell: SimulatedCell(table.clone()),
            every,
            count: 0,
            fastest: fastest.clone(),
        };
        let mut picker = support::picker(Intercepted(cell)).expect("the simulated arm is ready");
        let placed = picker.pick_and_place(&item, &[], 0, 0);
        placed.unwrap_or_else(|error| panic!("late every {every} set points: {error}"));
        let fault = table.borrow().simulation.arm().simulator().safety().fault();
        assert_eq!(fault, None);
        let fastest = *fastest.lock().unwrap();
        // 0.75 m/s and more at full pace at once.
        assert!(fastest < 0.6, "{fastest}");
    }
}

/// The first motion of the hand would drop it.
#[test]
fn a_hand_that_holds_something_is_not_opened_at_the_start() {
    let (table, _) = interrupted(Some(Stop::default()));
    let error = support::picker(SimulatedCell(table.clone())).err();
    let refused = matches!(error, Some(PickError::HoldsSomething));
    assert!(refused, "{error:?}");
    let mut cell = SimulatedCell(table);
    cell.command_hand("GO").expect("the hand opens");
    support::picker(cell).expect("it is empty");
}

/// Picks with an arm that stops itself at the first set point for whose time, s, `stops` returns true, and picks again.
#[track_caller]
fn check_stopped_arm(mut stops: impl FnMut(f64) -> bool) {
    let mut stopped = false;
    let (_table, mut picker, item) = deaf(0, move |table: &Shared| {
        let mut table = table.borrow_mut();
        let stops_now = stops(table.simulation.time().as_secs_f64());
        if stops_now && !stopped {
            stopped = true;
            let arm = table.simulation.arm_mut();
            let set = arm.set_control_modes(Axes::All, &[Mode::Position; 7]);
            set.expect("the mode is set");
        }
        true
    });
    let error = picker.pick_and_place(&item, &[], 0, 0).unwrap_err();
    assert!(matches!(error, PickError::Blocked { .. }), "{error}");
    let placed = picker.pick_and_place(&item, &[], 0, 0);
    placed.expect("it is placed");
}

/// The arm stops when it notices that a joint has stalled, and takes no set points until its mode is set again: that ended
/// the run.
#[test]
fn an_arm_that_stopped_itself_is_used_again() {
    let mut count = 0;
    check_stopped_arm(move |_| {
        count += 1;
        count == 30
    });
}

/// Its fingers were still taking the shape of the grasp when the next attempt asked for their positions, which a busy hand refuses.
#[test]
fn a_hand_that_is_busy_after_a_failed_attempt_is_waited_for() {
    let mut count = 0;
    check_stopped_arm(move |_| {
        count += 1;
        count == 3
    });
}

#[test]
fn an_object_whose_lift_is_blocked_is_put_back() {
    let (table, mut picker, item) = deaf(0, |table: &Shared| height(table) < 0.0);
    let before = height(&table);
    let error = picker.pick_and_place(&item, &[], 0, 0).unwrap_err();
    let lift = Step::Lift;
    match error {
        PickError::Blocked { step, .. } => assert_eq!(step, lift),
        other => panic!("{other}"),
    }
    assert!((height(&table) - before).abs() < 0.01, "{}", height(&table));
    let clutches = table.borrow().simulation.hand().clutches();
    assert!(clutches.iter().all(Option::is_none), "{clutches:?}");
}

/// The arm stopped itself on the way back, too, and the run ended with the object above its place.
#[test]
fn an_object_is_put_back_although_the_way_back_is_blocked_once() {
    let mut is_lifted = false;
    let (table, mut picker, item) = deaf_until(2, 0, move |table: &Shared| {
        // High enough that an arm that stays there is behind on its way back.
        is_lifted |= height(table) > 0.1;
        !is_lifted
    });
    let before = height(&table);
    let error = picker.pick_and_place(&item, &[], 0, 0).unwrap_err();
    let step = Step::Lift;
    assert!(
        matches!(error, PickError::Blocked { step: at, .. } if at == step),
        "{error}"
    );
    assert!((height(&table) - before).abs() < 0.01, "{}", height(&table));
    let clutches = table.borrow().simulation.hand().clutches();
    assert!(clutches.iter().all(Option::is_none), "{clutches:?}");
}

/// It stopped while its end posture was corrected, where set points are rare: that ended the run.
#[test]
fn an_arm_that_stops_itself_at_the_end_of_a_motion_is_used_again() {
    let mut last = 0.0;
    check_stopped_arm(move |now| {
        let is_correction = last > 0.0 && (0.1..0.15).contains(&(now - last));
        last = now;
        is_correction
    });
}

#[test]
fn a_hot_hand_is_waited_for() {
    let size = [0.06, 0.09, 0.08];
    let (table, mut picker, item) = table(Shape::Box { size }, 0.55, 0.05);
    table
        .borrow_mut()
        .simulation
        .hand_mut()
        .set_temperature(65.2);
    let placed = picker.pick_and_place(&item, &[], 0, 0);
    placed.expect("it is placed");
    // It cools by 5 degrees before it moves again.
    let took = table.borrow().simulation.time().as_secs_f64();
    assert!(took > 40.0, "{took}");
}

#[test]
fn a_hand_that_stays_hot_is_an_error_that_says_so() {
    let size = [0.06, 0.09, 0.08];
    let (table, mut picker, item) = table(Shape::Box { size }, 0.55, 0.05);
    table
        .borrow_mut()
        .simulation
        .hand_mut()
        .set_temperature(400.0);
    let error = picker.pick_and_place(&item, &[], 0, 0).unwrap_err();
    assert!(error.to_string().contains("over-temperature"), "{error}");
    assert!(height(&table) > -0.05, "{}", height(&table));
}

/// Returns whether the object is beside the place where it stood: on its way to the container.
fn is_under_way(table: &Shared) -> bool {
    let table = table.borrow();
    let place = table.simulation.scene().objects[0].pose.translation;
    place.z > 0.05 && (place.x - 0.55).hypot(place.y - 0.05) > 0.1
}

#[test]
fn a_transport_that_is_blocked_twice_is_tried_a_third_time() {
    let (table, mut picker, item) = deaf_until(2, 0, |table: &Shared| !is_under_way(table));
    let placed = picker.pick_and_place(&item, &[], 0, 0);
    placed.expect("it is placed");
    table.borrow_mut().step(1.0);
    let table = table.borrow();
    let scene = table.simulation.scene();
    let place = scene.objects[0].pose.translation.vector;
    assert!(scene.baskets[0].contains(&place), "{place}");
}

#[test]
fn an_object_stays_held_when_its_transport_stays_blocked() {
    let (table, mut picker, item) = deaf_until(9, 0, |table: &Shared| !is_under_way(table));
    let error = picker.pick_and_place(&item, &[], 0, 0).unwrap_err();
    let step = Step::Transport;
    assert!(
        matches!(error, PickError::Blocked { step: at, .. } if at == step),
        "{error}"
    );
    table.borrow_mut().step(1.0);
    assert!(height(&table) > 0.05, "{}", height(&table));
}

/// An object that fell out of the hand may block the arm: it was reported as held, and the run ended.
#[test]
fn an_object_that_is_gone_when_its_transport_is_blocked_is_lost() {
    let mut gone = false;
    let (_table, mut picker, item) = deaf_until(9, 0, move |table: &Shared| {
        if !gone && is_under_way(table) {
            gone = true;
            let mut table = table.borrow_mut();
            table.simulation.place(
                0,
                yarp_devices::kinematics::Pose::translation(0.8, 0.3, 0.0),
            );
        }
        !gone
    });
    let error = picker.pick_and_place(&item, &[], 0, 0).unwrap_err();
    let step = Step::Transport;
    assert!(
        matches!(error, PickError::Lost { step: at, .. } if at == step),
        "{error}"
    );
}

#[test]
fn a_task_tells_what_it_does() {
    let size = [0.06, 0.09, 0.08];
    let (table, mut picker, _) = table(Shape::Box { size }, 0.55, 0.05);
    let told: Arc<Mutex<Vec<String>>> = Arc::default();
    let telling = Arc::clone(&told);
    picker.observe(move |event| {
        let text = match event {
            TaskEvent::Detected { items } => format!("detected {}", items.len()),
            TaskEvent::Progress { done, all } => format!("{done} of {all}"),
            TaskEvent::Chosen { item, destination } => format!("{} to {destination}", item.label),
            TaskEvent::Step { step, path } => match path.is_empty() {
                true => format!("{step}, resting"),
                false => format!("{step}, moving"),
            },
            TaskEvent::Ended { stopped, error } => format!("ended {stopped} {error:?}"),
            other => format!("{other:?}"),
        };
        telling.lock().unwrap().push(text);
    });
    let mut detector = Truth {
        table,
        random: Random::for_purpose(1, 7),
        noise: 0.0,
    };
    let report = tidy(&mut picker, &mut detector, &TidyOptions::default());
    assert_eq!(report.released, 1);
    let mut told = told.lock().unwrap().clone();
    told.dedup();
    let expected = [
        "detected 1",
        "0 of 1",
        "box to the basket of polygons",
        "plan, resting",
        "pre-grasp, moving",
        "approach, moving",
        "grasp, resting",
        "lift, moving",
        "transport, moving",
        "detected 0",
        "1 of 1",
    ];
    assert_eq!(told[..expected.len()], expected);
    assert_eq!(told.last().unwrap(), "ended false None");
}
