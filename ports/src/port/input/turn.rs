//! The turn of a connection: the messages that it handles before other tasks run.

use std::time::{Duration, Instant};

/// Messages after which the time is looked at.
const MESSAGES: usize = 256;
/// Messages that one with an answer counts for.
const ANSWERED: usize = 16;
/// Bytes of an answer that count for one more message: a status with many connections takes long to write.
const ANSWER_BYTES: usize = 64;
/// Time that a turn may take: a pause after every 256 messages would cost a tenth of the rate of small ones.
const DURATION: Duration = Duration::from_micros(500);

/// Counts the messages of a connection since other tasks ran.
pub(super) struct Turn {
    messages: usize,
    begun: Instant,
}

impl Turn {
    pub(super) fn begin(now: Instant) -> Self {
        Self {
            messages: 0,
            begun: now,
        }
    }

    /// Counts a message with an answer of this many bytes; returns whether other tasks must run before the next one, and
    /// begins the next turn then.
    pub(super) fn is_over(&mut self, answer: Option<usize>, now: impl Fn() -> Instant) -> bool {
        self.messages += answer.map_or(1, |bytes| ANSWERED + bytes / ANSWER_BYTES);
        if self.messages < MESSAGES {
            return false;
        }
        self.messages = 0;
        let now = now();
        let is_over = now.duration_since(self.begun) >= DURATION;
        if is_over {
            self.begun = now;
        }
        is_over
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns after how many messages each of three turns is over, if one takes this long.
    fn turns(answer: Option<usize>, message: Duration) -> [u32; 3] {
        let mut now = Instant::now();
        let mut turn = Turn::begin(now);
        [(); 3].map(|()| {
            let mut count = 0;
            loop {
                count += 1;
                now += message;
                if turn.is_over(answer, || now) {
                    return count;
                }
            }
        })
    }

    #[test]
    fn a_turn_ends_after_256_messages_and_500_microseconds() {
        assert_eq!(turns(None, Duration::from_micros(2)), [256; 3]);
        assert_eq!(turns(None, Duration::from_nanos(1953)), [512; 3]);
        assert_eq!(turns(None, Duration::from_nanos(400)), [1280; 3]);
    }

    #[test]
    fn messages_with_answers_count_for_more() {
        assert_eq!(turns(Some(63), Duration::from_millis(1)), [16; 3]);
        assert_eq!(turns(Some(64 * 16), Duration::from_millis(1)), [8; 3]);
    }
}
