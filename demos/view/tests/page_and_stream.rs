//! The page of a view, its stream to several viewers, and the gate in front of both.

mod support;

use support::{Lab, Page, within};
use yarp_ports::{Port, PortOptions};
use yarp_wire::Bottle;

/// Headers that browsers add to requests of a page elsewhere.
const FOREIGN: &str = "Origin: http://evil.example\r\nUser-Agent: Mozilla/5.0\r\n";

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn the_page_and_the_description_of_the_robot_are_served() {
    let lab = Lab::open(false).await;
    let page = lab.request("/", "").await;
    assert!(
        page.contains("Content-Type: text/html") && page.contains("/view/main.js"),
        "{page}"
    );
    for (path, content) in [
        ("/view/main.js", "text/javascript"),
        ("/view/view.css", "text/css"),
        ("/robot/wam.urdf", "<joint name=\"joint7\""),
        ("/robot/forearm.obj", "\nf 1//1 "),
    ] {
        let told = lab.request(path, "").await;
        assert!(
            told.starts_with("HTTP/1.1 200") && told.contains(content),
            "{path}: {told:.200}"
        );
    }
    let scene = lab.request("/view/scene.js", "").await;
    assert_eq!(
        scene.starts_with("HTTP/1.1 200"),
        yarp_view::HAS_SCENE,
        "{scene:.200}"
    );
    // What the view does not have is a page of any port, and no file.
    let other = lab.request("/robot/../../etc/passwd.obj", "").await;
    assert!(!other.contains("root:"), "{other:.200}");
    lab.close().await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn pages_of_other_origins_are_refused() {
    let lab = Lab::open(true).await;
    for path in ["/", "/robot/wam.urdf", "/?ws"] {
        let told = lab.request(path, FOREIGN).await;
        assert!(told.starts_with("HTTP/1.1 403"), "{path}: {told:.200}");
    }
    lab.close().await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn several_viewers_see_the_arm_and_one_that_does_not_read_disturbs_nobody() {
    let lab = Lab::open(false).await;
    let slow = Page::watch(&lab).await;
    let (mut one, mut other) = (Page::watch(&lab).await, Page::watch(&lab).await);
    // Lines of the log make each status large, so that the sockets of the slow viewer are full soon.
    let writer = Port::open(&lab.network, "/writer", PortOptions::new())
        .await
        .unwrap();
    within(writer.connect("/wam/view/in:i")).await.unwrap();
    let line = Bottle::of("log")
        .with("info")
        .with("test")
        .with("x".repeat(300));
    let told = async {
        loop {
            within(writer.write(&line)).await;
            let message = one.next().await;
            let skipped = message["status"]["skipped"].as_u64();
            if skipped.is_some_and(|skipped| skipped > 0) {
                return message;
            }
        }
    };
    let told = within(told).await;
    assert_eq!(told["status"]["viewers"], 3);
    other.until_joint(3, 179.3).await;
    drop(slow);
    one.until(|message| (message["status"]["viewers"] == 2).then_some(()))
        .await;
    within(writer.close()).await;
    lab.close().await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn messages_of_other_programs_are_shown() {
    let lab = Lab::open(false).await;
    let mut page = Page::watch(&lab).await;
    let writer = Port::open(&lab.network, "/writer", PortOptions::new())
        .await
        .unwrap();
    within(writer.connect("/wam/view/in:i")).await.unwrap();
    let plan = Bottle::parse("plan (phase grasp) (joints (0 0 0 0 0 0 0))").unwrap();
    within(writer.write(&plan)).await;
    within(writer.write(&Bottle::parse("nothing that is known").unwrap())).await;
    let told = page
        .until(|message| message["status"]["plan"].as_object().cloned())
        .await;
    assert_eq!(told["phase"], "grasp");
    assert_eq!(told["path"].as_array().unwrap().len(), 1);
    within(writer.close()).await;
    lab.close().await;
}
