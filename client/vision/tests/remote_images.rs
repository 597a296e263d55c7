//! Images of a frame grabber on the network, raw and compressed, and a stream that stops.

use std::sync::Arc;
use std::time::{Duration, Instant};

use yarp_client::ports::blocking::wait;
use yarp_client::{Camera, Network};
use yarp_devices::FrameGrabberImage;
use yarp_devices::camera::{CameraOptions, Scene, SimulatedCamera};
use yarp_nameserver::{Server, ServerOptions};
use yarp_vision::image_source::{ImageSource, RemoteImages};
use yarp_vision::{Image, VisionError};
use yarp_wrappers::{FrameGrabberOptions, FrameGrabberServer, RemoteFrameGrabberOptions};

/// Longer than any step takes on a busy machine.
const TIMEOUT: Duration = Duration::from_secs(60);

/// A camera that shows a still, served on a network of its own.
struct Lab {
    names: Server,
    network: Network,
    camera: Arc<SimulatedCamera>,
    server: FrameGrabberServer,
    _folder: tempfile::TempDir,
}

impl Lab {
    fn start(rate: f64) -> Self {
        let names = wait(Server::start(ServerOptions::default().at("127.0.0.1", 0))).unwrap();
        let network = names.network();
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("still.ppm");
        std::fs::write(&path, still()).unwrap();
        let options = CameraOptions::new().scene(Scene::File(path)).rate(rate);
        let camera = Arc::new(SimulatedCamera::start(options).unwrap());
        let period = FrameGrabberOptions::new().period(Duration::from_millis(2));
        let device: Arc<SimulatedCamera> = Arc::clone(&camera);
        let on = network.clone();
        let serving =
            async move { FrameGrabberServer::open(&on, device, "/grabber", period).await };
        let server = wait(serving).unwrap();
        Self {
            names,
            network,
            camera,
            server,
            _folder: folder,
        }
    }

    fn images(&self, carrier: &str, timeout: Duration) -> RemoteImages {
        let options = RemoteFrameGrabberOptions::new("/grabber", format!("/test/{carrier}"))
            .carrier(carrier)
            .max_state_age(Duration::from_secs(600));
        let camera = Camera::open(&self.network, options).unwrap();
        RemoteImages::new(camera, timeout)
    }

    fn end(self) {
        wait(self.server.close());
        wait(self.names.close());
    }
}

/// An image of 64 x 48 pixels in which red grows to the right and green downwards, as PPM.
fn still() -> Vec<u8> {
    let mut bytes = b"P6 64 48 255\n".to_vec();
    for row in 0..48_u8 {
        for column in 0..64_u8 {
            bytes.extend([column * 4, row * 5, 90]);
        }
    }
    bytes
}

/// Mean difference of the values of two images of one size.
fn difference(one: &Image, other: &Image) -> f64 {
    let (one, other) = (one.to_rgb().unwrap(), other.to_rgb().unwrap());
    assert_eq!((one.width(), one.height()), (other.width(), other.height()));
    let sum: u64 = one
        .pixels()
        .iter()
        .zip(other.pixels())
        .map(|(a, b)| u64::from(a.abs_diff(*b)))
        .sum();
    sum as f64 / one.pixels().len() as f64
}

#[test]
fn raw_images_arrive_unchanged_and_compressed_ones_nearly() {
    let lab = Lab::start(50.0);
    let shown = lab.camera.image().unwrap().image;
    let mut raw = lab.images("fast_tcp", TIMEOUT);
    let first = raw.latest().unwrap();
    assert_eq!(difference(&first.image, &shown), 0.0);
    let mut compressed = lab.images("mjpeg", TIMEOUT);
    let lossy = difference(&compressed.latest().unwrap().image, &shown);
    assert!(lossy > 0.0 && lossy < 12.0, "{lossy}");
    // Both go on: later images have later numbers and times.
    let start = Instant::now();
    let later = loop {
        let next = raw.latest().unwrap();
        if next.number > first.number {
            break next;
        }
        assert!(start.elapsed() < TIMEOUT, "no second image");
        std::thread::yield_now();
    };
    assert!(later.time > first.time, "{} {}", later.time, first.time);
    drop((raw, compressed));
    lab.end();
}

#[test]
fn a_stream_without_new_images_is_an_error_that_names_the_camera() {
    // The second image is due after 10 s.
    let lab = Lab::start(0.1);
    let mut images = lab.images("fast_tcp", Duration::ZERO);
    images.latest().unwrap();
    let error = images.latest().unwrap_err();
    assert!(
        matches!(error, VisionError::StreamStopped { .. }),
        "{error}"
    );
    assert!(error.to_string().contains("/grabber"), "{error}");
    drop(images);
    lab.end();
}

#[test]
fn a_camera_that_is_not_there_is_an_error() {
    let names = wait(Server::start(ServerOptions::default().at("127.0.0.1", 0))).unwrap();
    let options = RemoteFrameGrabberOptions::new("/grabber", "/test/none");
    let error = Camera::open(&names.network(), options).map_err(VisionError::from);
    let error = error.err().unwrap().to_string();
    assert!(error.contains("/grabber"), "{error}");
    wait(names.close());
}

#[test]
fn images_go_on_when_the_name_server_disappears() {
    let lab = Lab::start(50.0);
    let mut images = lab.images("fast_tcp", TIMEOUT);
    let first = images.latest().unwrap();
    let Lab {
        names,
        network,
        camera,
        server,
        _folder,
    } = lab;
    wait(names.close());
    let start = Instant::now();
    // An image of after the name server's end: some may have been on their way.
    while images.latest().unwrap().number < first.number + 20 {
        assert!(start.elapsed() < TIMEOUT, "no further images");
        std::thread::yield_now();
    }
    // A new connection fails.
    let network = network.with_timeout(Duration::from_secs(2));
    let options = RemoteFrameGrabberOptions::new("/grabber", "/test/late");
    let error = Camera::open(&network, options).map_err(VisionError::from);
    let error = error.err().unwrap().to_string();
    assert!(error.contains("/grabber"), "{error}");
    drop(images);
    wait(server.close());
    drop(camera);
}
