//! Prints the log of the libraries in the form of stock's log lines.
//!
//! `[INFO] |yarp.os.Port| Port /read active at tcp://127.0.0.1:10002/`: information and below on
//! standard output, warnings and errors on standard error. Verified against stock 3.5.0.

use std::fmt;
use std::io;

use tracing::field::{Field, Visit};
use tracing::{Event, Level, Metadata, Subscriber};
use tracing_subscriber::filter::LevelFilter;
use tracing_subscriber::fmt::format::Writer;
use tracing_subscriber::fmt::{FmtContext, FormatEvent, FormatFields, MakeWriter};
use tracing_subscriber::registry::LookupSpan;

/// Starts to print the log.
pub(crate) fn start() {
    let subscriber = tracing_subscriber::fmt()
        // If the reader of the log is gone (`yarp read /x | head`), errors are ignored.
        .log_internal_errors(false)
        .with_max_level(level(|name| {
            std::env::var(name).is_ok_and(|value| is_on(&value))
        }))
        .event_format(StockFormat)
        .with_writer(Streams)
        .finish();
    // This fails only if a logger is installed already, which then prints.
    let _ = tracing::subscriber::set_global_default(subscriber);
}

/// Returns the level that stock's environment variables select.
fn level(is_set: impl Fn(&str) -> bool) -> LevelFilter {
    if is_set("YARP_TRACE_ENABLE") {
        LevelFilter::TRACE
    } else if is_set("YARP_DEBUG_ENABLE") {
        LevelFilter::DEBUG
    } else if is_set("YARP_QUIET") {
        LevelFilter::WARN
    } else {
        LevelFilter::INFO
    }
}

fn is_on(value: &str) -> bool {
    !matches!(value, "" | "0" | "false" | "off" | "no")
}

/// Writes to standard output up to information, and to standard error beyond.
struct Streams;

impl MakeWriter<'_> for Streams {
    type Writer = Box<dyn io::Write>;

    fn make_writer(&self) -> Self::Writer {
        Box::new(io::stdout())
    }

    fn make_writer_for(&self, metadata: &Metadata<'_>) -> Self::Writer {
        if *metadata.level() <= Level::WARN {
            Box::new(io::stderr())
        } else {
            Box::new(io::stdout())
        }
    }
}

struct StockFormat;

impl<S, N> FormatEvent<S, N> for StockFormat
where
    S: Subscriber + for<'a> LookupSpan<'a>,
    N: for<'a> FormatFields<'a> + 'static,
{
    fn format_event(
        &self,
        _context: &FmtContext<'_, S, N>,
        mut writer: Writer<'_>,
        event: &Event<'_>,
    ) -> fmt::Result {
        let metadata = event.metadata();
        let level = match *metadata.level() {
            Level::ERROR => "ERROR",
            Level::WARN => "WARNING",
            Level::INFO => "INFO",
            Level::DEBUG => "DEBUG",
            Level::TRACE => "TRACE",
        };
        let mut message = Message::default();
        event.record(&mut message);
        let component = component(metadata.target(), &message.0);
        writeln!(writer, "[{level}] |{component}| {}", message.0)
    }
}

/// Text of an event; its fields repeat what the text says.
#[derive(Default)]
struct Message(String);

impl Visit for Message {
    fn record_debug(&mut self, field: &Field, value: &dyn fmt::Debug) {
        if field.name() == "message" {
            self.0 = format!("{value:?}");
        }
    }
}

/// Returns stock's name for the component of an event.
fn component(target: &str, message: &str) -> String {
    let connection = |ends: &[&str]| ends.iter().any(|end| message.starts_with(end));
    if target.starts_with("yarp.") {
        target.to_owned()
    } else if connection(&["Receiving input", "Removing input"]) {
        "yarp.os.impl.PortCoreInputUnit".to_owned()
    } else if connection(&["Sending output", "Removing output"]) {
        "yarp.os.impl.PortCoreOutputUnit".to_owned()
    } else if target.starts_with("yarp_ports::port") {
        "yarp.os.Port".to_owned()
    } else if target.starts_with("yarp_ports::remote_admin") {
        "yarp.os.Network".to_owned()
    } else {
        target.replace("::", ".")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn components_are_named_as_in_stock() {
        let check = |target: &str, message: &str, expected: &str| {
            assert_eq!(component(target, message), expected);
        };
        check(
            "yarp_ports::port",
            "Port /r active at tcp://h:1/",
            "yarp.os.Port",
        );
        let input = "Receiving input from /a to /b using tcp";
        check(
            "yarp_ports::port::core",
            input,
            "yarp.os.impl.PortCoreInputUnit",
        );
        let output = "Removing output from /a to /b";
        check(
            "yarp_ports::port::core",
            output,
            "yarp.os.impl.PortCoreOutputUnit",
        );
        check(
            "yarp_ports::remote_admin",
            "Connection found",
            "yarp.os.Network",
        );
        check("yarp.os.Ping", "Ping #2:", "yarp.os.Ping");
        check("yarp_devices::wam", "x", "yarp_devices.wam");
    }

    #[test]
    fn the_environment_chooses_the_level() {
        let check = |set: &[&str], expected: LevelFilter| {
            assert_eq!(level(|name| set.contains(&name)), expected);
        };
        check(&[], LevelFilter::INFO);
        check(&["YARP_QUIET"], LevelFilter::WARN);
        check(&["YARP_DEBUG_ENABLE", "YARP_QUIET"], LevelFilter::DEBUG);
        check(&["YARP_TRACE_ENABLE"], LevelFilter::TRACE);
    }
}
