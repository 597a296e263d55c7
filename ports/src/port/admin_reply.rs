//! Parts of the answers to admin requests.

use yarp_wire::{Bottle, Value, Vocab32};

use crate::thread_schedule::Schedule;

pub(super) fn ok() -> Bottle {
    Bottle::of(Vocab32::OK)
}

pub(super) fn fail(reason: &str) -> Bottle {
    Bottle::from_iter([Vocab32::FAIL.into(), reason.into()])
}

/// `0 TEXT` or `-1 TEXT`.
pub(super) fn counted(result: Result<String, String>) -> Bottle {
    let (code, text) = match result {
        Ok(text) => (0, text),
        Err(text) => (-1, text),
    };
    Bottle::from_iter([Value::Int32(code), text.into()])
}

pub(super) fn pair(key: &str, value: impl Into<Value>) -> Value {
    Bottle::from_iter([key.into(), value.into()]).into()
}

pub(super) fn group<const N: usize>(key: &str, pairs: [Value; N]) -> Value {
    pair(key, Value::Dictionary(Bottle::from_iter(pairs)))
}

/// `(sched ((policy P) (priority P) (tid T)))`
pub(super) fn scheduling(schedule: Schedule, thread: i32) -> Value {
    let policy = [
        pair("policy", schedule.policy),
        pair("priority", schedule.priority),
        pair("tid", thread),
    ];
    group("sched", policy)
}
