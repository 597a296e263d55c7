//! Arms, a hand and cameras of the table of device types, each with the peer that it needs.

mod support;

use support::Stage;
use yarp_devices::embedded::{LinkMode, NodeOptions, WamNode};
use yarp_devices::hand::simulated::{SimulatedHand, SimulatedHandOptions};
use yarp_devices::wam::SimulatedWam;
use yarp_devices::{Axes, DeviceError};
use yarp_ports::{Answer, Port, PortOptions, Received};
use yarp_testing::eventually;
use yarp_wire::float_vector::Vector;
use yarp_wire::{Bottle, Vocab32};

/// Checks a camera that one program serves and another one reads.
#[test]
fn a_camera_is_served_to_a_client() {
    let stage = Stage::new();
    let text = "attached_device fakeFrameGrabber\nwrapper_device frameGrabber_nws_yarp\nname /eye\nmode grid\nwidth 48\nheight 32\nperiod 0.01\nfirewire true\nfocalLengthX 5.5\n";
    let served = stage.open("deviceBundler", text).expect("it opens");
    let text = "remote /eye\nlocal /me/eye\n";
    let seen = stage
        .open("frameGrabber_nwc_yarp", text)
        .expect("it is there");
    let camera = seen.parts().camera.expect("it has images");
    let images = camera.frame_grabber_image().expect("in colour");
    eventually("an image", || {
        images
            .image()
            .is_ok_and(|image| (image.image.width(), image.image.height()) == (48, 32))
    });
    let lens = camera.rgb_visual_params().expect("it tells its lens");
    assert_eq!(lens.intrinsics().unwrap().focal_length.0, 5.5);
    let firewire = camera.firewire_controls().expect("it can be asked");
    assert_eq!(firewire.video_mode().unwrap(), 24);
    drop(camera);
    stage.runtime.block_on(seen.close());
    stage.runtime.block_on(served.close());
}

#[test]
fn an_arm_behind_its_pc_is_a_device() {
    let stage = Stage::new();
    let arm = std::sync::Arc::new(SimulatedWam::new());
    let node =
        WamNode::start(arm, NodeOptions::new(LinkMode::listen_on_loopback())).expect("it listens");
    let places = node.addresses();
    let (ports, host) = ((places.arm.port(), places.packets.port()), places.arm.ip());
    let text = format!("connect {host}\nports ({} {})\n", ports.0, ports.1);
    let hosted = stage.open("embeddedWam", &text).expect("it opens");
    let board = hosted.parts().board.expect("it has joints");
    eventually("a reading", || {
        board
            .encoders()
            .unwrap()
            .encoder_readings(Axes::All)
            .is_ok_and(|all| all.len() == 7)
    });
    assert!(hosted.machine().is_some());
    drop(board);
    stage.runtime.block_on(hosted.close());
}

#[test]
fn arms_have_four_joints_where_that_is_said() {
    let stage = Stage::new();
    let arm = SimulatedWam::with_axes(yarp_devices::wam::parameters_of::<4>());
    let node = NodeOptions::new(LinkMode::listen_on_loopback());
    let node = WamNode::start(std::sync::Arc::new(arm), node).expect("it listens");
    let places = node.addresses();
    let (ports, host) = ((places.arm.port(), places.packets.port()), places.arm.ip());
    let behind = format!("connect {host}\nports ({} {})\n", ports.0, ports.1);
    let lists = "jointMin (-30 -114.6 -30 -40)\nmaxTorques (10 10 5 5)\ngravityMoments (0 0 0 0 0 1 0 0 0 0 0 0)\n";
    for (kind, text) in [
        ("simulatedWam", lists),
        ("dynamicWam", lists),
        (
            "simulatedCanWam",
            &format!("{lists}homeConfirmed\ncoggingTorques (0 0 0 0)"),
        ),
        ("embeddedWam", &behind),
    ] {
        let hosted = stage
            .open(kind, &format!("joints 4\n{text}"))
            .unwrap_or_else(|error| panic!("{kind}: {error}"));
        let board = hosted.parts().board.expect("it has joints");
        assert_eq!(board.axis_info().unwrap().axes(), 4, "{kind}");
        let encoders = board.encoders().unwrap();
        eventually("a reading", || {
            encoders
                .encoder_readings(Axes::All)
                .is_ok_and(|all| all.len() == 4)
        });
        if text.contains("jointMin") {
            let limits = board.control_limits().unwrap();
            let base = limits.position_limits(0.into()).unwrap();
            assert!((base.min + 30.0).abs() < 1e-9, "{kind}: {base:?}");
        }
        drop(board);
        stage.runtime.block_on(hosted.close());
    }
}

#[test]
fn lists_have_a_number_for_each_joint() {
    let stage = Stage::new();
    for (text, expected) in [
        ("joints 5", "parameter joints: expected 4 or 7, got 5"),
        (
            "joints 4\nmaxTorques (1 1 1 1 1 1 1)",
            "parameter maxTorques: expected 4 torques in Nm",
        ),
        (
            "joints 4\ncoggingTorques (0 0 0 0 0 0 0)",
            "parameter coggingTorques: expected 4 torques of motors",
        ),
        (
            "gravityMoments (0 0 0 0 0 1 0 0 0 0 0 0)",
            "parameter gravityMoments: expected 21 numbers",
        ),
    ] {
        let refused = stage.open("dynamicWam", text).map(drop).unwrap_err();
        let refused = refused.to_string();
        assert!(refused.contains(expected), "{text}: {refused}");
    }
}

#[test]
fn a_hand_on_its_line_is_a_device() {
    let stage = Stage::new();
    let hand = SimulatedHand::start(SimulatedHandOptions::new().speed(20.0)).expect("it starts");
    let text = format!("serial {}\nbaud 9600\n", hand.path());
    let hosted = stage.open("barrettHand", &text).expect("it opens");
    let board = hosted.parts().board.expect("it has joints");
    assert_eq!(board.axis_info().unwrap().axes(), 4);
    drop(board);
    stage.runtime.block_on(hosted.close());
}

#[test]
fn errors_name_the_line() {
    let stage = Stage::new();
    for (kind, text, expected) in [
        (
            "barrettHand",
            "a 1",
            "d.ini:1: device d: parameter serial is missing, expected a word",
        ),
        (
            "barrettHand",
            "serial /nowhere/line",
            "d.ini:1: device d did not start: ",
        ),
        (
            "canWam",
            "a 1",
            "d.ini:1: device d: parameter interface is missing, expected a word",
        ),
        (
            "canWam",
            "interface ghost0",
            "d.ini:1: device d did not start: ",
        ),
        (
            "fakeFrameGrabber",
            "width 10\nmode plaid",
            "d.ini:2: device d: parameter mode: expected one of ",
        ),
        (
            "fakeFrameGrabber",
            "freq 0",
            "d.ini:1: device d: parameter freq: expected 0.1 to 1000 images a second, got 0",
        ),
        (
            "frameGrabber_nws_yarp",
            "capabilities GREY",
            "d.ini:1: device d: parameter capabilities: expected COLOR or RAW, got GREY",
        ),
        (
            "frameGrabber_nwc_yarp",
            "local /me",
            "d.ini:1: device d: parameter remote is missing, expected a port name such as /arm",
        ),
        (
            "frameGrabber_nws_yarp",
            "subdevice simulatedWam",
            "it cannot attach to simulatedWam, expected a camera",
        ),
        (
            "controlBoard_nws_yarp",
            "name /x\nsubdevice fakeFrameGrabber",
            "it cannot attach to fakeFrameGrabber, expected a device with joints",
        ),
    ] {
        let refused = stage.open(kind, text).err().expect("it is refused");
        assert!(refused.starts_with(expected), "{kind}: {refused}");
    }
}

/// Checks the server of a tool, with the parameters of iCub's files, and its client.
#[test]
fn a_tool_is_served_to_a_client() {
    let stage = Stage::new();
    let text = "attached_device simulatedWam\nwrapper_device cartesiancontrollerserver\n[GENERAL]\nControllerName wam/tool\n\
                ControllerPeriod 5\nKinematicPart custom\nSolverNameToConnect x\nNumberOfDrivers 1\n";
    let served = stage.open("deviceBundler", text).expect("it opens");
    let text = "remote /wam/tool\nlocal /me/tool\ncarrier tcp\ntimeout 5.0\n";
    let seen = stage
        .open("cartesiancontrollerclient", text)
        .expect("it is there");
    let tool = seen.parts().tool.expect("it controls a tool");
    let control = tool.cartesian_control().expect("it controls a tool");
    eventually("a pose", || control.pose().is_ok());
    drop(tool);
    stage.runtime.block_on(seen.close());
    stage.runtime.block_on(served.close());
    let text = "attached_device simulatedWam\nwrapper_device cartesiancontrollerserver\n[GENERAL]\nKinematicPart arm\n";
    let error = stage.open("deviceBundler", text).err().expect("iCub's arm");
    assert!(
        error.contains("GENERAL::KinematicPart: expected custom or wam4 or wam7"),
        "{error}"
    );
}

/// Checks the client of a gaze controller, with stock's parameters, as far as it comes without one.
#[test]
fn a_gaze_controller_that_is_not_there_is_named() {
    let stage = Stage::new();
    for (text, expected) in [
        (
            "local /me",
            "d.ini:1: device d: parameter remote is missing",
        ),
        (
            "remote /gaze",
            "d.ini:1: device d: parameter local is missing",
        ),
        (
            "remote /gaze\nlocal /me\ntimeout soon",
            "d.ini:3: device d: parameter timeout: expected",
        ),
        (
            "remote /gaze\nlocal /me\ncarrier tcp\ntimeout 0.5",
            "d.ini:1: device d",
        ),
    ] {
        let error = stage.open("gazecontrollerclient", text).err();
        let error = error.expect("there is no controller");
        assert!(error.starts_with(expected), "{error}");
    }
}

/// Checks the client of a gaze controller, with stock's parameters, on ports that tell a version and nothing else.
#[test]
fn a_gaze_controller_is_reached() {
    let stage = Stage::new();
    let reply = |_: &mut Received| {
        let version = Bottle::of("server_version").with("2.0");
        Answer::reply(Bottle::of(Vocab32::new("ack")).with(Bottle::of(version)))
    };
    let suffixes = [
        "rpc", "xd:i", "angles:i", "mono:i", "stereo:i", "x:o", "angles:o", "q:o", "events:o",
    ];
    let ports = suffixes.map(|suffix| {
        let name = format!("/gaze/{suffix}");
        let options = PortOptions::new().handler(reply);
        let opening = Port::open(&stage.network, &name, options);
        stage.runtime.block_on(opening).expect("it opens")
    });
    let text = "remote /gaze\nlocal /me\ncarrier nosuch\n";
    let error = stage.open("gazecontrollerclient", text).err();
    let error = error.expect("no carrier has this name");
    assert!(error.contains("/gaze/xd:i over nosuch"), "{error}");
    let text = "remote /gaze\nlocal /me\ncarrier tcp\ntimeout 0.25\n";
    let seen = stage
        .open("gazecontrollerclient", text)
        .expect("it is there");
    let device = seen.parts().other.expect("it is a device");
    let gaze = device.gaze_control().expect("it controls the gaze");
    assert_eq!(gaze.gaze_info().unwrap().server_version, "2.0");
    let point = Vector(vec![1.0, 2.0, 3.0]);
    stage.runtime.block_on(ports[5].write_strict(&point, None));
    eventually("a point that grew old", || {
        let limit = std::time::Duration::from_millis(250);
        matches!(gaze.fixation_point(), Err(DeviceError::Stale { limit: of, .. }) if of == limit)
    });
    drop(device);
    stage.runtime.block_on(seen.close());
}

/// Checks the old names, whose period is in milliseconds.
#[test]
fn a_camera_is_served_under_old_names() {
    let stage = Stage::new();
    for name in ["grabber", "grabberDual"] {
        let text = format!("subdevice fakeFrameGrabber\nfreq 30\nname /{name}\nperiod 40\n");
        let served = stage.open(name, &text).expect("it opens");
        assert!(served.parts().camera.is_some());
        stage.runtime.block_on(served.close());
        let text = "subdevice fakeFrameGrabber\nfreq 30\nperiod 0.04\n";
        assert!(stage.open(name, text).is_err(), "{name}");
    }
}
