//! `mjpeg_images [NUMBER]`: a port that writes an image repeatedly, to be watched in a browser or
//! with VLC at the printed address.
//!
//! The left half is red, the right half blue; a white bar moves from left to right.

use std::time::Duration;

use yarp_ports::{Network, Port, PortOptions};
use yarp_wire::typed::{Image, PixelCode};

const WIDTH: usize = 320;
const HEIGHT: usize = 240;
const BAR: usize = 8;

#[tokio::main]
async fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut options = PortOptions::new().unregistered();
    if let Some(number) = std::env::args().nth(1) {
        options = options.tcp_port(number.parse()?);
    }
    let port = Port::open(&Network::none(), "/pictures", options).await?;
    println!("http://127.0.0.1:{}/?action=stream", port.tcp_port());
    for begin in (0..WIDTH).step_by(BAR).cycle() {
        let row = (0..WIDTH).flat_map(|x| match x {
            _ if (begin..begin + BAR).contains(&x) => [255; 3],
            ..160 => [200, 30, 30],
            _ => [30, 30, 200],
        });
        let pixels = row.collect::<Vec<u8>>().repeat(HEIGHT);
        let image = Image::from_packed(PixelCode::RGB, WIDTH, HEIGHT, pixels)?;
        // A slow reader misses some.
        port.write_if_idle(&image, None);
        tokio::time::sleep(Duration::from_millis(50)).await;
    }
    Ok(())
}
