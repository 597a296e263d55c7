//! Adds numbers on request: `cargo run --example adder_server`, then `echo "1 2 3" | yarp rpc /adder`.

use yarp_client::prelude::*;

fn main() -> Result<()> {
    let server = RpcServer::open("/adder", |request: Bottle| {
        let sum: f64 = request.iter().filter_map(Value::as_f64).sum();
        bottle![sum]
    })?;
    println!("{} adds numbers until Enter", server.name());
    std::io::stdin().read_line(&mut String::new()).ok();
    Ok(())
}
