//! `yarp read`: prints the messages that a port receives.

use std::io::Write;
use std::process::ExitCode;

use bytes::Bytes;
use yarp_ports::{PortOptions, Queue, Received};
use yarp_wire::{Bottle, Stamp, Value};

use super::argument_words::take_value;
use crate::error::Result;
use crate::network_access;
use crate::port_connections::{self, Verbosity};
use crate::signals::Interrupt;
use crate::stock_format::{complain, leading_integer};

/// Maximum number of messages queued for printing; beyond that the writer waits.
const MAX_QUEUED: usize = 64;
/// Default maximum number of characters of a message with `trim`.
const DEFAULT_TRIM: usize = 80;

/// read from the network and print to standard output
///
/// Opens a port and prints each message that arrives as a Bottle.
///
/// Ends on Ctrl-C, or when `yarp write ... verbatim` at the other end ends.
#[derive(Debug, clap::Args)]
#[command(after_help = "\
Words after the port:
  REMOTE       connect from this port first
  envelope     print the envelope (count and time) on a line of its own in front of each message
  envelope2    the same
  trim [N]     print at most N characters of each message (80)
  once         end after one message
  --type TYPE  register the port with this message type")]
pub(crate) struct Args {
    /// Port to open
    port: Option<String>,
    /// See below
    #[arg(
        value_name = "REMOTE | envelope | trim [N] | once",
        allow_hyphen_values = true,
        trailing_var_arg = true
    )]
    words: Vec<String>,
}

pub(super) async fn run(args: Args, out: &mut dyn Write) -> Result<ExitCode> {
    let Some(name) = args.port else {
        complain(
            out,
            "Usage:\n  yarp read <port> [remote port] [envelope] [trim [length]]",
        )?;
        return Ok(ExitCode::FAILURE);
    };
    let read_options = ReadOptions::parse(args.words);
    let network = network_access::network()?;
    let mut interrupt = Interrupt::listen();
    let mut options = PortOptions::new()
        .queue(Queue::Wait(MAX_QUEUED))
        .input_only();
    if let Some(type_name) = &read_options.type_name {
        options = options.type_name(type_name);
    }
    let Some(port) = network_access::open(&network, &name, options).await? else {
        return Ok(ExitCode::FAILURE);
    };
    if let Some(remote) = &read_options.remote {
        // Stock continues even so: another port may connect.
        port_connections::connect(&network, remote, port.name(), None, Verbosity::FailuresOnly)
            .await;
    }
    let mut printer = Printer::new(&read_options);
    crate::systemd_notify::notify_ready();
    let printed = loop {
        let message = tokio::select! {
            biased;
            () = interrupt.interrupted() => break Ok(()),
            message = port.read() => match message {
                Ok(message) => message,
                Err(_) => break Ok(()),
            },
        };
        match printer.print(&message, out) {
            Ok(true) if read_options.once => break Ok(()),
            Ok(true) => {}
            Ok(false) => break Ok(()),
            Err(error) => break Err(error),
        }
    };
    port.close().await;
    printed.map(|()| ExitCode::SUCCESS)
}

/// Returns true if a word is an option, rather than a port or a number.
fn is_option(word: &str) -> bool {
    matches!(word, "envelope" | "envelope2" | "once" | "trim") || word.starts_with('/')
}

/// Options after the name of the port.
#[derive(Debug, Default, Eq, PartialEq)]
struct ReadOptions {
    remote: Option<String>,
    envelope: bool,
    trim: Option<usize>,
    once: bool,
    type_name: Option<String>,
}

impl ReadOptions {
    fn parse(mut words: Vec<String>) -> Self {
        let mut read_options = Self {
            type_name: take_value(&mut words, "--type"),
            ..Self::default()
        };
        let mut words = words.into_iter().peekable();
        while let Some(word) = words.next() {
            match word.as_str() {
                "envelope" | "envelope2" => read_options.envelope = true,
                "once" => read_options.once = true,
                "trim" => {
                    let number = words.next_if(|word| !is_option(word));
                    // As in stock, 0 and anything that is no number mean no limit.
                    read_options.trim = match number.map(|word| leading_integer(&word)) {
                        None => Some(DEFAULT_TRIM),
                        Some(number) => usize::try_from(number).ok().filter(|limit| *limit > 0),
                    };
                }
                _ => read_options.remote = Some(word),
            }
        }
        read_options
    }
}

#[derive(Default)]
pub(super) struct Printer {
    envelope: bool,
    trim: Option<usize>,
    last_envelope: Option<Bytes>,
}

impl Printer {
    fn new(read_options: &ReadOptions) -> Self {
        Self {
            envelope: read_options.envelope,
            trim: read_options.trim,
            last_envelope: None,
        }
    }

    /// Prints a message; returns false at the end.
    pub(super) fn print(&mut self, message: &Received, out: &mut dyn Write) -> Result<bool> {
        let bottle = match message.bottle() {
            Ok(bottle) => bottle,
            Err(error) => {
                tracing::error!(target: "yarp.companion", "what {} sent cannot be read: {error}", message.from);
                return Ok(true);
            }
        };
        if message.envelope.is_some() {
            // As in stock, an envelope holds until the next one arrives.
            self.last_envelope.clone_from(&message.envelope);
        }
        let line = match classify(&bottle) {
            PrintedForm::End => return Ok(false),
            PrintedForm::Raw(text) => trimmed(text, self.trim),
            PrintedForm::Bottle => trimmed(bottle.to_string(), self.trim),
        };
        if self.envelope
            && let Some(envelope) = &self.last_envelope
        {
            writeln!(out, "{} ", envelope_text(envelope))?;
        }
        writeln!(out, "{line}")?;
        Ok(true)
    }
}

/// Printed form of a message.
#[derive(Debug, Eq, PartialEq)]
enum PrintedForm {
    /// The Bottle itself.
    Bottle,
    /// `0 "text"`, as sent by `write ... verbatim`: printed as text.
    Raw(String),
    /// `1 "<EOF>"`: the writer has ended.
    End,
}

fn classify(bottle: &Bottle) -> PrintedForm {
    match bottle.as_slice() {
        [Value::Int32(1), Value::String(_)] => PrintedForm::End,
        [Value::Int32(_), Value::String(text)] => PrintedForm::Raw(text.to_lossy().into_owned()),
        _ => PrintedForm::Bottle,
    }
}

fn trimmed(mut text: String, limit: Option<usize>) -> String {
    if let Some(limit) = limit
        && let Some((end, _)) = text.char_indices().nth(limit)
    {
        text.truncate(end);
    }
    text
}

fn envelope_text(envelope: &[u8]) -> String {
    let text = String::from_utf8_lossy(envelope).into_owned();
    match text.parse::<Stamp>() {
        Ok(_) => Bottle::parse(&text).map_or(text, |bottle| bottle.to_string()),
        Err(_) => text,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn options_may_be_in_any_order() {
        let parse =
            |line: &str| ReadOptions::parse(line.split_whitespace().map(str::to_owned).collect());
        let expected = ReadOptions {
            remote: Some("/w".into()),
            envelope: true,
            trim: Some(3),
            once: true,
            type_name: Some("T".into()),
        };
        assert_eq!(parse("once /w --type T trim 3 envelope"), expected);
        assert_eq!(parse("trim").trim, Some(80));
        assert_eq!(parse("trim 0").trim, None);
        assert_eq!(parse("trim x"), ReadOptions::default());
        assert_eq!(parse(""), ReadOptions::default());
        assert_eq!(parse("trim /w").remote.as_deref(), Some("/w"));
    }

    #[test]
    fn verbatim_text_is_printed_unchanged() {
        let check = |text: &str, expected: PrintedForm| {
            assert_eq!(classify(&Bottle::parse(text).unwrap()), expected, "{text}");
        };
        check("0 x", PrintedForm::Raw("x".into()));
        check("-1 \"a b\"", PrintedForm::Raw("a b".into()));
        check("0 x y", PrintedForm::Bottle);
        check("0 5", PrintedForm::Bottle);
        check("1 \"<EOF>\"", PrintedForm::End);
        check("hello", PrintedForm::Bottle);
    }

    #[test]
    fn trimming_counts_characters() {
        assert_eq!(trimmed("one two".into(), Some(5)), "one t");
        assert_eq!(trimmed("äöü".into(), Some(2)), "äö");
        assert_eq!(trimmed("abc".into(), None), "abc");
    }
}
