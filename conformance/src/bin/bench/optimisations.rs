//! Ours against ours with one optimisation switched off, in turn.

use yarp_conformance::benchmark_statistics::{median, percentiles};

use crate::optimisation_peers::READERS;
use crate::peer_processes::{Bench, Side};
use crate::{CALLS, Failure};

/// Runs of each measurement with and without the optimisation.
const ALTERNATIONS: usize = 10;
/// The environment variable that switches optimisations off.
const WITHOUT: &str = "YARP_LATENCY_WITHOUT";
/// Requests over new connections, periodic messages, and messages to several readers in one run.
const CONNECTIONS: usize = 1000;
const PERIODS: usize = 500;
const MESSAGES: u32 = 20_000;

/// Something to measure.
#[derive(Clone, Copy, Debug)]
enum Workload {
    /// Median of round trips of a small message over a carrier, in µs.
    Call(&'static str),
    /// Messages per second from one process to another: carrier, bytes, messages.
    OneWay(&'static str, usize, u32),
    /// Messages per second to several readers.
    FanOut,
    /// Median of a request over a new connection, in µs.
    Connection,
    /// Median age of a periodic message at its reader, in µs.
    Periodic,
    /// Median delay of a thread with deadlines, in µs.
    Deadline,
}

use Workload::{Call, Connection, Deadline, FanOut, OneWay, Periodic};

const TCP: Workload = OneWay("tcp", 16, 20_000);
const FAST: Workload = OneWay("fast_tcp", 16, 500_000);
const FAST_LARGE: Workload = OneWay("fast_tcp", 1_000_000, 500);
const UNIX: Workload = OneWay("unix_stream", 16, 500_000);
const UNIX_LARGE: Workload = OneWay("unix_stream", 1_000_000, 500);
const SHMEM: Workload = OneWay("shmem", 16, 100_000);
const SHMEM_LARGE: Workload = OneWay("shmem", 1_000_000, 1000);

/// Name of each optimisation, and what it is for.
const OPTIMISATIONS: [(&str, &[Workload]); 17] = [
    ("busy-poll", &[Call("tcp"), TCP, Call("unix_stream")]),
    ("yield", &[Call("tcp"), TCP, Call("shmem")]),
    ("gather", &[FAST, UNIX]),
    ("suppress-wakeups", &[Call("tcp"), TCP, FAST, UNIX]),
    ("low-water-mark", &[FAST_LARGE]),
    ("no-delay", &[Call("tcp"), TCP, FAST, Periodic]),
    ("unix-write-poll", &[UNIX, UNIX_LARGE]),
    ("unix-send-buffer", &[UNIX, UNIX_LARGE]),
    ("shmem-poll", &[Call("shmem"), SHMEM, SHMEM_LARGE]),
    ("write-batch", &[FAST, UNIX]),
    ("shared-parts", &[FAST_LARGE, UNIX_LARGE]),
    ("encode-once", &[FanOut]),
    ("buffer-reuse", &[Call("tcp"), FAST]),
    ("direct-write", &[Periodic]),
    ("inline-handling", &[Call("tcp"), FAST]),
    ("first-reply", &[Connection]),
    ("timer-slack", &[Deadline]),
];

impl Workload {
    /// Returns whether a larger number is better.
    fn is_rate(self) -> bool {
        matches!(self, OneWay(..) | FanOut)
    }

    fn label(self) -> String {
        match self {
            Call(carrier) => format!("call over {carrier}, p50 µs"),
            OneWay(carrier, bytes, _) => format!("{carrier}, {bytes} bytes, 1/s"),
            FanOut => format!("fast_tcp, {READERS} readers, 1/s"),
            Connection => "request over a new connection, p50 µs".to_owned(),
            Periodic => "periodic message, p50 µs".to_owned(),
            Deadline => "delay behind a deadline, p50 µs".to_owned(),
        }
    }
}

impl Bench {
    /// Measures the gain of the optimisation `wanted`, or of all if it is empty.
    pub(crate) fn optimisations(&self, wanted: &str) -> Result<(), Failure> {
        if !cfg!(feature = "latency-ablation") {
            return Err("build it with `--features latency-ablation`".into());
        }
        println!("{ALTERNATIONS} alternations, medians; gain: how much better with than without");
        println!(
            "optimisation        workload                                      with    without    gain"
        );
        let wanted = |(name, _): &&(&str, &[Workload])| wanted.is_empty() || *name == wanted;
        for (name, workloads) in OPTIMISATIONS.iter().filter(wanted) {
            for workload in *workloads {
                let (mut with, mut without) = (Vec::new(), Vec::new());
                for turn in 0..2 * ALTERNATIONS {
                    // A B B A, so that a drift of the machine favours neither.
                    match turn % 4 {
                        0 | 3 => with.push(self.run(*workload, "")?),
                        _ => without.push(self.run(*workload, name)?),
                    }
                }
                let (with, without) = (median(with.into_iter()), median(without.into_iter()));
                let gain = match workload.is_rate() {
                    true => with / without - 1.0,
                    false => 1.0 - with / without,
                };
                let gain = 100.0 * gain;
                let label = workload.label();
                println!("{name:<19} {label:<40} {with:>10.1} {without:>10.1} {gain:>6.1} %");
            }
        }
        Ok(())
    }

    fn run(&self, workload: Workload, without: &str) -> Result<f64, Failure> {
        let variables = [(WITHOUT, without)];
        let start = |words: &[&str]| self.start_with(Side::Ours, words, &variables);
        let name = self.name();
        let server = |program: &str| {
            let mut server = start(&[program, &name])?;
            server.line_starting("ready")?;
            Ok::<_, Failure>(server)
        };
        let p50 = |times: Vec<f64>| percentiles(times).0;
        Ok(match workload {
            Call(carrier) => {
                let _server = server("serve")?;
                let mut caller = start(&["call-over", &name, carrier, &CALLS.to_string()])?;
                p50(caller.numbers(CALLS)?)
            }
            OneWay(carrier, bytes, n) => {
                let reader = server("count")?;
                let words = ["send", &name, carrier, &n.to_string(), &bytes.to_string()];
                self.until_count(reader, start(&words)?, n)?
            }
            FanOut => {
                let reader = server("count-all")?;
                let writer = start(&["send-all", &name, &MESSAGES.to_string()])?;
                self.until_count(reader, writer, READERS * MESSAGES)?
            }
            Connection => {
                let _server = server("serve")?;
                let mut client = start(&["ask", &name, &CONNECTIONS.to_string()])?;
                p50(client.numbers(CONNECTIONS)?)
            }
            Periodic => {
                let mut reader = server("time")?;
                let _writer = start(&["pulse", &name, &PERIODS.to_string()])?;
                // Some are lost on a busy machine.
                p50(reader.numbers(PERIODS * 9 / 10)?)
            }
            Deadline => p50(start(&["ticks", &PERIODS.to_string()])?.numbers(PERIODS)?),
        })
    }
}
