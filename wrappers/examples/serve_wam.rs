//! Serves a simulated WAM arm until it is interrupted.
//!
//! ```sh
//! cargo run -p yarp-wrappers --example serve_wam -- HOST PORT NAME [PERIOD_MS]
//! ```

use std::error::Error;
use std::sync::Arc;
use std::time::Duration;

use yarp_devices::wam::SimulatedWam;
use yarp_ports::Network;
use yarp_wrappers::{ControlBoardOptions, ControlBoardServer};

#[tokio::main]
async fn main() -> Result<(), Box<dyn Error>> {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let [host, port, name, rest @ ..] = &words[..] else {
        return Err("expected HOST PORT NAME [PERIOD_MS]".into());
    };
    let mut options = ControlBoardOptions::new();
    if let [period] = rest {
        options = options.period(Duration::from_millis(period.parse()?));
    }
    let network = Network::at(host, port.parse()?);
    let arm = Arc::new(SimulatedWam::new());
    let board = ControlBoardServer::open(&network, arm, name, options).await?;
    println!("{} is served", board.name());
    tokio::signal::ctrl_c().await?;
    board.close().await;
    Ok(())
}
