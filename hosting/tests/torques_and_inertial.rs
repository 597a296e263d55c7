//! `inertial` and `virtualAnalogServer` of a robot.

mod support;

use std::sync::{Arc, Mutex};

use support::Stage;
use yarp_devices::{AnalogSensor, Axes, SensorReading};
use yarp_hosting::robot::{Progress, RunningRobot};
use yarp_ports::{Answer, Port, PortOptions, Received, remote_admin};
use yarp_testing::eventually;
use yarp_wire::Bottle;

const ROBOT: &str = r#"<robot name="r" portprefix="r">
  <device name="upper" type="fakeMotionControl"><group name="GENERAL"><param name="Joints">4</param></group></device>
  <device name="wrist" type="fakeSensors"><param name="channels">2</param></device>
  <device name="imu" type="fakeSensors">
    <param name="ThreeAxisLinearAccelerometersNames">(head)</param>
  </device>
  <device name="head_inertial" type="inertial">
    <param name="name">/r/inertial</param> <param name="period">0.002</param>
    <action phase="startup" level="5" type="attach"><param name="device">imu</param></action>
    <action phase="shutdown" level="5" type="detach"/>
  </device>
  <device name="vft" type="virtualAnalogServer">
    <param name="name">/r/joint_vsens/arm:i</param> <param name="channels">7</param>
    <paramlist name="networks">
      <elem name="first">(0 3 0 3)</elem> <elem name="second">(4 6 0 2)</elem>
    </paramlist>
    <action phase="startup" level="5" type="attach">
      <paramlist name="networks"><elem name="first">upper</elem><elem name="second">wrist</elem></paramlist>
    </action>
    <action phase="shutdown" level="5" type="detach"/>
  </device>
  <device name="upper_nws" type="controlBoard_nws_yarp">
    <param name="name">/r/upper</param>
    <action phase="startup" level="6" type="attach"><param name="device">upper</param></action>
    <action phase="shutdown" level="5" type="detach"/>
  </device>
  <device name="wrist_nws" type="analogServer">
    <param name="name">/r/wrist</param> <param name="period">2</param>
    <action phase="startup" level="6" type="attach"><param name="device">wrist</param></action>
    <action phase="shutdown" level="5" type="detach"/>
  </device>
</robot>"#;

/// Opens a port that keeps the last bottle of `writer`.
fn listen(stage: &Stage, writer: &str) -> (Port, Arc<Mutex<Bottle>>) {
    let last = Arc::new(Mutex::new(Bottle::new()));
    let theirs = last.clone();
    let take = move |received: &mut Received| {
        *theirs.lock().unwrap() = received.bottle().unwrap();
        assert!(received.stamp().is_some());
        Answer::Nothing
    };
    let options = PortOptions::new().handler(take).input_only();
    let port = stage.runtime.block_on(async {
        let port = Port::open(&stage.network, &format!("/reader{writer}"), options).await;
        let port = port.unwrap();
        let connecting =
            remote_admin::connect(&stage.network, writer, port.name(), Some("fast_tcp"));
        connecting.await.unwrap();
        port
    });
    (port, last)
}

fn numbers(bottle: &Mutex<Bottle>) -> Vec<f64> {
    let bottle = bottle.lock().unwrap();
    bottle.iter().filter_map(yarp_wire::Value::as_f64).collect()
}

#[test]
fn an_inertial_sensor_is_twelve_numbers_on_one_port() {
    let stage = Stage::new();
    let robot = stage.run("r.xml", ROBOT);
    let (port, last) = listen(&stage, "/r/inertial");
    let mut expected = vec![0.0; 12];
    expected[5] = 9.80665;
    eventually("a measurement", || numbers(&last) == expected);
    stage.runtime.block_on(port.close());
    stage.end(robot);
}

/// Torques reach the boards of their networks, and become zero when no more come.
#[test]
fn torques_of_another_program_are_those_of_the_joints() {
    let stage = Stage::new();
    let robot = stage.run("r.xml", ROBOT);
    let board = stage.remote("/r/upper");
    let board: &dyn yarp_devices::Device = &board;
    let (wrist, last) = listen(&stage, "/r/wrist");
    let torques = || {
        board
            .torque_control()
            .unwrap()
            .torques(Axes::All)
            .unwrap_or_default()
    };
    let writer = stage.runtime.block_on(async {
        let writer = Port::open(&stage.network, "/writer", PortOptions::new())
            .await
            .unwrap();
        let connecting = remote_admin::connect(
            &stage.network,
            "/writer",
            "/r/joint_vsens/arm:i",
            Some("fast_tcp"),
        );
        connecting.await.unwrap();
        writer
    });
    // Sent again and again, as programs do.
    eventually("torques", || {
        let message = Bottle::parse("1 1.0 2.0 3.0 4.0 5.0 6.0 7.0").unwrap();
        stage.runtime.block_on(writer.write(&message));
        torques() == [1.0, 2.0, 3.0, 4.0] && numbers(&last) == [5.0, 0.0]
    });
    eventually("zeros", || {
        torques() == [0.0; 4] && numbers(&last) == [0.0; 2]
    });
    stage.runtime.block_on(writer.close());
    stage.runtime.block_on(wrist.close());
    stage.end(robot);
}

/// Each mistake is reported with its line.
#[test]
fn mistakes_name_the_line() {
    let stage = Stage::new();
    for (kind, text, expected) in [
        (
            "inertial",
            "period 0",
            "d.ini:1: device d: parameter period: expected 0.001 to 60 seconds, got 0",
        ),
        (
            "inertial",
            "subdevice simulatedWam",
            "it cannot attach to simulatedWam, expected an inertial sensor",
        ),
        (
            "virtualAnalogServer",
            "name /v",
            "d.ini:1: device d: parameter networks: expected the names of 1 to 64 networks",
        ),
        (
            "virtualAnalogServer",
            "name /v\nnetworks (a)\na (0 3 0)",
            "d.ini:3: device d: parameter a: expected first and last channel of the port, first and last of the board, up to 254",
        ),
        (
            "virtualAnalogServer",
            "name /v\nnetworks (a)\na (0 255 0 3)",
            "d.ini:3: device d: parameter a: expected first and last channel of the port",
        ),
        (
            "virtualAnalogServer",
            &format!("name /v\nnetworks ({})", "a ".repeat(65)),
            "d.ini:2: device d: parameter networks: expected the names of 1 to 64 networks",
        ),
    ] {
        let error = stage.open(kind, text).err().expect(text);
        assert!(error.contains(expected), "{error}");
    }
}

/// A board that cannot take torques, and a network without a board, end the start.
#[test]
fn unsuitable_boards_are_refused() {
    let stage = Stage::new();
    for (from, to) in [
        ("\"second\">wrist", "\"third\">wrist"),
        ("\"second\">wrist", "\"second\">head_inertial"),
    ] {
        let text = ROBOT.replace(from, to);
        let file = stage.folder().join("r.xml");
        std::fs::write(&file, text).unwrap();
        let robot = yarp_hosting::robot::Robot::read(&file, &Default::default()).unwrap();
        let starting = RunningRobot::start(&stage.network, robot, Progress::default());
        let started = stage.runtime.block_on(starting);
        let is_ready = started.as_ref().is_some_and(RunningRobot::is_ready);
        assert!(!is_ready, "{to}");
        if let Some(mut robot) = started {
            stage.runtime.block_on(robot.close());
        }
    }
}

/// The channels of a fake hold what they are set to; more and infinite values are refused.
#[test]
fn channels_of_a_fake_take_torques() {
    let sensors = yarp_devices::fake::ConstantSensors::new(2);
    let device: &dyn yarp_devices::Device = &sensors;
    let torques = device.virtual_sensor().unwrap();
    torques.set_virtual_measures(&[1.0]).unwrap();
    assert!(torques.set_virtual_measures(&[1.0; 3]).is_err());
    assert!(torques.set_virtual_measures(&[2.0, f64::NAN]).is_err());
    let mut reading = SensorReading::default();
    sensors.read_channels(&mut reading);
    assert_eq!(reading.values, [1.0, 0.0]);
}
