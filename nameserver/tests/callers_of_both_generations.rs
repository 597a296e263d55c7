//! Who asks without saying of which generation it is gets floats as it reads them: its port is asked.

use yarp_nameserver::{Server, ServerOptions};
use yarp_ports::{Answer, Network, Port, PortOptions, Received};
use yarp_wire::{Bottle, Dialect};

const REPLY: &str = "[is] (1.5 2.5) 3.0";

#[tokio::test]
async fn floats_are_answered_as_the_caller_reads_them() {
    let place = ServerOptions::default().at("127.0.0.1", 0);
    let server = Server::start(place).await.unwrap();
    let network = Network::at("127.0.0.1", server.port());
    let options = PortOptions::new()
        .handler(move |_: &mut Received| Answer::reply(Bottle::parse(REPLY).unwrap()));
    let asked = Port::open(&network, "/asked", options).await.unwrap();
    for generation in [Dialect::V3, Dialect::V4] {
        // It takes for granted that it is answered in its own words, as stock does.
        let options = PortOptions::new()
            .dialect(generation)
            .readers_are(generation);
        let caller = Port::open(&network, "/caller", options).await.unwrap();
        for carrier in ["tcp", "fast_tcp", "text_ack"] {
            caller.connect_over("/asked", carrier).await.unwrap();
            for request in ["[get] [encs]", "[get] [encs]", "[get] 1.5", "[get]"] {
                let request = Bottle::parse(request).unwrap();
                let answer: Bottle = caller.call(&request).await.unwrap();
                assert_eq!(answer.to_string(), REPLY, "{generation} over {carrier}");
            }
            assert!(caller.disconnect("/asked").await);
        }
        caller.close().await;
    }
    asked.close().await;
    server.close().await;
}
