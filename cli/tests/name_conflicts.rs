//! A name in use is refused, and its owner is reported.

#![cfg(unix)]

use crate::common;

use common::Home;

#[test]
fn a_command_reports_who_owns_the_name() {
    let home = Home::new();
    let _server = home.serve();
    let owner = home.start("read /used").see("active at");
    let process = format!("process {} (", owner.id());
    for line in ["write /used", "clock --name /used", "rpcserver /used"] {
        let refused = home.run(line);
        assert_ne!(refused.code, Some(0), "{line}");
        let lines = [refused.out, refused.err].concat().join("\n");
        assert!(lines.contains("address conflict"), "{line}: {lines}");
        assert!(lines.contains(&process), "{line}: {lines}");
    }
}

#[test]
fn a_device_reports_who_owns_its_name() {
    let home = Home::new();
    let _server = home.serve();
    let owner = home.start("read /wam/rpc:i").see("active at");
    let refused = home.run("dev --device simulatedWam --name /wam").with(1);
    let lines = [refused.out, refused.err].concat().join("\n");
    assert!(lines.contains("/wam/rpc:i already: tcp://"), "{lines}");
    assert!(
        lines.contains(&format!("process {}", owner.id())),
        "{lines}"
    );
}
