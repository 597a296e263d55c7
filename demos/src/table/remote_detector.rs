//! A detector that asks another program.

use std::thread::sleep;
use std::time::{Duration, Instant};

use yarp_client::{Bottle, Network, RpcClient, Value, bottle};
use yarp_manipulation::{DetectError, Detector, Item};

use super::item_message;

/// Name in reports.
const NAME: &str = "port";
/// Timeout of a reply: a camera that delivers nothing new is waited for there.
const REPLY_TIMEOUT: Duration = Duration::from_secs(40);
/// Time within which a program that ended may be started again.
const ABSENCE_TIMEOUT: Duration = Duration::from_secs(20);
/// Interval between two attempts to reach it.
const RETRY_INTERVAL: Duration = Duration::from_millis(500);

/// A detector at the port of another program, such as `yarp vision serve`: it answers `list` with the objects on the table.
///
/// A program that ends and is started again within 20 s is asked again.
#[derive(Debug)]
pub struct RemoteDetector {
    network: Network,
    client: Option<RpcClient>,
    peer: String,
    absence_timeout: Duration,
}

impl RemoteDetector {
    /// Connects to the port of this name.
    ///
    /// Errors: those of [`RpcClient::connect_on`].
    pub fn connect(network: &Network, peer: &str) -> yarp_client::Result<Self> {
        let mut detector = Self {
            network: network.clone(),
            client: None,
            peer: peer.to_owned(),
            absence_timeout: ABSENCE_TIMEOUT,
        };
        detector.client()?;
        Ok(detector)
    }

    fn client(&mut self) -> yarp_client::Result<&RpcClient> {
        let client = match self.client.take() {
            Some(client) => client,
            None => {
                let client = RpcClient::connect_on(&self.network, "...", &self.peer)?;
                client.with_timeout(REPLY_TIMEOUT)
            }
        };
        Ok(self.client.insert(client))
    }

    /// Asks until there is a reply; a connection that failed is made anew.
    fn ask(&mut self) -> Result<Bottle, DetectError> {
        let start = Instant::now();
        loop {
            let asked = self
                .client()
                .and_then(|client| client.call(bottle!["list"]));
            let error = match asked {
                Ok(reply) => return Ok(reply),
                Err(error) => error,
            };
            tracing::warn!(
                peer = self.peer,
                error = yarp_client::ports::error_chain(&error),
                "the detector does not answer"
            );
            self.client = None;
            let waited = start.elapsed();
            if waited >= self.absence_timeout {
                return Err(DetectError::Stale {
                    detector: NAME,
                    peer: self.peer.clone(),
                    seconds: waited.as_secs_f64(),
                });
            }
            sleep(RETRY_INTERVAL);
        }
    }
}

impl Detector for RemoteDetector {
    fn name(&self) -> &'static str {
        NAME
    }

    fn detect(&mut self) -> Result<Vec<Item>, DetectError> {
        let reply = self.ask()?;
        if reply.get(0).and_then(Value::as_str) != Some("is") {
            let why = format!("{} answered `{reply}`", self.peer);
            return Err(DetectError::Failed {
                detector: NAME,
                source: why.into(),
            });
        }
        let items: Vec<Item> = item_message::entries(&reply)
            .filter_map(item_message::read)
            .collect();
        Ok(items)
    }
}

#[cfg(test)]
mod tests {
    use yarp_client::RpcServer;
    use yarp_client::ports::blocking::wait;
    use yarp_nameserver::{Server, ServerOptions};

    use super::*;

    const PORT: &str = "/vision/rpc:i";

    fn serve(network: &Network, reply: &'static str) -> RpcServer {
        let answer = move |_: Bottle| reply.parse::<Bottle>().expect("a bottle");
        RpcServer::open_on(network, PORT, answer).expect("the name is free")
    }

    #[test]
    fn a_detector_that_is_started_again_is_asked_again_and_one_that_is_gone_is_named() {
        let names = wait(Server::start(ServerOptions::default().at("127.0.0.1", 0))).unwrap();
        let network = names.network();
        let one = "is (3 glass 0.5 0.1 0.0 0 0 0 (0.03 0.1) glass) (4 nonsense)";
        let server = serve(&network, one);
        let mut detector = RemoteDetector::connect(&network, PORT).unwrap();
        detector.absence_timeout = Duration::from_millis(1500);
        let numbers = |items: Vec<Item>| items.iter().map(|item| item.id).collect::<Vec<_>>();
        assert_eq!(numbers(detector.detect().unwrap()), [3]);
        drop(server);
        let again = serve(&network, one);
        assert_eq!(numbers(detector.detect().unwrap()), [3]);
        drop(again);
        match detector.detect() {
            Err(DetectError::Stale { peer, seconds, .. }) => {
                assert!(peer == PORT && seconds >= 1.5, "{peer} {seconds}");
            }
            other => panic!("{other:?}"),
        }
        let refusing = serve(&network, "fail \"the camera has moved\"");
        let error = detector.detect().unwrap_err().to_string();
        assert!(error.contains("the camera has moved"), "{error}");
        drop(refusing);
        wait(names.close());
    }
}
