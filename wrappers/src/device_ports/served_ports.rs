//! A server: its ports, its publisher, closing.

use std::io;
use std::sync::Arc;
use std::time::Duration;

use tokio::runtime::Handle;
use yarp_ports::{Network, Port, PortOptions};

use crate::OpenError;
use crate::open_ports::{close_all, open_all};
use crate::periodic_thread::PeriodicThread;

/// Timeout of the end of publishing.
const PUBLISHER_END_TIMEOUT: Duration = Duration::from_secs(1);

/// The ports of a served device and the thread that publishes on them. Dropping it closes them in the background, as
/// far as the runtime still runs.
#[derive(Debug)]
pub(crate) struct ServedPorts {
    name: String,
    running: Option<Running>,
    /// Runtime of the ports, for closing them from anywhere.
    runtime: Handle,
}

#[derive(Debug)]
struct Running {
    inputs: Vec<Port>,
    output: Arc<Port>,
    publisher: PeriodicThread,
}

impl ServedPorts {
    /// Opens the ports `NAME/SUFFIX`, the output first, and starts to publish; on an error nothing stays open.
    ///
    /// Errors: [`OpenError::NameTaken`], [`OpenError::Port`], [`OpenError::Thread`].
    pub(crate) async fn open(
        network: &Network,
        name: &str,
        output: (&str, PortOptions),
        input: (&str, PortOptions),
        publish: impl FnOnce(Arc<Port>) -> io::Result<PeriodicThread>,
    ) -> Result<Self, OpenError> {
        let [output, input] = open_all(network, name, [output, input]).await?;
        let output = Arc::new(output);
        match publish(output.clone()) {
            Ok(publisher) => Ok(Self {
                name: name.to_owned(),
                running: Some(Running {
                    inputs: vec![input],
                    output,
                    publisher,
                }),
                runtime: Handle::current(),
            }),
            Err(error) => {
                close_all([input].into_iter().chain(Arc::into_inner(output))).await;
                Err(OpenError::Thread(error))
            }
        }
    }

    /// Returns the prefix of the ports' names.
    pub(crate) fn name(&self) -> &str {
        &self.name
    }

    /// Closes the ports and unregisters their names; takes a few seconds at most, even if peers do not answer.
    pub(crate) async fn close(mut self) {
        if let Some(running) = self.running.take() {
            running.close().await;
        }
    }
}

impl Drop for ServedPorts {
    fn drop(&mut self) {
        if let Some(running) = self.running.take() {
            self.runtime.spawn(running.close());
        }
    }
}

impl Running {
    async fn close(self) {
        close_all(self.inputs).await;
        self.publisher.end(PUBLISHER_END_TIMEOUT).await;
        close_all(Arc::into_inner(self.output)).await;
    }
}
