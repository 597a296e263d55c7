//! `yarp manager` prints what an application lists, and says what it leaves out.

use crate::common::Home;

const TWO: &str = r#"<application><name>two</name>
<module><name>yarpview</name><parameters>--name /view</parameters><node>localhost</node></module>
<connection><from>/cam</from><to>/view</to><protocol>udp</protocol></connection>
<connection><from>/cam</from></connection>
</application>"#;

/// Returns a folder with the file, and its path.
fn home() -> (Home, String) {
    let home = Home::new();
    let file = home.path().join("two.xml");
    std::fs::write(&file, TWO).unwrap();
    (home, file.display().to_string())
}

#[test]
fn programs_and_connections_are_printed() {
    let (home, file) = home();
    let printed = home.run(&format!("manager --dryrun {file}")).with(0);
    let expected = [
        "application two",
        "module yarpview on localhost, parameters --name /view",
        "connection /cam to /view, carrier udp",
    ];
    assert_eq!(printed.out, expected);
    let left_out = "two.xml:4: a <connection> without <from> and <to> is left out";
    printed.complains(left_out);
    // As stock's console is given it.
    let json = home
        .run(&format!("manager --dryrun --json --application {file}"))
        .with(0);
    let json: serde_json::Value = serde_json::from_str(&json.out.join("\n")).unwrap();
    assert_eq!(json["connections"][0]["carrier"], "udp");
    assert_eq!(json["modules"][0]["parameters"], "--name /view");
    home.run(&format!("manager --dryrun --strict {file}"))
        .with(1);
}

#[test]
fn nothing_is_started() {
    let (home, file) = home();
    let refused = home.run(&format!("manager {file}")).with(1);
    assert!(refused.says("--dryrun"), "{refused:?}");
    let missing = home.run("manager --dryrun nowhere.xml").with(1);
    missing.complains("cannot read nowhere.xml");
}
