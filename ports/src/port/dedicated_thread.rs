//! Dedicated threads for connections with a scheduling policy or heavy work.
//!
//! Connections are tasks that share the threads of the runtime. A connection that is given a policy
//! moves permanently to a thread with that policy that serves nothing else; one that decodes JPEG
//! images begins on such a thread. The same thread waits for its bytes, so that no other thread has
//! to run first. Other connections and timers that the connection starts belong to its original
//! runtime; threads started there do not inherit its real-time priority. A handler that calls
//! tokio's `block_in_place` there moves the connection to another thread and should not.
//!
//! A connection checks between messages whether it has to move. Until then it stays on its old
//! thread; the new thread exists, with its policy, before the request is answered. Wake-ups of a
//! connection over `shmem` still come from the old runtime.

use std::future::{Future, poll_fn};
use std::io;
use std::pin::Pin;
use std::sync::{Arc, OnceLock};
use std::task::{Context, Poll};

use tokio::runtime::{Builder, Handle, Runtime};
use tokio::sync::watch;
use tokio::task::{JoinError, JoinHandle};

use super::socket_handle::SocketHandle;
use crate::thread_schedule::{self, Schedule};

/// A dedicated thread; it ends when the last reference is dropped.
#[derive(Debug)]
pub(crate) struct DedicatedThread {
    /// A runtime of one thread, for the connection that moves there.
    runtime: Option<Runtime>,
    /// The system's number of the thread.
    id: i32,
    /// The socket that the connection sends on since it moved.
    socket: OnceLock<SocketHandle>,
}

impl DedicatedThread {
    /// Starts a thread that has this policy, if it is to have one; none is left if it cannot have it.
    pub(crate) async fn start(schedule: Option<Schedule>) -> io::Result<Arc<Self>> {
        let runtime = Builder::new_multi_thread()
            .worker_threads(1)
            .thread_name("yarp-connection")
            .enable_io()
            .build()?;
        let asking = runtime.spawn(async move {
            match schedule {
                Some(schedule) => schedule.apply_to_current_thread(),
                None => Ok(thread_schedule::thread()),
            }
        });
        let mut thread = Self {
            runtime: Some(runtime),
            id: 0,
            socket: OnceLock::new(),
        };
        thread.id = asking.await.map_err(io::Error::other)??;
        Ok(Arc::new(thread))
    }

    /// Returns the system's number of the thread.
    pub(crate) fn id(&self) -> i32 {
        self.id
    }

    pub(crate) fn schedule(&self) -> io::Result<Schedule> {
        Schedule::of(self.id)
    }

    pub(crate) fn set_schedule(&self, schedule: Schedule) -> io::Result<()> {
        schedule.give(self.id)
    }

    /// Returns the socket that the connection sends on, once it has moved.
    pub(crate) fn socket(&self) -> Option<&SocketHandle> {
        self.socket.get()
    }

    /// Runs a connection on this thread until it ends; cancelling this call cancels it.
    ///
    /// `begin` recreates the sockets so that this thread waits for them, and returns a handle of
    /// the sending one. `None` if the connection panicked, or the thread has ended with its
    /// runtime.
    pub(crate) async fn run<F>(
        &self,
        begin: impl FnOnce() -> (SocketHandle, F) + Send,
    ) -> Option<F::Output>
    where
        F: Future<Output: Send + 'static> + Send + 'static,
    {
        let home = Handle::current();
        let runtime = self.runtime.as_ref()?;
        let connection = {
            let _here = runtime.enter();
            let (socket, connection) = begin();
            // A connection moves once.
            let _ = self.socket.set(socket);
            connection
        };
        let mut connection = Box::pin(connection);
        let running = runtime.spawn(poll_fn(move |context| {
            let _home = home.enter();
            connection.as_mut().poll(context)
        }));
        AbortOnDrop(running).await.ok()
    }
}

impl Drop for DedicatedThread {
    fn drop(&mut self) {
        if let Some(runtime) = self.runtime.take() {
            runtime.shutdown_background();
        }
    }
}

struct AbortOnDrop<T>(JoinHandle<T>);

impl<T> Future for AbortOnDrop<T> {
    type Output = Result<T, JoinError>;

    fn poll(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<Self::Output> {
        Pin::new(&mut self.0).poll(context)
    }
}

impl<T> Drop for AbortOnDrop<T> {
    fn drop(&mut self) {
        self.0.abort();
    }
}

/// Requests an incoming connection to close or to move. Dropping it closes the connection.
#[derive(Clone, Debug)]
pub(crate) struct ConnectionControl(watch::Sender<ControlState>);

/// The end of a [`ConnectionControl`] that the connection listens to.
#[derive(Clone, Debug)]
pub(crate) struct ControlReceiver(watch::Receiver<ControlState>);

#[derive(Debug, Default)]
struct ControlState {
    ends: bool,
    thread: Option<Arc<DedicatedThread>>,
}

impl ConnectionControl {
    pub(crate) fn new() -> (Self, ControlReceiver) {
        let (sender, receiver) = watch::channel(ControlState::default());
        (Self(sender), ControlReceiver(receiver))
    }

    pub(crate) fn end(&self) {
        self.0.send_modify(|state| state.ends = true);
    }

    /// Has the connection move, unless it was given a thread before; gives the one that it has now.
    pub(crate) fn give(&self, thread: Arc<DedicatedThread>) -> Arc<DedicatedThread> {
        let mut has = thread.clone();
        self.0
            .send_modify(|state| has = state.thread.get_or_insert(thread).clone());
        has
    }

    /// Returns the connection's own thread, if it was given one.
    pub(crate) fn thread(&self) -> Option<Arc<DedicatedThread>> {
        self.0.borrow().thread.clone()
    }
}

impl ControlReceiver {
    /// Waits until the connection must close.
    pub(crate) async fn ended(&mut self) {
        // An error means that the sender was dropped, which also ends the connection.
        let _ = self.0.wait_for(|state| state.ends).await;
    }

    /// The thread to move to, once there is one.
    pub(crate) async fn thread(&mut self) -> Arc<DedicatedThread> {
        let given = match self.0.wait_for(|state| state.thread.is_some()).await {
            Ok(state) => state.thread.clone(),
            Err(_) => None,
        };
        match given {
            Some(thread) => thread,
            None => std::future::pending().await,
        }
    }
}
