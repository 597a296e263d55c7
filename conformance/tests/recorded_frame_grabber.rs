//! Recorded conversations of stock's cameras and their clients, played against ours: byte for byte.

use std::sync::Arc;

use bytes::{Bytes, BytesMut};
use yarp_conformance::capture::Capture;
use yarp_conformance::traffic_replay;
use yarp_devices::camera::{CameraOptions, Pattern, Scene, SimulatedCamera};
use yarp_nameserver::{Server, ServerOptions};
use yarp_wire::WireVersion;
use yarp_wire::message::{ReadObject, WireObject};
use yarp_wire::typed;
use yarp_wrappers::frame_grabber::messages::image_message;
use yarp_wrappers::{FrameGrabberOptions, FrameGrabberServer};

/// Size of the recorded images: a header and 32 x 24 pixels.
const IMAGE: usize = 60 + 32 * 24 * 3;

/// A camera like the recorded one.
fn camera() -> SimulatedCamera {
    let options = CameraOptions::new()
        .size(32, 24)
        .rate(500.0)
        .scene(Scene::Pattern(Pattern::Line));
    SimulatedCamera::start(options).expect("the machine has threads")
}

#[tokio::test]
async fn the_stock_client_is_answered_as_by_stock() {
    for (generation, least) in [("yarp-3.12", 2), ("yarp-4.0", 3)] {
        let names = Server::start(ServerOptions::default().at("127.0.0.1", 0));
        let names = names.await.expect("a server");
        let network = names.network();
        let options = FrameGrabberOptions::new();
        let server = FrameGrabberServer::open(&network, Arc::new(camera()), "/cam/img:o", options);
        let server = server.await.expect("a camera");
        let capture = Capture::load(generation, "framegrabber");
        let port = "/cam/img:o/rpc";
        let place = network.query(port).await.expect("a place");
        let mut compared = 0;
        for recorded in capture.to(capture.number_of(port)) {
            let played = traffic_replay::play(recorded, (place.host.as_str(), place.port)).await;
            played.unwrap_or_else(|error| panic!("{generation}: {error}"));
            compared += recorded.runs.iter().filter(|run| !run.sent).count();
        }
        assert!(
            compared >= least,
            "{generation}: {compared} answers compared"
        );
        server.close().await;
        names.close().await;
    }
}

/// Returns the recorded images as transmitted.
fn recorded(generation: &str) -> Vec<Bytes> {
    let capture = Capture::load(generation, "framegrabber");
    let runs = capture.streams.iter().flat_map(|stream| &stream.runs);
    let messages = runs.filter(|run| run.sent && run.bytes.len() > IMAGE);
    messages
        .map(|run| Bytes::copy_from_slice(&run.bytes[run.bytes.len() - IMAGE..]))
        .collect()
}

#[test]
fn recorded_images_become_ours_and_ours_become_the_same_bytes() {
    let generations = [
        ("yarp-3.12", WireVersion::V3, true),
        ("yarp-4.0", WireVersion::V4, false),
    ];
    for (generation, wire_version, marked) in generations {
        let images = recorded(generation);
        assert!(images.len() >= 3, "{generation}");
        for bytes in images {
            let received = typed::Image::read_binary(&bytes, wire_version).expect("an image");
            let ours = image_message::from_wire(&received).expect("colours");
            // A green ball around the centre, with a light one in it.
            assert_eq!((ours.width(), ours.height()), (32, 24));
            assert_eq!(ours.pixel(16, 12), Some(&[0, 255, 255][..]));
            // 3.10 to 3.12 set a marker on every image, which means nothing; ours has no marker.
            let sent = image_message::to_wire(&ours).expect("it can be sent");
            let mut written = BytesMut::new();
            sent.with_mark(marked)
                .write_binary(&mut written, wire_version);
            assert_eq!(written, bytes, "{generation}");
        }
    }
}
