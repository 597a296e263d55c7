//! `yarp conf` and `yarp namespace` write the files that stock reads.

use crate::common;

use common::Home;

#[test]
fn conf_shows_writes_and_clears() {
    let home = Home::new();
    let file = home.path().join("yarp.conf").display().to_string();
    assert_eq!(home.run("conf").with(0).out, std::slice::from_ref(&file));
    assert_eq!(home.file("yarp.conf"), None);
    let written = home.run("conf 1.2.3.4 99").with(0).out;
    assert_eq!(
        written,
        [
            "Configuration file:",
            &format!("  {file}"),
            "Now stores:",
            "  host 1.2.3.4 port number 99 (yarp name server)"
        ]
    );
    assert_eq!(home.file("yarp.conf").unwrap(), "1.2.3.4 99 yarp\n");
    let again = home.run("conf 5.6.7.8 100 local").with(0);
    assert!(again.says("host 1.2.3.4 port number 99 (yarp name server)"));
    assert_eq!(home.file("yarp.conf").unwrap(), "5.6.7.8 100 local\n");
    home.run("conf --clean").with(0);
    assert_eq!(home.file("yarp.conf").unwrap(), "");
}

#[test]
fn an_invalid_port_number_is_refused() {
    let home = Home::new();
    for line in ["conf host port", "conf host 0", "conf host 70000"] {
        home.run(line).with(1);
    }
    assert_eq!(home.file("yarp.conf"), None);
}

#[test]
fn conf_replaces_an_unreadable_file() {
    let home = Home::new();
    std::fs::write(home.path().join("yarp.conf"), "garbage\n").unwrap();
    let refused = home.run("where").with(1);
    assert_eq!(refused.err.len(), 1, "{refused:?}");
    home.run("conf 1.2.3.4 99").with(0);
    assert_eq!(home.file("yarp.conf").unwrap(), "1.2.3.4 99 yarp\n");
}

#[test]
fn each_namespace_has_its_own_file() {
    let home = Home::new();
    assert_eq!(home.run("namespace").with(0).out, ["YARP namespace: /root"]);
    assert!(
        home.run("namespace /foo")
            .with(0)
            .says("YARP namespace: /foo")
    );
    assert_eq!(home.file("yarp_namespace.conf").unwrap(), "\"/foo\"");
    home.run("conf 9.9.9.9 10").with(0);
    assert_eq!(home.file("_foo.conf").unwrap(), "9.9.9.9 10 yarp\n");
    let two = home.run("namespace /a /b").with(0);
    assert!(two.says("YARP namespaces: \"/a\" \"/b\""));
}
