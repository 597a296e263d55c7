//! Latency optimisations, in one place.

mod ablation;
mod busy_poll;
mod form_buffers;
mod tcp_stream;
mod timer_slack;
mod write_batch;

pub(crate) use ablation::Optimisation;
pub(crate) use busy_poll::{BusyPoll, Expecting, MAX_POLL_DURATION, Yielder};
pub(crate) use form_buffers::{Form, keep_form, write_form};
pub(crate) use tcp_stream::Tcp;
pub use timer_slack::request_low_timer_slack;
pub(crate) use write_batch::{Batch, DatagramBatch};
