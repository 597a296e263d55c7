//! A server: its ports, its work on them, closing.

use std::io;
use std::sync::Arc;
use std::time::Duration;

use tokio::runtime::Handle;
use yarp_ports::{Network, Port, PortOptions};

use crate::OpenError;
use crate::open_ports::{close_all, open_all, port_name};
use crate::periodic_thread::PeriodicThread;

/// Timeout of the end of publishing, and of each other thread of a server.
pub(crate) const PUBLISHER_END_TIMEOUT: Duration = Duration::from_secs(1);

/// Work of a server on its ports, such as publishing.
pub(crate) trait PortWork: Send + 'static {
    /// Ends the work in bounded time and releases the output ports.
    fn end(self) -> impl Future<Output = ()> + Send;
}

impl PortWork for PeriodicThread {
    fn end(self) -> impl Future<Output = ()> + Send {
        Self::end(self, PUBLISHER_END_TIMEOUT)
    }
}

/// A port of a server, to be opened.
pub(crate) struct ServedPort {
    suffix: String,
    /// Name of its own, in place of one with the prefix of the device.
    name: Option<String>,
    is_input: bool,
    options: PortOptions,
}

impl ServedPort {
    /// A port that only receives: `NAME/SUFFIX`, or `NAME` if the suffix is empty.
    pub(crate) fn input(suffix: impl Into<String>, options: PortOptions) -> Self {
        Self {
            suffix: suffix.into(),
            name: None,
            is_input: true,
            options,
        }
    }

    /// A port that the server's work writes to, named like an input.
    pub(crate) fn output(suffix: impl Into<String>, options: PortOptions) -> Self {
        Self {
            is_input: false,
            ..Self::input(suffix, options)
        }
    }

    /// Gives the port a name without the prefix of the device.
    pub(crate) fn named(self, name: impl Into<String>) -> Self {
        Self {
            name: Some(name.into()),
            ..self
        }
    }
}

/// The ports of a served device and the work on them. Dropping it closes them in the background, as far as the
/// runtime still runs.
#[derive(Debug)]
pub(crate) struct ServedPorts<W: PortWork = PeriodicThread> {
    name: String,
    running: Option<Running<W>>,
    /// Runtime of the ports, for closing them from anywhere.
    runtime: Handle,
}

#[derive(Debug)]
struct Running<W> {
    inputs: Vec<Port>,
    outputs: Vec<Arc<Port>>,
    work: W,
    /// True if the inputs close before the work ends.
    inputs_first: bool,
}

impl<W: PortWork> ServedPorts<W> {
    /// Opens the ports in this order and starts the work on the outputs; on an error nothing stays open.
    ///
    /// Errors: [`OpenError::NameTaken`], [`OpenError::Port`], [`OpenError::Thread`].
    ///
    /// Cancelling closes the ports in the background.
    pub(crate) async fn open(
        network: &Network,
        name: &str,
        ports: Vec<ServedPort>,
        start: impl FnOnce(&[Arc<Port>]) -> io::Result<W>,
    ) -> Result<Self, OpenError> {
        let (inputs, outputs) = open_ports(network, name, ports).await?;
        match start(&outputs) {
            Ok(work) => Ok(Self {
                name: name.to_owned(),
                running: Some(Running {
                    inputs,
                    outputs,
                    work,
                    inputs_first: false,
                }),
                runtime: Handle::current(),
            }),
            Err(error) => {
                close_all(inputs.into_iter().chain(owned(outputs))).await;
                Err(OpenError::Thread(error))
            }
        }
    }

    /// Closes the inputs before the work ends; otherwise all ports close after it.
    pub(crate) fn inputs_close_first(mut self) -> Self {
        if let Some(running) = &mut self.running {
            running.inputs_first = true;
        }
        self
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

impl<W: PortWork> Drop for ServedPorts<W> {
    fn drop(&mut self) {
        if let Some(running) = self.running.take() {
            self.runtime.spawn(running.close());
        }
    }
}

impl<W: PortWork> Running<W> {
    async fn close(mut self) {
        if self.inputs_first {
            close_all(self.inputs.drain(..)).await;
        }
        self.work.end().await;
        close_all(self.inputs.into_iter().chain(owned(self.outputs))).await;
    }
}

/// Opens the ports; returns inputs and outputs. No request makes the ports of a device deaf, or its process slow.
async fn open_ports(
    network: &Network,
    name: &str,
    ports: Vec<ServedPort>,
) -> Result<(Vec<Port>, Vec<Arc<Port>>), OpenError> {
    let are_inputs: Vec<bool> = ports.iter().map(|port| port.is_input).collect();
    let wanted = ports.into_iter().map(|port| {
        let options = port.options.deny_modification();
        let own = port.name;
        (
            own.unwrap_or_else(|| port_name(name, &port.suffix)),
            options,
        )
    });
    let opened = open_all(network, wanted.collect()).await?;
    let (mut inputs, mut outputs) = (Vec::new(), Vec::new());
    for (port, is_input) in opened.into_iter().zip(are_inputs) {
        match is_input {
            true => inputs.push(port),
            false => outputs.push(Arc::new(port)),
        }
    }
    Ok((inputs, outputs))
}

/// Returns the ports that are no longer shared; the others close when they are dropped.
fn owned(ports: Vec<Arc<Port>>) -> impl Iterator<Item = Port> {
    ports.into_iter().filter_map(Arc::into_inner)
}

#[cfg(test)]
mod tests {
    use std::sync::Mutex;

    use yarp_nameserver::{Server, ServerOptions};
    use yarp_ports::remote_admin;

    use super::*;

    /// Work that notes, when it ends, which ports are still there.
    struct Noting {
        network: Network,
        seen: Arc<Mutex<Vec<bool>>>,
    }

    impl PortWork for Noting {
        async fn end(self) {
            for port in ["/device/in", "/device"] {
                let there = remote_admin::exists(&self.network, port).await;
                self.seen.lock().unwrap().push(there.unwrap());
            }
        }
    }

    #[tokio::test]
    async fn inputs_close_before_the_work_ends_if_so_chosen_and_outputs_after_it() {
        let options = ServerOptions::default().at("127.0.0.1", 0);
        let names = Server::start(options).await.unwrap();
        let network = names.network();
        for inputs_first in [false, true] {
            let seen = Arc::new(Mutex::new(Vec::new()));
            let ports = vec![
                ServedPort::input("in", PortOptions::new()),
                ServedPort::output("", PortOptions::new()),
            ];
            let work = Noting {
                network: network.clone(),
                seen: seen.clone(),
            };
            let opening = ServedPorts::open(&network, "/device", ports, |_| Ok(work));
            let mut served = opening.await.unwrap();
            if inputs_first {
                served = served.inputs_close_first();
            }
            served.close().await;
            assert_eq!(*seen.lock().unwrap(), [!inputs_first, true]);
            for port in ["/device/in", "/device"] {
                assert!(!remote_admin::exists(&network, port).await.unwrap());
            }
        }
    }
}
