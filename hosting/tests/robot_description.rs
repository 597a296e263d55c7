//! A robot tells other programs which devices it has, as YARP 4.0's does.

mod support;

use support::{Stage, TIMEOUT};
use yarp_hosting::robot::RunningRobot;
use yarp_ports::{Port, PortOptions};
use yarp_wire::name_service::RegisterRequest;
use yarp_wire::{Bottle, Value};

const PORT: &str = "/yarpRobotInterface/devices/rpc";

const ROBOT: &str = r#"<robot name="bot" portprefix="/bot">
<device name="arm" type="fakeMotionControl"><group name="GENERAL"><param name="Joints">2</param></group></device>
<device name="nws" type="controlBoard_nws_yarp">
  <param name="period">0.05</param><param name="name">${portprefix}/arm</param>
  <action phase="startup" level="5" type="attach"><param name="device">arm</param></action>
</device>
</robot>"#;

/// Sends requests to a port; returns the replies.
fn ask(stage: &Stage, name: &str, requests: &[&str]) -> Vec<Bottle> {
    stage.runtime.block_on(async {
        let port = Port::open(&stage.network, "...", PortOptions::new().rpc_client()).await;
        let port = port.unwrap();
        port.connect(name).await.unwrap();
        let mut replies = Vec::new();
        for request in requests {
            let request = Bottle::parse(request).unwrap();
            replies.push(port.call_within(&request, TIMEOUT).await.unwrap());
        }
        port.close().await;
        replies
    })
}

/// Returns the names and ports of the devices in a reply, as yarpmotorgui finds its parts.
fn parts(reply: &Bottle) -> Vec<(String, String)> {
    let code = reply.get(0).and_then(Value::as_list).unwrap();
    assert_eq!(code.to_string(), "[ok]", "{reply}");
    let devices = reply.get(1).and_then(Value::as_list).unwrap();
    let devices = devices.iter().map(|device| {
        let texts: Vec<_> = device
            .as_list()
            .unwrap()
            .iter()
            .map(Value::to_plain_string)
            .collect();
        assert_eq!(texts.len(), 4);
        let configuration = Bottle::parse(&texts[2]).unwrap();
        let lists = configuration.iter().filter_map(Value::as_list);
        let named = lists.filter(|list| list.get(0).unwrap().as_str() == Some("name"));
        let port = named.map(|list| list.get(1).unwrap().to_plain_string());
        (texts[0].clone(), port.last().unwrap_or_default())
    });
    devices.collect()
}

fn is_there(stage: &Stage, name: &str) -> bool {
    stage.runtime.block_on(stage.network.query(name)).is_ok()
}

fn end(stage: &Stage, robot: RunningRobot) {
    stage.end(robot);
    assert!(!is_there(stage, PORT));
}

#[test]
fn a_robot_tells_of_its_devices_by_itself() {
    let stage = Stage::new();
    let robot = stage.run("bot.xml", ROBOT);
    let replies = ask(
        &stage,
        PORT,
        &[
            "getAllDevicesByTypeRPC controlBoard_nws_yarp",
            "getAllDevicesRPC",
            "getAllDevicesByTypeRPC nothing",
            "unregisterAllRPC",
            "getAllDevicesRPC x y",
            "",
        ],
    );
    assert_eq!(
        parts(&replies[0]),
        [("nws".to_owned(), "/bot/arm".to_owned())]
    );
    assert_eq!(parts(&replies[1]).len(), 2);
    assert_eq!(parts(&replies[2]), []);
    for refused in &replies[3..] {
        assert!(
            refused.get(1).is_none() && refused.to_string() != "[ok]",
            "{refused}"
        );
    }
    // Another robot does not take the name away.
    let other = ROBOT.replace("/bot", "/two");
    let other = stage.run("two.xml", &other);
    assert_eq!(
        parts(
            &ask(
                &stage,
                PORT,
                &["getAllDevicesByTypeRPC controlBoard_nws_yarp"]
            )[0]
        )[0]
        .1,
        "/bot/arm"
    );
    stage.end(other);
    assert!(is_there(&stage, PORT));
    end(&stage, robot);
}

/// Programs no longer found the parts of a robot that was killed and started again.
#[test]
fn a_killed_robot_leaves_its_place_to_another() {
    let stage = Stage::new();
    // Nobody listens there any more.
    let listener = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
    let left = RegisterRequest {
        host: Some("127.0.0.1".to_owned()),
        number: Some(listener.local_addr().unwrap().port().into()),
        ..RegisterRequest::named(PORT)
    };
    drop(listener);
    let registered = stage.runtime.block_on(stage.network.register(left));
    registered.unwrap();
    let robot = stage.run("bot.xml", ROBOT);
    let replies = ask(&stage, PORT, &["getAllDevicesRPC"]);
    assert_eq!(parts(&replies[0]).len(), 2);
    end(&stage, robot);
}

#[test]
fn a_large_request_is_refused() {
    let stage = Stage::new();
    let robot = stage.run("bot.xml", ROBOT);
    stage.runtime.block_on(async {
        for (length, answered) in [(60 * 1024, true), (70 * 1024, false)] {
            let port = Port::open(&stage.network, "...", PortOptions::new().rpc_client()).await;
            let port = port.unwrap();
            port.connect(PORT).await.unwrap();
            let request = Bottle::of("x".repeat(length));
            let reply: Result<Bottle, _> = port.call_within(&request, TIMEOUT).await;
            assert_eq!(reply.is_ok(), answered);
            port.close().await;
        }
    });
    end(&stage, robot);
}

#[test]
fn a_description_may_open_the_port_itself() {
    let stage = Stage::new();
    let own = r#"<device name="list" type="robotDescription_nws_yarp"><param name="local">/bot/list</param>
        <action phase="startup" level="9" type="attach"><param name="device"> yriDescriptionStorage </param></action>
        <action phase="shutdown" level="5" type="detach"/></device></robot>"#;
    let robot = stage.run("bot.xml", &ROBOT.replace("</robot>", own));
    assert!(robot.is_ready() && !is_there(&stage, PORT));
    assert_eq!(
        parts(&ask(&stage, "/bot/list", &["getAllDevicesRPC"])[0]).len(),
        3
    );
    end(&stage, robot);
    assert!(!is_there(&stage, "/bot/list"));
}
