//! Answers that do not depend on the state of the registry.

use yarp_wire::name_service::{Form, plain_text};
use yarp_wire::{Bottle, Value};

use super::Body;

/// The lines of `help`, as recorded from 3.12.3 and 4.0.0: programs show them to people.
const HELP: [&str; 13] = [
    "+ help",
    "+ list [$prefix]",
    "+ register $portname",
    "+ register $portname $carrier $ipAddress $portNumber",
    "  (if you want a field set automatically, write '...')",
    "+ unregister $portname",
    "+ query $portname",
    "+ set $portname $property $value",
    "+ get $portname $property",
    "+ check $portname $property",
    "+ route $port1 $port2",
    "+ runners",
    "  (to get a list of the yarprun ports)",
];

pub(super) fn help(form: Form) -> Body {
    match form {
        Form::Bot => Body::Bottle(HELP.into_iter().map(Value::from).collect()),
        Form::Plain => {
            let title = "Here are some ways to use the name server:";
            Body::lines([title].into_iter().chain(HELP))
        }
    }
}

/// Returns the answer to `route`: stock always proposes `tcp`, for any two ports.
pub(super) fn route(source: &str, destination: &str) -> String {
    let [source, destination] = [source, destination].map(plain_text);
    format!("port {source} route {destination} = tcp:/{destination}")
}

/// Returns the answer to the web command: stock's answer for a page that it does not have.
pub(super) fn web() -> Body {
    Body::Bottle(Bottle::of("web").with("Hmm."))
}
