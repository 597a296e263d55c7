//! `yarp clock`: publishes a time that other programs follow.

mod adjustable_clock;
mod clock_requests;

use std::env;
use std::io::Write;
use std::process::ExitCode;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use adjustable_clock::{AdjustableClock, time_bottle};
use tokio::sync::Notify;
use yarp_devices::clock::wall_clock;
use yarp_ports::{Answer, Port, PortOptions, Received};

use super::argument_words::Options;
use crate::error::Result;
use crate::network_access;
use crate::signals::Interrupt;

const USAGE: &str = "\
This command publishes a clock time through a YARP port

Accepted parameters are:
period:     update period [ms]. Default 30
name:       name of yarp port to be opened. Default: check YARP_CLOCK environment variable; if missing use '/clock'
rtf:        realt time factor. Elapsed time will be multiplied by this factor to simulate faster or slower then real time clock frequency. Default 1 (real time)
systemTime: If present the published time will start at the same value as system clock. If if not present (default) the published time will start from 0. \n\
help:       print this help
";

/// Interval between two progress reports, in seconds.
const REPORT_SECONDS: u64 = 5;
/// Minimum sleep between two messages.
const MIN_SLEEP: Duration = Duration::from_millis(1);

/// creates a server publishing the system time
///
/// Publishes seconds and nanoseconds, two integers, on its port. Programs started with YARP_CLOCK
/// follow it. Takes requests on PORT/rpc:i: get, pause, resume, step SECONDS, rate FACTOR, help.
/// With --paused it begins paused.
#[derive(Debug, clap::Args)]
#[command(disable_help_flag = true)]
pub(crate) struct Args {
    /// The options
    #[arg(
        value_name = "[--name PORT] [--period MILLISECONDS] [--rtf FACTOR] [--systemTime] [--paused] [--help]",
        allow_hyphen_values = true,
        trailing_var_arg = true
    )]
    words: Vec<String>,
}

pub(super) async fn run(args: Args, out: &mut dyn Write) -> Result<ExitCode> {
    let options = Options::parse(&args.words);
    if options.has("help") {
        writeln!(out, "{USAGE}")?;
        return Ok(ExitCode::FAILURE);
    }
    let period = options.number("period").unwrap_or(30.0) / 1000.0;
    let factor = options.number("rtf").unwrap_or(1.0);
    let system = options.has("systemTime");
    let name = options.text("name").unwrap_or_else(usual_name);
    writeln!(out, "Clock configuration is the following:")?;
    writeln!(out, "period {:.3} msec", period * 1000.0)?;
    writeln!(out, "name   {name}")?;
    writeln!(out, "rtf    {factor:.3}")?;
    writeln!(out, "system {system}")?;
    let network = network_access::network()?;
    let mut interrupt = Interrupt::listen();
    let Some(port) = network_access::open(&network, &name, PortOptions::new()).await? else {
        writeln!(out, "yarp clock error: Cannot open '/clock' port")?;
        return Ok(ExitCode::FAILURE);
    };
    let base = if system { wall_clock() } else { 0.0 };
    let clock = AdjustableClock::new(base, factor, options.has("paused"), Instant::now());
    let shared = Arc::new(Shared {
        clock: Mutex::new(clock),
        changed: Notify::new(),
    });
    let requests = requests_port(&shared);
    let requests = network_access::open(&network, &format!("{name}/rpc:i"), requests).await;
    let requests = match requests {
        Ok(Some(requests)) => requests,
        failed => {
            port.close().await;
            return failed.map(|_| ExitCode::FAILURE);
        }
    };
    write!(out, "\n\n")?;
    crate::systemd_notify::notify_ready();
    let pause = Duration::try_from_secs_f64(period).unwrap_or(MIN_SLEEP);
    let done = tick(
        &port,
        &shared,
        pause.clamp(MIN_SLEEP, network_access::FOREVER),
        &mut interrupt,
        out,
    )
    .await;
    requests.close().await;
    port.close().await;
    done.map(|()| ExitCode::SUCCESS)
}

/// The clock, shared with the port for requests.
struct Shared {
    clock: Mutex<AdjustableClock>,
    /// Signals a change that is published at once.
    changed: Notify,
}

impl Shared {
    fn clock(&self) -> MutexGuard<'_, AdjustableClock> {
        // A clock is whole between any two calls.
        self.clock.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Returns the options of the port that answers requests.
fn requests_port(shared: &Arc<Shared>) -> PortOptions {
    let shared = Arc::clone(shared);
    let respond = move |message: &mut Received| {
        let request = message.bottle().unwrap_or_default();
        let reply = clock_requests::answer(&mut shared.clock(), &request, Instant::now());
        shared.changed.notify_one();
        Answer::reply(reply)
    };
    PortOptions::new().input_only().handler(respond)
}

/// Returns the default port name of a clock.
fn usual_name() -> String {
    let named = env::var("YARP_CLOCK").ok().filter(|name| !name.is_empty());
    named.unwrap_or_else(|| "/clock".to_owned())
}

/// Publishes the time until a signal.
async fn tick(
    port: &Port,
    shared: &Shared,
    pause: Duration,
    interrupt: &mut Interrupt,
    out: &mut dyn Write,
) -> Result<()> {
    let mut said = None;
    let began = Instant::now();
    loop {
        let now = Instant::now();
        let time = shared.clock().time(now);
        port.write_if_idle(&time_bottle(time), None);
        let lustrum = (now - began).as_secs() / REPORT_SECONDS;
        if said.replace(lustrum) != Some(lustrum) {
            writeln!(out, "yarp clock running happily...")?;
            out.flush()?;
        }
        tokio::select! {
            biased;
            () = interrupt.interrupted() => return Ok(()),
            () = shared.changed.notified() => {}
            () = tokio::time::sleep(pause) => {}
        }
    }
}
