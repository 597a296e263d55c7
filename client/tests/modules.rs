//! A module reads its parameters, is updated periodically, answers requests, and closes.

mod support;

use std::sync::mpsc::{Receiver, Sender, channel};
use std::thread;
use std::time::Duration;

use support::{TIMEOUT, name_server, registered};
use yarp_client::Network;
use yarp_client::module::run_with;
use yarp_client::prelude::*;

#[derive(Debug, PartialEq)]
enum Event {
    Configured {
        name: String,
        gain: f64,
        label: String,
    },
    Updated,
    Closed,
}

struct Probe {
    events: Sender<Event>,
    stop_after: Option<u32>,
}

impl Module for Probe {
    fn configure(&mut self, context: &Context) -> Result<()> {
        let event = Event::Configured {
            name: context.name().to_owned(),
            gain: context.get_or("gain", 1.0)?,
            label: context.get_or("label", String::new())?,
        };
        self.stop_after = context.get::<i32>("stop_after")?.map(|count| count as u32);
        self.events.send(event).expect("the test listens");
        Ok(())
    }

    fn update(&mut self) -> Result<Flow> {
        self.events.send(Event::Updated).ok();
        if let Some(left) = &mut self.stop_after {
            *left -= 1;
            if *left == 0 {
                return Ok(Flow::Stop);
            }
        }
        Ok(Flow::Continue)
    }

    fn period(&self) -> Duration {
        Duration::from_millis(1)
    }

    fn respond(&mut self, request: &Bottle) -> Option<Bottle> {
        (request.to_string() == "ping").then(|| bottle!["pong"])
    }

    fn help(&self) -> Vec<String> {
        vec!["ping: replies pong".to_owned()]
    }

    fn close(&mut self) {
        self.events.send(Event::Closed).ok();
    }
}

fn start(
    network: &Network,
    arguments: &[&str],
) -> (Receiver<Event>, thread::JoinHandle<Result<()>>) {
    let (events, received) = channel();
    let arguments: Vec<String> = arguments.iter().map(|&word| word.to_owned()).collect();
    let network = network.clone();
    let module = Probe {
        events,
        stop_after: None,
    };
    let running = thread::spawn(move || run_with(module, &network, &arguments, "probe"));
    (received, running)
}

#[test]
fn the_command_line_wins_over_the_file() {
    let (names, network) = name_server();
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("probe.ini");
    std::fs::write(&file, "gain 2.5\nlabel left\n").unwrap();
    let from = file.to_str().unwrap();
    let (events, running) = start(
        &network,
        &[
            "--from",
            from,
            "--name",
            "/lab/probe",
            "--label",
            "007",
            "--stop_after",
            "3",
        ],
    );
    running.join().unwrap().unwrap();
    let events: Vec<Event> = events.iter().collect();
    let configured = Event::Configured {
        name: "lab/probe".into(),
        gain: 2.5,
        label: "7".into(),
    };
    assert_eq!(events[0], configured);
    assert_eq!(
        events[1..],
        [
            Event::Updated,
            Event::Updated,
            Event::Updated,
            Event::Closed
        ]
    );
    assert_eq!(registered(&names), Vec::<String>::new());
}

#[test]
fn a_parameter_of_another_type_is_refused_by_name() {
    let (_names, network) = name_server();
    let (_, running) = start(&network, &["--gain", "much"]);
    let text = format!(
        "{:?}",
        running.join().unwrap().expect_err("it is no number")
    );
    assert!(
        text.contains("parameter gain") && text.contains("much"),
        "{text}"
    );
    let (_, running) = start(&network, &["--from", "/nowhere/at/all.ini"]);
    let missing = running
        .join()
        .unwrap()
        .expect_err("the file does not exist");
    assert!(matches!(missing, Error::Config(_)), "{missing:?}");
}

#[test]
fn its_rpc_port_answers_and_quit_closes_it() {
    let (names, network) = name_server();
    let (events, running) = start(&network, &[]);
    assert!(matches!(
        events.recv_timeout(TIMEOUT),
        Ok(Event::Configured { .. })
    ));
    assert!(matches!(events.recv_timeout(TIMEOUT), Ok(Event::Updated)));
    let client = RpcClient::connect_on(&network, "/me", "/probe/rpc:i").unwrap();
    let ask = |request: Bottle| client.call::<Bottle>(request).unwrap().to_string();
    assert_eq!(ask(bottle!["ping"]), "pong");
    let help = ask(bottle!["help"]);
    assert!(
        help.starts_with("[many]") && help.contains("ping: replies pong"),
        "{help}"
    );
    assert!(ask(bottle!["what"]).contains("unknown request what; try help"));
    assert_eq!(ask(bottle!["quit"]), "bye");
    running.join().unwrap().unwrap();
    assert_eq!(events.iter().last(), Some(Event::Closed));
    drop(client);
    assert_eq!(registered(&names), Vec::<String>::new());
}
