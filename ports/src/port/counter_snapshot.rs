//! Snapshot of the counters of a port and its connections.

use std::time::SystemTime;

use yarp_wire::Stamp;

use super::connections::Connections;
use super::counters::{ConnectionCounters, Ended, PortCounters};

impl Connections {
    /// Returns the counters of the port and of its connections; `waiting` messages wait to be read.
    pub(super) fn counters(&self, waiting: usize) -> PortCounters {
        let now = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH);
        let now = now.map_or(0.0, |now| now.as_secs_f64());
        let age = |stamp: Option<Stamp>| stamp.map(|stamp| now - stamp.time);
        let outputs = self.outputs();
        let inputs = self.inputs();
        // A connection counts among the ended ones from the moment that it leaves the list.
        let Ended {
            mut received,
            mut sent,
        } = *self.ended();
        let mut connections = Vec::new();
        for input in inputs.iter() {
            let (traffic, stamp) = (input.meter.traffic(), input.meter.stamp());
            received.add(traffic);
            connections.push(ConnectionCounters {
                peer: input.from.clone(),
                carrier: input.carrier_text.clone(),
                incoming: true,
                traffic,
                queued: 0,
                unanswered: 0,
                stamp,
                age: age(stamp),
            });
        }
        for output in outputs.iter() {
            let depth = output.send_queue.depth();
            sent.add(depth.traffic);
            connections.push(ConnectionCounters {
                peer: output.to.clone(),
                carrier: output.carrier_text.clone(),
                incoming: false,
                traffic: depth.traffic,
                queued: depth.queued,
                unanswered: depth.unanswered,
                stamp: depth.stamp,
                age: age(depth.stamp),
            });
        }
        PortCounters {
            received,
            sent,
            waiting,
            connections,
        }
    }
}
