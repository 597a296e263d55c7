//! Takes an image of the camera of `yarp camera`: `cargo run --example camera`.

use yarp_client::prelude::*;

fn main() -> Result<()> {
    let camera = Camera::connect("/grabber")?;
    let (width, height) = camera.image_size()?;
    let frame = camera.image()?;
    println!("image {} of {width} x {height} pixels", frame.number);
    Ok(())
}
