//! `local` passes messages to a reader of the same process, without copying them.

use crate::common;

use common::{Raw, at, bottle, connect, next, open, within};
use yarp_ports::{Answer, PortOptions, Queue};
use yarp_wire::Bottle;
use yarp_wire::typed::{Image, PixelCode};

#[tokio::test]
async fn the_pixels_of_an_image_are_not_copied() {
    let reader = open("/reader", PortOptions::new().queue(Queue::Wait(1))).await;
    let writer = open("/writer", PortOptions::new()).await;
    connect(&writer, &reader, "local").await;
    let image = Image::new(PixelCode::RGB, 640, 480).unwrap();
    let (_, read) = within(async { tokio::join!(writer.write(&image), reader.read()) }).await;
    let received = read.unwrap();
    let seen: Image = received.read().unwrap();
    assert_eq!(seen, image);
    assert_eq!(seen.pixels().as_ptr(), image.pixels().as_ptr());
    // A reader that expects another type gets it as well.
    assert_eq!(received.bottle().unwrap().len(), 4);
    assert_eq!(*received.from, *"/writer");
}

#[tokio::test]
async fn a_writer_waits_for_its_reader_alone() {
    let slow = open("/slow", PortOptions::new().queue(Queue::Wait(1))).await;
    let quick = open("/quick", PortOptions::new().queue(Queue::Latest)).await;
    let writer = open("/writer", PortOptions::new()).await;
    connect(&writer, &slow, "local").await;
    within(writer.connect(&at(&quick, "local"))).await.unwrap();
    for number in 0..3 {
        writer.write_strict(&Bottle::of(number), None).await;
    }
    let last = Bottle::of(3);
    let writing = writer.write(&last);
    let reading = async {
        for number in 0..4 {
            assert_eq!(next(&slow).await, number.to_string());
        }
    };
    let (taken, ()) = within(async { tokio::join!(writing, reading) }).await;
    assert_eq!(taken, 2);
    assert_eq!(next(&quick).await, "3");
}

#[tokio::test]
async fn both_ends_notice_the_end() {
    let reader = open("/reader", PortOptions::new().queue(Queue::Latest)).await;
    let writer = open("/writer", PortOptions::new()).await;
    connect(&writer, &reader, "local").await;
    assert_eq!(reader.inputs(), ["/writer"]);
    assert!(within(writer.disconnect("/reader")).await);
    common::until(|| reader.inputs().is_empty()).await;
    connect(&writer, &reader, "local").await;
    within(reader.close()).await;
    common::until(|| writer.outputs().is_empty()).await;
    assert_eq!(within(writer.write(&bottle("x"))).await, 0);
    within(writer.close()).await;
}

#[tokio::test]
async fn a_reader_that_panics_ends_the_connection() {
    let options = PortOptions::new().handler(|_| panic!("as the test wants it"));
    let reader = open("/reader", options).await;
    let writer = open("/writer", PortOptions::new()).await;
    connect(&writer, &reader, "local").await;
    assert_eq!(within(writer.write(&bottle("x"))).await, 0);
    common::until(|| writer.outputs().is_empty() && reader.inputs().is_empty()).await;
}

#[tokio::test]
async fn ports_that_talk_to_themselves_do_not_hang() {
    let options = PortOptions::new().handler(|request| match request.bottle() {
        Ok(bottle) => Answer::reply(bottle),
        Err(_) => Answer::Nothing,
    });
    let port = open("/echo", options).await;
    within(port.connect(&at(&port, "local"))).await.unwrap();
    let answer: Bottle = within(port.call(&bottle("hello 5"))).await.unwrap();
    assert_eq!(answer.to_string(), "hello 5");
    within(port.close()).await;
}

#[tokio::test]
async fn a_reader_in_another_process_is_named_in_the_error() {
    let listener = tokio::net::TcpListener::bind("127.0.0.1:0").await.unwrap();
    let number = listener.local_addr().unwrap().port();
    let writer = open("/writer", PortOptions::new()).await;
    let elsewhere = format!("local://127.0.0.1:{number}/elsewhere");
    let error = within(writer.connect(&elsewhere))
        .await
        .unwrap_err()
        .to_string();
    assert!(
        error.contains("/elsewhere is not in this process"),
        "{error}"
    );
    assert!(writer.outputs().is_empty());
}

#[tokio::test]
async fn a_peer_of_another_process_is_refused() {
    let reader = open("/reader", PortOptions::new().queue(Queue::Latest)).await;
    let mut peer = Raw::to(&reader).await;
    peer.send(b"LOCALITY\x03\0\0\0/w\0").await;
    peer.ended().await;
    assert!(reader.inputs().is_empty());
}
