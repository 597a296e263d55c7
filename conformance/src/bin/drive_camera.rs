//! Drives a stock camera with our client, and prints `ok` or `FAIL` per check.
//!
//! ```text
//! drive_camera /camera 3.x
//! ```
//!
//! Made for `fakeFrameGrabber` of 32 x 24 pixels in mode `line` behind `frameGrabber_nws_yarp` of
//! 3.5.0 and of 4.0.0, whose features have no effect in 3.5.0. Exits with 1 if any check failed.

use std::process::ExitCode;
use std::time::Duration;

use yarp_conformance::live_checks::{CHECK_TIMEOUT, Checks};
use yarp_devices::image::Crop;
use yarp_devices::{
    Feature, FeatureMode, FirewireControls, FrameGrabberControls, FrameGrabberImage,
    FrameGrabberImageRaw, RgbVisualParams, Window,
};
use yarp_ports::Network;
use yarp_wrappers::{RemoteFrameGrabber, RemoteFrameGrabberOptions};

/// Period in which a camera that is not paused sends several images.
const SEVERAL_IMAGES: Duration = Duration::from_millis(500);

fn main() -> ExitCode {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let [name, generation] = &words[..] else {
        eprintln!("usage: drive_camera NAME 3.x|4.0");
        return ExitCode::from(2);
    };
    let mut checks = Checks::new();
    for streams in [true, false] {
        let mut options =
            RemoteFrameGrabberOptions::new(name, "/drive/camera").max_state_age(CHECK_TIMEOUT);
        if !streams {
            println!("---- each image asked for");
            options = options.no_stream();
        }
        let network = match Network::from_process() {
            Ok(network) => network,
            Err(error) => {
                println!("FAIL network: {error:?}");
                return ExitCode::FAILURE;
            }
        };
        match RemoteFrameGrabber::open(&network, options) {
            Ok(camera) => drive(&mut checks, &camera, generation, streams),
            Err(error) => {
                println!("FAIL opens: {error:?}");
                return ExitCode::FAILURE;
            }
        }
    }
    checks.exit_code()
}

fn drive(checks: &mut Checks, camera: &RemoteFrameGrabber, generation: &str, streams: bool) {
    let found = camera.wire_version().to_string();
    checks.check("its generation", Ok(found), |found| found == generation);
    let row = || {
        let image = camera.image()?.image;
        // The line is a row whose red is 255.
        let rows: Vec<usize> = (0..image.height())
            .filter(|y| (0..image.width()).all(|x| image.pixel(x, *y) == Some(&[255, 0, 0])))
            .collect();
        Ok((image.width(), image.height(), rows))
    };
    checks.until("a line", row, |(width, height, rows)| {
        (*width, *height, rows.len()) == (32, 24, 1)
    });
    let first = row().map(|(.., rows)| rows).unwrap_or_default();
    checks.until("the line moves", row, |(.., rows)| {
        rows.len() == 1 && *rows != first
    });
    if streams {
        let number = camera.image().map_or(0, |frame| frame.number);
        checks.until(
            "numbers go up",
            || camera.image().map(|frame| frame.number),
            |next| *next > number,
        );
        camera.pause();
        std::thread::sleep(SEVERAL_IMAGES);
        checks.check("no image of a pause", Ok(camera.image().is_err()), |none| {
            *none
        });
        camera.resume();
        checks.until(
            "numbers go up after a pause",
            || camera.image().map(|frame| frame.number),
            |next| *next > number,
        );
        checks.check("times", camera.image().map(|frame| frame.time), |time| {
            *time > 1.6e9
        });
    }
    checks.check("size", camera.image_size(), |size| *size == (32, 24));
    let crop = Crop::Rectangle((1, 2), (4, 3));
    let part = camera
        .image_crop(&crop)
        .map(|frame| (frame.image.width(), frame.image.height()));
    checks.check("a part", part, |size| *size == (4, 2));
    let raw = camera.raw_image().map(|frame| frame.image.pixels().len());
    checks.check("raw", raw, |count| *count == 32 * 24);
    checks.check("resolution", camera.resolution(), |size| *size == (32, 24));
    checks.check("field of view", camera.field_of_view(), |view| {
        *view == (1.0, 2.0)
    });
    checks.check(
        "set field of view",
        camera.set_field_of_view(1.0, 2.0),
        |()| true,
    );
    checks.check("configurations", camera.supported_configurations(), |all| {
        all.len() == 3 && all[0].width == 128 && all[1].rate == 30.0
    });
    checks.check("lens", camera.intrinsics(), |lens| {
        lens.focal_length == (4.0, 5.0)
            && lens.distortion_model == "FishEye"
            && lens.radial[2] == 10.0
    });
    checks.check(
        "mirrored",
        camera.set_mirroring(true).and_then(|()| camera.mirroring()),
        |mirrored| *mirrored,
    );
    checks.check(
        "not mirrored",
        camera
            .set_mirroring(false)
            .and_then(|()| camera.mirroring()),
        |mirrored| !mirrored,
    );
    checks.check(
        "refuses no order to a knob",
        camera.set_feature(Feature::Gain, 0.5),
        |()| true,
    );
    drive_features(checks, camera, generation);
}

/// Checks features and their modes, which servers of 3.x do not report.
fn drive_features(checks: &mut Checks, camera: &RemoteFrameGrabber, generation: &str) {
    if generation == "4.0" {
        checks.check("a knob", camera.feature(Feature::Gain), |value| {
            *value == 0.5
        });
        // The fake camera stores one value for all features, reports that it has none, and has no
        // description.
        checks.check("has a knob", camera.has_feature(Feature::Gain), |has| !has);
        checks.check("description", camera.camera_description(), |about| {
            about.description.is_empty()
        });
        for active in [true, false] {
            let kept = camera.set_active(Feature::Gain, active);
            let kept = kept.and_then(|()| camera.is_active(Feature::Gain));
            checks.check("switched", kept, |kept| *kept == active);
        }
        for mode in [FeatureMode::Automatic, FeatureMode::Manual] {
            let kept = camera.set_mode(Feature::Gain, mode);
            let kept = kept.and_then(|()| camera.mode(Feature::Gain));
            checks.check("mode", kept, |kept| *kept == mode);
        }
        firewire(checks, camera);
        let pushed = camera.one_push(Feature::Gain);
        let pushed = pushed.and_then(|()| camera.has_one_push(Feature::Gain));
        checks.check("pushed once", pushed, |pushed| *pushed);
    } else {
        let refused = camera.video_mode().is_err() && camera.set_rate(1).is_err();
        checks.check("IEEE 1394 is refused", Ok(refused), |refused| *refused);
        // Without meaning, but an answer.
        checks.check("a knob is answered", camera.feature(Feature::Gain), |_| {
            true
        });
        checks.check(
            "whether it is there",
            camera.has_feature(Feature::Gain),
            |_| true,
        );
    }
}

/// Checks FireWire: the fake camera stores numbers without meaning, and reports no windows; its
/// server returns the coding for the mask of codings.
fn firewire(checks: &mut Checks, camera: &RemoteFrameGrabber) {
    checks.check("video modes", camera.video_modes(), |mask| *mask == 10);
    checks.check("rates", camera.rates(), |mask| *mask == 12);
    let mode = camera.set_video_mode(3).and_then(|()| camera.video_mode());
    checks.check("video mode", mode, |mode| *mode == 3);
    let rate = camera.set_rate(4).and_then(|()| camera.rate());
    checks.check("rate", rate, |rate| *rate == 4);
    let speed = camera.set_iso_speed(5).and_then(|()| camera.iso_speed());
    checks.check("speed of the bus", speed, |speed| *speed == 5);
    let coding = camera
        .set_color_coding(6)
        .and_then(|()| camera.color_coding());
    checks.check("coding", coding, |coding| *coding == 6);
    checks.check("codings", camera.color_codings(3), |mask| *mask == 6);
    checks.check("largest window", camera.window_limits(), |_| true);
    checks.check("window", camera.window(), |_| true);
    let set = camera.set_window(Window::default());
    checks.check("set window", set, |()| true);
    for on in [true, false] {
        let kept = camera.set_1394b(on).and_then(|()| camera.is_1394b());
        checks.check("1394b", kept, |kept| *kept == on);
        let kept = camera.set_transmission(on);
        let kept = kept.and_then(|()| camera.is_transmitting());
        checks.check("transmission", kept, |kept| *kept == on);
        let orders = [
            camera.set_broadcast(on),
            camera.set_power(on),
            camera.set_capture(on),
            camera.set_defaults(),
            camera.reset(),
        ];
        for order in orders {
            checks.check("an order", order, |()| true);
        }
    }
    let bytes = camera.set_bytes_per_packet(7);
    let bytes = bytes.and_then(|()| camera.bytes_per_packet());
    checks.check("packets", bytes, |bytes| *bytes == 7);
}
