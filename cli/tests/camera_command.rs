//! `yarp camera` serves a camera, or prints one line with the reason.

#![cfg(unix)]

use crate::common;

use common::Home;

#[test]
fn it_serves_images_and_commands_until_a_signal() {
    let home = Home::new();
    let _server = home.serve();
    let camera = home
        .start("camera --name /eye --mode grid --width 32 --height 24")
        .see("Ctrl-C ends it.");
    let said = home.run_with("rpc /eye/rpc", "[fgi] [get] [w]\n").with(0);
    assert!(said.says("[fgi] [w] [is] 32"), "{said:?}");
    let said = home.run_with("rpc /eye/rpc", "getHeightRPC\n").with(0);
    assert!(said.says("([ok]) 24"), "{said:?}");
    let image = home.run("read ... /eye once").with(0);
    assert!(
        image.says("[mat] [rgb] (3 2304 8 32 24) {0 0 "),
        "{image:?}"
    );
    let second = home.run("camera --name /eye").with(1);
    assert!(
        second.err.iter().any(|line| line.contains("/eye/rpc")),
        "{second:?}"
    );
    camera.signal("TERM").finish().with(0);
    assert!(home.names().is_empty());
}

#[test]
fn it_simulates_ieee_1394_on_request() {
    let home = Home::new();
    let _server = home.serve();
    for (options, modes) in [
        ("", "\"command not recognized\""),
        (" --firewire", "16777235"),
    ] {
        let camera = home
            .start(&format!("camera --name /eye{options}"))
            .see("Ctrl-C ends it.");
        let said = home.run_with("rpc /eye/rpc", "[fgfw] [DR2m]\n").with(0);
        assert!(said.says(modes), "{said:?}");
        camera.signal("TERM").finish().with(0);
    }
}

#[test]
fn invalid_camera_options_are_refused() {
    let home = Home::new();
    let refused = home.run("camera --mode circus").with(1);
    assert!(
        refused.says("expected one of line, ball, grid, rand, none"),
        "{refused:?}"
    );
    let refused = home.run("camera --src /no/such/picture.png").with(1);
    let told = refused
        .err
        .iter()
        .any(|line| line.contains("cannot read a picture from /no/such/picture.png"));
    assert!(told, "{refused:?}");
    home.run("camera --name eye").with(1);
    home.run("camera --width 0").with(1);
}
