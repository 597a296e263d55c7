//! Serves the live view of a simulated arm, on a network of its own; ends with standard input.

use std::io::Read;
use std::sync::Arc;

use yarp_devices::wam::DynamicWam;
use yarp_nameserver::{Server, ServerOptions};
use yarp_view::{View, ViewOptions};
use yarp_wrappers::{ControlBoardOptions, ControlBoardServer};

#[tokio::main]
async fn main() -> Result<(), Box<dyn std::error::Error>> {
    let server = Server::start(ServerOptions::default().at("127.0.0.1", 0)).await?;
    let network = server.network();
    let arm = Arc::new(DynamicWam::start()?);
    let arm = ControlBoardServer::open(&network, arm, "/wam", ControlBoardOptions::new()).await?;
    let view = View::open(
        &network,
        ViewOptions::new("/wam").hand("/hand").control(true),
    )
    .await?;
    println!("Live view: {}", view.url());
    tokio::task::spawn_blocking(|| std::io::stdin().read_to_end(&mut Vec::new())).await??;
    view.close().await;
    arm.close().await;
    server.close().await;
    Ok(())
}
