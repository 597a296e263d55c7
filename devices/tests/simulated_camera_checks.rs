//! The checks of cameras on the simulated one, and what only a local one can show.

use std::path::Path;
use std::time::{Duration, Instant};

use yarp_devices::camera::{CameraOptions, Pattern, Scene, SimulatedCamera};
use yarp_devices::{
    Device, DeviceError, FirewireControls, FrameGrabberImage, RgbVisualParams, checks,
};

const TEST_TIMEOUT: Duration = Duration::from_secs(60);

fn camera(scene: Scene) -> SimulatedCamera {
    let options = CameraOptions::new().size(48, 32).rate(200.0).scene(scene);
    SimulatedCamera::start(options).expect("it starts")
}

/// Waits until the camera has shown images of all these kinds, distinguished by their first byte, and no others.
fn shows(camera: &SimulatedCamera, kinds: &[(u8, u8)]) {
    let mut missing: Vec<_> = kinds.iter().collect();
    let deadline = Instant::now() + TEST_TIMEOUT;
    while !missing.is_empty() {
        assert!(Instant::now() < deadline, "never shown: {missing:?}");
        let kind = camera.image().expect("there is one").image.pixels()[0];
        let is = |(least, most): &(u8, u8)| (*least..=*most).contains(&kind);
        assert!(kinds.iter().any(is), "{kind}");
        missing.retain(|one| !is(one));
        std::thread::yield_now();
    }
}

fn ppm(grey: u8) -> Vec<u8> {
    let mut bytes = b"P6 4 2 255\n".to_vec();
    bytes.extend([grey; 24]);
    bytes
}

fn jpeg(grey: u8) -> Vec<u8> {
    let mut bytes = Vec::new();
    let encoder = jpeg_encoder::Encoder::new(&mut bytes, 90);
    let pixels = vec![grey; 16 * 16];
    encoder
        .encode(&pixels, 16, 16, jpeg_encoder::ColorType::Luma)
        .unwrap();
    bytes
}

#[test]
fn every_check_passes() {
    for (name, check) in checks::CAMERA {
        println!("{name}");
        check(&camera(Scene::Pattern(Pattern::Grid)), TEST_TIMEOUT);
    }
}

fn firewire(scene: Scene) -> SimulatedCamera {
    let options = CameraOptions::new().size(48, 32).rate(200.0).firewire(true);
    SimulatedCamera::start(options.scene(scene)).expect("it starts")
}

#[test]
fn every_check_of_cameras_on_ieee_1394_passes() {
    for (name, check) in checks::CAMERA.iter().chain(checks::FIREWIRE) {
        println!("{name}");
        check(&firewire(Scene::Pattern(Pattern::Grid)), TEST_TIMEOUT);
    }
    let plain = camera(Scene::Pattern(Pattern::Grid));
    assert!(plain.firewire_controls().is_none());
}

/// Switched off in any way, the camera takes no images; its number is constant for many of its periods.
#[test]
fn a_camera_that_is_switched_off_takes_no_images() {
    type Switch = fn(&SimulatedCamera, bool) -> Result<(), DeviceError>;
    let switches: [Switch; 3] = [
        |camera, on| camera.set_transmission(on),
        |camera, on| camera.set_power(on),
        |camera, on| camera.set_capture(on),
    ];
    let camera = firewire(Scene::Pattern(Pattern::Grid));
    let number = || camera.image().expect("the last one is kept").number;
    for switch in switches {
        switch(&camera, false).expect("it can be switched");
        let deadline = Instant::now() + TEST_TIMEOUT;
        loop {
            let before = number();
            std::thread::sleep(Duration::from_millis(100));
            if number() == before {
                break;
            }
            assert!(Instant::now() < deadline, "images go on");
        }
        let last = number();
        switch(&camera, true).expect("it can be switched");
        while number() == last {
            assert!(Instant::now() < deadline, "no images come");
            std::thread::yield_now();
        }
    }
}

/// Pictures have a size of their own, which no video mode and no window changes.
#[test]
fn pictures_are_in_format_7_only() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("still.ppm");
    std::fs::write(&path, ppm(77)).unwrap();
    let camera = firewire(Scene::File(path));
    assert_eq!(camera.video_modes().unwrap(), 1 << 24);
    assert_eq!(camera.video_mode().unwrap(), 24);
    assert!(camera.set_video_mode(1).is_err());
    let window = camera.window().unwrap();
    assert_eq!((window.width, window.height), (4, 2));
    assert!(camera.set_window(window).is_err());
}

#[test]
fn a_still_picture_is_shown_in_its_own_size() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("still.ppm");
    std::fs::write(&path, ppm(77)).unwrap();
    let camera = camera(Scene::File(path));
    let frame = camera.image().unwrap();
    assert_eq!((frame.image.width(), frame.image.height()), (4, 2));
    assert_eq!(camera.resolution().unwrap(), (4, 2));
    let refused = camera.set_resolution(8, 4);
    assert!(matches!(refused, Err(DeviceError::NotSupported { .. })));
    shows(&camera, &[(77, 77)]);
    let first = frame.number;
    let deadline = Instant::now() + TEST_TIMEOUT;
    while camera.image().unwrap().number == first {
        assert!(Instant::now() < deadline, "it does not go on");
        std::thread::yield_now();
    }
}

#[test]
fn a_folder_is_shown_and_what_is_no_picture_is_passed_over() {
    let folder = tempfile::tempdir().unwrap();
    for (name, bytes) in [
        ("b.ppm", ppm(20)),
        ("a.ppm", ppm(10)),
        ("c.jpg", b"no picture at all".to_vec()),
        ("notes.txt", b"not looked at".to_vec()),
    ] {
        std::fs::write(folder.path().join(name), bytes).unwrap();
    }
    shows(
        &camera(Scene::File(folder.path().into())),
        &[(10, 10), (20, 20)],
    );
}

#[test]
fn a_film_is_shown() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("film.mjpeg");
    std::fs::write(&path, [jpeg(0), jpeg(255)].concat()).unwrap();
    shows(&camera(Scene::File(path)), &[(0, 5), (250, 255)]);
}

#[test]
fn what_makes_no_camera_is_refused_by_name() {
    let folder = tempfile::tempdir().unwrap();
    let file = |name: &str, bytes: &[u8]| {
        let path = folder.path().join(name);
        std::fs::write(&path, bytes).unwrap();
        path
    };
    let refused = |options: CameraOptions| SimulatedCamera::start(options).unwrap_err().to_string();
    let of = |path: &Path| CameraOptions::new().scene(Scene::File(path.into()));
    let wrong = file("wrong.png", b"P6 nothing");
    assert_eq!(
        refused(of(&wrong)),
        format!("cannot read a picture from {}", wrong.display())
    );
    let empty = file("empty.mjpeg", b"no pictures");
    assert_eq!(
        refused(of(&empty)),
        format!("cannot read a film from {}", empty.display())
    );
    let nothing = folder.path().join("nothing");
    std::fs::create_dir(&nothing).unwrap();
    assert_eq!(
        refused(of(&nothing)),
        format!("cannot list the pictures of {}", nothing.display())
    );
    assert!(refused(CameraOptions::new().size(0, 3)).starts_with("resolution 0 x 3 is refused"));
    assert!(refused(CameraOptions::new().rate(f64::NAN)).starts_with("images a second: NaN"));
    assert!(refused(CameraOptions::new().rate(1e9)).contains("0.1 to 1000"));
}

/// A reader that keeps asking, and one that holds on to an old image, do not hold the camera up.
#[test]
fn readers_do_not_hold_up_the_camera() {
    let camera = camera(Scene::Pattern(Pattern::Grid));
    let old = camera.image().unwrap();
    let (number, copy) = (old.number, old.image.pixels().to_vec());
    std::thread::scope(|scope| {
        for _ in 0..3 {
            scope.spawn(|| {
                let mut last = 0;
                let deadline = Instant::now() + TEST_TIMEOUT;
                while last < 50 {
                    let frame = camera.image().unwrap();
                    assert!(frame.number >= last, "an older one");
                    last = frame.number;
                    // All of the image is of one moment: one row is blue, and it is blue all along.
                    let rows = frame.image.pixels().chunks_exact(48 * 3);
                    let blue = rows.filter(|row| row.chunks_exact(3).all(|pixel| pixel[2] == 255));
                    assert_eq!(blue.count(), 1, "of two moments");
                    let dots = frame
                        .image
                        .pixels()
                        .chunks_exact(3)
                        .filter(|pixel| pixel[2] == 255);
                    assert_eq!(dots.count(), 48, "torn");
                    assert!(
                        Instant::now() < deadline,
                        "the camera stands still at {last}"
                    );
                }
            });
        }
    });
    assert_eq!(old.number, number);
    let stays = "an image that somebody holds stays as it is";
    assert!(*old.image.pixels() == copy, "{stays}");
}
