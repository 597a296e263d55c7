//! Applications of stock's `yarpmanager` are read as stock reads them; what it leaves out is reported.

use std::fs;
use std::path::{Path, PathBuf};

use proptest::prelude::*;
use yarp_hosting::application::{Application, ApplicationError};

/// With what stock accepts: names in capitals, an unquoted value, and elements that it leaves out.
const EYES: &str = r#"<application>
<name>my eyes ${n}</name>
<description>two of them</description><version>1.0</version>
<var name="n">seven</var>
<var name="place">$ENV{SOMEWHERE}x</var>
<dependencies><port>/outside</port></dependencies>
<module><name>grabber</name><parameters>--mode "a b" --r ${n}</parameters><node>${place}</node><prefix>/p</prefix>
<workdir>/tmp</workdir><stdio>console</stdio><environment>A=1;B=2</environment><deployer>yarpdev</deployer><rank>3</rank>
<dependencies><port timeout="5.0" request="is_ready" reply="[ok]">/x/rpc</port></dependencies>
<ensure><wait when="start">2</wait><wait when="stop">1.5</wait></ensure>
<portmap><old>/a</old><new>/b</new></portmap></module>
<MODULE><name>second</name><node>localhost</node></MODULE>
<module><parameters>none</parameters></module>
<connection id=c1 persist="TRUE" qos="HIGH"><from external="true">/a:o</from><to qos="LOW">/b:i</to></connection>
<connection><output>/outside</output><input>/d:i</input><protocol>fast_tcp</protocol></connection>
<connection><from>/e</from></connection>
<application><name>inner</name><prefix>/in</prefix></application>
<arbitrator><port>/b:i</port><rule connection="c1">c1 and c2</rule></arbitrator>
<bogus/>
</application>
"#;

fn environment(name: &str) -> Option<String> {
    (name == "SOMEWHERE").then(|| "icub".to_owned())
}

fn read(text: &[u8]) -> Result<Application, ApplicationError> {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("app.xml");
    fs::write(&file, text).unwrap();
    Application::read(&file, &environment)
}

fn some(text: &str) -> Option<String> {
    Some(text.to_owned())
}

#[test]
fn everything_that_stock_reads_is_there() {
    let eyes = read(EYES.as_bytes()).unwrap();
    assert_eq!(eyes.name, "my_eyes_seven");
    assert_eq!(
        (eyes.description, eyes.version),
        (some("two of them"), some("1.0"))
    );
    let [grabber, second] = &eyes.modules[..] else {
        panic!("{:?}", eyes.modules);
    };
    assert_eq!(grabber.name, "grabber");
    assert_eq!(grabber.parameters, some("--mode \"a b\" --r seven"));
    assert_eq!(grabber.node, some("icubx"));
    assert_eq!(
        (grabber.prefix.clone(), grabber.workdir.clone()),
        (some("/p"), some("/tmp"))
    );
    assert_eq!(
        (grabber.stdio.clone(), grabber.rank),
        (some("console"), Some(3))
    );
    assert_eq!(grabber.environment, some("A=1;B=2"));
    assert_eq!(grabber.deployer, some("yarpdev"));
    assert_eq!(grabber.waits, [2.0, 1.5]);
    assert_eq!(grabber.port_names, [("/a".to_owned(), "/b".to_owned())]);
    let port = &grabber.ports[0];
    assert_eq!((&*port.name, port.timeout), ("/x/rpc", Some(5.0)));
    assert_eq!(
        (port.request.clone(), port.reply.clone()),
        (some("is_ready"), some("[ok]"))
    );
    assert_eq!((&*second.name, second.parameters.clone()), ("second", None));
    let [first, other] = &eyes.connections[..] else {
        panic!("{:?}", eyes.connections);
    };
    assert_eq!(
        (&*first.from, &*first.to, &first.carrier),
        ("/a:o", "/b:i", &None)
    );
    assert_eq!(first.external, [true, false]);
    assert_eq!(first.qos, [some("HIGH"), some("LOW")]);
    assert!(first.persistent && first.id == some("c1"));
    // The dependencies name its sender.
    assert_eq!((&*other.from, other.external), ("/outside", [true, false]));
    assert_eq!(
        (other.carrier.clone(), other.persistent),
        (some("fast_tcp"), false)
    );
    assert_eq!(
        (&*eyes.applications[0].name, &eyes.applications[0].prefix),
        ("inner", &some("/in"))
    );
    let rule = ("c1".to_owned(), "c1 and c2".to_owned());
    assert_eq!(
        (&*eyes.arbitrators[0].port, &eyes.arbitrators[0].rules[..]),
        ("/b:i", &[rule][..])
    );
    let problems: Vec<String> = eyes.problems.iter().map(ToString::to_string).collect();
    let [unquoted, module, bogus, connection] = &problems[..] else {
        panic!("{problems:?}");
    };
    assert!(
        unquoted.ends_with("app.xml:14: the value of attribute id is not quoted"),
        "{unquoted}"
    );
    assert!(
        module.ends_with("app.xml:13: a <module> without a <name> is left out"),
        "{module}"
    );
    assert!(
        bogus.ends_with("app.xml:19: <bogus> is not read"),
        "{bogus}"
    );
    assert!(
        connection.contains("app.xml:16: a <connection> without <from> and <to>"),
        "{connection}"
    );
}

/// Such a port belongs to no program, in whichever connection it is.
#[test]
fn an_external_port_is_so_in_later_connections() {
    let text = "<application><name>a</name>\
        <connection><from>/cam</from><to>/before</to></connection>\
        <connection><from external=\"true\">/cam</from><to>/one</to></connection>\
        <connection><from>/CAM</from><to>/two</to></connection></application>";
    let application = read(text.as_bytes()).unwrap();
    let external = application.connections.iter().map(|found| found.external);
    let expected = [[false, false], [true, false], [true, false]];
    assert!(external.eq(expected), "{application:?}");
    assert_eq!(application.ports[0].name, "/cam");
}

#[test]
fn what_is_left_out_is_reported() {
    let problems = |inside: &str| {
        let text = format!("<application><name>a</name>{inside}</application>");
        let problems = read(text.as_bytes()).unwrap().problems;
        problems
            .iter()
            .map(ToString::to_string)
            .collect::<Vec<_>>()
            .join("; ")
    };
    for (inside, expected) in [
        ("<Dependencies/>", "<Dependencies> is not read"),
        ("<prefix>/p</prefix>", "<prefix> is not read"),
        (
            "<module><name>m</name><bogus/></module>",
            "<bogus> in <module> is not read",
        ),
        (
            "<module><name>m</name><ensure><wait when=\"now\">1</wait></ensure></module>",
            "expected start or stop",
        ),
        ("<description>a & b</description>", "expected &amp;"),
        (
            "<connection><from/><to>/a</to></connection>",
            "the name of both ports",
        ),
    ] {
        let found = problems(inside);
        assert!(found.contains(expected), "{inside}: {found}");
    }
    assert_eq!(problems("<authors/><geometry/><var name=\"\">x</var>"), "");
    // No more than a thousand.
    let found = problems(&"<bogus/>".repeat(1001));
    assert_eq!(found.matches("<bogus>").count(), 1000);
}

/// Numbers have the form that C's `atof` reads, and end where it stops.
#[test]
fn numbers_are_read_as_stock_reads_them() {
    let wait = |text: &str| {
        let text = format!(
            "<application><name>a</name><module><name>m</name><ensure><wait>{text}</wait></ensure></module></application>"
        );
        read(text.as_bytes()).unwrap().modules[0].waits[0]
    };
    for (text, expected) in [
        ("2s", 2.0),
        ("-1.5e1x", -15.0),
        ("", 0.0),
        ("x", 0.0),
        ("inf", 0.0),
    ] {
        assert_eq!(wait(text), expected, "{text}");
    }
}

#[test]
fn what_is_no_application_is_refused_with_its_place() {
    let error = |text: &str| read(text.as_bytes()).unwrap_err().to_string();
    assert!(error("\n<robot/>").ends_with("app.xml:2: expected <application>, got <robot>"));
    assert!(error("<application>").contains("app.xml:1: "));
    let missing = Application::read(Path::new("/nowhere/app.xml"), &environment).unwrap_err();
    assert_eq!(missing.to_string(), "cannot read /nowhere/app.xml");
    let folder = Application::read(&PathBuf::from("/"), &environment).unwrap_err();
    assert!(matches!(folder, ApplicationError::Read { .. }), "{folder}");
}

proptest! {
    /// Any bytes, and the file above with some of its bytes replaced, are read or refused.
    #[test]
    fn no_file_is_too_strange(
        bytes in proptest::collection::vec(any::<u8>(), 0..200),
        changes in proptest::collection::vec((0..EYES.len(), any::<u8>()), 0..8),
    ) {
        let _ = read(&bytes);
        let mut changed = EYES.as_bytes().to_vec();
        for (place, byte) in changes {
            changed[place] = byte;
        }
        let _ = read(&changed);
    }
}
