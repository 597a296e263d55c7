//! `yarp clean`: unregisters ports that are gone.

use std::io::Write;
use std::process::ExitCode;
use std::sync::Arc;
use std::time::Duration;

use tokio::sync::Semaphore;
use yarp_ports::{Endpoint, Network, remote_admin};

use crate::error::Result;
use crate::network_access;
use crate::stock_format::general;

/// try to remove inactive entries from the name server
///
/// Unregisters ports that are gone: those whose address refuses a connection.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// Timeout for each port, in seconds
    #[arg(long, value_name = "SECONDS", num_args = 0..=1, default_missing_value = "")]
    timeout: Option<String>,
    #[arg(hide = true, allow_hyphen_values = true, trailing_var_arg = true)]
    rest: Vec<String>,
}

/// Default timeout for a port. Stock waits forever.
const DEFAULT_TIMEOUT: Duration = Duration::from_secs(2);
/// Maximum number of ports that are tested concurrently.
const MAX_CONCURRENT_PROBES: usize = 256;

/// Returns true if a port listens; waits for a permit first.
async fn test(room: Arc<Semaphore>, network: Network, place: Endpoint) -> bool {
    let _room = room.acquire().await;
    remote_admin::listens(&network, &place).await
}

pub(super) async fn run(args: Args, out: &mut dyn Write) -> Result<ExitCode> {
    if args.timeout.is_none() && args.rest.is_empty() {
        writeln!(
            out,
            "# If the cleaning process has long delays, you may wish to use a timeout, "
        )?;
        writeln!(
            out,
            "# specifying how long to wait (in seconds) for a test connection to a port:"
        )?;
        writeln!(out, "#   yarp clean --timeout 5.0")?;
    }
    let network = network_access::network()?;
    let timeout = args.timeout.and_then(|text| text.parse::<f64>().ok());
    let timeout = timeout.and_then(|seconds| Duration::try_from_secs_f64(seconds).ok());
    let timeout = timeout.filter(|timeout| !timeout.is_zero());
    writeln!(out, "Requesting list of ports from name server... ")?;
    let places = match network.ask("list").await {
        Ok(answer) => answer.registrations(),
        Err(error) => {
            writeln!(out, "got -1 ports")?;
            network_access::log_server_unreachable(&network, &error);
            return Ok(ExitCode::FAILURE);
        }
    };
    writeln!(out, "got {} ports", places.len())?;
    match timeout {
        Some(timeout) => {
            writeln!(
                out,
                "Using a timeout of {} seconds",
                general(timeout.as_secs_f64())
            )?;
        }
        None => writeln!(
            out,
            "No timeout; to specify one, do \"yarp clean --timeout NN.N\""
        )?,
    }
    let patient = network.with_timeout(timeout.unwrap_or(DEFAULT_TIMEOUT));
    let room = Arc::new(Semaphore::new(MAX_CONCURRENT_PROBES));
    // Tests many ports concurrently, and prints them in order.
    let tests: Vec<_> = places
        .into_iter()
        .map(|place| {
            let ours = place.name == network.namespace() || !place.name.starts_with('/');
            let test =
                (!ours).then(|| tokio::spawn(test(room.clone(), patient.clone(), place.clone())));
            (place, test)
        })
        .collect();
    for (place, test) in tests {
        let Some(test) = test else {
            writeln!(out, "Ignoring {}", place.name)?;
            continue;
        };
        let (carrier, host, port) = (&place.carrier, &place.host, place.port);
        writeln!(out, "Testing {} at {carrier}://{host}:{port}/", place.name)?;
        // A test that panicked says nothing about the port.
        if !test.await.unwrap_or(true) {
            writeln!(out, "* No response, removing port {}", place.name)?;
            network.unregister(&place.name).await?;
        }
    }
    writeln!(out, "Giving name server a chance to do garbage collection.")?;
    let answer = network.ask("gc").await?;
    let lines: Vec<_> = answer.lines().collect();
    writeln!(out, "Name server says: {}", lines.join(" "))?;
    Ok(ExitCode::SUCCESS)
}
