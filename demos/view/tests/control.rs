//! Commands of the page.

mod support;

use support::{Lab, Page};
use yarp_devices::kinematics::Joints;
use yarp_devices::wam::WamModel;
use yarp_wire::Value;

fn verdict(reply: &yarp_wire::Bottle) -> &str {
    reply.get(0).and_then(Value::as_str).unwrap_or_default()
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_view_without_control_refuses_commands() {
    let lab = Lab::open(false).await;
    let reply = Page::open(&lab).await.command("move 3 120.0").await;
    assert_eq!(verdict(&reply), "refused");
    assert!(reply.to_string().contains("--control"), "{reply}");
    lab.close().await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn commands_move_the_arm_until_the_emergency_stop() {
    let lab = Lab::open(true).await;
    let mut page = Page::watch(&lab).await;
    let mut control = Page::open(&lab).await;
    assert_eq!(verdict(&control.command("move 3 170.0").await), "ok");
    page.until_joint(3, 170.0).await;
    let refused = control.command("move 3 900.0").await;
    assert_eq!(verdict(&refused), "refused", "{refused}");
    // A move that takes seconds.
    assert_eq!(verdict(&control.command("move 0 140.0").await), "ok");
    assert_eq!(verdict(&control.command("stop").await), "ok");
    let stopped = |message: &serde_json::Value| {
        let arm = &message["state"]["arm"];
        let all = |key: &str, holds: &dyn Fn(&serde_json::Value) -> bool| {
            arm[key]
                .as_array()
                .is_some_and(|values| values.iter().all(holds))
        };
        let at_rest = all("v", &|speed| {
            speed.as_f64().is_some_and(|speed| speed.abs() < 0.01)
        });
        let idle = all("m", &|mode| mode == "idle");
        (at_rest && idle).then(|| arm["p"][0].as_f64().unwrap())
    };
    let position = page.until(stopped).await;
    assert!(position < 139.0, "{position}");
    page.until(|message| (message["status"]["stopped"] == true).then_some(()))
        .await;
    for command in ["move 3 100.0", "mode pos"] {
        let refused = control.command(command).await;
        assert!(refused.to_string().contains("emergency stop"), "{refused}");
    }
    assert_eq!(verdict(&control.command("release").await), "ok");
    assert_eq!(verdict(&control.command("move 3 160.0").await), "ok");
    page.until_joint(3, 160.0).await;
    lab.close().await;
}

/// Returns the place of the tool plate, m.
fn tool(message: &serde_json::Value) -> Option<nalgebra::Vector3<f64>> {
    let joints = message["state"]["arm"]["p"].as_array()?;
    let angles = joints.iter().filter_map(serde_json::Value::as_f64);
    let joints = Joints::<7>::from_iterator(angles.map(f64::to_radians));
    let pose = WamModel::<7>::new().chain.forward(&joints);
    Some(pose.translation.vector)
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn dragging_guides_the_tool_to_a_place() {
    let lab = Lab::open(true).await;
    let mut page = Page::watch(&lab).await;
    let mut control = Page::open(&lab).await;
    let place = page.until(tool).await + nalgebra::Vector3::new(0.05, 0.08, 0.1);
    let command = format!("guide {} {} {}", place.x, place.y, place.z);
    assert_eq!(verdict(&control.command(&command).await), "ok");
    page.until(|message| tool(message).filter(|tool| (tool - place).norm() < 2e-3))
        .await;
    assert_eq!(verdict(&control.command("stop").await), "ok");
    let refused = control.command(&command).await;
    assert!(refused.to_string().contains("emergency stop"), "{refused}");
    lab.close().await;
}
