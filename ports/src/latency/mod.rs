//! Latency and throughput optimisations.
//!
//! Each has a name ([`Optimisation`]), by which a measuring build switches it off:
//! `conformance/bench/run.sh only optimisations [NAME]` runs ours against ours, with and without it
//! in turn, and prints the gain. What was measured, when and where, is in `docs/benchmarks.md`. An
//! optimisation that gains less than 3 % there is removed, unless the last column gives another
//! reason to keep it.
//!
//! | name | effect | file | also needed for |
//! | --- | --- | --- | --- |
//! | `busy-poll` | a thread that expects bytes soon polls for them before it sleeps | `busy_poll` | |
//! | `yield` | a polling thread yields to the peer, which may wait for its processor | `busy_poll` | machines with few processors |
//! | `gather` | small unrequested messages are left in the socket for 20 µs and read together | `busy_poll` | small messages of stock's writers |
//! | `suppress-wakeups` | bytes for a polling thread wake no other one | `tcp_stream`, `unix_socket` | |
//! | `low-water-mark` | a large message wakes its reader once many bytes are there | `tcp_stream` | large messages of stock's writers |
//! | `no-delay` | TCP sends small messages at once (`TCP_NODELAY`) | `socket` | acknowledged messages, which wait for delayed acknowledgements otherwise |
//! | `unix-write-poll` | a writer polls for room in a Unix socket, which reports it late | `stream_output` | |
//! | `unix-send-buffer` | a Unix socket has a send buffer of 300 kB | `unix_socket` | |
//! | `shmem-poll` | an end of shared memory polls before it sleeps | `shmem` | |
//! | `write-batch` | queued small messages lie one behind the other and leave in one system call | `write_batch` | |
//! | `shared-parts` | large parts of a message are not copied into the batch | `write_batch` | images without copies |
//! | `encode-once` | a message is encoded once for all readers of a form | `encode_once` | |
//! | `buffer-reuse` | buffers are reused by the next message | `form_buffers`, `socket` | small messages that allocate nothing |
//! | `direct-write` | the publishing thread writes a periodic message itself | `send_queue` | |
//! | `inline-handling` | a message that needs no wait is handled without a future of its own | `input` | |
//! | `first-reply` | the header reply waits up to 1 ms for the reply to the first message | `input` | |
//! | `timer-slack` | threads with deadlines have low timer slack and short time slices | `timer_slack` | deadlines of control loops |
//!
//! The carrier `local` and the threads of single connections
//! ([`dedicated_thread`](crate::port::dedicated_thread)) are functions, not optimisations.

mod busy_poll;
mod form_buffers;
mod optimisation_switches;
mod tcp_stream;
mod timer_slack;
mod write_batch;

pub(crate) use busy_poll::{BusyPoll, Expecting, MAX_POLL_DURATION, Yielder};
pub(crate) use form_buffers::{Form, keep_form, write_form};
pub(crate) use optimisation_switches::Optimisation;
pub(crate) use tcp_stream::Tcp;
pub use timer_slack::request_low_timer_slack;
pub(crate) use write_batch::{Batch, DatagramBatch};
