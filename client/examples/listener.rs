//! Prints what `/talker` publishes: `cargo run --example listener`.

use yarp_client::prelude::*;

fn main() -> Result<()> {
    let listener = Subscriber::<Bottle>::open("/listener")?;
    listener.connect("/talker")?;
    for message in &listener {
        println!("{}", message?.value);
    }
    Ok(())
}
