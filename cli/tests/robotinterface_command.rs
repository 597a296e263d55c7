//! `yarp robotinterface` runs a robot of several devices, described in XML or TOML.

#![cfg(unix)]

use crate::common;

use std::process::Command;

use common::Home;
use yarp_testing::eventually;

const RUNNING: &str = "running happily";

const XML: &str = r#"<?xml version="1.0" encoding="UTF-8" ?>
<!DOCTYPE robot PUBLIC "-//YARP//DTD yarprobotinterface 3.0//EN" "http://www.yarp.it/DTD/yarprobotinterfaceV3.0.dtd">
<robot name="one" build="1" portprefix="one" xmlns:xi="http://www.w3.org/2001/XInclude">
  <params><param name="verbose">0</param></params>
  <devices>
    <device name="arm" type="fakeMotionControl">
      <xi:include href="joints.xml"/>
      <group name="GENERAL"><param name="AxisName">a b</param></group>
    </device>
    <xi:include href="server.xml" enabled_by="served"/>
  </devices>
</robot>
"#;
const JOINTS: &str = "<group name=\"GENERAL\"><param name=\"Joints\">2</param></group>";
const SERVER: &str = r#"<devices>
  <device name="arm_nws" type="controlBoard_nws_yarp">
    <param name="name" extern-name="arm_port">${portprefix}/arm</param>
    <param name="period">0.05</param>
    <action phase="startup" level="5" type="attach">
      <paramlist name="networks"><elem name="all_of_it">arm</elem></paramlist>
    </action>
    <action phase="shutdown" level="5" type="detach"/>
  </device>
  <device name="calibrator" type="boardCalibrator">
    <action phase="startup" level="10" type="calibrate"><param name="target">arm</param></action>
    <action phase="interrupt1" level="1" type="park"><param name="target">arm</param></action>
  </device>
</devices>"#;

const TOML: &str = r#"
include = [{ file = "server.toml", enabled_by = ["served"] }]
[robot]
name = "one"
portprefix = "/one"
[params]
verbose = 0
[[device]]
name = "arm"
type = "fakeMotionControl"
params = { GENERAL = { Joints = 2, AxisName = ["a", "b"] } }
"#;
const SERVER_TOML: &str = r#"
[[device]]
name = "arm_nws"
type = "controlBoard_nws_yarp"
params = { name = "${portprefix}/arm", period = 0.05 }
extern = { name = "arm_port" }
action = [
  { phase = "startup", level = 5, type = "attach", params = { networks = ["all_of_it"], all_of_it = "arm" } },
  { phase = "shutdown", level = 5, type = "detach" },
]
[[device]]
name = "calibrator"
type = "boardCalibrator"
action = [
  { phase = "startup", level = 10, type = "calibrate", params = { target = "arm" } },
  { phase = "interrupt1", level = 1, type = "park", params = { target = "arm" } },
]
"#;

/// Creates a configuration with these files.
fn home(files: &[(&str, &str)]) -> Home {
    let home = Home::new();
    for (name, text) in files {
        std::fs::write(home.path().join(name), text).unwrap();
    }
    home
}

/// Checks a running robot: its arm answers, its port reports the phase, and nothing is left in the
/// end.
#[track_caller]
fn lives(home: &Home, config: &str) {
    let _server = home.serve();
    let file = home.path().join(config).display().to_string();
    let robot = home
        .start(&format!(
            "robotinterface --config {file} --enable_tags served --arm_port /two/arm"
        ))
        .see(RUNNING);
    let axes = home
        .run_with("rpc /two/arm/rpc:i", "[get] [axes]\n[get] [name] 1\n")
        .with(0);
    assert!(axes.says("[is] [axes] 2") && axes.says(" b "), "{axes:?}");
    let asked = "get_phase\nget phase\nget_level\nget_robot\nis_ready\nhelp\nhelp quit\nnonsense\n";
    let told = home.run_with("rpc /one/yarprobotinterface", asked).with(0);
    let answers: Vec<_> = told
        .out
        .iter()
        .filter_map(|line| line.strip_prefix("Response: "))
        .collect();
    let expected = ["run", "run", "0", "one", "[ok]"];
    assert_eq!(answers[..5], expected, "{told:?}");
    for line in ["*** Available commands:", "Ends the program.", "[fail]"] {
        assert!(told.says(line), "no {line}: {told:?}");
    }
    let robot = match config.ends_with("xml") {
        true => robot.signal("TERM"),
        false => {
            assert!(
                home.run_with("rpc /one/yarprobotinterface", "quit\n")
                    .says("bye")
            );
            robot
        }
    };
    let ended = robot.finish().with(0);
    for step in [
        "interrupt1 phase finished",
        "level 5 of shutdown phase finished",
    ] {
        assert!(ended.says(step), "no {step}: {ended:?}");
    }
    assert_eq!(home.names(), Vec::<String>::new());
}

#[test]
fn a_robot_in_xml() {
    let home = home(&[
        ("robot.xml", XML),
        ("joints.xml", JOINTS),
        ("server.xml", SERVER),
    ]);
    lives(&home, "robot.xml");
}

/// A service that fails does not end the robot, but its exit code tells.
#[test]
fn a_service_that_fails_is_reported_at_the_end() {
    let text = r#"<robot name="one" portprefix="one">
<device name="recorder" type="pipe">
  <param name="source">fakeFrameGrabber</param> <param name="sink">imageFolderWriter</param>
  <param name="folder">FOLDER</param> <param name="freq">20</param> <param name="max_images">20</param>
</device>
</robot>"#;
    let home = Home::new();
    let folder = home.path().join("images").display().to_string();
    let file = home.path().join("robot.xml");
    std::fs::write(&file, text.replace("FOLDER", &folder)).unwrap();
    let _server = home.serve();
    let robot = home
        .start(&format!("robotinterface --config {}", file.display()))
        .see(RUNNING);
    eventually("the error of the service", || {
        let failed = "the service of recorder failed: image 21 is refused";
        robot.logged().iter().any(|line| line.contains(failed))
    });
    assert!(
        home.run_with("rpc /one/yarprobotinterface", "is_ready\n")
            .says("[ok]"),
        "the robot goes on"
    );
    robot.signal("TERM").finish().with(1);
}

#[test]
fn a_robot_in_toml() {
    let home = home(&[("robot.toml", TOML), ("server.toml", SERVER_TOML)]);
    lives(&home, "robot.toml");
}

/// Without the tag that includes the rest, and with the default file.
#[test]
fn a_robot_is_described_without_a_network() {
    let home = home(&[
        ("robot.xml", XML),
        ("joints.xml", JOINTS),
        ("server.xml", SERVER),
    ]);
    let file = home.path().join("robot.xml").display().to_string();
    let said = home
        .run(&format!("robotinterface --config {file} --dryrun"))
        .with(0);
    let expected = [
        "robot one, ports /one",
        "device arm of type fakeMotionControl",
        "  param GENERAL (Joints 2) (AxisName a b)",
        "  param device fakeMotionControl",
        "  param id arm",
        "  param robotName one",
    ];
    assert_eq!(said.out[said.out.len() - 6..], expected);
    std::fs::write(
        home.path().join("yarprobotinterface.ini"),
        "config robot.xml\n",
    )
    .unwrap();
    let line = "robotinterface --dryrun --enable_tags served --portprefix /p";
    let said = home.run(line).with(0);
    assert!(
        said.says("robot one, ports /p") && said.says("  startup 5: attach"),
        "{said:?}"
    );
    let ended = home.run(&format!("robotinterface --config {file}")).with(1);
    ended.complains("is the yarp server available");
}

/// Other devices take the place of those of the description, and the result is printed as JSON.
#[test]
fn a_robot_with_substitutes_is_described_as_json() {
    let xml = XML.replace("fakeMotionControl", "someBoard");
    let rules = "[[substitute]]\ntypes = [\"someBoard\"]\nwith = \"fakeMotionControl\"\ncopy = { \"GENERAL::Joints\" = \"GENERAL::Joints\" }\n";
    let home = home(&[
        ("robot.xml", &xml),
        ("joints.xml", JOINTS),
        ("server.xml", SERVER),
        ("fakes.toml", rules),
    ]);
    let file = |name| home.path().join(name).display().to_string();
    let line = format!(
        "robotinterface --dryrun --json --enable_tags served --config {}",
        file("robot.xml")
    );
    let robot = |line: &str| -> serde_json::Value {
        let text = home.run(line).with(0).out;
        let begin = text.iter().position(|line| line == "{").unwrap();
        serde_json::from_str(&text[begin..].join("\n")).unwrap()
    };
    let real = robot(&line);
    let what = real["problems"][0]["what"].as_str().unwrap();
    assert!(what.contains("there is no device type someBoard"), "{what}");
    let faked = robot(&format!("{line} --substitute {}", file("fakes.toml")));
    assert_eq!(faked["problems"], serde_json::json!([]));
    let arm = &faked["devices"][0];
    assert_eq!(arm["type"], "fakeMotionControl");
    assert_eq!(arm["params"]["GENERAL"], serde_json::json!([["Joints", 2]]));
    let attach = &faked["devices"][1]["actions"][0];
    assert_eq!(
        (&attach["phase"], &attach["level"]),
        (&"startup".into(), &5.into())
    );
    assert_eq!(
        attach["params"],
        serde_json::json!([["all_of_it", "arm"], ["networks", ["all_of_it"]]])
    );
}

#[test]
fn the_old_format_is_read_if_allowed() {
    let old = XML.replace("3.0", "1.0").replace(
        "<xi:include href=\"joints.xml\"/>",
        "<params file=\"joints.xml\"/>",
    );
    let joints = format!("<params>{JOINTS}</params>");
    let home = home(&[("robot.xml", &old), ("joints.xml", &joints)]);
    let line = format!(
        "robotinterface --dryrun --config {}",
        home.path().join("robot.xml").display()
    );
    home.run(&line)
        .with(1)
        .complains("robot.xml:2: expected format 3");
    let said = home.run(&format!("{line} --allow-deprecated-dtd")).with(0);
    assert!(
        said.says("device arm of type fakeMotionControl"),
        "{said:?}"
    );
}

/// Each error names its file and line.
#[test]
fn errors_name_file_and_line() {
    let around = |inside: &str| {
        format!("<robot name=\"r\" portprefix=\"r\" xmlns:xi=\"x\">\n{inside}\n</robot>\n")
    };
    let device = |inside: &str| {
        around(&format!(
            "<device name=\"d\" type=\"simulatedWam\">\n{inside}\n</device>"
        ))
    };
    for (text, expected) in [
        (
            around("<device type=\"x\"/>"),
            "r.xml:2: expected attribute name in <device>, got none",
        ),
        (
            around("<device name=\"d\"/>"),
            "r.xml:2: expected attribute type in <device>, got none",
        ),
        (
            around("<thing/>"),
            "r.xml:2: expected <param>, <group>, <paramlist>, <subdevice> or <params>, got <thing>",
        ),
        (
            around("<xi:include href=\"none.xml\"/>"),
            "none.xml (included by",
        ),
        (
            device("<param name=\"p\"></param>"),
            "r.xml:3: expected a value in <param name=\"p\">, got nothing",
        ),
        (
            device("<param>1</param>"),
            "r.xml:3: expected attribute name in <param>, got none",
        ),
        (
            device("<group name=\"g\"/>"),
            "r.xml:3: expected parameters in <group name=\"g\">, got none",
        ),
        (
            device("<paramlist name=\"l\"><param/></paramlist>"),
            "r.xml:3: expected <elem>, got <param>",
        ),
        (
            device("<action phase=\"startup\" level=\"-1\" type=\"attach\"/>"),
            "r.xml:3: expected a whole number from 0 as level of <action>, got -1",
        ),
        (
            device("<params file=\"x\"/>"),
            "r.xml:3: expected <xi:include href=..>, got file=\"x\"",
        ),
        (device("</param>"), "r.xml:3: "),
        (
            "<devices/>".to_owned(),
            "r.xml:1: expected <robot>, got <devices>",
        ),
        (
            format!(
                "<!DOCTYPE robot SYSTEM \"http://www.yarp.it/DTD/yarprobotinterfaceV2.0.dtd\">\n{}",
                around("")
            ),
            "r.xml:1: expected format 3 (or 1, with --allow-deprecated-dtd), got format 2",
        ),
    ] {
        let home = home(&[("r.xml", &text)]);
        let ended = home.run(&format!(
            "robotinterface --dryrun --config {}",
            home.path().join("r.xml").display()
        ));
        ended.with(1).complains(expected);
    }
    let robot = "[robot]\nname = \"r\"\n";
    for (text, expected) in [
        (
            format!("{robot}[[device]]\ntype = \"x\"\n"),
            "r.toml:3: expected key name in [[device]], got none",
        ),
        (
            format!("{robot}nam = 1\n"),
            "r.toml:3: expected one of name, build, portprefix, reverse-shutdown-action-order in [robot], got nam",
        ),
        (
            format!("{robot}[params]\na = 1979-05-27\n"),
            "r.toml:4: expected a word, a number, a truth value or a list, got a value of type datetime",
        ),
        (
            format!(
                "{robot}[[device]]\nname = \"d\"\ntype = \"t\"\naction = [\n {{ phase = \"start\", level = 1, type = \"park\" }}]\n"
            ),
            "r.toml:7: expected one of startup, run",
        ),
        (
            format!("include = [\"none.toml\"]\n{robot}"),
            "none.toml (included by",
        ),
        (format!("{robot}a = \n"), "r.toml:3: "),
        (
            "[params]\n".to_owned(),
            "r.toml:1: expected a table [robot], got none",
        ),
        (
            format!("include = [\"r.toml\"]\n{robot}"),
            "expected no table [robot] in a file that is included",
        ),
    ] {
        let home = home(&[("r.toml", &text)]);
        let ended = home.run(&format!(
            "robotinterface --dryrun --config {}",
            home.path().join("r.toml").display()
        ));
        ended.with(1).complains(expected);
    }
}

/// Errors from opening and attaching devices end the robot, too, and leave nothing.
#[test]
fn a_robot_that_does_not_start_leaves_nothing() {
    let robot = |device: &str| {
        format!(
            "<robot name=\"r\" portprefix=\"r\">\n<device name=\"arm\" type=\"simulatedWam\"/>\n{device}\n</robot>"
        )
    };
    let server = |inside: &str| {
        robot(&format!(
            "<device name=\"s\" type=\"controlBoard_nws_yarp\">\n<param name=\"name\">/s</param>\n{inside}</device>"
        ))
    };
    let shared = home(&[]);
    let _server = shared.serve();
    for (text, expected) in [
        (
            robot("<device name=\"s\" type=\"controlBoard_nws_yarp\"/>"),
            "r.xml:3: device s: parameter name is missing, expected a port name such as /arm",
        ),
        (
            robot(
                "<device name=\"s\" type=\"controlBoard_nws_yarp\">\n<param name=\"name\">s</param></device>",
            ),
            "r.xml:4: device s: parameter name: expected a port name such as /arm, got s",
        ),
        (
            robot("<device name=\"s\" type=\"nothing\"/>"),
            "r.xml:3: there is no device type nothing: device s cannot be opened",
        ),
        (
            server("<param name=\"name\">/t</param>"),
            "r.xml:5: parameter name is defined already, at",
        ),
        (
            server("<action phase=\"startup\" level=\"1\" type=\"attach\"/>"),
            "r.xml:5: cannot run attach action on device s: expected parameter device, networks or all, got none",
        ),
        (
            server(
                "<action phase=\"startup\" level=\"1\" type=\"attach\"><param name=\"device\">leg</param></action>",
            ),
            "r.xml:5: cannot run attach action on device s: there is no device leg, only arm, s",
        ),
        (
            server(
                "<action phase=\"startup\" level=\"1\" type=\"attach\"><param name=\"device\">s</param></action>",
            ),
            "it cannot attach to s, expected a device with joints",
        ),
        (
            server(
                "<action phase=\"startup\" level=\"1\" type=\"park\"><param name=\"target\">arm</param></action>",
            ),
            "it is no calibrator",
        ),
    ] {
        let file = shared.path().join("r.xml");
        std::fs::write(&file, text).unwrap();
        let ended = shared.run(&format!("robotinterface --config {}", file.display()));
        ended.with(1).complains(expected);
        assert_eq!(shared.names(), Vec::<String>::new());
    }
}

/// Above 64 KiB, a description was cut off for a slow reader, with exit code 0.
#[test]
fn a_slow_reader_gets_a_whole_description() {
    let home = Home::new();
    let devices: String = (0..3000)
        .map(|number| format!("<device name=\"d{number}\" type=\"fakeMotionControl\"/>\n"))
        .collect();
    let file = home.path().join("large.xml");
    let robot =
        format!("<robot name=\"large\" build=\"1\" portprefix=\"/large\">\n{devices}</robot>\n");
    std::fs::write(&file, robot).unwrap();
    for json in ["", "--json"] {
        let mut command = Command::new("sh");
        let yarp = env!("CARGO_BIN_EXE_yarp");
        let file = file.display();
        command.args([
            "-c",
            &format!("{yarp} robotinterface --config {file} --dryrun {json} | (sleep 1; cat)"),
        ]);
        let described = home.spawn(command, "described").finish().with(0);
        let last = described
            .out
            .iter()
            .rev()
            .find(|line| line.contains("d2999"));
        assert!(last.is_some(), "{} lines", described.out.len());
    }
}
