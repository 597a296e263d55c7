//! Names of the optimisations, and a switch for each one to measure its gain.
//!
//! The switches exist only with the feature `latency-ablation`, which only the benchmark enables:
//! the environment variable `YARP_LATENCY_WITHOUT` lists the names that are off. In every other
//! build [`Optimisation::is_enabled`] is constant, and the compiler removes the test.

/// One optimisation of the table in [`latency`](super).
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub(crate) enum Optimisation {
    BusyPoll,
    Yield,
    Gather,
    SuppressWakeups,
    LowWaterMark,
    NoDelay,
    UnixWritePoll,
    UnixSendBuffer,
    #[cfg_attr(
        not(feature = "shmem"),
        allow(dead_code, reason = "only shared memory asks for it")
    )]
    ShmemPoll,
    WriteBatch,
    SharedParts,
    EncodeOnce,
    BufferReuse,
    DirectWrite,
    InlineHandling,
    FirstReply,
    TimerSlack,
}

impl Optimisation {
    /// Returns whether the optimisation is in use: always, except in a measuring build.
    #[cfg(not(feature = "latency-ablation"))]
    #[inline]
    pub(crate) const fn is_enabled(self) -> bool {
        true
    }

    /// Returns whether the optimisation is in use: `YARP_LATENCY_WITHOUT` does not list its name.
    #[cfg(feature = "latency-ablation")]
    #[inline]
    pub(crate) fn is_enabled(self) -> bool {
        use std::sync::LazyLock;

        static DISABLED: LazyLock<u32> = LazyLock::new(|| {
            let names = std::env::var("YARP_LATENCY_WITHOUT").unwrap_or_default();
            let names = names.split(',').filter(|name| !name.is_empty());
            names.fold(0, |disabled, name| {
                let known = ALL.iter().find(|(_, known)| *known == name);
                let (optimisation, _) =
                    known.unwrap_or_else(|| panic!("YARP_LATENCY_WITHOUT: no optimisation {name}"));
                disabled | 1 << *optimisation as u32
            })
        });
        *DISABLED & 1 << self as u32 == 0
    }
}

/// Names of the optimisations in `YARP_LATENCY_WITHOUT`.
#[cfg(feature = "latency-ablation")]
const ALL: [(Optimisation, &str); 17] = [
    (Optimisation::BusyPoll, "busy-poll"),
    (Optimisation::Yield, "yield"),
    (Optimisation::Gather, "gather"),
    (Optimisation::SuppressWakeups, "suppress-wakeups"),
    (Optimisation::LowWaterMark, "low-water-mark"),
    (Optimisation::NoDelay, "no-delay"),
    (Optimisation::UnixWritePoll, "unix-write-poll"),
    (Optimisation::UnixSendBuffer, "unix-send-buffer"),
    (Optimisation::ShmemPoll, "shmem-poll"),
    (Optimisation::WriteBatch, "write-batch"),
    (Optimisation::SharedParts, "shared-parts"),
    (Optimisation::EncodeOnce, "encode-once"),
    (Optimisation::BufferReuse, "buffer-reuse"),
    (Optimisation::DirectWrite, "direct-write"),
    (Optimisation::InlineHandling, "inline-handling"),
    (Optimisation::FirstReply, "first-reply"),
    (Optimisation::TimerSlack, "timer-slack"),
];
