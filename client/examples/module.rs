//! A program with a parameter and an RPC port: `cargo run --example module -- --start 5`, `yarp rpc /counter/rpc:i`.

use yarp_client::prelude::*;

#[derive(Default)]
struct Counter {
    publisher: Option<Publisher<Bottle>>,
    count: i32,
}

impl Module for Counter {
    fn configure(&mut self, context: &Context) -> Result<()> {
        self.count = context.get_or("start", 0)?;
        self.publisher = Some(Publisher::open(&context.port_name("count:o"))?);
        Ok(())
    }

    fn update(&mut self) -> Result<Flow> {
        self.count += 1;
        let publisher = self.publisher.as_ref();
        publisher.map(|publisher| publisher.publish(&bottle![self.count]));
        Ok(Flow::Continue)
    }
}

fn main() -> Result<()> {
    run(Counter::default(), "counter")
}
