//! The log of this process, sent to stock's `yarplogger`.
//!
//! With `YARP_FORWARD_LOG_ENABLE` a process has a port `/log/HOST/PROGRAM/PID`, which connects to `/yarplogger`, and which a
//! logger that starts later finds by its name. A message has two strings: the name of the port in brackets, and the line
//! ([`forwarded_line`](super::forwarded_line)). As in stock, what the network itself reports (`yarp.os...`) is not
//! sent: sending it would be reported again.
//!
//! The thread that reports a line never waits: lines wait in a bounded queue for a task of their own.

use std::collections::VecDeque;
use std::sync::{LazyLock, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use tokio::runtime::Handle;
use tokio::sync::Notify;
use tokio::task::JoinHandle;
use tokio::time::timeout;
use tracing::{Event, Subscriber};
use tracing_subscriber::layer::{Context, Layer};
use yarp_ports::{Network, Port, PortOptions, error_chain, host_name, program_name};
use yarp_wire::Bottle;

use super::forwarded_line::{last_line, line};
use super::{is_set, level_name, text_of};
use crate::output::error_line;

/// Port of stock's logger, and the carrier to it.
const LOGGER: &str = "/yarplogger";
const CARRIER: &str = "fast_tcp";
/// Modules whose reports sending would cause again.
const NETWORK_MODULES: [&str; 2] = ["yarp_ports", "yarp_wire"];
/// Lines that wait to be sent; further ones are left out and counted.
const MAX_WAITING: usize = 1000;
/// Timeout of opening the port, and of the connection to the logger.
const CONNECT_TIMEOUT: Duration = Duration::from_secs(2);
/// Time for the lines that wait when the process ends.
const FINISH_TIMEOUT: Duration = Duration::from_secs(1);

/// The lines that wait; `None` if this process forwards nothing.
static WAITING: LazyLock<Option<Waiting>> = LazyLock::new(|| is_enabled().then(Waiting::default));
/// Sends them.
static SENDING: Mutex<Option<JoinHandle<()>>> = Mutex::new(None);

/// Returns whether the environment asks for it. What `yarp run --log` forwards, the process does not.
fn is_enabled() -> bool {
    is_set("YARP_FORWARD_LOG_ENABLE") && !is_set("YARPRUN_IS_FORWARDING_LOG")
}

#[derive(Default)]
struct Waiting {
    lines: Mutex<Lines>,
    changed: Notify,
}

#[derive(Default)]
struct Lines {
    lines: VecDeque<String>,
    left_out: usize,
    is_ending: bool,
    /// Set if no port can be opened.
    is_off: bool,
}

impl Waiting {
    fn lock(&self) -> MutexGuard<'_, Lines> {
        self.lines.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn add(&self, line: String) {
        self.lock().add(line);
        self.changed.notify_one();
    }

    /// Waits for lines; `None` once the process ends and all are taken.
    async fn next(&self) -> Option<String> {
        loop {
            {
                let mut lines = self.lock();
                if let Some(line) = lines.take() {
                    return Some(line);
                }
                if lines.is_ending {
                    return None;
                }
            }
            self.changed.notified().await;
        }
    }

    fn end(&self) {
        self.lock().is_ending = true;
        self.changed.notify_one();
    }
}

impl Lines {
    fn add(&mut self, line: String) {
        if self.is_off {
            return;
        }
        match self.lines.len() < MAX_WAITING {
            true => self.lines.push_back(line),
            false => self.left_out += 1,
        }
    }

    fn take(&mut self) -> Option<String> {
        if let Some(line) = self.lines.pop_front() {
            return Some(line);
        }
        let left_out = std::mem::take(&mut self.left_out);
        (left_out > 0).then(|| {
            let message =
                format!("{left_out} lines left out: they came faster than they were sent");
            line("WARNING", "yarp.os.Log", &message)
        })
    }
}

/// Adds the lines of the log to those that wait.
pub(super) struct ForwardedLog;

impl<S: Subscriber> Layer<S> for ForwardedLog {
    fn on_event(&self, event: &Event<'_>, _context: Context<'_, S>) {
        let Some(waiting) = &*WAITING else {
            return;
        };
        let metadata = event.metadata();
        let module = metadata.module_path().unwrap_or_default();
        if NETWORK_MODULES.iter().any(|each| module.starts_with(each)) {
            return;
        }
        let (component, message) = text_of(event);
        waiting.add(line(level_name(*metadata.level()), &component, &message));
    }
}

/// Begins to send the log over `network`, if the environment asks for it and the network has a name server.
///
/// Only the first call in a process has an effect.
pub(crate) fn start_forwarding(network: &Network) {
    let Some(waiting) = &*WAITING else {
        return;
    };
    let (Some(_), Ok(runtime)) = (network.server(), Handle::try_current()) else {
        return;
    };
    let mut sending = sending();
    if sending.is_none() {
        *sending = Some(runtime.spawn(send(network.clone(), waiting)));
    }
}

/// Sends what waits, and closes the port; takes a few seconds at most.
pub(crate) async fn finish_forwarding() {
    let task = sending().take();
    if let (Some(task), Some(waiting)) = (task, &*WAITING) {
        waiting.end();
        let _ = timeout(2 * CONNECT_TIMEOUT + FINISH_TIMEOUT, task).await;
    }
}

fn sending() -> MutexGuard<'static, Option<JoinHandle<()>>> {
    SENDING.lock().unwrap_or_else(PoisonError::into_inner)
}

async fn send(network: Network, waiting: &Waiting) {
    let name = port_name();
    let network = network.with_timeout(network.timeout().min(CONNECT_TIMEOUT));
    let port = match Port::open(&network, &name, PortOptions::new()).await {
        Ok(port) => port,
        Err(error) => {
            error_line(format_args!(
                "[WARNING] the log is not forwarded: {}",
                error_chain(&error)
            ));
            *waiting.lock() = Lines {
                is_off: true,
                ..Lines::default()
            };
            return;
        }
    };
    // A logger that starts later connects itself.
    let _ = timeout(CONNECT_TIMEOUT, port.connect_over(LOGGER, CARRIER)).await;
    let sender = format!("[{name}]");
    let message = |line: &str| Bottle::new().with(sender.as_str()).with(line);
    let all = async {
        while let Some(line) = waiting.next().await {
            port.write(&message(&line)).await;
        }
        port.write(&message(&last_line())).await;
    };
    tokio::select! {
        () = all => {}
        // A logger that reads nothing holds no process up.
        () = ended_for(waiting, FINISH_TIMEOUT) => {}
    }
    port.close().await;
}

/// Waits until the process has been ending for this time.
async fn ended_for(waiting: &Waiting, time: Duration) {
    let mut checks = tokio::time::interval(time / 4);
    while !waiting.lock().is_ending {
        checks.tick().await;
    }
    tokio::time::sleep(time).await;
}

/// Returns the name of the port: `/log/HOST/PROGRAM/PID`, with `YARP_LOG_PROCESS_LABEL` in brackets behind the program.
fn port_name() -> String {
    let label = std::env::var("YARP_LOG_PROCESS_LABEL").unwrap_or_default();
    let label = match label.is_empty() {
        true => label,
        false => format!("[{label}]"),
    };
    let (host, program) = (host_name(), program_name());
    format!("/log/{host}/{program}{label}/{}", std::process::id())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_beyond_the_queue_are_left_out_and_counted() {
        let mut lines = Lines::default();
        for number in 0..1003 {
            lines.add(number.to_string());
        }
        for number in 0..1000 {
            assert_eq!(lines.take(), Some(number.to_string()));
        }
        let told = lines.take().unwrap();
        assert!(told.contains("(message \"3 lines left out"), "{told}");
        assert_eq!(lines.take(), None);
    }
}
