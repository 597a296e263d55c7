//! Ports for programs that do not write async.
//!
//! The tasks run on two threads of their own; each call here waits for its result and may be made
//! from any thread, even one of another runtime.

use std::cell::Cell;
use std::future::Future;
use std::sync::{Arc, Mutex, OnceLock, PoisonError, mpsc};
use std::time::Duration;

use tokio::runtime::{Builder, Runtime};
use yarp_wire::message::{ReadObject, WireObject};

use crate::compiled_here::CompiledHere;
use crate::error::PortError;
use crate::network::Network;
use crate::port::{PortOptions, Received};

/// Returns the threads on which the ports of this module live.
fn runtime() -> &'static Runtime {
    static RUNTIME: OnceLock<Runtime> = OnceLock::new();
    RUNTIME.get_or_init(|| {
        Builder::new_multi_thread()
            .worker_threads(2)
            .thread_name("yarp-ports")
            .on_thread_start(|| OWN.set(true))
            .enable_all()
            .build()
            .expect("the system has threads to give")
    })
}

thread_local! {
    /// `true` on the threads of this module.
    static OWN: Cell<bool> = const { Cell::new(false) };
}

/// Runs a future to its end on the threads of this module. The future is dropped before this returns.
pub fn wait<T: Send + 'static>(future: impl Future<Output = T> + Send + 'static) -> T {
    let result = Arc::new(Mutex::new(None));
    let slot = Arc::clone(&result);
    wait_for(Box::pin(async move {
        let value = future.await;
        *slot.lock().unwrap_or_else(PoisonError::into_inner) = Some(value);
    }));
    let value = result.lock().unwrap_or_else(PoisonError::into_inner).take();
    value.expect("the future runs to its end")
}

/// Runs a task to its end, also if it panics. What does not depend on its result is compiled once.
fn wait_for(task: CompiledHere<'static, ()>) {
    let (ending, ended) = mpsc::sync_channel::<()>(0);
    runtime().spawn(async move {
        let _ending = ending;
        task.await;
    });
    let receive = || {
        // Nothing is sent: the end of the task drops the other side.
        let _ = ended.recv();
    };
    if OWN.get() {
        // A handler of a port that calls another device: its tasks move to another thread meanwhile.
        tokio::task::block_in_place(receive);
    } else {
        receive();
    }
}

/// Runs a future on the threads of this module, for ports that outlive the caller's runtime. Dropping the returned future
/// leaves it running.
///
/// Panics as `future` does.
pub async fn spawn<T: Send + 'static>(future: impl Future<Output = T> + Send + 'static) -> T {
    match runtime().spawn(future).await {
        Ok(done) => done,
        Err(error) => std::panic::resume_unwind(error.into_panic()),
    }
}

/// A port whose calls block.
///
/// ```no_run
/// # fn example() -> Result<(), yarp_ports::PortError> {
/// use std::time::Duration;
/// use yarp_ports::{Network, PortOptions, blocking::Port};
/// use yarp_wire::Bottle;
///
/// let port = Port::open(&Network::from_process()?, "/me", PortOptions::new().rpc_client())?;
/// port.connect("/wam/rpc:i")?;
/// let answer: Bottle = port.call(&Bottle::parse("[get] [axes]").unwrap(), Duration::from_secs(1))?;
/// println!("{answer}");
/// # Ok(()) }
/// ```
#[derive(Debug)]
pub struct Port {
    port: Option<std::sync::Arc<crate::Port>>,
}

impl Port {
    /// Opens a port like [`crate::Port::open`].
    pub fn open(network: &Network, name: &str, options: PortOptions) -> Result<Self, PortError> {
        let (network, name) = (network.clone(), name.to_owned());
        let port = wait(async move { crate::Port::open(&network, &name, options).await })?;
        Ok(Self {
            port: Some(port.into()),
        })
    }

    /// Returns the same port for async code.
    pub fn as_async(&self) -> &crate::Port {
        self.port.as_ref().expect("taken only on drop")
    }

    fn shared(&self) -> std::sync::Arc<crate::Port> {
        self.port.clone().expect("taken only on drop")
    }

    /// Returns the name.
    pub fn name(&self) -> &str {
        self.as_async().name()
    }

    /// Connects like [`crate::Port::connect`].
    pub fn connect(&self, to: &str) -> Result<(), PortError> {
        let (port, to) = (self.shared(), to.to_owned());
        wait(async move { port.connect(&to).await })
    }

    /// Connects like [`crate::Port::connect_over`].
    pub fn connect_over(&self, to: &str, carrier: &str) -> Result<(), PortError> {
        let (port, to, carrier) = (self.shared(), to.to_owned(), carrier.to_owned());
        wait(async move { port.connect_over(&to, &carrier).await })
    }

    /// Returns the oldest message that was kept; waits for one at most until `deadline`, then `None`.
    pub fn read(&self, deadline: Duration) -> Result<Option<Received>, PortError> {
        let port = self.shared();
        wait(async move {
            match tokio::time::timeout(deadline, port.read()).await {
                Ok(read) => read.map(Some),
                Err(_) => Ok(None),
            }
        })
    }

    /// Sends to every reader and waits at most until `deadline`; returns the number of readers that
    /// took it before then.
    pub fn write(
        &self,
        message: impl WireObject + Send + Sync + 'static,
        deadline: Duration,
    ) -> usize {
        let port = self.shared();
        wait(async move {
            let writing = port.write(&message);
            tokio::time::timeout(deadline, writing).await.unwrap_or(0)
        })
    }

    /// Sends like [`crate::Port::write_if_idle`].
    pub fn write_if_idle(&self, message: &impl WireObject) -> usize {
        self.as_async().write_if_idle(message, None)
    }

    /// Sends a request and waits for the reply at most until `deadline`.
    pub fn call<R: ReadObject + Send + 'static>(
        &self,
        request: &(impl WireObject + Clone + Send + Sync + 'static),
        deadline: Duration,
    ) -> Result<R, PortError> {
        let (port, request) = (self.shared(), request.clone());
        wait(async move { port.call_within(&request, deadline).await })
    }
}

impl Drop for Port {
    fn drop(&mut self) {
        let Some(port) = self.port.take() else { return };
        wait(async move {
            if let Some(port) = std::sync::Arc::into_inner(port) {
                port.close().await;
            }
        });
    }
}
