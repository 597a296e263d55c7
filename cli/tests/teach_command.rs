//! `yarp teach` stores the pose of an arm as text, and `yarp play` brings the arm back to it.

#![cfg(unix)]

use crate::common;

use common::Home;

#[test]
fn a_pose_is_stored_and_played() {
    let home = Home::new();
    let up = home.start("up").see("Ctrl-C ends it.");
    let file = home.path().join("motion.txt");
    let file = file.display();
    let lines = "start\nwait 0.1\nno name\ngrasp hold\nquit\n";
    let told = home
        .run_with(&format!("teach {file} --guide"), lines)
        .with(0);
    assert!(told.says("not stored: expected NAME"), "{told:?}");
    assert!(told.says("there is no hand"), "{told:?}");
    assert!(told.says("The arm holds its place."), "{told:?}");
    let modes = home
        .run_with("rpc /wam/rpc:i", "[get] [icmd] [cmod] 0\n")
        .with(0);
    assert!(modes.says("[pos]"), "{modes:?}");
    let text = std::fs::read_to_string(file.to_string()).unwrap();
    let taught: Vec<&str> = text.lines().collect();
    assert_eq!(taught.len(), 2, "{text}");
    assert!(
        taught[0].starts_with("pose start ") && taught[1] == "wait 0.1",
        "{text}"
    );
    assert_eq!(taught[0].split(' ').count(), 9, "{text}");
    // The file is text: another pose, a little away.
    let mut words: Vec<String> = taught[0].split(' ').map(str::to_owned).collect();
    words[2] = "5.5".to_owned();
    std::fs::write(file.to_string(), format!("{text}{}\n", words.join(" "))).unwrap();
    let told = home.run(&format!("play {file} --speed 1")).with(0);
    assert!(told.says("wait 0.1"), "{told:?}");
    let at = home.run_with("rpc /wam/rpc:i", "[get] [enc] 0\n").with(0);
    assert!(at.says("5.5"), "{at:?}");
    // Beyond the limits: refused before anything moves, with the line.
    words[2] = "500.0".to_owned();
    std::fs::write(file.to_string(), format!("{text}{}\n", words.join(" "))).unwrap();
    let refused = home.run(&format!("play {file}")).with(1);
    refused.complains("line 3: axis 0 at 500");
    home.run(&format!("play {file} --speed 1.5")).with(1);
    up.signal("TERM").finish().with(0);
}
