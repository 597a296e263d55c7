//! Descriptions of robots are read as TinyXML reads them, and files that are none are refused in time.

use std::path::Path;

use proptest::prelude::*;
use yarp_hosting::robot::{ParamValue, Phase, ReadOptions, Robot, RobotError};

fn read_with(folder: &Path, files: &[(&str, &str)], line: &[&str]) -> Result<Robot, RobotError> {
    for (name, text) in files {
        let file = folder.join(name);
        std::fs::create_dir_all(file.parent().unwrap()).unwrap();
        std::fs::write(file, text).unwrap();
    }
    let mut options = ReadOptions::default();
    options.given.add_command_line(line);
    Robot::read(&folder.join(files[0].0), &options)
}

/// Returns the devices of a robot with their parameters, as `name type; param value; ...`.
fn devices(robot: &Robot) -> Vec<String> {
    let devices = robot.devices.iter().map(|device| {
        let params = device.params.iter().map(|param| match &param.value {
            ParamValue::Values(values) => {
                let values: Vec<_> = values.iter().map(|value| value.to_plain_string()).collect();
                format!("; {} {}", param.name, values.join(" "))
            }
            ParamValue::Group(inner) => format!("; {} ({})", param.name, inner.len()),
        });
        let params: String = params.collect();
        format!("{} {}{params}", device.name, device.kind)
    });
    devices.collect()
}

#[track_caller]
fn check(files: &[(&str, &str)], expected: &[&str]) {
    let folder = tempfile::tempdir().unwrap();
    let robot = read_with(folder.path(), files, &[]).unwrap();
    assert_eq!(devices(&robot), expected);
}

#[track_caller]
fn check_refused(files: &[(&str, &str)], expected: &[&str]) {
    let folder = tempfile::tempdir().unwrap();
    let error = read_with(folder.path(), files, &[])
        .unwrap_err()
        .to_string();
    for part in expected {
        assert!(error.contains(part), "no {part}: {error}");
    }
}

#[test]
fn names_have_no_namespaces() {
    let root = "<robot name=\"r\" xlmns:xi=\"typo\"><devices><xi:include href=\"./a.xml\"/></devices></robot>";
    let device = "<device xi:id=\"1\" name=\"a\" type=\"t\"/>";
    check(&[("r.xml", root), ("a.xml", device)], &["a t"]);
}

#[test]
fn attribute_values_need_no_quotes() {
    let text = "<robot name=r build=0 portprefix='/r'><device name=a type=t><param name=p >1</param>\
                <param name='<q>'>2</param></device><device name=b type=u/></robot>";
    check(&[("r.xml", text)], &["a t; p 1; <q> 2", "b u"]);
}

#[test]
fn declarations_may_be_anywhere() {
    let root = "<!-- c -->\n<?xml version=\"1.0\"?>\n<?xml version=\"1.0\"?><robot name=\"r\">\
                <?xml version=\"1.0\" ?><xi:include href=\"a.xml\"/></robot>";
    let device = "\u{feff}\n<!-- of a\n--><?xml version=\"1.0\" encoding=\"UTF-8\" ?><!DOCTYPE x><device name=\"a\" type=\"t\"/>";
    check(&[("r.xml", root), ("a.xml", device)], &["a t"]);
}

#[test]
fn a_comment_ends_at_the_first_end() {
    let text =
        "<robot name=\"r\"><!-- a -- b <!-- c --><device name=\"a\" type=\"t\"/><!------></robot>";
    check(&[("r.xml", text)], &["a t"]);
}

#[test]
fn content_after_the_root_is_passed_over() {
    let device = "<robot name=\"r\"><device name=\"a\" type=\"t\"/></robot>";
    for after in [
        "</robot>",
        "\n</robot>\n<robot name=\"s\"/>",
        "text <",
        "<!-- c -->",
    ] {
        check(&[("r.xml", &format!("{device}{after}"))], &["a t"]);
    }
    let text = format!("{device}\n<robot>");
    check_refused(
        &[("r.xml", &text)],
        &["r.xml:2: <robot> of line 2 is not closed"],
    );
}

#[test]
fn white_space_is_condensed() {
    let text = "<robot name=\"r\"><device name=\"a\" type=\"t\">\r\n<param name=\"debug  \">\n 1\n\t 2 </param>\
                <param name=\"q\"> \"   l   elbow\" </param></device></robot>";
    check(&[("r.xml", text)], &["a t; debug 1 2; q  l elbow"]);
}

#[test]
fn entities_are_those_of_stock() {
    let text = "<robot name=\"r\"><device name=\"a&lt;&#66;&#x43;\" type=\"t\"><param name=\"p\">x&y&amp;z</param></device></robot>";
    check(&[("r.xml", text)], &["a<BC t; p xy&z"]);
}

#[test]
fn latin_1_is_read() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("r.xml");
    std::fs::write(&file, b"<robot name=\"r\xe9\"><!-- 90\xb0 --></robot>").unwrap();
    let robot = Robot::read(&file, &ReadOptions::default()).unwrap();
    assert_eq!(robot.name, "r\u{e9}");
}

/// Parameters beside devices are given to each of them; its own count.
#[test]
fn parameters_may_be_beside_devices() {
    let text = "<robot name=\"r\"><devices><params><xi:include href=\"p.xml\"/></params>\
                <device name=\"a\" type=\"t\"/><device name=\"b\" type=\"t\"><param name=\"p\">2</param></device></devices>\
                <device name=\"c\" type=\"t\"/></robot>";
    let params = "<params><param name=\"p\">1</param></params>";
    check(
        &[("r.xml", text), ("p.xml", params)],
        &["a t; p 1", "b t; p 2", "c t"],
    );
}

/// They were given to all devices, which in stock get none of them.
#[test]
fn no_device_gets_parameters_of_the_robot() {
    let text = "<robot name=\"r\" portprefix=\"\"><params><param name=\"p\">1</param></params>\
                <device name=\"a\" type=\"t\"/></robot>";
    let folder = tempfile::tempdir().unwrap();
    let robot = read_with(folder.path(), &[("r.xml", text)], &[]).unwrap();
    let parameters = robot.parameters(&robot.devices[0]).unwrap();
    let settings = parameters.settings().to_bottle().to_string();
    // An empty prefix is no value.
    assert_eq!(settings, "(device t) (id a) (robotName)");
}

#[test]
fn a_reference_is_relative_to_the_including_file() {
    let root = "<robot name=\"r\"><xi:include href=\".\\sub\\a.xml\"/></robot>";
    let middle = "<devices><xi:include href=\"/b.xml\"/></devices>";
    let device = "<device name=\"b\" type=\"t\"/>";
    check(
        &[
            ("r.xml", root),
            ("sub/a.xml", middle),
            ("sub/b.xml", device),
        ],
        &["b t"],
    );
}

#[test]
fn the_format_without_a_document_type_is_stocks() {
    let folder = tempfile::tempdir().unwrap();
    let root = "<!-- http://www.yarp.it/DTD/yarprobotinterfaceV2.0.dtd --><robot name=\"r\"><devices file=\"a.xml\"/></robot>";
    let files = [
        ("r.xml", root),
        (
            "a.xml",
            "<devices><device name=\"a\" type=\"t\"/></devices>",
        ),
    ];
    let robot = read_with(folder.path(), &files, &["--allow-deprecated-dtd"]).unwrap();
    assert_eq!(devices(&robot), ["a t"]);
    let error = read_with(folder.path(), &files, &[]).unwrap_err();
    assert!(
        error.to_string().contains("expected <xi:include"),
        "{error}"
    );
}

#[test]
fn errors_name_file_line_and_including_file() {
    let root = "<robot name=\"r\">\n<xi:include href=\"a.xml\"/></robot>";
    for (text, expected) in [
        (
            "<device\n name=\"a\" type>",
            "a.xml:2: expected = and a value after type in <device>, got \">\"",
        ),
        (
            "<device name=\"a\n",
            "a.xml:1: \" is not closed in <device>",
        ),
        (
            "<device>\n</devices>",
            "a.xml:2: expected </device> (opened in line 1)",
        ),
        ("<device>\n<!-- ", "a.xml:2: a comment is not closed"),
        (
            "<device name=a name=b/>",
            "a.xml:1: attribute name occurs twice",
        ),
        ("\n", "a.xml:2: there is no element"),
        ("<a>&#xd800;</a>", "a.xml:1: expected a number and ;"),
        ("<a>&#0;</a>", "a.xml:1: expected a number and ;"),
        ("<a>\n<![CDATA[ ]]</a>", "a.xml:2: <![CDATA[ is not closed"),
        ("<a b=c\"d\"/>", "a.xml:1: expected a quote at both ends"),
    ] {
        check_refused(
            &[("r.xml", root), ("a.xml", text)],
            &[expected, "(included by", "r.xml:2)"],
        );
    }
}

#[test]
fn large_descriptions_are_refused() {
    let nested = |depth: usize| {
        let (open, close) = ("<devices>".repeat(depth), "</devices>".repeat(depth));
        format!("<robot name=\"r\">{open}{close}</robot>")
    };
    check(&[("r.xml", &nested(99))], &[]);
    check_refused(&[("r.xml", &nested(100))], &["more than 100 levels"]);
    let many: String = (0..1001).map(|n| format!("a{n}=1 ")).collect();
    check_refused(
        &[("r.xml", &format!("<robot {many}/>"))],
        &["more than 1000 attributes"],
    );
    let many = format!(
        "<robot name=\"r\">{}</robot>",
        "<devices/>".repeat(1_000_000)
    );
    check_refused(&[("r.xml", &many)], &["too many elements"]);
}

/// The limit is for all files, not for each.
#[test]
fn the_size_of_all_files_is_limited() {
    let folder = tempfile::tempdir().unwrap();
    let half = std::fs::File::create(folder.path().join("a.xml")).unwrap();
    half.set_len(17 << 20).unwrap();
    let include = "<xi:include href=\"a.xml\"/>";
    let root = |times: usize| format!("<robot name=\"r\">{}</robot>", include.repeat(times));
    std::fs::write(folder.path().join("b.xml"), "<params/>").unwrap();
    // A file of zeros is an empty text.
    let error = read_with(folder.path(), &[("r.xml", &root(1))], &[]).unwrap_err();
    assert!(error.to_string().contains("there is no element"), "{error}");
    let mut text = b"<params/>".to_vec();
    text.resize(17 << 20, b' ');
    std::fs::write(folder.path().join("a.xml"), text).unwrap();
    read_with(folder.path(), &[("r.xml", &root(1))], &[]).unwrap();
    let error = read_with(folder.path(), &[("r.xml", &root(2))], &[]).unwrap_err();
    assert!(matches!(error, RobotError::Read { .. }), "{error}");
}

#[cfg(unix)]
#[test]
fn only_regular_files_are_read() {
    let folder = tempfile::tempdir().unwrap();
    let fifo = folder.path().join("fifo.xml");
    let made = std::process::Command::new("mkfifo").arg(&fifo).status();
    assert!(made.unwrap().success());
    for other in ["fifo.xml", "/dev/zero", "."] {
        let root = format!("<robot name=\"r\">\n<xi:include href=\"{other}\"/></robot>");
        let error = read_with(folder.path(), &[("r.xml", &root)], &[]).unwrap_err();
        assert!(matches!(error, RobotError::Read { .. }), "{error}");
        assert!(error.to_string().contains("r.xml:2"), "{error}");
    }
}

#[test]
fn the_prefix_is_as_written() {
    for (attribute, expected) in [
        ("portprefix=\"teoSim\"", "teoSim teoSim r"),
        ("portprefix=\"/teoSim\"", "/teoSim teoSim r"),
        ("", "r r r"),
    ] {
        let text = format!(
            "<robot name=\"r\" {attribute}><device name=\"a\" type=\"t\"><param name=\"p\">${{portprefix}} ${{portprefixnoslash}} ${{robotname}}</param></device></robot>"
        );
        check(&[("r.xml", &text)], &[&format!("a t; p {expected}")]);
    }
}

/// Files with such values were refused; stock warns and loses the parameter.
#[test]
fn values_without_balance_are_lost_as_in_stock() {
    for value in ["1 2 )", "1 (2 3)) 4", "(1 2", "(a \"b c)"] {
        let text = format!(
            "<robot name=\"r\"><device name=\"a\" type=\"t\"><param name=\"p\">{value}</param><param name=\"q\">7</param></device></robot>"
        );
        check(&[("r.xml", &text)], &["a t; q 7"]);
    }
    let text = "<robot name=\"r\"><device name=\"a\" type=\"t\"><group name=\"g\"><param name=\"p\">(1</param></group></device></robot>";
    check(&[("r.xml", text)], &["a t; g (0)"]);
}

/// Stock reads an action of an unknown phase and never runs it; such files were refused.
#[test]
fn an_action_of_an_unknown_phase_never_runs() {
    let folder = tempfile::tempdir().unwrap();
    let text = "<robot name=\"r\"><device name=\"a\" type=\"t\"><action phase=\"start up\" level=\"1\" type=\"attach\"/>
        <action phase=\"shutdown\" level=\"1\" type=\"detach\"/></device></robot>";
    let robot = read_with(folder.path(), &[("r.xml", text)], &[]).unwrap();
    let phases: Vec<_> = robot.devices[0]
        .actions
        .iter()
        .map(|action| action.phase)
        .collect();
    assert_eq!(phases, [Phase::Shutdown]);
}

#[test]
fn devices_of_one_name_are_all_there() {
    let text =
        "<robot name=\"r\"><device name=\"a\" type=\"t\"/><device name=\"a\" type=\"u\"/></robot>";
    check(&[("r.xml", text)], &["a t", "a u"]);
}

/// Problems are found without opening a device: each type once, and actions without a device.
#[test]
fn problems_name_file_and_line() {
    let folder = tempfile::tempdir().unwrap();
    let text = r#"<robot name="r" portprefix="/r">
<device name="a" type="fakeMotionControl"/>
<device name="b" type="embObj"><action phase="startup" level="1" type="attach">
  <param name="device">a</param></action></device>
<device name="c" type="embObj"><param name="subdevice">other</param>
<action phase="startup" level="1" type="attach"><paramlist name="networks"><elem name="x">a</elem><elem name="y">d</elem></paramlist></action>
<action phase="startup" level="2" type="calibrate"><param name="target">e</param></action>
<action phase="startup" level="3" type="park"/>
<action phase="startup" level="4" type="attach"><param name="all"> 1 </param></action>
<action phase="startup" level="5" type="custom"/></device>
</robot>"#;
    let robot = read_with(folder.path(), &[("r.xml", text)], &[]).unwrap();
    let found: Vec<_> = robot.problems().iter().map(ToString::to_string).collect();
    let expected = [
        "r.xml:3: there is no device type embObj: device b cannot be opened, nor 1 others of this type",
        "r.xml:5: there is no device type other: device c cannot be opened",
        "r.xml:6: attach action of device c: there is no device d",
        "r.xml:7: calibrate action of device c: there is no device e",
        "r.xml:8: park action of device c: parameter target is missing",
    ];
    assert_eq!(found.len(), expected.len(), "{found:?}");
    for (found, expected) in found.iter().zip(expected) {
        assert!(found.contains(expected), "no {expected}: {found}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(300))]

    #[test]
    fn any_bytes_are_read_or_refused(bytes in prop::collection::vec(any::<u8>(), 0..200), soup in prop::collection::vec(
        prop::sample::select(vec!["<", ">", "/", "</", "<!--", "-->", "<![CDATA[", "]]>", "<?xml", "?>", "=", "\"", "'", "a", "robot", " ", "\n",
            "&#", ";", "x41", "&amp;", "&", "é", "<a>", "</a>", "\u{feff}", "\0", "<robot name=\"r\">", "</robot>"]), 0..40)) {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("r.xml");
        let soup = soup.concat();
        for text in [&bytes[..], soup.as_bytes()] {
            std::fs::write(&file, text).unwrap();
            if let Err(error) = Robot::read(&file, &ReadOptions::default()) {
                prop_assert!(error.to_string().contains("r.xml"), "{}", error);
            }
        }
    }
}
