//! `yarp record` writes what a port publishes to a file, and `yarp replay` publishes it again.

#![cfg(unix)]

use crate::common;

use common::Home;

#[test]
fn a_run_is_recorded_and_replayed_into_the_network() {
    let home = Home::new();
    let up = home.start("up").see("Ctrl-C ends it.");
    let file = home.path().join("run.mcap");
    let file = file.display();
    home.run(&format!("record --out {file} /nobody")).with(1);
    let told = home
        .run(&format!("record --out {file} --seconds 1 /wam/state:o"))
        .with(0);
    assert!(told.says(" messages recorded, 0 dropped"), "{told:?}");
    let replay = home
        .start(&format!("replay {file} --prefix /replay --loop"))
        .see("/replay/wam/state:o");
    let reader = home.start("read /reader");
    home.run("wait /reader").with(0);
    home.run("connect /replay/wam/state:o /reader").with(0);
    // The elbow of the folded arm.
    let reader = reader.see("179.3");
    replay.signal("TERM").finish().with(0);
    reader.signal("TERM").finish();
    up.signal("TERM").finish().with(0);
}
