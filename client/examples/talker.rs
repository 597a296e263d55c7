//! Publishes a counter ten times a second: `cargo run --example talker`, then `yarp read ... /talker`.

use std::thread;
use std::time::Duration;

use yarp_client::prelude::*;

fn main() -> Result<()> {
    let talker = Publisher::open("/talker")?;
    for count in 0.. {
        talker.publish(&bottle!["hello", count]);
        thread::sleep(Duration::from_millis(100));
    }
    Ok(())
}
