//! Requests to be sent: queries in their order, and one move (thesis, 5.4.1: commands are never queued).

use std::collections::VecDeque;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{self, Receiver, Sender};

use super::driver_state::Goal;
use crate::DeviceError;
use crate::embedded::protocol::{Reply, Request};

type Outcome = Result<Reply, DeviceError>;

/// A request of a waiting caller.
#[derive(Debug)]
pub(super) struct PendingRequest {
    pub(super) request: Request,
    pub(super) goal: Goal,
    /// Its caller has stopped waiting: it is not to be carried out any more.
    pub(super) abandoned: Arc<AtomicBool>,
    answer: Sender<Outcome>,
}

impl PendingRequest {
    pub(super) fn new(request: Request, goal: Goal) -> (Self, Receiver<Outcome>) {
        let (answer, outcome) = mpsc::channel();
        let order = Self {
            request,
            goal,
            abandoned: Arc::default(),
            answer,
        };
        (order, outcome)
    }

    /// Tells its caller what became of it.
    pub(super) fn answer(&self, outcome: Outcome) {
        // A caller that has stopped waiting does not receive it.
        let _ = self.answer.send(outcome);
    }

    pub(super) fn fail_as_replaced(&self, peer: &str) {
        self.answer(Err(DeviceError::Refused {
            peer: format!("the driver of {peer}"),
            step: format!(
                "{}: a newer move took its place before it was sent",
                self.request.kind().step()
            ),
            advice: "again when the newer move has ended".to_owned(),
        }));
    }
}

/// Requests that wait. Its length is bounded by the number of callers, each of which waits for one.
#[derive(Debug, Default)]
pub(super) struct PendingRequests {
    direct: VecDeque<PendingRequest>,
    motion: Option<PendingRequest>,
}

impl PendingRequests {
    /// Takes a request; a move takes the place of one that waits, which comes back.
    pub(super) fn put(&mut self, order: PendingRequest) -> Option<PendingRequest> {
        if order.request.kind().is_move() {
            return self.motion.replace(order);
        }
        self.direct.push_back(order);
        None
    }

    /// The next to be sent: a move after everything else.
    pub(super) fn take(&mut self) -> Option<PendingRequest> {
        let wanted = |order: &PendingRequest| !order.abandoned.load(Ordering::Acquire);
        while let Some(order) = self.direct.pop_front() {
            if wanted(&order) {
                return Some(order);
            }
        }
        self.motion.take().filter(wanted)
    }

    /// Returns whether a move is pending.
    pub(super) fn has_move(&self) -> bool {
        self.motion.is_some()
    }

    /// Takes out everything.
    pub(super) fn clear(&mut self) -> Vec<PendingRequest> {
        let motion = self.motion.take();
        self.direct.drain(..).chain(motion).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn order(request: Request) -> (PendingRequest, Receiver<Outcome>) {
        PendingRequest::new(request, Goal::Unknown)
    }

    #[test]
    fn of_three_moves_one_is_sent_one_refused_and_the_newest_waits() {
        let mut pending = PendingRequests::default();
        let (first, _first) = order(Request::Home);
        assert!(pending.put(first).is_none());
        assert_eq!(pending.take().unwrap().request, Request::Home);
        // Now it is on its way, and two more come.
        let (second, told) = order(Request::MovePose([0.0; 6]));
        assert!(pending.put(second).is_none());
        let (third, _third) = order(Request::MoveJoints(vec![0.0; 7]));
        pending.put(third).unwrap().fail_as_replaced("the arm");
        let refused = told.recv().unwrap().unwrap_err().to_string();
        assert!(refused.contains("newer move took its place"), "{refused}");
        assert!(pending.has_move());
        assert_eq!(
            pending.take().unwrap().request,
            Request::MoveJoints(vec![0.0; 7])
        );
        assert!(pending.take().is_none());
    }

    #[test]
    fn questions_go_before_a_move_and_in_their_order() {
        let mut pending = PendingRequests::default();
        for request in [Request::Home, Request::Gravity, Request::Pose] {
            assert!(pending.put(order(request).0).is_none());
        }
        let sent: Vec<_> = std::iter::from_fn(|| pending.take())
            .map(|order| order.request)
            .collect();
        assert_eq!(sent, [Request::Gravity, Request::Pose, Request::Home]);
    }

    #[test]
    fn nobody_moves_for_a_caller_who_has_gone() {
        let mut pending = PendingRequests::default();
        for request in [Request::Home, Request::Pose] {
            let (order, _outcome) = order(request);
            order.abandoned.store(true, Ordering::Release);
            pending.put(order);
        }
        assert!(pending.take().is_none());
    }
}
