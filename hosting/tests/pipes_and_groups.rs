//! `pipe`, `group` and other devices with services, and `inertial` on `fakeIMU`.

mod support;

use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex};

use support::Stage;
use yarp_devices::Axes;
use yarp_devices::image::image_file;
use yarp_hosting::{Hosted, RunningService, park};
use yarp_ports::{Answer, Port, PortOptions, Received, remote_admin};
use yarp_testing::eventually;
use yarp_wire::{Bottle, Value};

fn service(stage: &Stage, hosted: &dyn Hosted) -> RunningService {
    let device = hosted.service().expect("it has a service");
    let starting = RunningService::start("it", device);
    stage.runtime.block_on(starting).expect("it starts")
}

fn image(folder: &Path, number: u32) -> PathBuf {
    folder.join(format!("image_{number:06}.ppm"))
}

/// Checks an image of the grid: red grows from left to right, green from top to bottom.
fn check_grid(file: &Path, width: usize, height: usize) {
    let image = image_file::read(file).expect("it is whole");
    assert_eq!((image.width(), image.height()), (width, height));
    let corner = image.pixel(width - 1, height - 1).unwrap();
    assert_eq!(corner[..2], [255, 255]);
    assert_eq!(image.pixel(0, 0).unwrap()[..2], [0, 0]);
}

fn exists(stage: &Stage, port: &str) -> bool {
    let asking = remote_admin::exists(&stage.network, port);
    stage
        .runtime
        .block_on(asking)
        .expect("the name server answers")
}

#[test]
fn a_pipe_writes_the_images_of_a_camera_to_a_folder() {
    let stage = Stage::new();
    let folder = stage.folder().join("images");
    let text = format!(
        "source fakeFrameGrabber\nsink imageFolderWriter\nfolder {}\nmode grid\nwidth 16\nheight 8\nfreq 200\n",
        folder.display()
    );
    let pipe = stage.open("pipe", &text).expect("it opens");
    let running = service(&stage, pipe.as_ref());
    eventually("images", || image(&folder, 5).exists());
    assert!(stage.runtime.block_on(running.stop()));
    for number in 1..=5 {
        check_grid(&image(&folder, number), 16, 8);
    }
    let count = || std::fs::read_dir(&folder).unwrap().count();
    let before = count();
    std::thread::sleep(std::time::Duration::from_millis(50));
    assert_eq!(count(), before, "it was stopped");
    stage.runtime.block_on(pipe.close());
    let first = std::fs::read(image(&folder, 1)).unwrap();
    let refused = stage.open("pipe", &text).err().expect("there are images");
    assert!(
        refused.contains("cannot write into a folder with") && refused.contains("image_0"),
        "{refused}"
    );
    assert_eq!(std::fs::read(image(&folder, 1)).unwrap(), first);
    assert_eq!(count(), before);
}

#[test]
fn a_pipe_between_groups_of_parameters_writes_sound_too() {
    let stage = Stage::new();
    let folder = stage.folder().join("both");
    let text = format!(
        "[source]\ndevice fakeAudioVisualGrabber\nwidth 4\nheight 4\nfreq 100\n[sink]\ndevice imageFolderWriter\nfolder {}\n",
        folder.display()
    );
    let pipe = stage.open("pipe", &text).expect("it opens");
    let running = service(&stage, pipe.as_ref());
    let sound = folder.join("sound.wav");
    let length = || std::fs::metadata(&sound).map_or(0, |file| file.len());
    eventually("sound", || length() > 44 + 3_200);
    assert!(image(&folder, 2).exists());
    assert!(stage.runtime.block_on(running.stop()));
    stage.runtime.block_on(pipe.close());
}

/// The service ends by itself, with an error, and writes no more than it may.
#[test]
fn a_pipe_ends_when_its_sink_takes_no_more() {
    let stage = Stage::new();
    let folder = stage.folder().join("few");
    let text = format!(
        "source fakeFrameGrabber\nsink imageFolderWriter\nfolder {}\nfreq 200\nmax_images 2\nmax_bytes 5000000000\nmax_sound_bytes 1000\n",
        folder.display()
    );
    let pipe = stage.open("pipe", &text).expect("it opens");
    let mut running = service(&stage, pipe.as_ref());
    assert!(!stage.runtime.block_on(running.ended()));
    assert!(!stage.runtime.block_on(running.stop()));
    assert_eq!(std::fs::read_dir(&folder).unwrap().count(), 2);
    stage.runtime.block_on(pipe.close());
}

/// Parts are known by their names to those behind them: one camera is served and recorded at once.
#[test]
fn a_group_opens_its_parts_and_runs_their_services() {
    let stage = Stage::new();
    let folder = stage.folder().join("group");
    let text = format!(
        "part eye server recorder\n[eye]\ndevice fakeFrameGrabber\nmode grid\nwidth 32\nheight 16\nfreq 200\n\
         [server]\ndevice frameGrabber_nws_yarp\nsubdevice eye\nname /eye\n\
         [recorder]\ndevice pipe\nsource eye\nsink imageFolderWriter\nfolder {}\n",
        folder.display()
    );
    let group = stage.open("group", &text).expect("it opens");
    assert!(exists(&stage, "/eye"));
    assert!(group.machine().is_none());
    assert!(!image(&folder, 1).exists(), "its service is not started");
    let running = service(&stage, group.as_ref());
    eventually("images", || image(&folder, 3).exists());
    check_grid(&image(&folder, 3), 32, 16);
    assert!(stage.runtime.block_on(running.stop()));
    stage.runtime.block_on(group.close());
    assert!(!exists(&stage, "/eye"));
    let written = std::fs::read_dir(&folder).unwrap().count();
    std::thread::sleep(std::time::Duration::from_millis(50));
    assert_eq!(std::fs::read_dir(&folder).unwrap().count(), written);
}

#[test]
fn a_group_parks_the_arm_in_it_and_has_one_at_most() {
    let stage = Stage::new();
    let arm = "[arm]\ndevice simulatedWam\n[other]\ndevice simulatedWam\n[server]\ndevice controlBoard_nws_yarp\nsubdevice arm\nname /wam\n";
    let group = stage.open("group", &format!("part (arm server)\n{arm}"));
    let group = group.expect("it opens");
    let machine = group.machine().expect("it has an arm");
    let first = || {
        let encoders = machine.encoders().expect("it has encoders");
        encoders.encoder_readings(Axes::All).unwrap()[0].position
    };
    let park = || {
        stage
            .runtime
            .block_on(park(machine.clone()))
            .expect("it parks")
    };
    park();
    let parked = first();
    let control = machine.position_control().unwrap();
    control.relative_move(Axes::One(0.into()), &[4.0]).unwrap();
    eventually("a move", || (first() - parked).abs() > 2.0);
    park();
    assert!((first() - parked).abs() < 0.5, "{} {parked}", first());
    assert!(exists(&stage, "/wam/rpc:i"));
    drop(machine);
    stage.runtime.block_on(group.close());
    let refused = stage.open("group", &format!("part (arm server other)\n{arm}"));
    let refused = refused.err().expect("it has two arms");
    assert!(
        refused.contains("at most one part with joints to park"),
        "{refused}"
    );
    assert!(!exists(&stage, "/wam/rpc:i"), "nothing stays open");
}

#[test]
fn mistakes_name_the_line() {
    let stage = Stage::new();
    let folder = stage.folder().join("new");
    let folder = folder.display();
    let many: String = (0..65).map(|part| format!("p{part} ")).collect();
    let mut deep = "device fakeSpeaker".to_owned();
    for _ in 0..9 {
        deep = format!("device group) (part a) (a ({deep})");
    }
    for (kind, text, expected) in [
        (
            "pipe",
            "name x",
            "d.ini:1: device d: parameter source is missing, expected a word",
        ),
        (
            "pipe",
            "source fakeFrameGrabber",
            "d.ini:1: device d: parameter sink is missing, expected a word",
        ),
        (
            "pipe",
            "source pipe\nsink fakeSpeaker",
            "d.ini:1: device d: parameter source: expected a type that reads the other parameters of the pipe; a pipe or group needs a group of parameters of its own, got pipe",
        ),
        (
            "pipe",
            "source fakeMicrophone\nsink group",
            "d.ini:2: device d: parameter sink: expected a type that reads the other parameters of the pipe; a pipe or group needs a group of parameters of its own, got group",
        ),
        (
            "pipe",
            "source fakeBattery\nsink fakeSpeaker",
            "d.ini:1: device d: parameter source: expected a device that gives images or sound, got fakeBattery",
        ),
        (
            "pipe",
            "source fakeMicrophone\nsink fakeBattery",
            "d.ini:2: device d: parameter sink: expected a device that takes images or sound, got fakeBattery",
        ),
        (
            "pipe",
            "[source]\ndevice fakeBattery\n[sink]\ndevice fakeSpeaker",
            "d.ini:1: device d: parameter source: expected a device that gives images or sound, got (device fakeBattery)",
        ),
        (
            "pipe",
            "source fakeFrameGrabber\nsink fakeSpeaker",
            "d.ini:1: device d did not start: a pipe between devices that have neither images nor sound in common",
        ),
        (
            "pipe",
            "[source]\nwidth 3\n[sink]\ndevice fakeSpeaker",
            "d.ini:1: device source: parameter device is missing, expected a word",
        ),
        (
            "pipe",
            "source fakeFrameGrabber\nsink imageFolderWriter",
            "d.ini:1: device d: parameter folder is missing, expected a word",
        ),
        (
            "group",
            "name x",
            "d.ini:1: device d: parameter part: expected 1 to 64 names, each once, got nothing",
        ),
        (
            "group",
            "part a a",
            "d.ini:1: device d: parameter part: expected 1 to 64 names, each once, got a a",
        ),
        (
            "group",
            &format!("part {many}"),
            "d.ini:1: device d: parameter part: expected 1 to 64 names",
        ),
        (
            "group",
            "part a",
            "d.ini:1: device d: parameter part: expected names of groups of parameters; there is no group a",
        ),
        (
            "group",
            "part a b\n[a]\ndevice fakeSpeaker\n[b]\ndevice c",
            "d.ini:5: device b: there is no device c",
        ),
        (
            "group",
            &format!("part a\na ({deep})"),
            "d.ini:2: device a: devices in devices go 9 deep, expected at most 8",
        ),
        (
            "imageFolderWriter",
            &format!("folder {folder}\nmax_images 0"),
            "d.ini:2: device d: parameter max_images: expected 1 to 999999 images, got 0",
        ),
        (
            "imageFolderWriter",
            &format!("folder {folder}\nmax_bytes 0"),
            "d.ini:2: device d: parameter max_bytes: expected 1 to 1099511627776 bytes, got 0",
        ),
        (
            "imageFolderWriter",
            &format!("folder {folder}\nmax_sound_bytes 5000000000"),
            "d.ini:2: device d: parameter max_sound_bytes: expected 1 to 4294967000 bytes, got 5000000000",
        ),
        (
            "fakeMicrophone",
            "signal_frequency 8001",
            "d.ini:1: device d: parameter signal_frequency: expected more than 0 and up to 8000 Hz, got 8001",
        ),
        (
            "fakeMicrophone",
            "signal_amplitude 32768",
            "d.ini:1: device d: parameter signal_amplitude: expected 0 to 32767, got 32768",
        ),
        (
            "fakeMicrophone",
            "waveform square",
            "d.ini:1: device d: parameter waveform: expected sine, got square",
        ),
        (
            "fakeSpeaker",
            "channels 17",
            "d.ini:1: device d: parameter channels: expected 1 to 16, got 17",
        ),
        (
            "fakeSpeaker",
            "rate 0",
            "d.ini:1: device d: parameter rate: expected 1 to 192000 samples a second, got 0",
        ),
        (
            "fakeIMU",
            "period 0",
            "d.ini:1: device d: parameter period: expected 1 to 60000 milliseconds, got 0",
        ),
        (
            "grabber",
            "subdevice fakeFrameGrabber\nframerate 0.01",
            "d.ini:2: device d: parameter framerate: expected 1/60 to 1000 images a second, got 0.01",
        ),
    ] {
        let refused = stage
            .open(kind, text)
            .err()
            .unwrap_or_else(|| panic!("{text}"));
        assert!(refused.starts_with(expected), "{text}: {refused}");
    }
}

/// Ports as of stock's `grabber`: sound has a port of its own, or comes with the images.
#[test]
fn a_grabber_serves_sound() {
    let stage = Stage::new();
    let text = "subdevice fakeAudioVisualGrabber\nwidth 8\nheight 8\nframerate 50\n";
    for (more, has_second) in [("name2 /ear\n", true), ("shared-ports\n", false)] {
        let served = stage
            .open("grabber", &format!("{text}{more}"))
            .expect("it opens");
        assert!(exists(&stage, "/grabber"));
        assert_eq!(exists(&stage, "/ear"), has_second);
        stage.runtime.block_on(served.close());
    }
    let served = stage.open("grabber", text).expect("it opens");
    assert!(exists(&stage, "/grabber2"));
    stage.runtime.block_on(served.close());
    for rate in ["-1", "0", "0.05"] {
        let text =
            format!("subdevice fakeAudioVisualGrabber\nwidth 8\nheight 8\nframerate {rate}\n");
        let served = stage.open("grabber", &text).expect("it opens");
        stage.runtime.block_on(served.close());
    }
    let served = stage.open("grabberDual", text).expect("it opens");
    assert!(!exists(&stage, "/grabber2"));
    stage.runtime.block_on(served.close());
}

/// Reads one message of a port.
fn first_numbers(stage: &Stage, writer: &str) -> Vec<f64> {
    let first: Arc<Mutex<Option<Bottle>>> = Arc::default();
    let theirs = first.clone();
    let take = move |received: &mut Received| {
        theirs
            .lock()
            .unwrap()
            .get_or_insert(received.bottle().unwrap());
        Answer::Nothing
    };
    let options = PortOptions::new().handler(take).input_only();
    let port = stage.runtime.block_on(async {
        let port = Port::open(&stage.network, "/reader", options)
            .await
            .unwrap();
        let connecting = remote_admin::connect(&stage.network, writer, "/reader", Some("tcp"));
        connecting.await.unwrap();
        port
    });
    eventually("a message", || first.lock().unwrap().is_some());
    stage.runtime.block_on(port.close());
    let first = first.lock().unwrap();
    first.iter().flatten().filter_map(Value::as_f64).collect()
}

#[test]
fn a_fake_inertial_sensor_is_served_as_stock_serves_it() {
    let stage = Stage::new();
    let text = "subdevice fakeIMU\nconstantValue\nname /imu\n";
    let served = stage.open("inertial", text).expect("it opens");
    let numbers = first_numbers(&stage, "/imu");
    assert_eq!(numbers.len(), 12);
    for place in [0, 1, 2, 6, 7, 8, 9, 10, 11] {
        assert_eq!(numbers[place], 10.0, "{numbers:?}");
    }
    let gravity = numbers[3..6]
        .iter()
        .map(|part| part * part)
        .sum::<f64>()
        .sqrt();
    assert!((gravity - 9.81).abs() < 1e-9, "{numbers:?}");
    stage.runtime.block_on(served.close());
}

/// A robot starts the services of its devices once they are attached, and stops them before it closes them.
#[test]
fn a_robot_runs_the_services_of_its_devices() {
    let stage = Stage::new();
    let folder = stage.folder().join("robot");
    let text = format!(
        r#"<robot name="r" portprefix="r">
  <device name="recorder" type="pipe">
    <param name="source">fakeFrameGrabber</param> <param name="sink">imageFolderWriter</param>
    <param name="folder">{}</param> <param name="freq">100</param>
  </device>
</robot>"#,
        folder.display()
    );
    let robot = stage.run("r.xml", &text);
    eventually("images", || image(&folder, 2).exists());
    stage.end(robot);
    let written = std::fs::read_dir(&folder).unwrap().count();
    std::thread::sleep(std::time::Duration::from_millis(50));
    assert_eq!(std::fs::read_dir(&folder).unwrap().count(), written);
}
