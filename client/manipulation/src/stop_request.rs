//! Requests to stop.

use std::sync::Arc;
use std::sync::atomic::{AtomicU8, Ordering};

/// A request to stop.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub enum StopRequest {
    /// Nobody asked.
    None,
    /// Finish the current object, then end.
    AfterObject,
    /// Halt at once; a held object stays held.
    Now,
}

/// A stop button that threads share: the first press finishes the current object, the second halts at once.
#[derive(Clone, Debug, Default)]
pub struct Stop(Arc<AtomicU8>);

impl Stop {
    /// Presses the button; a third press has no effect.
    pub fn press(&self) {
        let more = |presses: u8| Some(presses.saturating_add(1).min(2));
        // Never refused.
        let _ = self
            .0
            .fetch_update(Ordering::AcqRel, Ordering::Acquire, more);
    }

    /// Halts at once.
    pub fn halt(&self) {
        self.0.store(2, Ordering::Release);
    }

    /// Returns the request.
    pub fn request(&self) -> StopRequest {
        match self.0.load(Ordering::Acquire) {
            0 => StopRequest::None,
            1 => StopRequest::AfterObject,
            _ => StopRequest::Now,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_second_press_halts() {
        let stop = Stop::default();
        let button = stop.clone();
        assert_eq!(stop.request(), StopRequest::None);
        button.press();
        assert_eq!(stop.request(), StopRequest::AfterObject);
        button.press();
        button.press();
        assert_eq!(stop.request(), StopRequest::Now);
    }
}
