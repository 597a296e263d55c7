//! A message is written once, however many readers there are.

use crate::common;

use std::sync::atomic::{AtomicUsize, Ordering};

use bytes::BytesMut;
use common::{Raw, at, open, until, within};
use yarp_ports::{PortOptions, Queue};
use yarp_wire::WireVersion;
use yarp_wire::message::WireObject;
use yarp_wire::typed::{Image, PixelCode};

/// An image that counts how often it is written.
struct Counted {
    image: Image,
    times: AtomicUsize,
}

impl WireObject for Counted {
    fn write_binary(&self, out: &mut BytesMut, wire_version: WireVersion) {
        self.times.fetch_add(1, Ordering::Relaxed);
        self.image.write_binary(out, wire_version);
    }
}

#[tokio::test]
async fn for_ten_readers_of_a_large_image() {
    let writer = open("/writer", PortOptions::new()).await;
    let mut readers = Vec::new();
    for (number, carrier) in (0..10).zip(["tcp", "fast_tcp", "unix_stream", "tcp", "udp"].repeat(2))
    {
        let options = PortOptions::new().queue(Queue::Wait(10));
        let reader = open(&format!("/reader/{number}"), options).await;
        within(writer.connect(&at(&reader, carrier))).await.unwrap();
        readers.push((reader, carrier));
    }
    let image = Image::from_packed(PixelCode::RGB, 640, 520, vec![7; 640 * 520 * 3]).unwrap();
    let message = Counted {
        image,
        times: AtomicUsize::new(0),
    };
    for round in 0..3 {
        let written = [
            within(writer.write(&message)).await,
            within(writer.write_strict(&message, None)).await,
            {
                within(writer.flush()).await;
                writer.write_if_idle(&message, None)
            },
        ];
        assert_eq!(written, [10; 3]);
        assert_eq!(message.times.load(Ordering::Relaxed), 3 * (round + 1));
        for (reader, carrier) in &readers {
            // The buffers of the system may not hold as many datagrams.
            if *carrier != "udp" {
                for _ in 0..3 {
                    let read: Image = within(reader.read()).await.unwrap().read().unwrap();
                    assert!(read == message.image);
                }
            }
        }
        within(writer.flush()).await;
    }
}

#[tokio::test]
async fn for_a_reader_and_a_viewer() {
    // The picture was made from a second writing of its own.
    let writer = open("/writer", PortOptions::new()).await;
    let reader = open("/reader", PortOptions::new().queue(Queue::Wait(10))).await;
    within(writer.connect(&at(&reader, "fast_tcp")))
        .await
        .unwrap();
    let mut browser = Raw::to(&writer).await;
    browser
        .send("GET /?action=stream HTTP/1.1\r\nHost: localhost\r\n\r\n")
        .await;
    until(|| writer.outputs().len() == 2).await;
    let message = Counted {
        image: Image::from_packed(PixelCode::RGB, 64, 48, vec![7; 64 * 48 * 3]).unwrap(),
        times: AtomicUsize::new(0),
    };
    assert_eq!(within(writer.write(&message)).await, 2);
    assert_eq!(message.times.load(Ordering::Relaxed), 1);
}
