//! The checks that the local camera passes, on a camera at the other end of a network.

use crate::support;

use std::time::{Duration, Instant};

use support::{Stage, TEST_TIMEOUT, eventually};
use yarp_devices::checks::{self, Check};
use yarp_devices::image::{Crop, PixelFormat};
use yarp_devices::{
    DeviceError, Feature, FrameGrabberControls, FrameGrabberImage, FrameGrabberImageRaw,
};
use yarp_ports::{Port, PortOptions, Queue};
use yarp_wire::typed::{Image, PixelCode};
use yarp_wire::{Bottle, WireVersion};
use yarp_wrappers::{FrameGrabberServer, OpenError, RemoteFrameGrabber, RemoteFrameGrabberOptions};

fn options() -> RemoteFrameGrabberOptions {
    // Longer than a machine forgets about us.
    RemoteFrameGrabberOptions::new("/grabber", "/tester")
        .max_state_age(TEST_TIMEOUT)
        .rpc_timeout(TEST_TIMEOUT)
}

/// Runs all checks on one camera.
fn all(options: RemoteFrameGrabberOptions, checks: &[(&str, Check)]) {
    let stage = Stage::new();
    let server = stage.serve_camera();
    all_of(&stage, server, options, checks);
}

/// The same on a camera on IEEE 1394.
fn all_on_firewire(options: RemoteFrameGrabberOptions, checks: &[(&str, Check)]) {
    let stage = Stage::new();
    let server = stage.serve_firewire_camera();
    all_of(&stage, server, options, checks);
}

fn all_of(
    stage: &Stage,
    server: FrameGrabberServer,
    options: RemoteFrameGrabberOptions,
    checks: &[(&str, Check)],
) {
    let camera = RemoteFrameGrabber::open(&stage.network, options).expect("it can be reached");
    for (name, check) in checks {
        println!("{name}");
        check(&camera, TEST_TIMEOUT);
    }
    drop(camera);
    stage.runtime.block_on(server.close());
    assert_eq!(stage.registered(), Vec::<String>::new());
}

#[test]
fn every_check_passes_over_3() {
    all(options().wire_version(WireVersion::V3), checks::CAMERA);
}

#[test]
fn every_check_passes_over_4() {
    all(options().wire_version(WireVersion::V4), checks::CAMERA);
}

#[test]
fn every_check_of_ieee_1394_passes_over_3() {
    all_on_firewire(options().wire_version(WireVersion::V3), checks::FIREWIRE);
}

#[test]
fn every_check_of_ieee_1394_passes_over_4() {
    all_on_firewire(options().wire_version(WireVersion::V4), checks::FIREWIRE);
}

#[test]
fn images_that_are_asked_for_are_images_as_well() {
    // Without a stream the number of an image is unknown: each is a new one.
    let same = |(name, _): &&(&str, Check)| *name != "images_go_on";
    let checks: Vec<_> = checks::CAMERA.iter().filter(same).copied().collect();
    for wire_version in [WireVersion::V3, WireVersion::V4] {
        let options = options()
            .no_stream()
            .carrier("none")
            .wire_version(wire_version);
        all(options.clone(), &checks);
        let same = |(name, _): &&(&str, Check)| *name != "images_go_on_when_switched_on";
        let checks: Vec<_> = checks::FIREWIRE.iter().filter(same).copied().collect();
        all_on_firewire(options, &checks);
    }
}

#[test]
fn the_generation_is_found_out() {
    let stage = Stage::new();
    let server = stage.serve_camera();
    let camera = RemoteFrameGrabber::open(&stage.network, options()).expect("it is there");
    assert_eq!(camera.wire_version(), WireVersion::V4);
    drop(camera);
    stage.runtime.block_on(server.close());

    // A server that does not understand the query for the version is of 3.x.
    let nak = |_: &mut yarp_ports::Received| {
        yarp_ports::Answer::reply(Bottle::parse("[nak]").expect("a bottle"))
    };
    let rpc = stage.port("/grabber/rpc", PortOptions::new().handler(nak));
    let camera = RemoteFrameGrabber::open(&stage.network, options().no_stream());
    let camera = camera.expect("it is there");
    assert_eq!(camera.wire_version(), WireVersion::V3);
    assert!(matches!(
        camera.feature(Feature::Gain),
        Err(DeviceError::Refused { .. })
    ));
    assert!(matches!(camera.image(), Err(DeviceError::Refused { .. })));
    drop(camera);
    stage.runtime.block_on(rpc.close());
}

#[test]
fn a_camera_that_is_not_there_is_named() {
    let stage = Stage::new();
    match RemoteFrameGrabber::open(&stage.network, options()) {
        Err(OpenError::NoRemote { name }) => assert_eq!(name, "/grabber/rpc"),
        other => panic!("{other:?}"),
    }
    assert_eq!(stage.registered(), Vec::<String>::new());
}

/// The tidying demo looks a few times a minute: in between nobody has to take images.
#[test]
fn a_paused_camera_is_left_alone_until_it_is_resumed() {
    let stage = Stage::new();
    let server = stage.serve_camera();
    let options = options().max_state_age(Duration::from_secs(1));
    let camera = RemoteFrameGrabber::open(&stage.network, options).expect("it is there");
    eventually("a first image", || camera.image().is_ok());
    let before = camera.image().expect("it is there").number;
    camera.pause();
    // Long enough for the watch over missing images, which is one for images older than a second.
    let end = Instant::now() + Duration::from_millis(2500);
    while Instant::now() < end {
        let image = camera.image();
        assert!(
            matches!(image, Err(DeviceError::NoDataYet { .. })),
            "{image:?}"
        );
        std::thread::sleep(Duration::from_millis(20));
    }
    camera.resume();
    eventually("an image", || camera.image().is_ok());
    assert!(camera.image().expect("it is there").number > before);
    // One that cannot be reached is resumed when it is back.
    camera.pause();
    stage.runtime.block_on(server.close());
    camera.resume();
    let server = stage.serve_camera();
    eventually("an image again", || camera.image().is_ok());
    drop(camera);
    stage.runtime.block_on(server.close());
}

#[test]
fn when_it_comes_back_it_is_connected_again() {
    for wire_version in [WireVersion::V3, WireVersion::V4] {
        let stage = Stage::new();
        let server = stage.serve_camera();
        let options = RemoteFrameGrabberOptions::new("/grabber", "/me")
            .max_state_age(Duration::from_secs(1))
            .wire_version(wire_version);
        let camera = RemoteFrameGrabber::open(&stage.network, options).expect("it is there");
        let sees = || camera.image().is_ok();
        eventually("a first image", sees);
        stage.runtime.block_on(server.close());
        eventually("distrust", || {
            matches!(camera.image(), Err(DeviceError::Stale { .. }))
        });
        let error = camera
            .feature(Feature::Gain)
            .expect_err("it is gone")
            .to_string();
        assert!(error.contains("with /grabber/rpc failed; try "), "{error}");

        let server = stage.serve_camera();
        eventually("images again", sees);
        eventually("answers again", || camera.feature(Feature::Gain).is_ok());
        drop(camera);
        stage.runtime.block_on(server.close());
        assert!(stage.registered().is_empty());
    }
}

/// A camera that was served and cast serves again: pixels and time come through both.
#[test]
fn a_remote_camera_can_be_served_again() {
    let stage = Stage::new();
    let server = stage.serve_camera();
    let near = RemoteFrameGrabber::open(&stage.network, options()).expect("it is there");
    let network = stage.network.clone();
    let relay = yarp_ports::blocking::wait(async move {
        let options = yarp_wrappers::FrameGrabberOptions::new();
        yarp_wrappers::FrameGrabberServer::open(
            &network,
            std::sync::Arc::new(near),
            "/relay",
            options,
        )
        .await
    });
    let relay = relay.expect("it can be served again");
    let options = RemoteFrameGrabberOptions::new("/relay", "/far")
        .max_state_age(TEST_TIMEOUT)
        .rpc_timeout(TEST_TIMEOUT);
    let far = RemoteFrameGrabber::open(&stage.network, options).expect("it is there");
    checks::camera_checks::images_go_on(&far, TEST_TIMEOUT);
    checks::camera_checks::brightness_is_seen(&far, TEST_TIMEOUT);
    drop(far);
    yarp_ports::blocking::wait(relay.close());
    stage.runtime.block_on(server.close());
}

/// A port reads images as any program does: complete, in order, with number and time.
#[test]
fn any_port_reads_the_images() {
    let stage = Stage::new();
    let server = stage.serve_camera();
    let reader = stage.port("/viewer", PortOptions::new().queue(Queue::Latest));
    stage.runtime.block_on(async {
        yarp_ports::remote_admin::connect(&stage.network, "/grabber", "/viewer", Some("tcp"))
            .await
            .expect("connected");
        let mut last = None;
        for _ in 0..10 {
            let reading = tokio::time::timeout(TEST_TIMEOUT, reader.read());
            let message = reading
                .await
                .expect("images come")
                .expect("the port is open");
            let image: Image = message.read().expect("an image");
            assert_eq!(
                (image.code(), image.width(), image.height()),
                (PixelCode::RGB, 48, 32)
            );
            let blue = |y: usize| {
                (0..48)
                    .filter(|x| image.pixel(*x, y).unwrap()[2] == 255)
                    .count()
            };
            let rows: Vec<_> = (0..32).map(blue).collect();
            assert!(
                rows.iter().all(|count| [0, 48].contains(count)),
                "torn: {rows:?}"
            );
            assert_eq!(rows.iter().sum::<usize>(), 48);
            let stamp = message.stamp().expect("a stamp");
            if let Some((count, time)) = last {
                assert!(stamp.count > count && stamp.time > time);
            }
            last = Some((stamp.count, stamp.time));
        }
    });
    stage.runtime.block_on(reader.close());
    stage.runtime.block_on(server.close());
}

/// Returns the reply to a typed request.
async fn answer(asking: &Port, said: &str) -> String {
    let message = Bottle::parse(said).expect("a bottle");
    let reply = asking.call_within::<Bottle>(&message, TEST_TIMEOUT).await;
    reply.expect("an answer").to_string()
}

/// Conversations of stock's clients of both wire versions with a camera on IEEE 1394.
#[test]
fn words_of_ieee_1394_are_answered_as_stock_answers() {
    let stage = Stage::new();
    let server = stage.serve_firewire_camera();
    let asking = stage.port("/asker", PortOptions::new().rpc_client());
    stage.runtime.block_on(async {
        asking.connect("/grabber/rpc").await.expect("connected");
        for (said, expected) in [
            (
                "[fgc] [get] [camd]",
                "[fgc] [camd] [is] 1 \"simulated camera\"",
            ),
            ("[fgfw] [DR2m]", "16777235"),
            ("[fgfw] [DR2o] 1", "1"),
            ("[fgfw] [DR2n]", "1"),
            ("[fgfw] [DR2o] 2", "0"),
            ("[fgfw] [DR2o] -1", "0"),
            ("[fgfw] [DR2o]", "0"),
            ("[fgfw] [DR2B] 16 12 0 0", "0"),
            ("[fgfw] [DR2o] 24", "1"),
            ("[fgfw] [DR2B] 16 12 -1 0", "0"),
            ("[fgfw] [DR2B] 16 12 8 4", "1"),
            ("[fgfw] [DR2A]", "16 12 8 4"),
            ("[fgfw] [DR2z]", "640 480 1 1 1 1"),
            ("[fgfw] [DR2u] 5", "\"command not recognized\""),
            ("[fgfw] [DR2C] 1", "1"),
            ("[fgfw] [DR2D]", "1"),
            ("getFormat7WindowDC1394RPC", "([ok]) 16 12 8 4"),
            ("getOperationModeDC1394RPC", "([ok]) [ok]"),
            ("setFPSDC1394RPC 9", "[err7]"),
            ("setFPSDC1394RPC 5", "[ok]"),
            ("getFPSDC1394RPC", "([ok]) 5"),
            ("setFormat7WindowDC1394RPC 1 1 1", "[fail]"),
            ("getColorCodingMaskDC1394RPC 24", "([ok]) 16"),
            ("setDefaultsDC1394RPC", "[ok]"),
            ("getOperationModeDC1394RPC", "([ok]) [fail]"),
        ] {
            assert_eq!(answer(&asking, said).await, expected, "{said}");
        }
    });
    stage.runtime.block_on(asking.close());
    stage.runtime.block_on(server.close());
}

/// Invalid requests are answered, on either port, and the camera continues.
#[test]
fn nonsense_is_refused_and_the_camera_goes_on() {
    let stage = Stage::new();
    let server = stage.serve_camera();
    for to in ["/grabber/rpc", "/grabber"] {
        let asking = stage.port("/asker", PortOptions::new().rpc_client());
        stage.runtime.block_on(async {
            asking.connect(to).await.expect("connected");
            for (said, expected) in [
                ("[fgi] [get] [w]", "[fgi] [w] [is] 48"),
                ("", "[nak]"),
                ("[help]", "[nak]"),
                ("1 2 3", "[nak]"),
                ("[fgc] [set] [feat] 0 7.5", "[fgc] [set] 0"),
                ("[fgc] [get] [feat] -1", "[fail]"),
                ("[fgc] [has] [feat] 99", "[fgc] [has] [feat] 1952540006 0"),
                ("[visr] [set] [res] -5 -5", "[visr] [set] 0"),
                ("[visr] [set] [res] 2000000000 2000000000", "[visr] [set] 0"),
                ("[fgfw] [DR2m]", "\"command not recognized\""),
                ("noSuchThingRPC 1 2", "[fail]"),
                ("setFeature1RPC 0 7.5", "[err7]"),
                ("setFeature1RPC 0 high", "[fail]"),
                ("getFeature1RPC 16", "([err2]) 0.0"),
                ("getVideoModeDC1394RPC", "([err6]) 0"),
                ("getWidthRPC", "([ok]) 48"),
                ("getCameraDescriptionRPC", "([ok]) 0 \"simulated camera\""),
                ("setRgbMirroringRPC [fail]", "[ok]"),
            ] {
                assert_eq!(answer(&asking, said).await, expected, "{said} to {to}");
            }
        });
        stage.runtime.block_on(asking.close());
    }
    let camera = RemoteFrameGrabber::open(&stage.network, options()).expect("it is there");
    checks::camera_checks::images_go_on(&camera, TEST_TIMEOUT);
    let part = camera
        .raw_image_crop(&Crop::Rectangle((0, 0), (1, 1)))
        .expect("it is inside");
    assert_eq!(part.image.format(), PixelFormat::Mono);
    drop(camera);
    stage.runtime.block_on(server.close());
}
