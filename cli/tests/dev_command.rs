//! `yarp dev` opens a device by its name and parameters.

#![cfg(unix)]

use crate::common;

use std::io::{BufRead, BufReader, Write};
use std::net::TcpStream;
use std::time::{Duration, Instant};

use common::Home;

/// Longer than any step takes on a busy machine.
const TIMEOUT: Duration = Duration::from_secs(60);

const ACTIVE: &str = "device active in background...";

/// Writes a configuration file and returns its path.
fn write(home: &Home, name: &str, text: &str) -> String {
    let file = home.path().join(name);
    std::fs::write(&file, text).unwrap();
    file.display().to_string()
}

#[test]
fn a_device_is_served_until_a_signal() {
    let home = Home::new();
    let _server = home.serve();
    let line = "dev --device fakeMotionControl --name /arm --GENERAL::Joints 2 --period 0.05";
    let dev = home.start(line).see(ACTIVE);
    let axes = home.run_with("rpc /arm/rpc:i", "[get] [axes]\n").with(0);
    assert!(axes.says("[is] [axes] 2"), "{axes:?}");
    assert!(home.names().contains(&"/arm/quit".to_owned()));
    dev.signal("TERM").finish().with(0);
    assert_eq!(home.names(), Vec::<String>::new());
}

/// The program ends with the service of its device, as stock's `yarpdev` does: the pipe ends when its sink is full.
#[test]
fn the_program_runs_a_service_and_ends_with_it() {
    let home = Home::new();
    let _server = home.serve();
    let folder = home.path().join("images");
    let line = format!(
        "dev --device pipe --source fakeFrameGrabber --sink imageFolderWriter --folder {} --freq 100 --max_images 3 --name /pipe",
        folder.display()
    );
    let ended = home.run(&line).with(1);
    ended.complains("the service of pipe failed: image 4 is refused, expected at most 3 images");
    assert_eq!(std::fs::read_dir(&folder).unwrap().count(), 3);
    assert_eq!(home.names(), Vec::<String>::new());
    let dev = home
        .start("dev --device group --part eye --eye::device fakeMicrophone --name /group")
        .see(ACTIVE);
    dev.signal("TERM").finish().with(0);
}

/// Waits until the name server knows the name, and returns at once then.
fn wait_for_name(server: u16, name: &str) {
    let mut stream = TcpStream::connect(("127.0.0.1", server)).unwrap();
    stream.write_all(b"CONNECT /watcher\n").unwrap();
    let mut lines = BufReader::new(stream.try_clone().unwrap()).lines();
    lines.find(|line| line.as_ref().unwrap().starts_with("Welcome"));
    let begin = Instant::now();
    while begin.elapsed() < TIMEOUT {
        let request = format!("d\nNAME_SERVER query {name}\n");
        stream.write_all(request.as_bytes()).unwrap();
        let mut found = false;
        for line in &mut lines {
            let line = line.unwrap();
            found |= line.starts_with("registration name");
            if line.starts_with("*** end of message") {
                break;
            }
        }
        if found {
            return;
        }
    }
    panic!("{name} is not registered");
}

/// Some ports are open and others are not when the signal arrives.
#[test]
fn a_signal_while_it_starts_leaves_no_names() {
    let home = Home::new();
    let _server = home.serve();
    for _ in 0..5 {
        let dev = home.start("dev --device simulatedWam --name /wam");
        wait_for_name(home.server_port(), "/wam/rpc:i");
        dev.signal("TERM").finish().with(0);
        assert_eq!(home.names(), Vec::<String>::new());
    }
}

#[test]
fn a_device_ends_on_quit() {
    let home = Home::new();
    let _server = home.serve();
    let dev = home
        .start("dev --device simulatedWam --name /wam")
        .see(ACTIVE);
    let answers = home.run_with("rpc /wam/quit", "hello\nquit\n");
    assert!(
        answers.says("[huh?]") && answers.says("[ok]"),
        "{answers:?}"
    );
    dev.finish().with(0);
    assert_eq!(home.names(), Vec::<String>::new());
}

/// The first signal parks the arm, and a second one ends the command without waiting for that.
#[test]
fn a_signal_parks_and_a_second_one_ends_at_once() {
    let home = Home::new();
    let _server = home.serve();
    let line = "dev --device fakeMotionControl --name /arm --LIMITS::Max 1000000";
    let start = || {
        let dev = home.start(line).see(ACTIVE);
        // So slow that parking outlasts every timeout.
        let orders = "[set] [encs] (900000.0)\n";
        let done = home.run_with("rpc /arm/rpc:i", orders).with(0);
        assert!(done.says("[ok]"), "{done:?}");
        dev.signal("TERM").see("parking")
    };
    // `timeout` sends its signal to the child and to the group of the child: names were left behind.
    let dev = start().signal("TERM");
    let asked = home.run_with("rpc /arm/rpc:i", "[get] [axes]\n").with(0);
    assert!(asked.says("[is] [axes]"), "{asked:?}");
    let ended = dev.signal("INT").finish();
    assert_eq!(
        ended.code, None,
        "it was not ended by the second signal: {ended:?}"
    );
}

#[test]
fn stock_files_and_names_work() {
    let home = Home::new();
    let _server = home.serve();
    let part = write(&home, "part.ini", "Joints 5\n");
    let file = write(
        &home,
        "arm.ini",
        &format!(
            "device controlboardwrapper2\nsubdevice fakeMotionControl\nname /a // remark\n[include GENERAL {part}]\n[extra]\nx 1\n"
        ),
    );
    let dev = home
        .start(&format!("dev --from {file} --name /b"))
        .see(ACTIVE);
    let axes = home.run_with("rpc /b/rpc:i", "[get] [axes]\n").with(0);
    assert!(axes.says("[is] [axes] 5"), "{axes:?}");
    let ended = dev.signal("TERM").finish().with(0);
    ended.complains("arm.ini:5: device controlboardwrapper2 ignores parameter extra");
    let line = "dev --device deviceBundler --wrapper_device controlBoard_nws_yarp --attached_device simulatedWam --name /c";
    let dev = home.start(line).see(ACTIVE);
    let remote = home
        .start("dev --device remote_controlboard --remote /c --local /me")
        .see(ACTIVE);
    remote.signal("TERM").finish().with(0);
    dev.signal("TERM").finish().with(0);
    assert_eq!(home.names(), Vec::<String>::new());
}

#[test]
fn errors_name_file_and_line() {
    let home = Home::new();
    let _server = home.serve();
    let fails = |text: &str, expected: &str| {
        let file = write(&home, "arm.ini", text);
        let ended = home.run(&format!("dev --from {file}")).with(1);
        ended.complains(&format!("{file}:{expected}"));
        assert_eq!(home.names(), Vec::<String>::new());
    };
    fails(
        "\ndevice fakeMotionControl\n",
        "2: device fakeMotionControl: parameter name is missing, expected a port name such as /arm",
    );
    fails(
        "device simulatedWam\nname arm\n",
        "2: device simulatedWam: parameter name: expected a port name such as /arm, got arm",
    );
    fails(
        "device simulatedWam\nname /arm\nperiod 0",
        "3: device simulatedWam: parameter period: expected a time in seconds, more than 0, got 0",
    );
    fails(
        "device simulatedWam\nname /arm\nperiod 100",
        "3: device simulatedWam: parameter period: expected 0.001 to 60 seconds, got 100",
    );
    fails(
        "name /arm\n[GENERAL]\nJoints x\n[]\ndevice fakeMotionControl\n",
        "3: device fakeMotionControl: parameter GENERAL::Joints: expected a whole number from 0, got x",
    );
    fails(
        "device simulatedwam\nname /arm\n",
        "1: device simulatedwam: there is no device simulatedwam, but there is simulatedWam",
    );
    fails(
        "device deviceBundler\nwrapper_device x\n",
        "1: device deviceBundler: parameter attached_device is missing, expected a word",
    );
    let ended = home
        .run("dev --device fakeMotionControl --name arm")
        .with(1);
    ended.complains("command line: device fakeMotionControl: parameter name: expected a port name");
    let ended = home
        .run("dev --device remote_controlboard --remote /nobody --local /me")
        .with(1);
    ended.complains("there is no port /nobody/");
    let ended = home.run("dev --from nowhere.ini").with(1);
    ended.complains("cannot find nowhere.ini in any of");
}

#[cfg(target_os = "linux")]
#[test]
fn a_camera_that_is_not_there_is_named() {
    let home = Home::new();
    let _server = home.serve();
    let list = home.run("dev --list").with(0);
    assert!(list.says("Device \"usbCamera\""), "{list:?}");
    for (device, reason) in [
        (
            "/dev/video-not-there",
            "finding the camera with /dev/video-not-there failed",
        ),
        ("/dev/null", "opening the camera with /dev/null failed"),
    ] {
        let line = format!("dev --device usbCamera --d {device} --name /eye");
        home.run(&line).with(1).complains(reason);
    }
    let ended = home.run("dev --device usbCamera --name /eye").with(1);
    ended.complains("parameter d is missing");
}

#[test]
fn help_needs_no_network() {
    let home = Home::new();
    let list = home.run("dev --list").with(0);
    for kind in [
        "fakeMotionControl",
        "controlboardremapper",
        "remotecontrolboardremapper",
        "fakeFrameGrabber",
        "frameGrabber_nws_yarp",
        "frameGrabber_nwc_yarp",
        "barrettHand",
        "embeddedWam",
        "canWam",
        "deviceBundler",
    ] {
        assert!(list.says(&format!("Device \"{kind}\"")), "{list:?}");
    }
    assert!(
        list.says("wrapped by \"controlBoard_nws_yarp\""),
        "{list:?}"
    );
    assert!(home.run("dev").with(0).says("--device DEVICENAME"));
    let ended = home.run("dev --device simulatedWam --name /wam").with(255);
    ended.complains("YARP network not available");
}

#[test]
fn the_page_of_stock_plugins_agrees_with_the_list() {
    let list = Home::new().run("dev --list").with(0);
    let page = include_str!("../../docs/stock-plugins.md");
    let devices = page.split("\n## ").find(|part| part.starts_with("Devices"));
    let mut supported = 0;
    for row in devices
        .unwrap()
        .lines()
        .filter(|line| line.starts_with("| `"))
    {
        let mut cells = row.split('|').map(str::trim).skip(1);
        let (name, state) = (
            cells.next().unwrap().trim_matches('`'),
            cells.next().unwrap(),
        );
        let line = list.out.iter().find(|line| {
            line.contains(&format!("Device \"{name}\","))
                || line.contains(&format!("also called {name}"))
        });
        assert_eq!(line.is_some(), state == "supported", "{name} is {state}");
        supported += usize::from(state == "supported");
    }
    assert!(supported > 10, "{supported}");
}

#[test]
fn a_device_is_described_without_a_network() {
    let home = Home::new();
    let file = write(
        &home,
        "arm.ini",
        "device fakeMotionControl\nname /arm\n[GENERAL]\nJoints 2\n",
    );
    let described = home
        .run(&format!("dev --from {file} --period 0.05 --dryrun"))
        .with(0);
    let expected = "device fakeMotionControl of type controlBoard_nws_yarp, fakeMotionControl";
    assert_eq!(described.out[0], expected);
    assert!(described.says("param GENERAL (Joints 2)") && described.says("param period 0.05"));
    let described = home
        .run(&format!("dev --from {file} --dryrun --json"))
        .with(0);
    let device: serde_json::Value = serde_json::from_str(&described.out.join("\n")).unwrap();
    assert_eq!(device["types"][1], "fakeMotionControl");
    assert_eq!(device["params"]["name"], serde_json::json!(["/arm"]));
    let described = home
        .run("dev --device deviceBundler --wrapper_device grabber --attached_device fakeFrameGrabber --dryrun")
        .with(0);
    assert!(described.says("of type grabber, fakeFrameGrabber"));
    for (words, expected) in [
        (
            "--device fakeMotioncontrol",
            "but there is fakeMotionControl",
        ),
        (
            "--device grabber --subdevice nothing",
            "there is no device nothing",
        ),
        ("--device deviceBundler", "wrapper_device is missing"),
    ] {
        home.run(&format!("dev {words} --dryrun"))
            .with(1)
            .complains(expected);
    }
}
