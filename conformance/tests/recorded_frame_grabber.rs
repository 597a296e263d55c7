//! Recorded conversations of stock's cameras and their clients, played against ours: byte for byte.

use std::sync::Arc;
use std::time::{Duration, Instant};

use bytes::{Bytes, BytesMut};
use yarp_conformance::capture::Capture;
use yarp_conformance::replay;
use yarp_devices::FrameGrabberImage;
use yarp_devices::camera::{CameraOptions, Pattern, Scene, SimulatedCamera};
use yarp_nameserver::{Server, ServerOptions};
use yarp_wire::Dialect;
use yarp_wire::message::{ReadObject, WireObject};
use yarp_wire::typed;
use yarp_wrappers::frame_grabber::messages::image;
use yarp_wrappers::{FrameGrabberOptions, FrameGrabberServer};

const PATIENCE: Duration = Duration::from_secs(60);
/// Bytes of the recorded images: a header and 32 x 24 pixels.
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
            let played = replay::play(recorded, (place.host.as_str(), place.port)).await;
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

/// The recorded images, by the row that is red.
fn recorded(generation: &str) -> Vec<(usize, Bytes)> {
    let capture = Capture::load(generation, "framegrabber");
    let runs = capture.streams.iter().flat_map(|stream| &stream.runs);
    let messages = runs.filter(|run| run.sent && run.bytes.len() > IMAGE);
    let images = messages.map(|run| Bytes::copy_from_slice(&run.bytes[run.bytes.len() - IMAGE..]));
    images
        .map(|bytes| {
            let image = typed::Image::read_binary(&bytes, Dialect::V3).expect("an image");
            let row = (0..24).find(|y| image.pixel(0, *y) == Some(&[255, 0, 0]));
            (row.expect("a red row"), bytes)
        })
        .collect()
}

#[test]
fn the_line_is_that_of_stock_and_so_are_its_bytes() {
    let camera = camera();
    for (generation, dialect, marked) in [
        ("yarp-3.12", Dialect::V3, true),
        ("yarp-4.0", Dialect::V4, false),
    ] {
        let images = recorded(generation);
        assert!(images.len() >= 3, "{generation}");
        for (row, bytes) in images {
            let deadline = Instant::now() + PATIENCE;
            let ours = loop {
                let image = camera.image().expect("it shows").image;
                if image.pixel(0, row) == Some(&[255, 0, 0]) {
                    break image;
                }
                assert!(
                    Instant::now() < deadline,
                    "the line never comes to row {row}"
                );
                std::thread::yield_now();
            };
            // 3.10 to 3.12 mark every image, which means nothing; ours has no mark.
            let wire = image::to_wire(&ours)
                .expect("it can be sent")
                .with_mark(marked);
            let mut written = BytesMut::new();
            wire.write_binary(&mut written, dialect);
            assert_eq!(written, bytes, "{generation}, row {row}");
            let back = typed::Image::read_binary(&bytes, dialect).expect("an image");
            assert_eq!(image::from_wire(&back).expect("colours"), ours);
        }
    }
}
