//! A port that receives the messages of a clock.

use std::process;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use tokio::sync::watch;
use tokio::task::JoinHandle;
use tokio::time::Instant;
use yarp_devices::clock::NetworkTime;
use yarp_ports::{
    Answer, Network, Port, PortError, PortOptions, Received, error_chain, host_name, printable,
    program_name, remote_admin,
};

use super::clock_message;
use super::stall_monitor::{ClockReport, StallMonitor};

/// Carrier of the connection to a clock, as in stock.
const CARRIER: &str = "tcp";
/// Longest port name of a program that becomes part of a port name.
const MAX_NAME_PART: usize = 64;

/// Options of a [`ClockFollower`].
#[derive(Clone, Debug, Eq, PartialEq)]
#[non_exhaustive]
pub struct FollowOptions {
    /// Name of the follower's port; `None` for `/HOST/PROCESS/PID/clock:i`.
    pub port_name: Option<String>,
    /// Timeout of the first message.
    pub first_tick_timeout: Duration,
    /// Real time without progress after which a clock is reported as standing still.
    pub stall_limit: Duration,
    /// Interval between checks of the connection.
    pub check_interval: Duration,
}

impl Default for FollowOptions {
    /// 30 s for the first message, 5 s without progress, a check every 500 ms.
    fn default() -> Self {
        Self {
            port_name: None,
            first_tick_timeout: Duration::from_secs(30),
            stall_limit: Duration::from_secs(5),
            check_interval: Duration::from_millis(500),
        }
    }
}

impl FollowOptions {
    /// Creates the default options.
    pub fn new() -> Self {
        Self::default()
    }

    /// Sets the name of the follower's port.
    pub fn port_name(mut self, name: &str) -> Self {
        self.port_name = Some(name.to_owned());
        self
    }

    /// Sets the timeout of the first message.
    pub fn first_tick_timeout(mut self, timeout: Duration) -> Self {
        self.first_tick_timeout = timeout;
        self
    }

    /// Sets the real time without progress after which the clock is reported as standing still.
    pub fn stall_limit(mut self, limit: Duration) -> Self {
        self.stall_limit = limit;
        self
    }

    /// Sets the interval between checks of the connection; at least 1 ms.
    pub fn check_interval(mut self, interval: Duration) -> Self {
        self.check_interval = interval.max(Duration::from_millis(1));
        self
    }
}

/// A clock that cannot be followed.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ClockError {
    /// The port that receives the time could not be opened.
    #[error("cannot follow the clock {clock} (YARP_CLOCK): cannot open port {port}")]
    Open {
        /// Port name of the clock.
        clock: String,
        /// Port of the follower.
        port: String,
        /// Reason.
        #[source]
        source: PortError,
    },
    /// No message of the clock arrived in time.
    #[error(
        "no time came from the clock {clock} (YARP_CLOCK) within {} s: {reason}; start the clock (`yarp clock --name {clock}`, or \
         the simulator that publishes it), or unset YARP_CLOCK to use the time of this machine; YARP_CLOCK_TIMEOUT=SECONDS \
         changes the time to wait",
        timeout.as_secs_f64()
    )]
    NoTick {
        /// Port name of the clock.
        clock: String,
        /// Time waited.
        timeout: Duration,
        /// State of the connection.
        reason: String,
    },
    /// The wait for the first message was cancelled.
    #[error("interrupted while waiting for the clock {clock} (YARP_CLOCK)")]
    Interrupted {
        /// Port name of the clock.
        clock: String,
    },
    /// A variable of the environment cannot be read.
    #[error(transparent)]
    Config(#[from] yarp_ports::config::ConfigError),
}

/// Follows a clock: keeps a [`NetworkTime`] at its time for as long as it lives.
///
/// The clock's port is asked to connect to the follower's, again whenever the connection is lost.
#[derive(Debug)]
pub struct ClockFollower {
    time: Arc<NetworkTime>,
    link: Arc<Link>,
    watching: JoinHandle<()>,
}

/// State shared by the follower and its task.
#[derive(Debug)]
struct Link {
    network: Network,
    port: Port,
    /// Reason of the last failure to connect.
    failure: Mutex<Option<String>>,
    started: watch::Receiver<bool>,
}

impl ClockFollower {
    /// Opens the port and begins to connect the clock to it. Does not wait for the clock.
    ///
    /// Errors: [`ClockError::Open`].
    pub async fn open(
        network: &Network,
        clock: &str,
        options: &FollowOptions,
    ) -> Result<Self, ClockError> {
        let time = Arc::new(NetworkTime::new(clock));
        let (sender, started) = watch::channel(false);
        let name = options.port_name.clone().unwrap_or_else(own_name);
        let receiver = MessageReceiver {
            time: Arc::clone(&time),
            started: sender,
            invalid: Mutex::new(false),
        };
        let handler = PortOptions::new()
            .input_only()
            .handler(move |message| receiver.receive(message));
        let port = match Port::open(network, &name, handler).await {
            Ok(port) => port,
            Err(source) => {
                return Err(ClockError::Open {
                    clock: clock.to_owned(),
                    port: name,
                    source,
                });
            }
        };
        let link = Arc::new(Link {
            network: network.clone(),
            port,
            failure: Mutex::default(),
            started,
        });
        let watching = watch(Arc::clone(&link), Arc::clone(&time), options.clone());
        Ok(Self {
            time,
            link,
            watching: tokio::spawn(watching),
        })
    }

    /// Returns the time of the clock.
    pub fn time(&self) -> &Arc<NetworkTime> {
        &self.time
    }

    /// Waits for the first message of the clock.
    ///
    /// Errors: [`ClockError::NoTick`] after `timeout`.
    pub async fn wait_first_tick(&self, timeout: Duration) -> Result<(), ClockError> {
        let mut started = self.link.started.clone();
        let first = started.wait_for(|started| *started);
        match tokio::time::timeout(timeout, first).await {
            Ok(Ok(_)) => Ok(()),
            _ => Err(ClockError::NoTick {
                clock: self.time.clock().to_owned(),
                timeout,
                reason: self.link.state(),
            }),
        }
    }

    /// Closes the port. The time stands still from now on.
    pub async fn close(mut self) {
        self.watching.abort();
        // It was aborted, and holds nothing that matters.
        let _ = (&mut self.watching).await;
        let link = Arc::clone(&self.link);
        drop(self);
        if let Some(link) = Arc::into_inner(link) {
            link.port.close().await;
        }
    }
}

impl Drop for ClockFollower {
    fn drop(&mut self) {
        self.watching.abort();
    }
}

impl Link {
    /// Returns the state of the connection, for people.
    fn state(&self) -> String {
        if !self.port.inputs().is_empty() {
            return "it is connected, but has sent no valid time".to_owned();
        }
        let failure = self.failure.lock().unwrap_or_else(PoisonError::into_inner);
        failure
            .clone()
            .unwrap_or_else(|| "it is not connected".to_owned())
    }

    /// Asks the clock to connect; gives up after `timeout`.
    async fn connect(&self, clock: &str, timeout: Duration) {
        let connecting =
            remote_admin::connect(&self.network, clock, self.port.name(), Some(CARRIER));
        let failure = match tokio::time::timeout(timeout, connecting).await {
            Ok(Ok(_)) => None,
            Ok(Err(error)) => Some(error_chain(&error)),
            Err(_) => Some(format!(
                "it does not reply within {} s",
                timeout.as_secs_f64()
            )),
        };
        if let Some(failure) = &failure {
            tracing::debug!(clock, "cannot connect: {}", printable(failure));
        }
        *self.failure.lock().unwrap_or_else(PoisonError::into_inner) = failure;
    }
}

/// Keeps the clock connected, and reports when it stands still.
async fn watch(link: Arc<Link>, time: Arc<NetworkTime>, options: FollowOptions) {
    let mut monitor = StallMonitor::new(options.stall_limit);
    let mut asked = None::<Instant>;
    loop {
        let status = time.status();
        let silent = status.is_none_or(|status| status.since_tick >= options.stall_limit);
        // A connection over which nothing comes may be dead without either side knowing.
        let stale = silent && asked.is_none_or(|asked| asked.elapsed() >= options.stall_limit);
        if link.port.inputs().is_empty() || stale {
            asked = Some(Instant::now());
            link.connect(time.clock(), options.stall_limit).await;
        }
        if let Some(report) = time.status().and_then(|status| monitor.check(status)) {
            tell(&link, &time, report);
        }
        tokio::time::sleep(options.check_interval).await;
    }
}

/// Logs a change of the clock.
fn tell(link: &Link, time: &NetworkTime, report: ClockReport) {
    let clock = printable(time.clock());
    let now = time.time().unwrap_or_default();
    match report {
        ClockReport::Running => tracing::info!("the clock {clock} goes on, at {now:.3} s"),
        ClockReport::Standing => tracing::warn!(
            "the clock {clock} stands still at {now:.3} s: it repeats its time; sleeps last until it goes on"
        ),
        ClockReport::Silent => {
            let reason = match link.port.inputs().is_empty() {
                true => link.state(),
                false => "it is connected, but sends nothing".to_owned(),
            };
            tracing::warn!(
                "the clock {clock} stands still at {now:.3} s: {}; sleeps last until it goes on",
                printable(&reason)
            );
        }
    }
}

/// Takes the messages of the clock.
struct MessageReceiver {
    time: Arc<NetworkTime>,
    started: watch::Sender<bool>,
    /// True after a message that was no time: the first of a run is logged.
    invalid: Mutex<bool>,
}

impl MessageReceiver {
    fn receive(&self, message: &mut Received) -> Answer {
        let result = match &*message.from == self.time.clock() {
            false => Err("it comes from another port".to_owned()),
            true => message
                .bottle()
                .map_err(|error| error_chain(&error))
                .and_then(|bottle| clock_message::apply(&bottle, &self.time)),
        };
        let mut invalid = self.invalid.lock().unwrap_or_else(PoisonError::into_inner);
        match result {
            Ok(()) => {
                *invalid = false;
                self.started
                    .send_if_modified(|started| !std::mem::replace(started, true));
            }
            Err(reason) if !*invalid => {
                *invalid = true;
                tracing::warn!(
                    from = %printable(&message.from),
                    "dropped a message to the clock port: {}", printable(&reason)
                );
            }
            Err(_) => {}
        }
        Answer::Nothing
    }
}

/// Returns stock's name of a follower's port: `/HOST/PROCESS/PID/clock:i`.
fn own_name() -> String {
    format!(
        "/{}/{}/{}/clock:i",
        name_part(&host_name()),
        name_part(&program_name()),
        process::id()
    )
}

/// Returns a text as part of a port name: other characters than letters, digits, `-`, `_` and `.` become `_`.
fn name_part(text: &str) -> String {
    let allowed = |character: char| match character {
        'a'..='z' | 'A'..='Z' | '0'..='9' | '-' | '_' | '.' => character,
        _ => '_',
    };
    let part: String = text.chars().take(MAX_NAME_PART).map(allowed).collect();
    match part.is_empty() {
        true => "unknown".to_owned(),
        false => part,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn any_host_and_program_make_a_port_name() {
        assert_eq!(name_part("robot-1.local"), "robot-1.local");
        assert_eq!(name_part("my program/é@#"), "my_program____");
        assert_eq!(name_part(""), "unknown");
        assert_eq!(name_part(&"x".repeat(1000)).len(), 64);
        assert!(own_name().parse::<yarp_wire::PortName>().is_ok());
    }
}
