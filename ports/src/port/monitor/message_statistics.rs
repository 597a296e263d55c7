//! `statistics`: counts messages and reports the counts by `[get]`.
//!
//! Stock's `stats_monitor` of 4.0 opens two ports that report bytes and messages per second; this
//! one accepts its name too, so that such connections work, but opens none.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Instant;

use yarp_wire::Bottle;
use yarp_wire::message::Payload;

use super::{Made, Monitor, MonitorSetup, Passing, parameter};

#[derive(Debug)]
pub(super) struct Statistics {
    since: Instant,
    messages: AtomicU64,
    bytes: AtomicU64,
    replies: AtomicU64,
    reply_bytes: AtomicU64,
}

impl Statistics {
    pub(super) fn make(_: &MonitorSetup) -> Made {
        Ok(Arc::new(Self {
            since: Instant::now(),
            messages: AtomicU64::new(0),
            bytes: AtomicU64::new(0),
            replies: AtomicU64::new(0),
            reply_bytes: AtomicU64::new(0),
        }))
    }
}

fn count(messages: &AtomicU64, bytes: &AtomicU64, payload: &Payload) {
    messages.fetch_add(1, Ordering::Relaxed);
    bytes.fetch_add(payload.len() as u64, Ordering::Relaxed);
}

impl Monitor for Statistics {
    fn update(&self, message: Passing) -> Option<Passing> {
        count(&self.messages, &self.bytes, &message.payload);
        Some(message)
    }

    fn reply(&self, reply: Payload) -> Payload {
        count(&self.replies, &self.reply_bytes, &reply);
        reply
    }

    /// Counts, and how many seconds they were counted for.
    fn get(&self) -> Bottle {
        let whole = |number: &AtomicU64| number.load(Ordering::Relaxed) as i64;
        Bottle::from_iter([
            parameter("messages", whole(&self.messages)),
            parameter("bytes", whole(&self.bytes)),
            parameter("replies", whole(&self.replies)),
            parameter("reply_bytes", whole(&self.reply_bytes)),
            parameter("seconds", self.since.elapsed().as_secs_f64()),
        ])
    }
}
