//! The current move, and the requests for its completion.

use std::time::{Duration, Instant};

/// Speed below which a joint is at rest, rad/s.
const STANDSTILL_SPEED: f64 = 0.02;
/// Time for which it must be at rest. The real arm ends up to 14 mm from its target, so that being there is no
/// measure.
const SETTLE_TIME: Duration = Duration::from_millis(50);
/// Maximum number of pending queries for one end: more than any client has.
const MAX_PENDING_QUERIES: usize = 100;

/// Questions that are to be answered now, by their numbers.
#[derive(Clone, Debug, Eq, PartialEq)]
pub(super) struct Ended {
    pub(super) questions: Vec<i32>,
    /// Empty when the move reached its target.
    pub(super) reason: String,
}

/// State of the arm's motion, and the `trf` requests that wait for its end.
#[derive(Debug, Default)]
pub(super) struct Motion {
    running: bool,
    still_since: Option<Instant>,
    asked: i32,
    questions: Vec<i32>,
    /// Of the move that a newer one replaced.
    replaced: Vec<i32>,
}

impl Motion {
    pub(super) fn is_running(&self) -> bool {
        self.running
    }

    pub(super) fn is_still(fastest: f64) -> bool {
        fastest < STANDSTILL_SPEED
    }

    /// A move was accepted; it replaces the previous one.
    pub(super) fn begin(&mut self) {
        self.running = true;
        self.still_since = None;
        self.replaced.append(&mut self.questions);
    }

    /// A `trf` came; whether there is room for it.
    pub(super) fn ask(&mut self) -> bool {
        if self.questions.len() + self.replaced.len() >= MAX_PENDING_QUERIES {
            return false;
        }
        self.asked = self.asked.wrapping_add(1);
        self.questions.push(self.asked);
        true
    }

    /// The connection of these queries is closed; the next one counts from 1.
    pub(super) fn drop_pending_queries(&mut self) {
        self.asked = 0;
        self.questions.clear();
        self.replaced.clear();
    }

    /// Returns the completion to report now; `still` tells whether the arm has arrived and is at rest.
    pub(super) fn look(&mut self, now: Instant, still: bool) -> Option<Ended> {
        if !self.replaced.is_empty() {
            return Some(Ended {
                questions: std::mem::take(&mut self.replaced),
                reason: "a newer move took its place".to_owned(),
            });
        }
        if self.running {
            let since = match (still, self.still_since) {
                (false, _) => {
                    self.still_since = None;
                    return None;
                }
                (true, None) => *self.still_since.insert(now),
                (true, Some(since)) => since,
            };
            if now.saturating_duration_since(since) < SETTLE_TIME {
                return None;
            }
            self.running = false;
        }
        self.tell(String::new())
    }

    /// The move ended otherwise.
    pub(super) fn fail(&mut self, reason: &str) -> Ended {
        self.running = false;
        Ended {
            questions: self.all(),
            reason: reason.to_owned(),
        }
    }

    fn tell(&mut self, reason: String) -> Option<Ended> {
        let questions = self.all();
        (!questions.is_empty()).then_some(Ended { questions, reason })
    }

    fn all(&mut self) -> Vec<i32> {
        let mut questions = std::mem::take(&mut self.replaced);
        questions.append(&mut self.questions);
        questions
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ended(questions: &[i32], reason: &str) -> Option<Ended> {
        Some(Ended {
            questions: questions.to_vec(),
            reason: reason.to_owned(),
        })
    }

    #[test]
    fn without_a_move_the_end_is_told_at_once() {
        let mut motion = Motion::default();
        assert_eq!(motion.look(Instant::now(), false), None);
        assert!(motion.ask());
        assert_eq!(motion.look(Instant::now(), false), ended(&[1], ""));
        assert_eq!(motion.look(Instant::now(), true), None);
    }

    #[test]
    fn a_move_has_ended_when_the_arm_has_stood_for_a_while() {
        let mut motion = Motion::default();
        let now = Instant::now();
        motion.begin();
        assert!(motion.ask());
        assert_eq!(motion.look(now, true), None);
        assert_eq!(motion.look(now + SETTLE_TIME / 2, false), None);
        assert_eq!(motion.look(now + SETTLE_TIME * 2, true), None);
        assert_eq!(motion.look(now + SETTLE_TIME * 3, true), ended(&[1], ""));
        assert!(!motion.is_running());
    }

    #[test]
    fn an_arm_at_rest_is_slower_than_a_fiftieth_of_a_radian_per_second_for_50_ms() {
        assert!(Motion::is_still(0.019) && !Motion::is_still(0.021));
        let mut motion = Motion::default();
        let now = Instant::now();
        motion.begin();
        assert!(motion.ask());
        assert_eq!(motion.look(now, true), None);
        let early = now + Duration::from_millis(49);
        assert_eq!(motion.look(early, true), None);
        let late = now + Duration::from_millis(51);
        assert_eq!(motion.look(late, true), ended(&[1], ""));
    }

    #[test]
    fn a_newer_move_ends_the_older_one() {
        let mut motion = Motion::default();
        let now = Instant::now();
        motion.begin();
        assert!(motion.ask() && motion.ask());
        motion.begin();
        assert!(motion.ask());
        let replaced = ended(&[1, 2], "a newer move took its place");
        assert_eq!(motion.look(now, true), replaced);
        assert_eq!(motion.look(now, true), None);
        assert_eq!(motion.look(now + SETTLE_TIME, true), ended(&[3], ""));
    }

    #[test]
    fn a_flood_of_questions_is_cut_and_a_new_client_counts_from_one() {
        let mut motion = Motion::default();
        motion.begin();
        while motion.ask() {}
        assert_eq!(motion.questions.len(), 100);
        motion.drop_pending_queries();
        assert!(motion.ask());
        assert_eq!(motion.fail("fault").questions, [1]);
    }
}
