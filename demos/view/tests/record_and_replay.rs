//! A recording of a port, played back into the network.

mod support;

use support::{Lab, Page, within};
use yarp_ports::{Port, PortOptions, Queue};
use yarp_view::{Recorder, Replay, ReplayError};
use yarp_wire::Bottle;
use yarp_wrappers::control_board::messages::JointData;

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_run_is_recorded_and_replayed_into_a_view() {
    let lab = Lab::open(true).await;
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("run.mcap");
    let recorder = Recorder::start(&lab.network, "/recorder", &file)
        .await
        .unwrap();
    within(recorder.connect("/wam/stateExt:o")).await.unwrap();
    let missing = within(recorder.connect("/nobody")).await.unwrap_err();
    assert!(missing.to_string().contains("/nobody"), "{missing}");
    let mut page = Page::watch(&lab).await;
    Page::open(&lab).await.command("move 3 175.0").await;
    page.until_joint(3, 175.0).await;
    // The state that the view has seen is also in the recording some messages later.
    let count = recorder.counts().taken;
    within(async {
        while recorder.counts().taken < count + 3 {
            tokio::task::yield_now().await;
        }
    })
    .await;
    let counts = within(recorder.finish()).await.unwrap();
    assert_eq!(counts.dropped, 0);

    let replay = Replay::open(&lab.network, &file, "/replay").await.unwrap();
    assert_eq!(replay.names(), ["/replay/wam/stateExt:o"]);
    let reader = PortOptions::new().queue(Queue::Strict);
    let reader = Port::open(&lab.network, "/reader", reader).await.unwrap();
    let connecting =
        yarp_ports::remote_admin::connect(&lab.network, "/replay/wam/stateExt:o", "/reader", None);
    within(connecting).await.unwrap();
    let played = within(replay.play(20.0)).await.unwrap();
    assert_eq!(played, counts.taken);
    let mut last = None;
    while let Some(message) = reader.try_read() {
        assert!(message.stamp().is_some());
        last = Some(message.read::<JointData>().unwrap());
    }
    // The reader may still be taking the last ones.
    let last = match last {
        Some(last) => last,
        None => within(reader.read())
            .await
            .unwrap()
            .read::<JointData>()
            .unwrap(),
    };
    assert_eq!(last.positions.values.len(), 7);
    within(replay.close()).await;
    within(reader.close()).await;
    lab.close().await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn messages_are_replayed_as_they_were() {
    let lab = Lab::open(false).await;
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("run.mcap");
    let recorder = Recorder::start(&lab.network, "/recorder", &file)
        .await
        .unwrap();
    let writer = Port::open(&lab.network, "/writer", PortOptions::new())
        .await
        .unwrap();
    within(recorder.connect("/writer")).await.unwrap();
    let sent: Vec<_> = (0..20)
        .map(|number| Bottle::of("message").with(number).with(0.5))
        .collect();
    for message in &sent {
        assert_eq!(within(writer.write(message)).await, 1);
    }
    within(writer.close()).await;
    assert_eq!(within(recorder.finish()).await.unwrap().taken, 20);

    let replay = Replay::open(&lab.network, &file, "").await.unwrap();
    let reader = PortOptions::new().queue(Queue::Strict);
    let reader = Port::open(&lab.network, "/reader", reader).await.unwrap();
    within(yarp_ports::remote_admin::connect(
        &lab.network,
        "/writer",
        "/reader",
        None,
    ))
    .await
    .unwrap();
    assert_eq!(within(replay.play(100.0)).await.unwrap(), 20);
    for expected in &sent {
        assert_eq!(
            within(reader.read()).await.unwrap().bottle().unwrap(),
            *expected
        );
    }
    within(replay.close()).await;
    within(reader.close()).await;
    lab.close().await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn files_that_are_no_recordings_are_refused() {
    let lab = Lab::open(false).await;
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("run.mcap");
    std::fs::write(&file, "something else").unwrap();
    let error = Replay::open(&lab.network, &file, "").await.unwrap_err();
    assert!(error.to_string().contains("MCAP"), "{error}");
    let recorder = Recorder::start(&lab.network, "/recorder", &file)
        .await
        .unwrap();
    within(recorder.finish()).await.unwrap();
    let error = Replay::open(&lab.network, &file, "").await.unwrap_err();
    assert!(matches!(error, ReplayError::Empty), "{error}");
    lab.close().await;
}
