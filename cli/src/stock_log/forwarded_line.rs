//! A line of the log in the form in which stock's programs hand it on.

use yarp_devices::clock::{TimeSource, wall_clock};
use yarp_wire::{Bottle, Value};

/// Returns a line: `(level INFO) (systemtime 1.5) (component yarp.os.Ping) (message "Ping #1:")`.
///
/// `level` is stock's name of a level. `networktime` is there if the process follows a clock, as in stock.
pub(super) fn line(level: &str, component: &str, message: &str) -> String {
    let mut line = Bottle::new()
        .with(pair("level", level.into()))
        .with(pair("systemtime", wall_clock().into()));
    let source = TimeSource::current();
    if source.is_network() {
        line = line.with(pair("networktime", source.now().into()));
    }
    line = line.with(pair("component", component.into()));
    if !message.is_empty() {
        line = line.with(pair("message", message.into()));
    }
    line.to_string()
}

/// Returns the line with which a program ends its log.
pub(super) fn last_line() -> String {
    Bottle::new()
        .with(pair("level", "INFO".into()))
        .with(pair("systemtime", wall_clock().into()))
        .with(pair("networktime", TimeSource::current().now().into()))
        .to_string()
}

fn pair(name: &str, value: Value) -> Value {
    Value::List([Value::from(name), value].into_iter().collect())
}
