//! The checks that the controller of a tool passes here, passed at the other end of a network.

use crate::support;

use std::sync::Arc;
use std::time::Duration;

use support::{Stage, TEST_TIMEOUT, eventually};
use yarp_devices::cartesian::{CartesianController, CartesianOptions};
use yarp_devices::wam::{SimulatedWam, WamModel};
use yarp_devices::{CartesianControl, CartesianEvent, Device, DeviceError, Target, checks};
use yarp_ports::PortOptions;
use yarp_wire::{Bottle, Value};
use yarp_wrappers::{
    CartesianServer, CartesianServerOptions, CartesianVersion, OpenError, RemoteCartesianControl,
    RemoteCartesianOptions,
};

const NAME: &str = "/cartController/wam";

fn tool() -> Arc<CartesianController<7>> {
    let arm = Arc::new(SimulatedWam::new());
    let chain = WamModel::<7>::new().chain;
    let options = CartesianOptions::new().part_type("wam7");
    Arc::new(CartesianController::start(arm, chain, options).expect("it is an arm"))
}

fn serve(stage: &Stage, tool: Arc<dyn Device>) -> CartesianServer {
    let options = CartesianServerOptions::new();
    let opening = CartesianServer::open(&stage.network, tool, NAME, options);
    stage.runtime.block_on(opening).expect("it can be served")
}

fn options() -> RemoteCartesianOptions {
    // Longer than a machine forgets about us; no datagram is lost.
    RemoteCartesianOptions::new(NAME, "/tester")
        .carrier("fast_tcp")
        .max_state_age(TEST_TIMEOUT)
        .rpc_timeout(TEST_TIMEOUT)
}

fn remote(stage: &Stage) -> RemoteCartesianControl {
    RemoteCartesianControl::open(&stage.network, options()).expect("it can be reached")
}

#[test]
fn every_check_passes() {
    let stage = Stage::new();
    let server = serve(&stage, tool());
    let far = remote(&stage);
    for (name, check) in checks::TOOL {
        println!("{name}");
        check(&far, TEST_TIMEOUT);
    }
    drop(far);
    stage.runtime.block_on(server.close());
    assert_eq!(stage.registered(), Vec::<String>::new());
}

#[test]
fn a_person_types_the_worked_conversation() {
    let stage = Stage::new();
    let server = serve(&stage, tool());
    let port = stage.port("/typist", PortOptions::new().rpc_client());
    let connected = stage
        .runtime
        .block_on(port.connect(&format!("{NAME}/rpc:i")));
    connected.expect("it is there");
    let ask = |text: &str| {
        let request = Bottle::parse(text).expect("a message");
        let answer = stage
            .runtime
            .block_on(port.call_within::<Bottle>(&request, TEST_TIMEOUT));
        // Through text, as a person sees it.
        Bottle::parse(&answer.expect("an answer").to_string()).expect("a message")
    };
    for (request, answer) in [
        (
            "[get] [info]",
            "[ack] ((server_version \"2.0\") (arm_version \"1.0\") (arm_type wam7) (events (motion-onset motion-done motion-ongoing closing \"*\")))",
        ),
        ("[get] [ison]", "[ack] [true]"),
        ("[get] [dof]", "[ack] (1 1 1 1 1 1 1)"),
        ("[set] [dof] (0 2 1)", "[ack] (0 1 1 1 1 1 1)"),
        ("[set] [dof] (1)", "[ack] (1 1 1 1 1 1 1)"),
        ("[set] [time] 150.0", "[ack]"),
        ("[get] [time]", "[ack] 150.0"),
        ("[get] [tol]", "[ack] 0.01"),
        ("[get] [mode]", "[ack] [shot]"),
        ("[get] [refe]", "[ack] [fals]"),
        ("[get] [prio]", "[ack] position"),
        ("[get] [tip]", "[ack] (0.0 0.0 0.0 0.0 0.0 1.0 0.0)"),
        ("[get] [done]", "[ack] [true]"),
        ("[get] [qdot]", "[ack] (0.0 0.0 0.0 0.0 0.0 0.0 0.0)"),
        ("[get] [xdot]", "[ack] (0.0 0.0 0.0 0.0 0.0 1.0 0.0)"),
        ("[stor]", "[ack] 1"),
        ("[go] [xyz] 150.0 (0.4 0.1 0.4)", "[ack]"),
        ("[get] [done]", "[ack] [fals]"),
        ("[stop]", "[ack]"),
        ("[get] [done]", "[ack] [true]"),
        ("[rest] 1", "[ack]"),
        ("[rest]", ""),
        ("[del]", ""),
        ("[del] (1)", "[ack]"),
        ("[del] (1)", "[nack]"),
        ("[even] [regi] [ogoi] 0.5", "[ack]"),
        ("[even] [list] [ogoi]", "[ack] (0.5)"),
        ("[even] [unre] [ogoi] 0.5", "[ack]"),
        ("[go] [xyz] 1.0 (0.4 0.1)", "[nack]"),
        ("[go] [xyz] 1.0 (0.4 0.1 nan)", "[nack]"),
        // Targets out of reach were once acknowledged, and the motion to the nearest pose was reported as done.
        ("[go] [xyz] 1.0 (3.0 0.3 0.6)", "[nack]"),
        ("[go] [pose] 1.0 (3.0 0.3 0.6 0.0 0.0 1.0 0.0)", "[nack]"),
        ("[tvel] (0 0 0.1 0 0 1 0)", "[nack]"),
        ("[get] [lim] 7", "[nack]"),
        ("[what]", "[nack]"),
        ("[get] [done]", "[ack] [true]"),
    ] {
        let expected = Bottle::parse(answer).expect("a message");
        assert_eq!(ask(request), expected, "{request}");
    }
    let asked = ask("[ask] ([xd] (0.4 0.1 0.4)) ([pose] [xyz])");
    let list = |message: &Bottle, at: usize| message.get(at).and_then(Value::as_list).cloned();
    let place = list(&asked, 1)
        .and_then(|group| list(&group, 1))
        .expect("a pose");
    let x = place.get(0).and_then(Value::as_f64).expect("a number");
    assert!((x - 0.4).abs() < 1e-4, "{asked}");
    let pose = ask("[get] [pose] 3");
    assert_eq!(pose.len(), 3, "{pose}");
    stage.runtime.block_on(port.close());
    stage.runtime.block_on(server.close());
}

#[test]
fn what_is_malformed_moves_nothing_on_the_port_for_orders() {
    let stage = Stage::new();
    let tool = tool();
    let server = serve(&stage, tool.clone());
    let port = stage.port("/typist", PortOptions::new());
    let connected = stage
        .runtime
        .block_on(port.connect(&format!("{NAME}/command:i")));
    connected.expect("it is there");
    let events = tool.events().expect("somebody listens");
    for text in [
        "[go] [xyz] 1.0 (0.4 0.1)",
        "[tvel] (nan 0 0 0 0 1 0)",
        "[stor]",
        "7",
        "[go] [xyz] 0.3 (0.4 0.1 0.4)",
    ] {
        let message = Bottle::parse(text).expect("a message");
        stage.runtime.block_on(port.write_strict(&message, None));
    }
    // The last is a command: effects of the others would have come before it.
    assert!(matches!(
        events.recv_timeout(TEST_TIMEOUT),
        Ok(CartesianEvent::Onset { .. })
    ));
    assert!(matches!(
        events.recv_timeout(TEST_TIMEOUT),
        Ok(CartesianEvent::Done { .. })
    ));
    assert_eq!(tool.store_context().expect("there is room"), 1);
    stage.runtime.block_on(port.close());
    stage.runtime.block_on(server.close());
}

#[test]
fn a_server_that_comes_back_is_connected_again() {
    let stage = Stage::new();
    let tool = tool();
    let server = serve(&stage, tool.clone());
    let far = remote(&stage);
    let events = far.events().expect("somebody listens");
    eventually("a pose", || far.pose().is_ok());
    stage.runtime.block_on(server.close());
    let last = events.recv_timeout(TEST_TIMEOUT);
    assert!(
        matches!(last, Ok(CartesianEvent::Closing { .. })),
        "{last:?}"
    );
    let before = far.pose().expect("it is trusted for long").time;
    let server = serve(&stage, tool);
    eventually("an answer", || far.motion_done().is_ok());
    eventually("a new pose", || {
        far.pose().is_ok_and(|pose| pose.time > before)
    });
    eventually("an order", || {
        far.go_to(Target::Position([0.4, 0.1, 0.4]), Some(0.3))
            .is_ok()
    });
    eventually("the place", || {
        let at = far.pose().expect("it is trusted for long").pose.position;
        let off = at.iter().zip([0.4, 0.1, 0.4]);
        off.map(|(at, goal)| (at - goal).abs()).fold(0.0, f64::max) < 0.011
    });
    drop(far);
    stage.runtime.block_on(server.close());
}

#[test]
fn a_pose_that_is_old_is_not_told() {
    let stage = Stage::new();
    let server = serve(&stage, tool());
    let options = options().max_state_age(Duration::from_millis(50));
    let far = RemoteCartesianControl::open(&stage.network, options).expect("it can be reached");
    stage.runtime.block_on(server.close());
    eventually("an old pose", || {
        matches!(
            far.pose(),
            Err(DeviceError::Stale { .. } | DeviceError::NoDataYet { .. })
        )
    });
}

#[test]
fn what_a_client_had_kept_is_forgotten_with_it() {
    let stage = Stage::new();
    let tool = tool();
    let server = serve(&stage, tool.clone());
    let far = remote(&stage);
    let id = far.store_context().expect("there is room");
    far.register_checkpoint(0.25).expect("it is a fraction");
    assert_eq!(tool.checkpoints().expect("it is here"), [0.25]);
    drop(far);
    assert!(tool.restore_context(id).is_err());
    assert!(tool.checkpoints().expect("it is here").is_empty());
    stage.runtime.block_on(server.close());
}

#[test]
fn both_versions_are_served_and_reached() {
    let stage = Stage::new();
    for (version, said) in [
        (
            CartesianVersion::V1_1,
            "(server_version 1.10000000000000008882)",
        ),
        (CartesianVersion::V2_0, "(server_version \"2.0\")"),
    ] {
        let options = CartesianServerOptions::new().version(version);
        let opening = CartesianServer::open(&stage.network, tool(), NAME, options);
        let server = stage.runtime.block_on(opening).expect("it can be served");
        let asker = stage.port("/asker", PortOptions::new().rpc_client());
        let asking = async {
            asker.connect(&format!("{NAME}/rpc:i")).await?;
            let request = Bottle::parse("[get] [info]").expect("a message");
            asker.call::<Bottle>(&request).await
        };
        let info = stage.runtime.block_on(asking).expect("an answer");
        assert!(info.to_string().contains(said), "{info}");
        let remote = remote(&stage);
        let told = remote.cartesian_control().expect("a tool").cartesian_info();
        assert_eq!(told.expect("an answer").server_version, version.text());
        stage.runtime.block_on(asker.close());
        drop(remote);
        stage.runtime.block_on(server.close());
    }
}

#[test]
fn opening_says_what_is_missing_and_leaves_nothing() {
    let stage = Stage::new();
    let missing = RemoteCartesianControl::open(&stage.network, options());
    assert!(matches!(missing, Err(OpenError::NoRemote { .. })));
    // Another version: there is one port that answers every query with it.
    let answer = "[ack] ((server_version \"3.0\"))";
    let old = PortOptions::new().handler(move |_: &mut yarp_ports::Received| {
        yarp_ports::Answer::reply(Bottle::parse(answer).expect("a message"))
    });
    let rpc = stage.port(&format!("{NAME}/rpc:i"), old);
    let others = ["command:i", "state:o", "events:o"]
        .map(|suffix| stage.port(&format!("{NAME}/{suffix}"), PortOptions::new()));
    let refused = RemoteCartesianControl::open(&stage.network, options());
    assert!(
        matches!(refused, Err(OpenError::Query { .. })),
        "{refused:?}"
    );
    stage.runtime.block_on(rpc.close());
    for port in others {
        stage.runtime.block_on(port.close());
    }
    assert_eq!(stage.registered(), Vec::<String>::new());
    struct Nothing;
    impl Device for Nothing {}
    let options = CartesianServerOptions::new();
    let opening = CartesianServer::open(&stage.network, Arc::new(Nothing), NAME, options);
    let refused = stage.runtime.block_on(opening);
    assert!(matches!(refused, Err(OpenError::NoInterface(_))));
}
