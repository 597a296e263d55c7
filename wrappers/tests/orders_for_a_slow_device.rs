//! Orders that wait while the device takes an earlier one: newer ones drop older ones, others are kept.

mod support;

use std::sync::{Arc, Condvar, Mutex};

use support::{PATIENCE, Stage, eventually};
use yarp_devices::wam::SimulatedWam;
use yarp_devices::{
    Axes, AxisInfo, ControlMode, Device, DeviceError, Encoders, PositionControl, PositionDirect,
};
use yarp_ports::{Port, PortOptions};
use yarp_wire::Bottle;
use yarp_wrappers::control_board::messages::{
    MotionEnd, MotionNews, MotionState, Numbered, Selection, Set, Setting,
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
            .wait_timeout_while(let_go, PATIENCE, held);
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
    let arm = SimulatedWam::start().expect("the machine has threads");
    let slow = Slow {
        arm,
        taken: taken.clone(),
    };
    (slow, taken)
}

fn caller(stage: &Stage, name: &str) -> Port {
    let port = stage.port(name, PortOptions::new().calling());
    let connecting = port.connect("/wam/rpc:i");
    stage.runtime.block_on(connecting).expect("it listens");
    port
}

async fn ask(port: &Port, message: &Bottle) -> Bottle {
    let answer = port.call_within::<Bottle>(message, PATIENCE).await;
    answer.expect("it answers")
}

fn drops(stage: &Stage, port: &Port) -> u64 {
    let asked = Numbered::Drops.to_bottle().expect("there are words");
    let answer = stage.runtime.block_on(ask(port, &asked));
    Numbered::read_drops(&answer).expect("a number")
}

/// A move of joint 0 with a number.
fn numbered_move(target: f64) -> Bottle {
    let selection = Selection::One(0.into());
    let set = Set::Values(Setting::Position, selection, vec![target]);
    Numbered::Order(set).to_bottle().expect("there are words")
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
    // The device is busy with it. The order for another joint is kept, whatever comes for this one.
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
    let mut news = answers.map(|answer| MotionNews::from_bottle(&answer).expect("news"));
    news.sort_by_key(|news| news.number);
    let [dropped, moved] = news;
    let by = moved.number;
    assert_eq!(moved.state, MotionState::Moving);
    assert_eq!(dropped.state, MotionState::Ended(MotionEnd::Dropped { by }));
    // It can be asked for, too.
    let asked = Numbered::Ask(dropped.number).to_bottle().expect("words");
    let told = stage.runtime.block_on(ask(&monitor, &asked));
    assert_eq!(MotionNews::from_bottle(&told), Some(dropped));
    drop(arm);
    stage.runtime.block_on(server.close());
}
