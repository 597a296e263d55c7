//! Reading of large messages: others do not wait for it, and its memory is bounded.
//!
//! A value takes some forty bytes in memory and may take two on the wire. So the values of messages above [`LONG_WORK`] count
//! against a budget of the process, by an upper bound that is known before they are read.

use std::sync::LazyLock;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::{Duration, Instant};

use tokio::runtime::{Handle, RuntimeFlavor};
use tokio::sync::{Semaphore, SemaphorePermit};
use tracing::warn;
use yarp_wire::Bottle;
use yarp_wire::bottle::DecodeError;
use yarp_wire::message::{Form, Payload, ReadObject};

use crate::port_limits::{PARSED_BUDGET, Reservation};

/// Bytes of a message above which reading it takes long enough for others to notice.
pub(crate) const LONG_WORK: usize = 64 * 1024;

/// Bytes of the values of a binary message above which reading it takes as long.
const MANY_VALUES: usize = 1 << 20;
/// Time after which a large message is handled although others still are.
const TURN_TIMEOUT: Duration = Duration::from_secs(10);

/// Large messages that are handled at a time: half of the processors stay free for others.
static TURNS: LazyLock<Semaphore> = LazyLock::new(|| {
    let processors = std::thread::available_parallelism().map_or(1, usize::from);
    Semaphore::new((processors / 2).max(1))
});

/// Returns whether a message is so small that reading it is bounded by its length.
pub(crate) fn is_small(payload: &Payload) -> bool {
    payload.len() <= LONG_WORK
}

/// Returns whether reading a message as a bottle takes long.
pub(crate) fn takes_long(payload: &Payload) -> bool {
    let takes_long = || match payload.form() {
        Form::Text => true,
        // A blob is read at once, however large.
        Form::Binary(_) => payload.max_bottle_size() > MANY_VALUES,
    };
    !is_small(payload) && takes_long()
}

/// Messages that wait for their turn.
static WAITING: AtomicUsize = AtomicUsize::new(0);

/// The turn of a large message, from the moment it comes.
struct Turn {
    /// None if the message waited for too long, and is handled nevertheless.
    permit: Option<SemaphorePermit<'static>>,
    begin: Instant,
}

impl Turn {
    /// Waits until it is the turn of a large message to be handled.
    ///
    /// A connection that waits needs no thread. The wait ends after [`TURN_TIMEOUT`].
    async fn wait() -> Self {
        Self::wait_within(TURN_TIMEOUT).await
    }

    async fn wait_within(timeout: Duration) -> Self {
        WAITING.fetch_add(1, Ordering::Relaxed);
        let _waiting = Waiting;
        let permit = tokio::time::timeout(timeout, TURNS.acquire()).await;
        Self {
            permit: permit.ok().and_then(Result::ok),
            begin: Instant::now(),
        }
    }

    /// Ends the turn. The next one comes at once if no message waits for it, else after a rest as long as this one: many peers that
    /// ask for much take at most half of the time of those who ask for little.
    fn end(self) {
        if let Some(permit) = self.permit
            && WAITING.load(Ordering::Relaxed) > 0
        {
            let rest = self.begin.elapsed();
            tokio::spawn(async move {
                tokio::time::sleep(rest).await;
                drop(permit);
            });
        }
    }
}

/// Counts a message as waiting until it is dropped, as it is with a connection that ends.
struct Waiting;

impl Drop for Waiting {
    fn drop(&mut self) {
        WAITING.fetch_sub(1, Ordering::Relaxed);
    }
}

/// Does work on so many bytes of a message; if they are many, in a way that lets another thread see to the other tasks
/// of this one, where there are several threads.
pub(crate) fn long_work<T>(bytes: usize, work: impl FnOnce() -> T) -> T {
    let may_leave = || {
        let flavor = Handle::try_current().map(|handle| handle.runtime_flavor());
        matches!(flavor, Ok(RuntimeFlavor::MultiThread))
    };
    match bytes > LONG_WORK && may_leave() {
        true => tokio::task::block_in_place(work),
        false => work(),
    }
}

/// Does work on so many bytes for a peer; if they are many, in turn with other such work of the process, and without keeping
/// the other tasks of this thread waiting.
///
/// For owners whose replies are large: the list of a large network.
pub async fn run_large<T>(bytes: usize, work: impl FnOnce() -> T) -> T {
    if bytes <= LONG_WORK {
        return work();
    }
    let turn = Box::pin(Turn::wait()).await;
    let result = long_work(bytes, work);
    turn.end();
    result
}

/// Returns a reservation of the bytes that the values of a message of `length` bytes take; none if the message is small.
pub(crate) fn reserve_large(
    length: usize,
    size: impl FnOnce() -> usize,
) -> Result<Option<Reservation>, DecodeError> {
    if length <= LONG_WORK {
        return Ok(None);
    }
    let bytes = size();
    if bytes == 0 {
        return Ok(None);
    }
    let reservation = PARSED_BUDGET.reserve(bytes);
    if reservation.is_none() {
        warn!(
            "a message of {length} bytes is not read: its values take {bytes} bytes in memory, and less is left for messages"
        );
    }
    reservation.map(Some).ok_or(DecodeError::NoMemory { bytes })
}

/// Reads a message as a bottle.
pub(crate) fn read_bottle(payload: &Payload) -> Result<(Bottle, Option<Reservation>), DecodeError> {
    read_within(payload, Payload::max_bottle_size, Payload::to_bottle)
}

/// Reads a message as an object.
pub(crate) fn read_object<T: ReadObject>(
    payload: &Payload,
) -> Result<(T, Option<Reservation>), DecodeError> {
    read_within(payload, T::max_read_size, T::read)
}

fn read_within<T>(
    payload: &Payload,
    size: impl FnOnce(&Payload) -> usize,
    read: impl FnOnce(&Payload) -> Result<T, DecodeError>,
) -> Result<(T, Option<Reservation>), DecodeError> {
    let length = payload.len();
    match payload.form() {
        Form::Text => long_work(length, || {
            let reservation = reserve_large(length, || size(payload))?;
            Ok((read(payload)?, reservation))
        }),
        Form::Binary(_) => {
            let reservation = reserve_large(length, || size(payload))?;
            let values = reservation.as_ref().map_or(0, Reservation::bytes);
            long_work(values, || Ok((read(payload)?, reservation)))
        }
    }
}

#[cfg(test)]
mod tests {
    use std::sync::mpsc;

    use bytes::Bytes;
    use yarp_wire::{Value, WireVersion};

    use super::*;

    /// Two who sent much text kept everybody else waiting for seconds. The only worker does the work here, and another
    /// task has to run for it to end.
    #[test]
    fn long_work_leaves_the_worker_to_others() {
        let runtime = tokio::runtime::Builder::new_multi_thread()
            .worker_threads(1)
            .build()
            .unwrap();
        let (told, heard) = mpsc::channel();
        let work = runtime.spawn(async move {
            let other = tokio::spawn(async move { told.send(()) });
            let patience = Duration::from_secs(20);
            let result = long_work(LONG_WORK + 1, || heard.recv_timeout(patience));
            let _ = other.await;
            result
        });
        assert_eq!(runtime.block_on(work).unwrap(), Ok(()));
        // Where there is only one thread it is done there.
        assert_eq!(long_work(LONG_WORK + 1, || 7), 7);
        let runtime = tokio::runtime::Builder::new_current_thread().build();
        let work = async { long_work(LONG_WORK + 1, || 7) };
        assert_eq!(runtime.unwrap().block_on(work), 7);
    }

    #[test]
    fn many_values_take_long_and_a_blob_does_not() {
        let binary = |bottle: Bottle| {
            let version = WireVersion::V3;
            Payload::new(bottle.encode(version), Form::Binary(version))
        };
        let text = |length: usize| Payload::new("a".repeat(length).into(), Form::Text);
        assert!(!takes_long(&text(LONG_WORK)) && takes_long(&text(LONG_WORK + 1)));
        let values = |count: usize| (0..count).map(|_| Value::from(1_i32)).collect();
        let fits = MANY_VALUES / size_of::<Value>() - 1;
        assert!(!takes_long(&binary(values(fits))) && takes_long(&binary(values(fits + 2))));
        assert!(!takes_long(&binary(Bottle::of(Bytes::from(vec![
            0;
            1 << 20
        ])))));
    }

    /// Takes all turns.
    async fn take_all(timeout: Duration) -> Vec<Turn> {
        let mut taken = Vec::new();
        loop {
            let turn = Turn::wait_within(timeout).await;
            match turn.permit {
                Some(_) => taken.push(turn),
                None => return taken,
            }
        }
    }

    // One test, as the turns are those of the process.
    #[tokio::test]
    async fn turns_come_in_time_and_after_a_rest() {
        let short = Duration::from_millis(20);
        let mut taken = take_all(short).await;
        assert!(!taken.is_empty());
        assert_eq!(run_large(LONG_WORK, || 1).await, 1);
        let mut large = std::pin::pin!(run_large(LONG_WORK + 1, || 2));
        let early = tokio::time::timeout(short, &mut large).await;
        assert!(early.is_err(), "large work was done out of turn");
        let end_after_work = |mut turn: Turn| {
            turn.begin -= Duration::from_millis(100);
            turn.end();
            TURNS.available_permits()
        };
        let turn = taken.pop().unwrap();
        assert_eq!(end_after_work(turn), 0, "somebody waits, after a rest");
        assert_eq!(large.await, 2);
        let turn = Turn::wait_within(short).await;
        assert!(turn.permit.is_some());
        assert_eq!(end_after_work(turn), 1, "nobody waits: there is no rest");
        // Those who gave up do not wait.
        taken.extend(take_all(short).await);
        let turn = taken.pop().unwrap();
        assert_eq!(end_after_work(turn), 1);
        assert!(Turn::wait_within(short).await.permit.is_some());
    }
}
