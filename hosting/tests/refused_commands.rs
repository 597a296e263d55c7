//! The first command that a server refuses is logged as a warning, later ones as information.

mod support;

use std::fmt;
use std::sync::{Arc, Mutex};

use support::Stage;
use tracing::field::{Field, Visit};
use tracing::span::{Attributes, Id, Record};
use tracing::{Event, Level, Metadata, Subscriber};
use yarp_devices::{Axes, Device};

/// Collects the messages of all threads.
#[derive(Clone, Default)]
struct Log(Arc<Mutex<Vec<(Level, String)>>>);

struct Message(String);

impl Visit for Message {
    fn record_debug(&mut self, field: &Field, value: &dyn fmt::Debug) {
        if field.name() == "message" {
            self.0 = format!("{value:?}");
        }
    }
}

impl Subscriber for Log {
    fn enabled(&self, _: &Metadata<'_>) -> bool {
        true
    }

    fn new_span(&self, _: &Attributes<'_>) -> Id {
        Id::from_u64(1)
    }

    fn record(&self, _: &Id, _: &Record<'_>) {}

    fn record_follows_from(&self, _: &Id, _: &Id) {}

    fn event(&self, event: &Event<'_>) {
        let mut message = Message(String::new());
        event.record(&mut message);
        let mut events = self.0.lock().unwrap();
        events.push((*event.metadata().level(), message.0));
    }

    fn enter(&self, _: &Id) {}

    fn exit(&self, _: &Id) {}
}

#[test]
fn the_first_refused_command_is_a_warning() {
    let log = Log::default();
    tracing::subscriber::set_global_default(log.clone()).expect("it is the only one");
    let stage = Stage::new();
    let text =
        "attached_device fakeMotionControl\nwrapper_device controlBoard_nws_yarp\nname /arm\n";
    let served = stage.open("deviceBundler", text).expect("it opens");
    let remote = stage.remote("/arm");
    let control = remote.position_control().expect("it moves");
    control
        .position_move(Axes::All, &[-5.0])
        .expect("it moves both ways");
    for _ in 0..2 {
        control
            .position_move(Axes::All, &[1e6])
            .expect_err("it is out of range");
    }
    drop(remote);
    stage.runtime.block_on(served.close());
    let events = log.0.lock().unwrap();
    let refused = events.iter().filter(|(_, text)| text.contains("refused: "));
    let levels: Vec<_> = refused.map(|(level, _)| *level).collect();
    assert_eq!(levels, [Level::WARN, Level::INFO], "{events:?}");
}
