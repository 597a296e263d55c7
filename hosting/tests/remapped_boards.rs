//! Two arms as one board: in descriptions of robots, by the names of joints and by networks, and over the network.

mod support;

use std::sync::Arc;
use std::time::Duration;

use support::{Stage, TIMEOUT};
use yarp_devices::{Axes, AxisIndex, AxisInfo, Device, Encoders, checks};

/// Two arms, each with its server.
const ARMS: &str = r#"
[robot]
name = "two"
portprefix = "two"
[[device]]
name = "left_arm"
type = "fakeMotionControl"
params = { GENERAL = { Joints = 2, AxisName = ["shoulder", "elbow"] }, LIMITS = { Min = [-10, -20], Max = [10, 20] } }
[[device]]
name = "right_arm"
type = "fakeMotionControl"
params = { GENERAL = { Joints = 2, AxisName = ["hip", "knee"] }, LIMITS = { Min = [-30, -40], Max = [30, 40] } }
[[device]]
name = "left_nws"
type = "controlBoard_nws_yarp"
params = { name = "/two/left", period = 0.01 }
action = [{ phase = "startup", level = 5, type = "attach", params = { device = "left_arm" } }]
[[device]]
name = "right_nws"
type = "controlBoard_nws_yarp"
params = { name = "/two/right", period = 0.01 }
action = [{ phase = "startup", level = 5, type = "attach", params = { device = "right_arm" } }]
"#;

/// A server of the remapped board.
const SERVED: &str = r#"
[[device]]
name = "both_nws"
type = "controlBoard_nws_yarp"
params = { name = "/two/both", period = 0.01 }
action = [
  { phase = "startup", level = 10, type = "attach", params = { device = "both" } },
  { phase = "shutdown", level = 1, type = "detach" },
]
"#;

/// Description of the remapper in stock's XML, with the same arms.
const XML: &str = r#"<robot name="two" build="1" portprefix="two">
<device name="left_arm" type="fakeMotionControl">
  <group name="GENERAL"><param name="Joints">2</param><param name="AxisName">shoulder elbow</param></group>
  <group name="LIMITS"><param name="Min">-10 -20</param><param name="Max">10 20</param></group>
</device>
<device name="right_arm" type="fakeMotionControl">
  <group name="GENERAL"><param name="Joints">2</param><param name="AxisName">hip knee</param></group>
  <group name="LIMITS"><param name="Min">-30 -40</param><param name="Max">30 40</param></group>
</device>
<device name="both" type="controlboardremapper">
  <paramlist name="networks"><elem name="l">( 0 0 1 1 )</elem><elem name="r">( 1 2 0 1 )</elem></paramlist>
  <param name="joints">3</param>
  <action phase="startup" level="5" type="attach">
    <paramlist name="networks"><elem name="r">right_arm</elem><elem name="l">left_arm</elem></paramlist>
  </action>
  <action phase="shutdown" level="5" type="detach"/>
</device>
<device name="both_nws" type="controlBoard_nws_yarp">
  <param name="name">/two/both</param><param name="period">0.01</param>
  <action phase="startup" level="10" type="attach"><param name="device">both</param></action>
  <action phase="shutdown" level="1" type="detach"/>
</device>
</robot>
"#;

fn names(board: &dyn AxisInfo) -> Vec<String> {
    let axes = (0..board.axes()).map(AxisIndex::from);
    axes.map(|axis| board.axis_name(axis).expect("it has a name"))
        .collect()
}

/// Checks that the three joints of the board move the right joints of the arms.
#[track_caller]
fn drives_both_arms(board: &dyn Device) {
    let info = board.axis_info().expect("it has joints");
    assert_eq!(names(info), ["elbow", "hip", "knee"]);
    let limits = board.control_limits().expect("it has limits");
    let most = [0, 1, 2].map(|axis| limits.position_limits(axis.into()).unwrap().max);
    assert_eq!(most, [20.0, 30.0, 40.0]);
    checks::a_move_ends_at_its_target(board, TIMEOUT);
    checks::a_bad_target_for_one_moves_none(board, TIMEOUT);
}

#[test]
fn two_arms_are_one_board_by_the_names_of_their_joints() {
    let stage = Stage::new();
    let remapper = r#"
[[device]]
name = "both"
type = "controlboardremapper"
params = { axesNames = ["elbow", "hip", "knee"] }
action = [
  { phase = "startup", level = 5, type = "attach", params = { networks = ["l", "r"], l = "left_arm", r = "right_arm" } },
  { phase = "shutdown", level = 5, type = "detach" },
]
"#;
    let robot = stage.run("r.toml", &format!("{ARMS}{remapper}{SERVED}"));
    assert!(robot.is_ready());
    let (both, left) = (stage.remote("/two/both"), stage.remote("/two/left"));
    drives_both_arms(&both);
    let ours = both.encoder_readings(Axes::All).unwrap()[0].position;
    let deadline = std::time::Instant::now() + TIMEOUT;
    // The other server reports the same position of the elbow in its next state.
    while (left
        .encoder_readings(Axes::All)
        .map_or(f64::NAN, |all| all[1].position)
        - ours)
        .abs()
        > 1e-6
    {
        assert!(
            std::time::Instant::now() < deadline,
            "not the elbow of the left arm"
        );
        std::thread::sleep(Duration::from_millis(2));
    }
    drop((both, left));
    stage.end(robot);
}

/// Checks ranges of networks that are attached in another order.
#[test]
fn two_arms_are_one_board_by_networks_in_xml() {
    let stage = Stage::new();
    let robot = stage.run("r.xml", XML);
    assert!(robot.is_ready());
    let both = stage.remote("/two/both");
    drives_both_arms(&both);
    drop(both);
    stage.end(robot);
}

/// Checks stock's older descriptions, where the server itself combines networks.
#[test]
fn the_old_server_is_made_of_networks() {
    let stage = Stage::new();
    let from = XML.find("<device name=\"both\"").unwrap();
    let old = r#"<device name="both_nws" type="controlboardwrapper2">
  <param name="name">/two/both</param><param name="period">10</param><param name="joints">3</param>
  <paramlist name="networks"><elem name="l">0 0 1 1</elem><elem name="r">1 2 0 1</elem></paramlist>
  <action phase="startup" level="5" type="attach">
    <paramlist name="networks"><elem name="l">left_arm</elem><elem name="r">right_arm</elem></paramlist>
  </action>
  <action phase="shutdown" level="5" type="detach"/>
</device></robot>"#;
    let robot = stage.run("r.xml", &format!("{}{old}", &XML[..from]));
    assert!(robot.is_ready());
    let both = stage.remote("/two/both");
    drives_both_arms(&both);
    drop(both);
    stage.end(robot);
}

#[test]
fn boards_of_other_programs_are_one_board() {
    let stage = Stage::new();
    let robot = stage.run("r.toml", ARMS);
    let text = "axesNames (elbow hip knee)\nremoteControlBoards (/two/left /two/right)\nlocalPortPrefix /here\n[REMOTE_CONTROLBOARD_OPTIONS]\ncarrier fast_tcp\nwriteStrict on\n";
    let hosted = stage
        .open("remotecontrolboardremapper", text)
        .expect("both are there");
    let board: Arc<dyn Device> = hosted.parts().board.expect("it has joints");
    drives_both_arms(board.as_ref());
    drop(board);
    stage.runtime.block_on(hosted.close());
    let again = text.replace("knee", "ankle");
    let refused = stage
        .open("remotecontrolboardremapper", &again)
        .err()
        .expect("no such joint");
    assert_eq!(
        refused,
        "d.ini:1: device d: the devices cannot be combined to one board: no device has a joint ankle; there is shoulder, elbow, hip, knee"
    );
    // The devices opened before the refusal are closed: their names are free.
    let hosted = stage
        .open("remotecontrolboardremapper", text)
        .expect("both are there");
    stage.runtime.block_on(hosted.close());
    stage.end(robot);
}

/// Checks `yarp dev --device controlboardremapper --subdevice ...`.
#[test]
fn a_part_of_one_device_is_a_bundle() {
    let stage = Stage::new();
    let text =
        "subdevice fakeMotionControl\nnetworks (it)\njoints 2\nit (0 1 1 2)\n[GENERAL]\nJoints 4\n";
    let hosted = stage.open("controlboardremapper", text).expect("it fits");
    let board = hosted.parts().board.expect("it has joints");
    assert_eq!(names(board.axis_info().unwrap()), ["joint1", "joint2"]);
    drop(board);
    stage.runtime.block_on(hosted.close());
}

#[test]
fn errors_name_the_line() {
    let stage = Stage::new();
    for (kind, text, expected) in [
        (
            "controlboardremapper",
            "verbose\n",
            "d.ini:1: device d: parameter axesNames is missing, expected the names of joints, or networks instead",
        ),
        (
            "remotecontrolboardremapper",
            "axesNames (a)\nremoteControlBoards (/a)\n",
            "d.ini:1: device d: parameter localPortPrefix is missing, expected a port name such as /arm",
        ),
        (
            "remotecontrolboardremapper",
            "axesNames (a)\nlocalPortPrefix /p\nremoteControlBoards (a)\n",
            "d.ini:3: device d: parameter remoteControlBoards: expected a port name such as /arm, got a",
        ),
        (
            "controlboardremapper",
            "subdevice simulatedWam\naxesNames (knee)\n",
            "d.ini:1: device d: the devices cannot be combined to one board: no device has a joint knee; there is",
        ),
    ] {
        let refused = stage.open(kind, text).err().expect("it is refused");
        assert!(refused.starts_with(expected), "{refused}");
    }
    // In a robot the error names the action, and the robot is not ready.
    let wrong = XML.replace("<elem name=\"r\">right_arm</elem><elem", "<elem");
    let robot = stage.run("r.xml", &wrong);
    assert!(!robot.is_ready());
    let mut robot = robot;
    stage.runtime.block_on(robot.close());
}
