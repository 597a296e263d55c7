//! A detector that works while its user does something else.

use std::panic::resume_unwind;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use std::time::Duration;

use crate::detector::{DetectError, Detector};
use crate::item::Item;
use crate::stop_request::{Stop, StopRequest};

type Outcome = Result<Vec<Item>, DetectError>;

/// Interval between two looks whether a detection has ended, or somebody wants to halt.
const POLL_INTERVAL: Duration = Duration::from_millis(5);

/// Carries out detections in a thread of their own, for a detector that needs time for images or another program: they may be
/// [begun](Detector::begin_detection) early, and nobody waits for one who wants to halt at once.
///
/// Dropping it waits for the end of what was begun, unless somebody wants to halt.
#[derive(Debug)]
pub struct BackgroundDetector<D> {
    detector: Arc<Mutex<D>>,
    name: &'static str,
    stop: Stop,
    begun: Option<JoinHandle<Outcome>>,
}

impl<D: Detector + Send + 'static> BackgroundDetector<D> {
    /// Wraps a detector, for which nobody waits any more once `stop` asks to halt at once.
    pub fn new(detector: D, stop: Stop) -> Self {
        Self {
            name: detector.name(),
            detector: Arc::new(Mutex::new(detector)),
            stop,
            begun: None,
        }
    }
}

impl<D> BackgroundDetector<D> {
    /// Waits for what was begun; [`DetectError::Stopped`] if somebody wants to halt, while it goes on.
    fn finish(&mut self) -> Option<Outcome> {
        let begun = self.begun.take()?;
        while !begun.is_finished() {
            if self.stop.request() == StopRequest::Now {
                return Some(Err(DetectError::Stopped));
            }
            std::thread::sleep(POLL_INTERVAL);
        }
        Some(begun.join().unwrap_or_else(|panic| resume_unwind(panic)))
    }
}

impl<D> Drop for BackgroundDetector<D> {
    fn drop(&mut self) {
        // The result does not matter any more.
        drop(self.finish());
    }
}

fn lock<D>(detector: &Mutex<D>) -> MutexGuard<'_, D> {
    detector.lock().unwrap_or_else(PoisonError::into_inner)
}

impl<D: Detector + Send + 'static> Detector for BackgroundDetector<D> {
    fn name(&self) -> &'static str {
        self.name
    }

    fn detect(&mut self) -> Outcome {
        self.begin_detection();
        match self.finish() {
            Some(outcome) => outcome,
            // No thread was to be had.
            None => lock(&self.detector).detect(),
        }
    }

    fn begin_detection(&mut self) {
        // What was begun before shows the table as it was then.
        drop(self.finish());
        let detector = Arc::clone(&self.detector);
        let thread = std::thread::Builder::new().name("detector".into());
        // Without a thread it is detected when it is asked for.
        self.begun = thread.spawn(move || lock(&detector).detect()).ok();
    }

    fn finish_detection(&mut self) -> Outcome {
        self.finish().unwrap_or_else(|| self.detect())
    }
}

#[cfg(test)]
mod tests {
    use std::sync::mpsc::{Receiver, Sender, channel};

    use super::*;

    /// Tells when a detection begins, and ends it when it is told to; the number of an object is that of the detection.
    struct Slow {
        begins: Sender<()>,
        ends: Receiver<()>,
        count: u32,
    }

    impl Detector for Slow {
        fn name(&self) -> &'static str {
            "slow"
        }

        fn detect(&mut self) -> Outcome {
            self.begins.send(()).expect("the test listens");
            self.ends.recv().expect("the test tells");
            self.count += 1;
            Err(DetectError::CameraMoved {
                pixels: f64::from(self.count),
            })
        }
    }

    /// Returns a detector, what tells that it begins, and what ends it.
    fn slow(stop: Stop) -> (BackgroundDetector<Slow>, Receiver<()>, Sender<()>) {
        let (begins, begun) = channel();
        let (end, ends) = channel();
        let slow = Slow {
            begins,
            ends,
            count: 0,
        };
        (BackgroundDetector::new(slow, stop), begun, end)
    }

    #[track_caller]
    fn number(outcome: &Outcome) -> f64 {
        match outcome {
            Err(DetectError::CameraMoved { pixels }) => *pixels,
            other => panic!("{other:?}"),
        }
    }

    #[test]
    fn what_was_begun_is_finished_later_and_never_taken_for_a_new_detection() {
        let (mut detector, begun, end) = slow(Stop::default());
        assert_eq!(detector.name(), "slow");
        detector.begin_detection();
        begun.recv().expect("it works while this thread goes on");
        end.send(()).unwrap();
        assert_eq!(number(&detector.finish_detection()), 1.0);
        // Nothing has begun: it is done now.
        end.send(()).unwrap();
        assert_eq!(number(&detector.finish_detection()), 2.0);
        // The third is out of date when the fourth is asked for, and the fifth when the sixth is begun.
        detector.begin_detection();
        end.send(()).unwrap();
        end.send(()).unwrap();
        assert_eq!(number(&detector.detect()), 4.0);
        detector.begin_detection();
        end.send(()).unwrap();
        detector.begin_detection();
        end.send(()).unwrap();
        assert_eq!(number(&detector.finish_detection()), 6.0);
    }

    /// A program that was asked to halt waited 20 s for a camera that was gone.
    #[test]
    fn nobody_who_wants_to_halt_waits_for_a_detection() {
        let stop = Stop::default();
        let (mut detector, begun, end) = slow(stop.clone());
        detector.begin_detection();
        begun.recv().expect("it works");
        stop.halt();
        // It would wait for this test forever.
        let outcome = detector.finish_detection();
        assert!(matches!(outcome, Err(DetectError::Stopped)), "{outcome:?}");
        let outcome = detector.detect();
        assert!(matches!(outcome, Err(DetectError::Stopped)), "{outcome:?}");
        drop(detector);
        // Both go on until their end.
        end.send(()).expect("the first works");
        begun.recv().expect("the second works");
        end.send(()).expect("it waits");
    }
}
