//! A robot whose boards are replaced by fakes starts completely, from the description of the real one.

mod support;

use support::Stage;
use yarp_devices::{Axes, AxisIndex, AxisInfo, ControlLimits, Encoders};
use yarp_hosting::robot::{Progress, ReadOptions, Robot, RunningRobot, Substitutions};
use yarp_testing::eventually;

/// A description in the style of iCub's: boards, a remapper, sensors and a skin, each with its server.
const ROBOT: &str = r#"<robot name="bot" portprefix="bot"><devices>
<device name="arm-eb1" type="embObjMotionControl">
  <group name="GENERAL"><param name="Joints"> 2 </param><param name="AxisMap">0 1</param></group>
  <group name="GENERAL"><param name="AxisName"> "shoulder" "elbow" </param></group>
  <group name="LIMITS"><param name="jntPosMax"> 14 130 </param><param name="jntPosMin"> -130 5 </param></group>
</device>
<device name="arm-eb2" type="embObjMotionControl">
  <group name="GENERAL"><param name="Joints">1</param><param name="AxisName">"wrist"</param></group>
</device>
<device name="arm-strain" type="embObjMultipleFTsensors">
  <group name="SERVICE"><group name="SENSORS"><param name="id"> arm_ft foot_ft </param></group></group>
</device>
<device name="arm-skin" type="embObjSkin"><param name="patches">4</param></device>
<device name="mystery" type="xsensmt"><param name="serial">/dev/ttyS0</param></device>
<device name="mystery2" type="xsensmt"><param name="serial">/dev/ttyS1</param></device>
<device name="mapper" type="controlboardremapper">
  <param name="axesNames">(shoulder elbow wrist)</param><param name="joints">3</param>
  <action phase="startup" level="5" type="attach"><paramlist name="networks">
    <elem name="one"> arm-eb1 </elem><elem name="two"> arm-eb2 </elem><elem name="three"> mystery </elem></paramlist></action>
  <action phase="shutdown" level="20" type="detach"/>
</device>
<device name="nws" type="controlBoard_nws_yarp">
  <param name="period"> 0.01 </param><param name="name"> /${portprefix}/arm </param>
  <action phase="startup" level="10" type="attach"><param name="device"> mapper </param></action>
  <action phase="shutdown" level="15" type="detach"/>
</device>
<device name="calibrator" type="parametricCalibratorEth">
  <group name="HOME"><param name="positionHome">5 30 0</param></group>
  <action phase="startup" level="11" type="calibrate"><param name="target">mapper</param></action>
  <action phase="interrupt1" level="1" type="park"><param name="target">mapper</param></action>
</device>
<device name="ft" type="multipleanalogsensorsremapper">
  <param name="SixAxisForceTorqueSensorsNames">(foot_ft)</param><param name="TemperatureSensorsNames">(arm_ft)</param>
  <action phase="startup" level="5" type="attach"><paramlist name="networks"><elem name="s"> arm-strain </elem></paramlist></action>
  <action phase="shutdown" level="20" type="detach"/>
</device>
<device name="ft_nws" type="multipleanalogsensorsserver">
  <param name="period"> 10 </param><param name="name"> /bot/arm/FT </param>
  <action phase="startup" level="10" type="attach"><paramlist name="networks"><elem name="s"> ft </elem></paramlist></action>
  <action phase="shutdown" level="15" type="detach"/>
</device>
<device name="skin_nws" type="skinWrapper">
  <param name="total_taxels"> 8 </param>
  <paramlist name="ports"><elem name="hand"> 0 3 0 3 </elem><elem name="forearm"> 4 7 0 3 </elem></paramlist>
  <action phase="startup" level="5" type="attach"><paramlist name="networks"><elem name="s"> arm-skin </elem></paramlist></action>
  <action phase="shutdown" level="5" type="detach"/>
</device>
<device name="waist_nws" type="multipleanalogsensorsserver">
  <param name="name"> /bot/waist </param>
  <action phase="startup" level="10" type="attach"><paramlist name="networks"><elem name="s"> mystery </elem></paramlist></action>
  <action phase="shutdown" level="15" type="detach"/>
</device>
</devices></robot>"#;

const RULES: &str = r#"
omit_unknown = true
[[substitute]]
types = ["embObjMotionControl"]
with = "fakeMotionControl"
[substitute.copy]
"GENERAL::Joints" = "GENERAL::Joints"
"GENERAL::AxisName" = "GENERAL::AxisName"
"LIMITS::Min" = "LIMITS::jntPosMin"
"LIMITS::Max" = "LIMITS::jntPosMax"
[[substitute]]
types = ["parametricCalibrator*"]
with = "boardCalibrator"
[[substitute]]
names = ["arm-str*"]
with = "fakeSensors"
copy = { SixAxisForceTorqueSensorsNames = "SERVICE::SENSORS::id", TemperatureSensorsNames = "SERVICE::SENSORS::id" }
[[substitute]]
types = ["embObjSkin"]
with = "fakeSensors"
params = { channels = 8 }
"#;

fn described(stage: &Stage) -> Robot {
    let file = stage.folder().join("bot.xml");
    std::fs::write(&file, ROBOT).unwrap();
    Robot::read(&file, &ReadOptions::default()).unwrap()
}

fn rules(stage: &Stage, text: &str) -> Result<Substitutions, String> {
    let file = stage.folder().join("fakes.toml");
    std::fs::write(&file, text).unwrap();
    Substitutions::read(&file).map_err(|error| error.to_string())
}

fn names(stage: &Stage) -> Vec<String> {
    let answer = stage.runtime.block_on(stage.network.ask("list")).unwrap();
    let words = answer.lines().flat_map(|line| line.split_whitespace());
    let words = words.filter(|word| word.starts_with("/bot/"));
    let mut names: Vec<String> = words.map(str::to_owned).collect();
    names.sort();
    names
}

/// The names of ports are those of stock for the same servers; `async:o` and `stop/rpc:i` are added to them.
#[test]
fn a_robot_with_fakes_starts_completely() {
    let stage = Stage::new();
    let mut robot = described(&stage);
    let omitted = robot.substitute(&rules(&stage, RULES).unwrap());
    let omitted: Vec<_> = omitted.iter().map(ToString::to_string).collect();
    assert_eq!(omitted.len(), 1, "{omitted:?}");
    let expected = "bot.xml:14: there is no device type xsensmt: device mystery is left out, 2 of this type in total";
    assert!(omitted[0].ends_with(expected), "{omitted:?}");
    assert_eq!(robot.problems(), []);
    let running = stage.start(robot);
    assert!(running.is_ready());
    let expected = [
        "/bot/arm/FT/measures:o",
        "/bot/arm/FT/rpc:o",
        "/bot/arm/async:o",
        "/bot/arm/command:i",
        "/bot/arm/nws/rpc:i",
        "/bot/arm/rpc:i",
        "/bot/arm/state:o",
        "/bot/arm/stateExt:o",
        "/bot/arm/stop/rpc:i",
        "/bot/skin/forearm",
        "/bot/skin/forearm/rpc:i",
        "/bot/skin/hand",
        "/bot/skin/hand/rpc:i",
    ];
    assert_eq!(names(&stage), expected);
    let board = stage.remote("/bot/arm");
    assert_eq!(board.axis_name(AxisIndex::new(2)).unwrap(), "wrist");
    let limits = board.position_limits(AxisIndex::new(0)).unwrap();
    assert_eq!((limits.min, limits.max), (-130.0, 14.0));
    eventually("the state of the board", || {
        let readings = board.encoder_readings(Axes::All);
        readings.is_ok_and(|readings| readings.len() == 3)
    });
    drop(board);
    stage.end(running);
    assert_eq!(names(&stage), Vec::<String>::new());
}

/// Each unknown type is reported once, and nothing is opened.
#[test]
fn a_robot_with_unknown_devices_opens_nothing() {
    let stage = Stage::new();
    let robot = described(&stage);
    let starting = RunningRobot::start(&stage.network, robot, Progress::default());
    assert!(stage.runtime.block_on(starting).is_none());
    assert_eq!(names(&stage), Vec::<String>::new());
}

#[test]
fn errors_in_rules_name_file_and_line() {
    let stage = Stage::new();
    for (text, expected) in [
        (
            "omit = 1",
            "fakes.toml:1: expected one of omit_unknown, substitute",
        ),
        ("omit_unknown = 1", "fakes.toml:1: expected true or false"),
        (
            "\n[[substitute]]\nwith = \"fakeSensors\"",
            "fakes.toml:2: expected key types",
        ),
        (
            "[[substitute]]\ntypes = [\"a\"]",
            "fakes.toml:1: expected key with",
        ),
        (
            "[[substitute]]\ntypes = [\"a\"]\nwith = \"b\"",
            "fakes.toml:3: expected a device type that exists here, got \"b\"",
        ),
        (
            "[[substitute]]\ntypes = [\"a\"]\nwith = \"fakeSensors\"\ncopy = { x = 1 }",
            "fakes.toml:4: expected the name of a parameter of the old device",
        ),
        (
            "[[substitute]]\ntypes = [\"a\"]\nwith = \"fakeSensors\"\nparams = 1",
            "fakes.toml:4: expected a table of parameters",
        ),
        ("[[substitute]", "fakes.toml:1: "),
    ] {
        let error = rules(&stage, text).unwrap_err();
        assert!(error.contains(expected), "no {expected}: {error}");
    }
}

#[test]
fn fake_sensors_have_a_limited_number_of_channels() {
    let stage = Stage::new();
    for (channels, allowed) in [(0, false), (1, true), (10_000, true), (10_001, false)] {
        match stage.open("fakeSensors", &format!("channels {channels}\n")) {
            Ok(sensors) => {
                assert!(allowed, "{channels}");
                stage.runtime.block_on(sensors.close());
            }
            Err(error) => assert!(
                !allowed && error.contains("expected 1 to 10000 channels"),
                "{error}"
            ),
        }
    }
}

/// The names of the ports of a skin begin with the robot, whose name may have a `/` in front.
#[test]
fn a_skin_needs_a_robot() {
    let stage = Stage::new();
    for (text, expected) in [
        ("period 20\n", "parameter robotName is missing"),
        (
            "robotName \"a b\"\n",
            "expected a name that begins the name of a port",
        ),
        ("robotName /bot\nperiod 0\n", "1 to 60000 milliseconds"),
    ] {
        let error = stage.open("skinWrapper", text).err().unwrap();
        assert!(error.contains(expected), "no {expected}: {error}");
    }
    let skin = stage.open("skinWrapper", "robotName /bot\n").ok().unwrap();
    stage.runtime.block_on(skin.close());
}
