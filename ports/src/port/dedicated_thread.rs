//! A thread of its own for a connection that was told how to be scheduled, or has much to do.
//!
//! Connections are tasks that share the threads of the runtime. One that is told a policy moves, for
//! the rest of its life, to a thread that has that policy and serves nothing else; one that expands
//! pictures begins on such a thread. The same thread waits for its bytes, so that none of the others
//! need run before it. What the connection begins there (other connections, timers) belongs to the runtime that it came from; threads that are started
//! there do not have its priority in real time. A handler that calls tokio's `block_in_place` there has
//! the connection go on on another thread: it should not.
//!
//! Between messages a connection looks whether it is to move. Until then it is where it was; the
//! thread is there, with its policy, before anybody is told so. What wakes a connection over `shmem`
//! comes from the old runtime still.

use std::future::{Future, poll_fn};
use std::io;
use std::pin::Pin;
use std::sync::{Arc, OnceLock};
use std::task::{Context, Poll};

use tokio::runtime::{Builder, Handle, Runtime};
use tokio::sync::watch;
use tokio::task::{JoinError, JoinHandle};

use super::socket_qos::SocketHandle;
use crate::thread_schedule::{self, Schedule};

/// The thread; it ends when nobody has this any more.
#[derive(Debug)]
pub(crate) struct DedicatedThread {
    /// Of one thread, for what moves there.
    runtime: Option<Runtime>,
    /// The system's number of the thread.
    id: i32,
    /// What the connection has sent on since it is here.
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

    /// The system's number of the thread.
    pub(crate) fn id(&self) -> i32 {
        self.id
    }

    pub(crate) fn schedule(&self) -> io::Result<Schedule> {
        Schedule::of(self.id)
    }

    pub(crate) fn set_schedule(&self, schedule: Schedule) -> io::Result<()> {
        schedule.give(self.id)
    }

    /// What the connection sends on, once it has moved.
    pub(crate) fn socket(&self) -> Option<&SocketHandle> {
        self.socket.get()
    }

    /// Runs a connection here to its end, which comes with that of this call, too.
    ///
    /// Sockets that `begin` makes anew are waited for by this thread; it also gives a handle of what the
    /// connection sends on. `None` if the connection panicked, or the thread is gone with its runtime.
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

/// What others tell an incoming connection: to end, or to move. Dropped, it says to end.
#[derive(Debug)]
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

    /// The connection's own thread, if it was given one.
    pub(crate) fn thread(&self) -> Option<Arc<DedicatedThread>> {
        self.0.borrow().thread.clone()
    }
}

impl ControlReceiver {
    /// Returns once the connection shall end.
    pub(crate) async fn ended(&mut self) {
        // An error says that nobody steers any more, which is as good.
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
