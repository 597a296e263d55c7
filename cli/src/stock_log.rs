//! Reports of the libraries, in the form of stock's log lines.
//!
//! `[INFO] |yarp.os.Port| Port /read active at tcp://127.0.0.1:10002/`: information and below on
//! standard output, warnings and errors on standard error. Checked against stock 3.5.0.
//!
//! A line never makes the thread that reports it wait ([`crate::output`]). What others chose, such as the name of a
//! sender, is printed without control characters and cut to a bounded length ([`foreign_text`]), and what the libraries report
//! again and again is limited to a rate ([`rate_limit`]).

mod foreign_text;
mod forwarded_line;
mod forwarded_log;
mod rate_limit;
mod shown_log;

use std::fmt;
use std::io;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::Instant;

use tracing::callsite::Identifier;
use tracing::field::{Field, Visit};
use tracing::{Event, Level, Metadata, Subscriber};
use tracing_subscriber::filter::LevelFilter;
use tracing_subscriber::fmt::format::Writer;
use tracing_subscriber::fmt::{FmtContext, FormatEvent, FormatFields, MakeWriter};
use tracing_subscriber::layer::SubscriberExt as _;
use tracing_subscriber::registry::LookupSpan;

use crate::output::{self, Stream, WhenFull};
pub(crate) use forwarded_log::{finish_forwarding, start_forwarding};
use rate_limit::Repeats;
pub(crate) use shown_log::show_in;

/// Prefix of the modules of this program, as opposed to those of the libraries.
const OWN_MODULES: &str = concat!(env!("CARGO_BIN_NAME"), "::");

/// Starts to print the log.
pub(crate) fn start() {
    let subscriber = tracing_subscriber::fmt()
        // If the reader of the log is gone (`yarp read /x | head`), errors are ignored.
        .log_internal_errors(false)
        .with_max_level(level(is_set))
        .event_format(StockFormat {
            forwarded: is_set("YARPRUN_IS_FORWARDING_LOG"),
        })
        .with_writer(Streams)
        .finish()
        .with(shown_log::ShownLog)
        .with(forwarded_log::ForwardedLog);
    // This fails only if a logger is installed already, which then prints.
    let _ = tracing::subscriber::set_global_default(subscriber);
}

/// True once standard output is for results alone.
static IS_APART: AtomicBool = AtomicBool::new(false);

/// Sends the whole log to standard error from now on, so that a program can read the result from standard output.
#[cfg(any(feature = "table", feature = "vision"))]
pub(crate) fn keep_apart() {
    IS_APART.store(true, Ordering::Relaxed);
}

/// Lines that wait for the guard of [`hold_back`].
static HELD: Mutex<Option<Vec<HeldLine>>> = Mutex::new(None);
/// Maximum number of lines that are held back.
const MAX_HELD: usize = 1000;

type HeldLine = (Stream, Vec<u8>, WhenFull);

/// Holds the log back until the guard is dropped, so that a command can print its first line before it.
pub(crate) fn hold_back() -> HeldBack {
    *held() = Some(Vec::new());
    HeldBack
}

/// Guard of [`hold_back`].
#[must_use]
pub(crate) struct HeldBack;

impl Drop for HeldBack {
    fn drop(&mut self) {
        let mut lines = held();
        for (stream, text, when_full) in lines.take().into_iter().flatten() {
            // As for a line of the log that its reader does not take.
            let _ = output::push(stream, &text, when_full);
        }
    }
}

fn held() -> MutexGuard<'static, Option<Vec<HeldLine>>> {
    HELD.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Prints a line, or holds it back.
fn push(stream: Stream, text: &[u8], when_full: WhenFull) -> io::Result<()> {
    if let Some(lines) = held().as_mut().filter(|lines| lines.len() < MAX_HELD) {
        lines.push((stream, text.to_vec(), when_full));
        return Ok(());
    }
    output::push(stream, text, when_full)
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

/// Returns whether a variable of the environment is set to a true value.
fn is_set(name: &str) -> bool {
    std::env::var(name).is_ok_and(|value| is_on(&value))
}

fn is_on(value: &str) -> bool {
    !matches!(value, "" | "0" | "false" | "off" | "no")
}

/// Writes to standard output up to information, and to standard error beyond.
struct Streams;

impl MakeWriter<'_> for Streams {
    type Writer = Line;

    fn make_writer(&self) -> Self::Writer {
        Line {
            level: Level::INFO,
            limited: None,
            when_full: WhenFull::Drop,
        }
    }

    fn make_writer_for(&self, metadata: &Metadata<'_>) -> Self::Writer {
        let level = *metadata.level();
        let module = metadata.module_path().unwrap_or_default();
        // What a command was asked to find out is printed whole.
        let own = module.starts_with(OWN_MODULES);
        Line {
            level,
            // Who asked for more than information wants all of it.
            limited: (!own && level <= Level::INFO).then(|| metadata.callsite()),
            when_full: if own { WhenFull::Wait } else { WhenFull::Drop },
        }
    }
}

/// One line on its way to its stream.
struct Line {
    level: Level,
    /// The place in the code that reports it, if such lines are limited to a rate.
    limited: Option<Identifier>,
    when_full: WhenFull,
}

impl io::Write for Line {
    fn write(&mut self, text: &[u8]) -> io::Result<usize> {
        static REPEATS: Repeats = Repeats::new();
        let stream = match self.level <= Level::WARN || IS_APART.load(Ordering::Relaxed) {
            true => Stream::Err,
            false => Stream::Out,
        };
        if let Some(place) = &self.limited {
            let Some(left_out) = REPEATS.admit(place.clone(), Instant::now()) else {
                return Ok(text.len());
            };
            if left_out > 0 {
                let level = level_name(self.level);
                let told = format!(
                    "[{level}] |yarp.os.Log| {left_out} lines like the next one left out\n"
                );
                push(stream, told.as_bytes(), self.when_full)?;
            }
        }
        push(stream, text, self.when_full)?;
        Ok(text.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

/// Returns stock's name of a level.
fn level_name(level: Level) -> &'static str {
    match level {
        Level::ERROR => "ERROR",
        Level::WARN => "WARNING",
        Level::INFO => "INFO",
        Level::DEBUG => "DEBUG",
        Level::TRACE => "TRACE",
    }
}

struct StockFormat {
    /// Lines for a `yarp run` that forwards the output of this process to a logger.
    forwarded: bool,
}

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
        let level = level_name(*event.metadata().level());
        let (component, message) = text_of(event);
        if self.forwarded {
            let line = forwarded_line::line(level, &component, &message);
            return writeln!(writer, "{line}");
        }
        writeln!(writer, "[{level}] |{component}| {message}")
    }
}

/// Returns stock's name for the component of an event, and its message as it may be printed.
fn text_of(event: &Event<'_>) -> (String, String) {
    let mut message = Message::default();
    event.record(&mut message);
    let component = component(event.metadata().target(), &message.text);
    let text = message.with_reason();
    (component, foreign_text::cleaned(&text).to_string())
}

/// Text of an event and its field `error`; its other fields repeat what the text says.
#[derive(Default)]
struct Message {
    text: String,
    error: Option<String>,
}

impl Message {
    /// Returns the text, with the error behind it unless the text contains it.
    fn with_reason(self) -> String {
        match self.error {
            Some(error) if !self.text.contains(&error) => format!("{}: {error}", self.text),
            _ => self.text,
        }
    }
}

impl Visit for Message {
    fn record_debug(&mut self, field: &Field, value: &dyn fmt::Debug) {
        match field.name() {
            "message" => self.text = format!("{value:?}"),
            "error" => self.error = Some(format!("{value:?}")),
            _ => {}
        }
    }

    fn record_str(&mut self, field: &Field, value: &str) {
        self.record_debug(field, &format_args!("{value}"));
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

    /// "the attempt failed" was all that the log said.
    #[test]
    fn an_error_is_behind_the_text_unless_the_text_has_it() {
        let text = |text: &str, error: Option<&str>| {
            let error = error.map(str::to_owned);
            let text = text.to_owned();
            Message { text, error }.with_reason()
        };
        assert_eq!(text("failed", Some("no path")), "failed: no path");
        assert_eq!(text("failed, no path", Some("no path")), "failed, no path");
        assert_eq!(text("done", None), "done");
    }

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
