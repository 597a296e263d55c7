//! `yarp latency-test`: round trip time of messages.
//!
//! The client sends `start SIZE 1` to `/latencyTest/server`, and then frames: a number and the
//! time. The server sends each back with a text of SIZE bytes, the seconds that adding it took, and
//! a number of its own: as a reply, or over a connection of its own after `start SIZE 0`. `stop`
//! ends a test, `quit` the server (stock 3.5.0).

mod latency_client;
mod latency_server;

use std::io::Write;
use std::process::ExitCode;
use std::time::Duration;

use yarp_wire::Value;

use super::argument_words::Options;
use crate::error::Result;
use crate::network_access;
use crate::stock_format::complain;

const USAGE: &str = "\
This is yarp latency-test
Syntax for the server:
yarp latency-test --server [--details]
--server_wait <time>
 \n\
Syntax for the client:
yarp latency-test --client [--details]
--nframes <X> --payload_size <Y> --client_wait <Z> [--protocol <protocol>] [--no-reply] [--logfile <filename_prefix>]
--nframes <X> --multitest --client_wait <Z> [--protocol <protocol>] [--no-reply] [--logfile <filename_prefix>]
--nframes <X> --multitest \"(1 400000)\" --client_wait <Z> [--protocol <protocol>] [--no-reply] [--logfile <filename_prefix>]
--nframes <X> --customtest \"(1 40 100 10000)\" --client_wait <Z> [--protocol <protocol>] [--no-reply] [--logfile <filename_prefix>]
Default value for filename_prefix: log_";

/// Exit code of stock for invalid options, and after some successful tests.
const EXIT_FAILED: u8 = 255;
/// Names of the two ports.
const SERVER: &str = "/latencyTest/server";
const CLIENT: &str = "/latencyTest/client";
/// Maximum size of the text: with its envelope, still a message that a port accepts.
const MAX_MESSAGE_BYTES: i32 = 500_000_000;

/// perform a latency test by exchanging data between a server and a client
///
/// The client writes the milliseconds of each frame, and the seconds that the server took to make it, to a file.
#[derive(Debug, clap::Args)]
#[command(disable_help_flag = true)]
pub(crate) struct Args {
    /// Options
    #[arg(
        value_name = "--server|--client ...",
        allow_hyphen_values = true,
        trailing_var_arg = true
    )]
    words: Vec<String>,
}

pub(super) async fn run(args: Args, out: &mut dyn Write) -> Result<ExitCode> {
    let options = Options::parse(&args.words);
    if args.words.is_empty() || options.has("help") {
        writeln!(out, "{USAGE}")?;
        return Ok(ExitCode::from(EXIT_FAILED));
    }
    if options.has("server") {
        return latency_server::serve(&options, out).await;
    }
    let complaint = if !options.has("client") {
        "Missing option. Use --help"
    } else if !options.has("nframes") {
        "Missing mandatory parameter nframes. See available options with yarp latency-test"
    } else if let Some(sizes) = Sizes::of(&options) {
        return latency_client::measure(&options, &sizes, out).await;
    } else {
        "Syntax error. See available options with yarp latency-test"
    };
    complain(out, complaint)?;
    Ok(ExitCode::from(EXIT_FAILED))
}

/// Sleeps between two frames; an invalid time means no sleep, or sleeping forever.
async fn sleep_between_frames(seconds: f64) {
    if seconds > 0.0 {
        tokio::time::sleep(Duration::try_from_secs_f64(seconds).unwrap_or(network_access::FOREVER))
            .await;
    }
}

/// Sizes of the texts that a client requests.
#[derive(Debug, PartialEq)]
struct Sizes {
    /// Size for each test; `None` where no number was given.
    sizes: Vec<Option<i32>>,
    /// Exit code of stock after them.
    code: u8,
}

impl Sizes {
    /// Parses the options; returns `None` if they contradict each other.
    fn of(options: &Options) -> Option<Self> {
        let list = |name| match options.value(name) {
            Some(Value::List(list)) => Some(list),
            _ => None,
        };
        let asked = ["payload_size", "multitest", "customtest"].map(|name| options.has(name));
        let (sizes, code) = match asked {
            [true, false, false] => (vec![options.value("payload_size")?.as_i32()], 0),
            [false, true, false] => {
                let bound = |index: usize, usual| match list("multitest") {
                    Some(list) if list.len() == 2 => list.get(index)?.as_f64(),
                    _ => Some(usual),
                };
                let bounds = bound(0, 1.0)?..=bound(1, 800_000_000.0)?;
                let sizes = series().into_iter();
                let sizes = sizes.filter(|size| bounds.contains(&f64::from(*size)));
                (sizes.map(Some).collect(), 0)
            }
            [false, false, true] => {
                let sizes = list("customtest").unwrap_or_default();
                let size = |value: &Value| match value {
                    Value::Int32(size) => Some(*size),
                    _ => None,
                };
                (sizes.iter().map(size).collect(), EXIT_FAILED)
            }
            _ => return None,
        };
        Some(Self { sizes, code })
    }
}

/// Returns the series 1 2 4 8 10 20 40 80 100 and so on.
fn series() -> Vec<i32> {
    let decades = (0..9).map(|power| 10_i32.pow(power));
    decades
        .flat_map(|decade| [1, 2, 4, 8].map(|factor| factor * decade))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sizes(line: &str) -> Option<Sizes> {
        let words: Vec<String> = line
            .split_whitespace()
            .map(|word| word.replace('_', " "))
            .collect();
        Sizes::of(&Options::parse(&words))
    }

    #[test]
    fn options_select_message_sizes() {
        let check = |words: &[&str], expected: &[Option<i32>], code: u8| {
            let words: Vec<String> = words.iter().map(|word| (*word).to_owned()).collect();
            let expected = Sizes {
                sizes: expected.to_vec(),
                code,
            };
            assert_eq!(
                Sizes::of(&Options::parse(&words)),
                Some(expected),
                "{words:?}"
            );
        };
        check(&["--payload_size", "100"], &[Some(100)], 0);
        check(
            &["--multitest", "(8 100)"],
            &[8, 10, 20, 40, 80, 100].map(Some),
            0,
        );
        check(
            &["--customtest", "(1 40)"],
            &[Some(1), Some(40)],
            EXIT_FAILED,
        );
        check(&["--customtest", "(1 x)"], &[Some(1), None], EXIT_FAILED);
        assert_eq!(sizes("--multitest").unwrap().sizes.len(), 36);
        assert_eq!(
            sizes("--multitest").unwrap().sizes.last(),
            Some(&Some(800_000_000))
        );
        assert_eq!(sizes("--multitest --customtest"), None);
        assert_eq!(sizes("--nframes 3"), None);
    }
}
