//! Publishes the pose of the tool every period, and the events after it.

use std::io;
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::sync::mpsc::Receiver;
use std::time::Duration;

use tokio::sync::mpsc::UnboundedSender;
use yarp_devices::CartesianEvent;
use yarp_ports::Port;
use yarp_wire::Stamp;
use yarp_wire::float_vector::Vector;

use super::cartesian_request_handler::RequestHandler;
use crate::periodic_thread::PeriodicThread;

/// Starts publishing poses on `state`, and passes `events` on to their writer.
pub(super) fn start(
    handler: Arc<RequestHandler>,
    state: Arc<Port>,
    events: Receiver<CartesianEvent>,
    written: UnboundedSender<CartesianEvent>,
    period: Duration,
) -> io::Result<PeriodicThread> {
    // Stock counts from 0.
    let mut stamp = Stamp::new(-1, 0.0);
    let mut failing = false;
    PeriodicThread::start("cartesian-server", period, move || {
        match handler.controller().and_then(|arm| arm.pose()) {
            Ok(now) => {
                stamp = stamp.next(now.time);
                handler.count.store(stamp.count, Ordering::Relaxed);
                let pose = Vector(now.pose.to_array().into());
                state.write_if_idle(&pose, Some(stamp.into()));
                failing = false;
            }
            Err(error) if !failing => {
                tracing::warn!("the pose of the tool is not known: {error}");
                failing = true;
            }
            Err(_) => {}
        }
        // After the state of the cycle, as stock.
        for event in events.try_iter() {
            // The writer has ended: the server closes.
            let _ = written.send(event);
        }
    })
}
