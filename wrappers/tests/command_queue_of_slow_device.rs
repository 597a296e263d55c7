//! Commands that are queued while the device executes an earlier one: newer ones drop older ones, others are kept.

use crate::support;

use std::sync::{Arc, Condvar, Mutex};

use support::{Stage, TEST_TIMEOUT, eventually};
use yarp_devices::wam::SimulatedWam;
use yarp_devices::{
    Axes, AxisInfo, ControlMode, Device, DeviceError, Encoders, PositionControl, PositionDirect,
};
use yarp_ports::{Port, PortOptions};
use yarp_wire::Bottle;
use yarp_wrappers::control_board::messages::{
    MotionEnd, MotionState, MotionUpdate, Numbered, Selection, Set, Setting,
};

/// Takes direct positions, one each time it is let.
struct Slow {
    arm: SimulatedWam,
    taken: Arc<Taken>,
}

#[derive(Default)]
struct Taken {
    positions: Mutex<Vec<(usize, f64)>>,
    let_go: Mutex<bool>,
    changed: Condvar,
}

impl Taken {
    /// From now on it is fast.
    fn let_go(&self) {
        *self.let_go.lock().unwrap() = true;
        self.changed.notify_all();
    }

    fn positions(&self) -> Vec<(usize, f64)> {
        self.positions.lock().unwrap().clone()
    }
}

impl AxisInfo for Slow {
    fn axes(&self) -> usize {
        self.arm.axes()
    }
    fn axis_name(&self, axis: yarp_devices::AxisIndex) -> Result<String, DeviceError> {
        self.arm.axis_name(axis)
    }
    fn joint_type(
        &self,
        axis: yarp_devices::AxisIndex,
    ) -> Result<yarp_devices::JointType, DeviceError> {
        self.arm.joint_type(axis)
    }
}

impl PositionDirect for Slow {
    fn set_direct_positions(&self, axes: Axes<'_>, positions: &[f64]) -> Result<(), DeviceError> {
        let axis = axes
            .iter(self.axes())
            .next()
            .map_or(99, |axis| axis.index());
        let new = (axis, positions[0]);
        self.taken.positions.lock().unwrap().push(new);
        let let_go = self.taken.let_go.lock().unwrap();
        let held = |let_go: &mut bool| !*let_go;
        let waited = self
            .taken
            .changed
            .wait_timeout_while(let_go, TEST_TIMEOUT, held);
        drop(waited.unwrap());
        Ok(())
    }
    fn direct_positions(&self, _: Axes<'_>) -> Result<Vec<f64>, DeviceError> {
        Ok(vec![0.0])
    }
}

impl Device for Slow {
    fn axis_info(&self) -> Option<&dyn AxisInfo> {
        Some(self)
    }
    fn position_direct(&self) -> Option<&dyn PositionDirect> {
        Some(self)
    }
    fn position_control(&self) -> Option<&dyn PositionControl> {
        self.arm.position_control()
    }
    fn encoders(&self) -> Option<&dyn Encoders> {
        self.arm.encoders()
    }
    fn control_mode(&self) -> Option<&dyn ControlMode> {
        self.arm.control_mode()
    }
}

fn slow() -> (Slow, Arc<Taken>) {
    let taken = Arc::new(Taken::default());
    let arm = SimulatedWam::new();
    let slow = Slow {
        arm,
        taken: taken.clone(),
    };
    (slow, taken)
}

fn caller(stage: &Stage, name: &str) -> Port {
    let port = stage.port(name, PortOptions::new().rpc_client());
    let connecting = port.connect("/wam/rpc:i");
    stage.runtime.block_on(connecting).expect("it listens");
    port
}

async fn ask(port: &Port, message: &Bottle) -> Bottle {
    let answer = port.call_within::<Bottle>(message, TEST_TIMEOUT).await;
    answer.expect("it answers")
}

fn drops(stage: &Stage, port: &Port) -> u64 {
    let asked = Numbered::Drops.to_bottle().expect("there are words");
    let answer = stage.runtime.block_on(ask(port, &asked));
    Numbered::read_drops(&answer).expect("a number")
}

/// A move with a number.
fn numbered(selection: Selection, targets: &[f64]) -> Bottle {
    let set = Set::Values(Setting::Position, selection, targets.to_vec());
    Numbered::Submit(set).to_bottle().expect("there are words")
}

/// The same, of joint 0.
fn numbered_move(target: f64) -> Bottle {
    numbered(Selection::One(0.into()), &[target])
}

#[test]
fn a_thousand_streamed_positions_are_no_backlog() {
    let stage = Stage::new();
    let (device, taken) = slow();
    let server = stage.serve("/wam", device);
    let arm = stage.remote("/me");
    let monitor = caller(&stage, "/monitor");
    let send = |axis: usize, position: f64| {
        arm.set_direct_positions(Axes::One(axis.into()), &[position])
            .expect("it is sent");
    };
    send(0, 0.0);
    eventually("the first", || taken.positions().len() == 1);
    // The device is busy with it. The command for another joint is kept, with any commands for this one.
    send(1, 0.5);
    for position in 1..1000 {
        send(0, f64::from(position));
    }
    eventually("drops", || drops(&stage, &monitor) == 998);
    assert_eq!(taken.positions(), [(0, 0.0)]);
    taken.let_go();
    eventually("the rest", || taken.positions().len() == 3);
    assert_eq!(taken.positions(), [(0, 0.0), (1, 0.5), (0, 999.0)]);
    drop(arm);
    stage.runtime.block_on(server.close());
}

#[test]
fn who_waits_for_the_answer_is_told_that_its_order_was_dropped() {
    let stage = Stage::new();
    let (device, taken) = slow();
    let server = stage.serve("/wam", device);
    let arm = stage.remote("/me");
    let monitor = caller(&stage, "/monitor");
    let (one, two) = (caller(&stage, "/one"), caller(&stage, "/two"));
    arm.set_direct_positions(Axes::One(3.into()), &[1.0])
        .expect("it is sent");
    eventually("the first", || taken.positions().len() == 1);
    let waiting = [(one, 1.0), (two, 2.0)].map(|(port, target)| {
        let task = async move { ask(&port, &numbered_move(target)).await };
        stage.runtime.spawn(task)
    });
    eventually("a drop", || drops(&stage, &monitor) == 1);
    taken.let_go();
    let answers = waiting.map(|answer| stage.runtime.block_on(answer).expect("it answers"));
    let mut news = answers.map(|answer| MotionUpdate::from_bottle(&answer).expect("news"));
    news.sort_by_key(|news| news.number);
    let [dropped, moved] = news;
    let by = moved.number;
    assert_eq!(moved.state, MotionState::Moving);
    assert_eq!(dropped.state, MotionState::Ended(MotionEnd::Dropped { by }));
    // It can be queried, too.
    let asked = Numbered::Ask(dropped.number).to_bottle().expect("words");
    let told = stage.runtime.block_on(ask(&monitor, &asked));
    assert_eq!(MotionUpdate::from_bottle(&told), Some(dropped));
    drop(arm);
    stage.runtime.block_on(server.close());
}

/// A command that was visibly invalid replaced a queued one, and was refused afterwards.
#[test]
fn an_order_that_is_wrong_whatever_the_device_says_displaces_none() {
    let stage = Stage::new();
    let (device, taken) = slow();
    let server = stage.serve("/wam", device);
    let arm = stage.remote("/me");
    let (monitor, one) = (caller(&stage, "/monitor"), caller(&stage, "/one"));
    arm.set_direct_positions(Axes::One(3.into()), &[1.0])
        .expect("it is sent");
    eventually("the first", || taken.positions().len() == 1);
    let waiting = stage
        .runtime
        .spawn(async move { ask(&one, &numbered_move(1.0)).await });
    // It waits as soon as something else can take its place, which is seen by a drop.
    let two = caller(&stage, "/two");
    let newer = stage
        .runtime
        .spawn(async move { ask(&two, &numbered_move(2.0)).await });
    eventually("a drop", || drops(&stage, &monitor) == 1);
    // All of these are about joint 0, and are answered while the device is busy.
    let group = |axes: &[usize]| Selection::Group(axes.iter().copied().map(Into::into).collect());
    for wrong in [
        numbered_move(f64::NAN),
        numbered(Selection::All, &[3.0]),
        numbered(group(&[0, 0]), &[3.0, 4.0]),
        numbered(group(&[0, 99]), &[3.0, 3.0]),
        Bottle::parse("[set] [poss] (3.0)").expect("a bottle"),
        Bottle::parse("[set] [stog] (0 99)").expect("a bottle"),
        Bottle::parse("[set] [stog] 2 (0 99)").expect("a bottle"),
    ] {
        let answer = stage.runtime.block_on(ask(&monitor, &wrong)).to_string();
        assert!(answer.contains("[fail]"), "{wrong}: {answer}");
    }
    assert_eq!(drops(&stage, &monitor), 1);
    assert_eq!(taken.positions(), [(3, 1.0)]);
    taken.let_go();
    let answers =
        [waiting, newer].map(|answer| stage.runtime.block_on(answer).expect("it answers"));
    let states = answers.map(|answer| MotionUpdate::from_bottle(&answer).expect("news").state);
    assert!(states.contains(&MotionState::Moving), "{states:?}");
    drop(arm);
    stage.runtime.block_on(server.close());
}
