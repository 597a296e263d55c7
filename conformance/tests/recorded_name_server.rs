//! Recorded conversations with stock name servers, played against ours.

use yarp_conformance::capture::Capture;
use yarp_conformance::traffic_replay;
use yarp_nameserver::{Server, ServerOptions};

/// Port of the recorded name servers.
const NAME_SERVER: u16 = 10000;

/// Names that an earlier scenario had left at the recorded server, which appear in the list.
const LEFT_BEHIND: [&str; 1] = ["/tmp/port/1"];

#[tokio::test]
async fn the_name_server_answers_as_stock_does() {
    for generation in ["yarp-3.12", "yarp-4.0"] {
        for scenario in [
            "name_commands",
            "admin",
            "rpc",
            "text_mode",
            "read_write_tcp",
            "read_write_fast_tcp",
            "read_write_text",
            "read_write_text_ack",
        ] {
            let options = ServerOptions::default().at("127.0.0.1", 0);
            let server = Server::start(options).await.expect("a name server");
            let capture = Capture::load(generation, scenario);
            for name in LEFT_BEHIND.iter().filter(|name| capture.mentions(name)) {
                let register = format!("register {name}");
                server.network().ask(&register).await.expect("an answer");
            }
            let streams = capture.to(NAME_SERVER);
            let errors = traffic_replay::play_together(streams, ("127.0.0.1", server.port())).await;
            assert!(
                errors.is_empty(),
                "{}:\n{}",
                capture.what,
                errors.join("\n")
            );
            server.close().await;
        }
    }
}
