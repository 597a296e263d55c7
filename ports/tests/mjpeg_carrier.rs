//! MJPEG: a port that writes images serves them to browsers, and one that reads pulls them.

use crate::common;

use common::{Raw, ask, at, bottle, open, until, within};
use yarp_ports::{Answer, PortOptions, Queue};
use yarp_wire::mjpeg::{PartReader, comment};
use yarp_wire::typed::{Image, PixelCode};
use yarp_wire::{Limits, Stamp, admin};

const REQUEST: &str = "GET /?action=stream HTTP/1.1\r\nHost: localhost\r\n\r\n";

/// Returns an image of one colour.
fn plain(red: u8, green: u8, blue: u8) -> Image {
    let pixels = [red, green, blue].repeat(64 * 48);
    Image::from_packed(PixelCode::RGB, 64, 48, pixels).unwrap()
}

/// Returns whether the middle of an image is about this colour.
fn is_about(image: &Image, colour: [u8; 3]) -> bool {
    let pixel = image.pixel(32, 24).unwrap();
    pixel.iter().zip(colour).all(|(a, b)| a.abs_diff(b) < 8)
}

#[tokio::test]
async fn a_browser_views_images() {
    let port = open("/camera", PortOptions::new()).await;
    let mut raw = Raw::to(&port).await;
    raw.send(REQUEST).await;
    until(|| port.outputs() == ["null"]).await;
    assert!(port.inputs().is_empty());
    // No picture can show these.
    let depth = Image::new(PixelCode::MONO_FLOAT, 4, 4).unwrap();
    assert_eq!(within(port.write(&bottle("1 2"))).await, 0);
    assert_eq!(within(port.write(&depth)).await, 0);
    let stamp = Stamp::new(7, 1.5);
    let image = plain(200, 30, 40);
    assert_eq!(within(port.write_with(&image, Some(stamp.into()))).await, 1);
    within(port.flush()).await;
    assert_eq!(port.write_if_idle(&image, None), 1);
    within(port.flush()).await;
    within(port.close()).await;
    let mut bytes = bytes::BytesMut::from(&raw.ended().await[..]);
    let mut reader = PartReader::new(Limits::DEFAULT);
    let first = reader.read(&mut bytes).unwrap().unwrap();
    assert_eq!(first.kind, "image/jpeg");
    assert_eq!(comment(&first.body), Some(stamp.to_string().into()));
    let second = reader.read(&mut bytes).unwrap().unwrap();
    assert_eq!(comment(&second.body), None);
    assert_eq!(reader.read(&mut bytes), Ok(None));
}

#[tokio::test]
async fn a_reader_pulls() {
    let camera = open("/camera", PortOptions::new()).await;
    let reader = open("/reader", PortOptions::new().queue(Queue::Wait(4))).await;
    let request = admin::add(&at(&camera, "mjpeg"));
    let answer = ask(&reader, &request).await;
    let expected = format!(
        "0 \"Added connection from /reader to {}\\r\\n\"",
        at(&camera, "mjpeg")
    );
    assert_eq!(answer, expected);
    until(|| reader.inputs() == ["/camera"]).await;
    until(|| camera.outputs() == ["null"]).await;
    assert_eq!(
        ask(&reader, &bottle("[list] [in] /camera")).await,
        "(from \"/camera\") (to \"/reader\") (carrier mjpeg) (push 0)"
    );
    let stamp = Stamp::new(7, 1.5);
    for (colour, envelope) in [([200, 30, 40], Some(stamp.into())), ([10, 220, 90], None)] {
        let [red, green, blue] = colour;
        let stamped = envelope.is_some();
        let image = plain(red, green, blue);
        assert_eq!(within(camera.write_with(&image, envelope)).await, 1);
        let received = within(reader.read()).await.unwrap();
        assert_eq!(&*received.from, "/camera");
        assert_eq!(received.stamp(), stamped.then_some(stamp));
        let image: Image = received.read().unwrap();
        assert_eq!((image.width(), image.height()), (64, 48));
        assert!(is_about(&image, colour), "{:?}", image.pixel(32, 24));
    }
    let answer = ask(&reader, &admin::remove("/camera")).await;
    assert!(
        answer.starts_with("0 \"Removing connection from /camera"),
        "{answer}"
    );
    until(|| reader.inputs().is_empty()).await;
    until(|| camera.outputs().is_empty()).await;
    within(reader.close()).await;
    within(camera.close()).await;
}

/// Images that arrive faster than they are decoded are queued, and are not lost when the writer
/// closes.
#[tokio::test]
async fn images_arrive_in_order_including_the_last() {
    const COUNT: usize = 24;
    let camera = open("/camera", PortOptions::new()).await;
    let reader = open("/reader", PortOptions::new().queue(Queue::Wait(COUNT))).await;
    within(reader.connect(&at(&camera, "mjpeg"))).await.unwrap();
    until(|| camera.outputs() == ["null"]).await;
    let sizes = (0..COUNT).map(|number| match number % 2 {
        0 => (800, 600 + number),
        _ => (16, 16 + number),
    });
    for (number, (width, height)) in sizes.clone().enumerate() {
        let image = Image::new(PixelCode::RGB, width, height).unwrap();
        let stamp = Stamp::new(number as i32, 1.5);
        let written = camera.write_with(&image, Some(stamp.into()));
        assert_eq!(within(written).await, 1);
    }
    within(camera.flush()).await;
    within(camera.close()).await;
    for (number, size) in sizes.enumerate() {
        let received = within(reader.read()).await.unwrap();
        assert_eq!(received.stamp().unwrap().count, number as i32);
        let image: Image = received.read().unwrap();
        assert_eq!((image.width(), image.height()), size);
    }
}

#[tokio::test]
async fn either_port_closing_ends_the_connection() {
    let camera = open("/camera", PortOptions::new()).await;
    let reader = open("/reader", PortOptions::new().queue(Queue::Latest)).await;
    within(reader.connect(&at(&camera, "mjpeg"))).await.unwrap();
    // The newer connection replaces the older one.
    within(reader.connect(&at(&camera, "mjpeg"))).await.unwrap();
    until(|| reader.inputs() == ["/camera"] && camera.outputs() == ["null"]).await;
    within(reader.close()).await;
    until(|| camera.outputs().is_empty()).await;
    let reader = open("/reader", PortOptions::new().queue(Queue::Latest)).await;
    within(reader.connect(&at(&camera, "mjpeg"))).await.unwrap();
    within(camera.close()).await;
    until(|| reader.inputs().is_empty()).await;
    within(reader.close()).await;
}

/// Each answers the request in its own way; none may do harm, and the valid image still arrives.
#[tokio::test]
async fn invalid_images_are_skipped_or_refused() {
    use tokio::io::{AsyncReadExt, AsyncWriteExt};
    let reader = open("/reader", PortOptions::new().queue(Queue::Wait(4))).await;
    let good = {
        let camera = open("/camera", PortOptions::new()).await;
        let mut raw = Raw::to(&camera).await;
        raw.send(REQUEST).await;
        until(|| camera.outputs() == ["null"]).await;
        within(camera.write(&plain(1, 2, 200))).await;
        within(camera.close()).await;
        raw.ended().await
    };
    let boundary = good.windows(4).position(|w| w == b"\r\n\r\n").unwrap() + 4;
    let (head, rest) = good.split_at(boundary);
    let bad =
        b"--boundarydonotcross\r\nContent-Type: image/jpeg\r\nContent-Length: 4\r\n\r\nabcd\r\n";
    let listener = tokio::net::TcpListener::bind("127.0.0.1:0").await.unwrap();
    let number = listener.local_addr().unwrap().port();
    let serving = tokio::spawn(async move {
        for answer in [
            b"SSH-2.0\r\n".to_vec(),
            b"HTTP/1.0 404 Not Found\r\n\r\n".to_vec(),
            b"HTTP/1.0 200 OK\r\nContent-Type: text/html\r\n\r\n".to_vec(),
            Vec::new(),
        ] {
            let (mut stream, _) = listener.accept().await.unwrap();
            let _ = stream.write_all(&answer).await;
        }
        let (stream, _) = listener.accept().await.unwrap();
        stream
    });
    let contact = format!("mjpeg+path.cam1://127.0.0.1:{number}/camera");
    for _ in 0..4 {
        let error = within(reader.connect(&contact)).await.unwrap_err();
        assert!(error.to_string().contains("/camera"), "{error}");
    }
    let connecting = tokio::spawn({
        let head = head.to_vec();
        let rest = [&bad[..], rest].concat();
        async move {
            let mut stream = serving.await.unwrap();
            let mut request = vec![0; "GET /cam1 HTTP/1.0\r\n".len()];
            stream.read_exact(&mut request).await.unwrap();
            assert_eq!(request, b"GET /cam1 HTTP/1.0\r\n");
            stream.write_all(&head).await.unwrap();
            stream.write_all(&rest).await.unwrap();
            stream
        }
    });
    within(reader.connect(&contact)).await.unwrap();
    let _stream = within(connecting).await.unwrap();
    let image: Image = within(reader.read()).await.unwrap().read().unwrap();
    assert!(is_about(&image, [1, 2, 200]));
    within(reader.close()).await;
}

/// A port that serves requests may read images, though it has no outputs.
#[tokio::test]
async fn pulling_is_no_output() {
    let camera = open("/camera", PortOptions::new()).await;
    let reader = open("/reader", PortOptions::new().rpc_server()).await;
    within(reader.connect(&at(&camera, "mjpeg"))).await.unwrap();
    let refused = within(reader.connect(&at(&camera, "tcp"))).await;
    refused.unwrap_err();
    let handled = PortOptions::new().handler(|_| Answer::Nothing);
    let other = open("/other", handled).await;
    within(other.connect(&at(&camera, "mjpeg"))).await.unwrap();
    until(|| camera.outputs() == ["null", "null"]).await;
    within(other.close()).await;
    within(reader.close()).await;
    within(camera.close()).await;
}

/// A third program connects them by asking the reader, and asks it again to close the connection.
#[tokio::test]
async fn others_connect_two_ports() {
    use yarp_ports::{Network, remote_admin};
    let camera = open("/camera", PortOptions::new()).await;
    let reader = open("/reader", PortOptions::new().queue(Queue::Latest)).await;
    let network = Network::none().with_timeout(common::DEADLINE);
    let (from, to) = (at(&camera, "tcp"), at(&reader, "tcp"));
    let said = within(remote_admin::connect(&network, &from, &to, Some("mjpeg"))).await;
    assert_eq!(
        said.unwrap(),
        format!("Added connection from /reader to {}", at(&camera, "mjpeg"))
    );
    until(|| camera.outputs() == ["null"]).await;
    let said = within(remote_admin::disconnect(&network, &from, &to)).await;
    assert_eq!(said.unwrap(), "Removing connection from /camera to /reader");
    until(|| camera.outputs().is_empty() && reader.inputs().is_empty()).await;
    let again = within(remote_admin::disconnect(&network, &from, &to)).await;
    assert!(
        matches!(again, Err(remote_admin::ConnectError::NoConnection)),
        "{again:?}"
    );
    within(reader.close()).await;
    within(camera.close()).await;
}
