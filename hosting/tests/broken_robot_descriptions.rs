//! Descriptions of robots with errors are refused, without a panic or a hang.

use std::path::Path;

use proptest::prelude::*;
use yarp_hosting::robot::{ReadOptions, Robot, RobotError};

const XML: &str = r#"<robot name="r" build="1" portprefix="/r" xmlns:xi="x">
<params><param name="v">0</param></params><devices>
<device name="a" type="fakeMotionControl"><group name="G"><param name="J" extern-name="j">2</param></group>
<paramlist name="l"><elem name="e">(1 2)</elem></paramlist><subdevice type="s"><param name="q">${portprefix}/x</param></subdevice>
<action phase="startup" level="5" type="attach"><param name="device">a</param></action></device>
<xi:include href="self.xml" enabled_by="t"/></devices></robot>"#;
const TOML: &str = r#"include = [{ file = "self.toml", enabled_by = ["t"] }]
[robot]
name = "r"
build = 1
portprefix = "/r"
[params]
v = 0
[[device]]
name = "a"
type = "fakeMotionControl"
params = { G = { J = 2 }, J = 0, l = ["e", 1.5, true, [1]], q = "${portprefix}/x" }
extern = { J = "j" }
action = [{ phase = "startup", level = 5, type = "attach", params = { device = "a" } }]
"#;

fn read(folder: &Path, name: &str, text: &str, line: &[&str]) -> Result<Robot, RobotError> {
    let file = folder.join(name);
    std::fs::write(&file, text).unwrap();
    let mut options = ReadOptions::default();
    options.given.add_command_line(line);
    Robot::read(&file, &options)
}

#[test]
fn xml_and_toml_are_equivalent() {
    let folder = tempfile::tempdir().unwrap();
    let line = ["--j", "7"];
    let xml = read(folder.path(), "r.xml", XML, &line).unwrap();
    let toml = read(folder.path(), "r.toml", TOML, &line).unwrap();
    let about = |robot: &Robot| {
        let devices = robot.devices.iter();
        let shown = devices.map(|device| {
            let action = &device.actions[0];
            format!(
                "{} {} {} {}",
                device.name, device.kind, action.phase, action.level
            )
        });
        let shown: Vec<_> = shown.collect();
        (
            robot.name.clone(),
            robot.build,
            robot.port_prefix.clone(),
            shown,
        )
    };
    assert_eq!(about(&xml), about(&toml));
    for robot in [xml, toml] {
        let devices = format!("{:?}", robot.devices);
        assert!(
            devices.contains("/r/x"),
            "the prefix is not in place: {devices}"
        );
        assert!(
            devices.contains("Int32(7)"),
            "what is given outside is not in place: {devices}"
        );
    }
}

/// Checks files that include themselves, and elements nested without end.
#[test]
fn recursion_is_bounded() {
    let folder = tempfile::tempdir().unwrap();
    // An included file has no [robot].
    let own = "include = [\"loop.toml\"]\n";
    std::fs::write(folder.path().join("loop.toml"), own).unwrap();
    let toml = format!("{own}[robot]\nname = \"r\"");
    for (name, text) in [("self.xml", XML), ("r.toml", &toml)] {
        let error = read(folder.path(), name, text, &["--enable_tags", "t"]).unwrap_err();
        let too_deep = matches!(error, RobotError::TooDeep { .. });
        assert!(too_deep, "{name}: {error}");
    }
    let deep = |open: &str, close: &str| format!("{}{}", open.repeat(5000), close.repeat(5000));
    let text = format!(
        "<robot name=\"r\">{}</robot>",
        deep("<params>", "</params>")
    );
    assert!(read(folder.path(), "deep.xml", &text, &[]).is_err());
    let text = format!("[robot]\nname = \"r\"\n[params]\na = {}", deep("[", "]"));
    assert!(read(folder.path(), "deep.toml", &text, &[]).is_err());
    let text = format!(
        "<robot name=\"r\"><param name=\"p\">{}</param></robot>",
        deep("(", ")")
    );
    assert!(read(folder.path(), "list.xml", &text, &[]).is_err());
    // Each entity is ten times as long as the one before.
    let mut entities = "<!ENTITY e0 \"ha\">".to_owned();
    for n in 1..12 {
        let inner = format!("&e{};", n - 1).repeat(10);
        entities.push_str(&format!("<!ENTITY e{n} \"{inner}\">"));
    }
    let text = format!("<!DOCTYPE robot [{entities}]><robot name=\"&e11;\"/>");
    assert!(read(folder.path(), "laughs.xml", &text, &[]).is_err());
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200))]

    #[test]
    fn broken_descriptions_are_refused(
        at in 0usize..1000,
        length in 0usize..40,
        put in "[<>/\"= a1{}\\[\\]\n]{0,6}",
    ) {
        let folder = tempfile::tempdir().unwrap();
        for (name, text) in [("r.xml", XML), ("r.toml", TOML)] {
            let from = at % text.len();
            let to = (from + length).min(text.len());
            let broken = format!("{}{put}{}", &text[..from], &text[to..]);
            if let Err(error) = read(folder.path(), name, &broken, &[]) {
                prop_assert!(error.to_string().contains(name), "{}", error);
            }
        }
    }
}
