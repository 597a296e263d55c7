//! Images and sound of a camera with a microphone, as stock's `grabber` of 3.5 sends them.

use crate::support;

use std::collections::BTreeSet;
use std::sync::Arc;
use std::time::Duration;

use support::{Stage, TEST_TIMEOUT};
use yarp_devices::Device;
use yarp_devices::camera::{CameraOptions, CameraWithMicrophone, SimulatedCamera};
use yarp_devices::fake::FakeMicrophone;
use yarp_ports::{Port, PortOptions, Queue, Received, remote_admin};
use yarp_wire::message::ReadObject;
use yarp_wire::typed::{Image, Pair, Sound};
use yarp_wrappers::{FrameGrabberOptions, FrameGrabberServer, SoundPort};

fn camera() -> Arc<SimulatedCamera> {
    let options = CameraOptions::new().size(16, 8).rate(50.0);
    Arc::new(SimulatedCamera::start(options).expect("the machine has threads"))
}

fn camera_with_microphone() -> (Arc<FakeMicrophone>, Arc<CameraWithMicrophone>) {
    let microphone = Arc::new(FakeMicrophone::new());
    let device = CameraWithMicrophone::new(camera(), microphone.clone());
    (microphone, Arc::new(device.expect("it has both")))
}

fn serve(stage: &Stage, device: Arc<dyn Device>, sound: SoundPort) -> FrameGrabberServer {
    let options = FrameGrabberOptions::new()
        .period(Duration::from_millis(5))
        .sound(sound);
    let opening = FrameGrabberServer::open(&stage.network, device, "/eye", options);
    stage.runtime.block_on(opening).expect("it can be served")
}

/// Opens a reader of `writer` that loses no message.
fn reader(stage: &Stage, writer: &str) -> Port {
    let reader = stage.port(
        &format!("/reader{writer}"),
        PortOptions::new().queue(Queue::Strict),
    );
    let connecting = remote_admin::connect(&stage.network, writer, reader.name(), Some("fast_tcp"));
    stage.runtime.block_on(connecting).expect("connected");
    reader
}

fn next<T: ReadObject>(stage: &Stage, reader: &Port) -> (T, Received) {
    let reading = async { tokio::time::timeout(TEST_TIMEOUT, reader.read()).await };
    let message = stage.runtime.block_on(reading);
    let message = message.expect("it comes").expect("the port is open");
    (message.read().expect("it has this type"), message)
}

fn check_image(image: &Image) {
    assert_eq!((image.width(), image.height()), (16, 8));
}

#[test]
fn on_one_port_each_message_is_an_image_and_its_sound() {
    let stage = Stage::new();
    let (microphone, device) = camera_with_microphone();
    let server = serve(&stage, device, SoundPort::Shared);
    assert_eq!(stage.registered(), ["/eye", "/eye/rpc"]);
    // Nobody reads: what is heard now is not sent.
    while yarp_devices::AudioGrabber::recorded(microphone.as_ref())
        .unwrap()
        .samples
        < 8_000
    {
        std::thread::sleep(Duration::from_millis(10));
    }
    let reader = reader(&stage, "/eye");
    let mut samples = 0;
    for message in 0..10 {
        let (pair, received): (Pair<Image, Sound>, _) = next(&stage, &reader);
        check_image(&pair.head);
        assert!(received.stamp().is_some_and(|stamp| stamp.time > 1e9));
        assert_eq!((pair.body.channels(), pair.body.frequency()), (1, 16_000));
        if message == 0 {
            assert!(pair.body.len() < 8_000, "{}", pair.body.len());
        }
        samples += pair.body.len();
    }
    // Nine images take 180 ms, if none is left out.
    assert!(samples > 1_600, "{samples}");
    stage.runtime.block_on(reader.close());
    stage.runtime.block_on(server.close());
}

#[test]
fn on_two_ports_the_sound_has_a_port_of_its_own() {
    let stage = Stage::new();
    let (_, device) = camera_with_microphone();
    let server = serve(&stage, device, SoundPort::Separate("/ear".to_owned()));
    assert_eq!(stage.registered(), ["/ear", "/eye", "/eye/rpc"]);
    let sounds = reader(&stage, "/ear");
    let (sound, _): (Sound, _) = next(&stage, &sounds);
    assert_eq!((sound.channels(), sound.frequency()), (1, 16_000));
    let images = reader(&stage, "/eye");
    // An image and its sound have the same stamp; a busy reader misses some.
    let (mut seen, mut heard) = (BTreeSet::new(), BTreeSet::new());
    while seen.is_disjoint(&heard) {
        let (image, received): (Image, _) = next(&stage, &images);
        check_image(&image);
        seen.insert(received.stamp().expect("it has one").count);
        let (sound, received): (Sound, _) = next(&stage, &sounds);
        if !sound.is_empty() {
            heard.insert(received.stamp().expect("it has one").count);
        }
    }
    for reader in [sounds, images] {
        stage.runtime.block_on(reader.close());
    }
    stage.runtime.block_on(server.close());
    assert_eq!(stage.registered(), Vec::<String>::new());
}

#[test]
fn a_camera_without_sound_is_served_as_ever() {
    let stage = Stage::new();
    let server = serve(&stage, camera(), SoundPort::Separate("/ear".to_owned()));
    assert_eq!(stage.registered(), ["/eye", "/eye/rpc"]);
    let reader = reader(&stage, "/eye");
    check_image(&next::<Image>(&stage, &reader).0);
    stage.runtime.block_on(reader.close());
    stage.runtime.block_on(server.close());
}
