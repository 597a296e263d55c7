//! Asks `/adder` for a sum: `cargo run --example adder_client`.

use yarp_client::prelude::*;

fn main() -> Result<()> {
    let adder = RpcClient::connect("/adder")?;
    let sum: Bottle = adder.call(bottle![1, 2.5, 3])?;
    println!("{sum}");
    Ok(())
}
