//! The latest image of threads and recorded sequences, and their failures.

use std::sync::mpsc;
use std::time::Duration;

use yarp_vision::image_source::{ImageSource, RecordedImages, RegionOfInterest, ThreadedImages};
use yarp_vision::{Crop, Frame, Image, PixelFormat, VisionError};

fn frame(number: u64) -> Frame {
    let pixels = vec![number as u8; 12];
    Frame {
        image: Image::new(PixelFormat::Mono, 4, 3, pixels).unwrap(),
        number,
        time: number as f64 / 30.0,
    }
}

/// A source that shows what the sender sends.
fn threaded(timeout: Duration) -> (mpsc::Sender<Frame>, ThreadedImages) {
    let (sender, receiver) = mpsc::channel();
    let grab = move || {
        let next = receiver.recv_timeout(Duration::from_millis(20));
        next.map_err(|_| VisionError::NoImageYet {
            source_name: "test".into(),
        })
    };
    (
        sender,
        ThreadedImages::start("test", timeout, grab).unwrap(),
    )
}

fn wait_for(source: &mut impl ImageSource, number: u64) -> Frame {
    loop {
        match source.latest() {
            Ok(frame) if frame.number == number => return frame,
            Ok(_) | Err(VisionError::NoImageYet { .. }) => std::thread::yield_now(),
            Err(error) => panic!("{error}"),
        }
    }
}

#[test]
fn a_threaded_source_has_the_latest_image_with_its_time() {
    let (sender, mut source) = threaded(Duration::from_secs(600));
    assert!(matches!(
        source.latest(),
        Err(VisionError::NoImageYet { .. })
    ));
    for number in 1..=3 {
        sender.send(frame(number)).unwrap();
    }
    assert_eq!(wait_for(&mut source, 3), frame(3));
}

#[test]
fn a_stopped_stream_is_an_error_that_names_the_source() {
    let (sender, mut source) = threaded(Duration::ZERO);
    sender.send(frame(1)).unwrap();
    wait_for(&mut source, 1);
    let error = source.latest().unwrap_err();
    assert!(
        matches!(error, VisionError::StreamStopped { .. }),
        "{error}"
    );
    assert!(error.to_string().contains("test"), "{error}");
    // It goes on with the next image.
    sender.send(frame(2)).unwrap();
    let next = loop {
        if let Ok(next) = source.latest() {
            break next;
        }
        std::thread::yield_now();
    };
    assert_eq!(next.number, 2);
}

#[test]
fn a_recorded_sequence_is_played_in_order_and_ends() {
    let folder = tempfile::tempdir().unwrap();
    for (name, grey) in [("b.pgm", 9_u8), ("a.pgm", 3)] {
        let mut bytes = b"P5 2 1 255\n".to_vec();
        bytes.extend([grey; 2]);
        std::fs::write(folder.path().join(name), bytes).unwrap();
    }
    std::fs::write(folder.path().join("notes.txt"), "none").unwrap();
    let mut source = RecordedImages::open(folder.path(), 0.5).unwrap();
    let (one, two) = (source.latest().unwrap(), source.latest().unwrap());
    assert_eq!((one.image.pixels()[0], one.time, one.number), (3, 0.0, 0));
    assert_eq!((two.image.pixels()[0], two.time, two.number), (9, 0.5, 1));
    let end = source.latest().unwrap_err();
    assert!(
        matches!(end, VisionError::EndOfSequence { images: 2, .. }),
        "{end}"
    );
    let empty = tempfile::tempdir().unwrap();
    assert!(RecordedImages::open(empty.path(), 0.5).is_err());
    assert!(RecordedImages::open(&empty.path().join("missing"), 0.5).is_err());
}

#[test]
fn a_region_of_interest_is_a_part_and_stays_within_the_image() {
    let (sender, source) = threaded(Duration::from_secs(600));
    let mut part = RegionOfInterest::new(source, Crop::Rectangle((1, 1), (2, 2)));
    sender.send(frame(5)).unwrap();
    let found = wait_for(&mut part, 5);
    assert_eq!((found.image.width(), found.image.height()), (2, 2));
    assert_eq!(found.time, 5.0 / 30.0);
    let (sender, source) = threaded(Duration::from_secs(600));
    let mut outside = RegionOfInterest::new(source, Crop::Rectangle((1, 1), (9, 9)));
    sender.send(frame(1)).unwrap();
    let error = loop {
        match outside.latest() {
            Err(VisionError::NoImageYet { .. }) => std::thread::yield_now(),
            Err(error) => break error,
            Ok(_) => panic!("a region beyond the image was accepted"),
        }
    };
    assert!(matches!(error, VisionError::Device(_)), "{error}");
}
