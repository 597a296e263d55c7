//! The thread that owns the camera: it takes images, executes the tasks of callers, and opens an unplugged camera again.

use std::sync::Arc;
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, TrySendError, sync_channel};
use std::time::{Duration, Instant};

use rustix::event::{EventfdFlags, PollFd, PollFlags, Timespec, eventfd, poll};
use rustix::fd::OwnedFd;

use super::bindings::{FIRST_CODING, FIRST_FILTER, index};
use super::frame_conversion::{FrameError, FrameLayout};
use super::iidc_session::Session;
use super::iidc_state::Shared;
use super::opened_camera::FrameView;
use crate::camera::hardware::{Failure, REOPEN_INTERVAL, mirrored};
use crate::error::chain;
use crate::image::Image;
use crate::{DeviceError, clock};

/// Longest wait for a frame or a task, after which the thread looks whether it shall end.
const POLL_INTERVAL: Duration = Duration::from_millis(100);
/// Maximum time that a caller waits for its task, with those before it. A task takes tens of accesses to registers, of about a
/// millisecond each; it ends at the first that fails, which on USB takes the library 1 s if the camera does not answer. More than that is a
/// call that blocks: the handshake of format 7 has no timeout.
pub(super) const CALL_TIMEOUT: Duration = Duration::from_secs(10);
/// Maximum number of tasks that wait.
const MAX_TASKS: usize = 16;

/// Minimum time between two messages about images that are left out.
const LEFT_OUT_INTERVAL: Duration = Duration::from_secs(10);

/// A task of a caller.
struct Task {
    /// Time at which the caller stops waiting.
    deadline: Instant,
    run: Box<dyn FnOnce(&mut Session) + Send>,
}

/// The callers' end of the thread's queue of tasks.
pub(super) struct TaskSender {
    sender: SyncSender<Task>,
    wake: Arc<OwnedFd>,
    device: String,
    timeout: Duration,
}

/// The thread's end of its queue of tasks.
pub(super) struct TaskQueue {
    tasks: Receiver<Task>,
    wake: Arc<OwnedFd>,
}

/// Creates a queue of tasks, each of which is waited for until `timeout`.
pub(super) fn task_queue(
    device: &str,
    timeout: Duration,
) -> Result<(TaskSender, TaskQueue), DeviceError> {
    let wake = eventfd(0, EventfdFlags::CLOEXEC | EventfdFlags::NONBLOCK);
    let wake = wake.map_err(|error| DeviceError::Start {
        what: "the thread of the camera",
        source: error.into(),
    })?;
    let wake = Arc::new(wake);
    let (sender, tasks) = sync_channel(MAX_TASKS);
    let sender = TaskSender {
        sender,
        wake: Arc::clone(&wake),
        device: device.to_owned(),
        timeout,
    };
    Ok((sender, TaskQueue { tasks, wake }))
}

impl TaskSender {
    /// Lets the thread execute a task, and waits for its result.
    pub(super) fn run<T: Send + 'static>(
        &self,
        task: impl FnOnce(&mut Session) -> Result<T, DeviceError> + Send + 'static,
    ) -> Result<T, DeviceError> {
        let failed = |step: &str, advice: &str| DeviceError::Remote {
            peer: self.device.clone(),
            step: step.to_owned(),
            advice: advice.to_owned(),
            source: None,
        };
        let (reply, result) = sync_channel(1);
        let deadline = Instant::now() + self.timeout;
        let run = Box::new(move |session: &mut Session| {
            // A caller whose task took too long is not there any more.
            let _ = reply.try_send(task(session));
        });
        let task = Task { deadline, run };
        match self.sender.try_send(task) {
            Ok(()) => {}
            Err(TrySendError::Full(_)) => {
                let advice = "again: too many requests wait for the camera";
                return Err(failed("queueing a request", advice));
            }
            Err(TrySendError::Disconnected(_)) => {
                return Err(failed("queueing a request", "starting the camera again"));
            }
        }
        // It fails only when the thread is woken anyway.
        let _ = rustix::io::write(&*self.wake, &1_u64.to_ne_bytes());
        match result.recv_timeout(self.timeout) {
            Ok(result) => result,
            Err(RecvTimeoutError::Timeout) => Err(failed(
                "waiting for the camera",
                "plugging the camera in again: a call of its library blocks",
            )),
            Err(RecvTimeoutError::Disconnected) => Err(failed(
                "waiting for the camera",
                "starting the camera again",
            )),
        }
    }
}

/// The thread's part of a camera.
pub(super) struct CaptureThread {
    shared: Arc<Shared>,
    session: Session,
    queue: TaskQueue,
    left_out: LeftOut,
}

/// Images left out since the last message about them.
#[derive(Debug, Default)]
struct LeftOut {
    count: u64,
    reported: Option<Instant>,
}

impl LeftOut {
    /// Counts an image that is left out, and returns the number of them if a message is due.
    fn count(&mut self, now: Instant) -> Option<u64> {
        self.count += 1;
        let since = self
            .reported
            .map(|then| now.saturating_duration_since(then));
        if since.is_some_and(|since| since < LEFT_OUT_INTERVAL) {
            return None;
        }
        self.reported = Some(now);
        Some(std::mem::take(&mut self.count))
    }
}

impl CaptureThread {
    pub(super) fn new(shared: Arc<Shared>, session: Session, queue: TaskQueue) -> Self {
        Self {
            shared,
            session,
            queue,
            left_out: LeftOut::default(),
        }
    }

    /// Opens the camera, tells the outcome, takes images until the camera is closed, and opens it again when it fails.
    pub(super) fn run(mut self, opened: &SyncSender<Result<(), DeviceError>>) {
        let outcome = self.session.open();
        let failed = outcome.is_err();
        if opened.try_send(outcome).is_err() || failed {
            return;
        }
        while !self.shared.capture.is_ending() {
            let outcome = self.capture();
            self.session.close();
            let Err(mut failure) = outcome else {
                return;
            };
            loop {
                self.shared.capture.report(failure);
                self.pause();
                if self.shared.capture.is_ending() {
                    return;
                }
                match self.session.open() {
                    Ok(()) => break,
                    Err(error) => failure = Failure::of_open(&error),
                }
            }
        }
    }

    /// Executes tasks for a while, without a camera.
    fn pause(&mut self) {
        let end = Instant::now() + REOPEN_INTERVAL;
        while !self.shared.capture.is_ending() {
            let rest = end.saturating_duration_since(Instant::now());
            if rest.is_zero() {
                return;
            }
            self.wait(rest.min(POLL_INTERVAL));
            self.run_task();
        }
    }

    /// Waits for a frame or a task.
    fn wait(&self, timeout: Duration) {
        let timeout = Timespec::try_from(timeout).unwrap_or_default();
        let wake = PollFd::new(&*self.queue.wake, PollFlags::IN);
        let camera = self.session.camera().ok();
        // Another outcome than a frame is seen when one is taken.
        let _ = match camera.and_then(|camera| camera.file()) {
            Some(file) => {
                let mut files = [wake, PollFd::from_borrowed_fd(file, PollFlags::IN)];
                poll(&mut files, Some(&timeout))
            }
            None => poll(&mut [wake], Some(&timeout)),
        };
    }

    /// Executes the next task, if there is one. Skips a task whose caller has stopped waiting.
    fn run_task(&mut self) {
        let mut count = [0; 8];
        // Nothing is there to read when nobody has woken the thread.
        let _ = rustix::io::read(&*self.queue.wake, &mut count);
        let Ok(task) = self.queue.tasks.try_recv() else {
            return;
        };
        // The next round looks for the next task without waiting.
        let _ = rustix::io::write(&*self.queue.wake, &1_u64.to_ne_bytes());
        if Instant::now() < task.deadline {
            (task.run)(&mut self.session);
        }
    }

    /// Takes images until the camera is closed or fails.
    fn capture(&mut self) -> Result<(), Failure> {
        let mut last_image = Instant::now();
        let mut defect: Option<FrameError> = None;
        while !self.shared.capture.is_ending() {
            self.wait(POLL_INTERVAL);
            let (before, starts) = (Instant::now(), self.session.starts);
            self.run_task();
            // No image is taken during a task, and the camera begins anew when the capture was started again.
            last_image = match self.session.starts == starts {
                true => last_image + before.elapsed(),
                false => Instant::now(),
            };
            match self.take().map_err(|error| of_stream(&error))? {
                Some(Ok(())) => {
                    last_image = Instant::now();
                    defect = None;
                }
                Some(Err(reason)) => {
                    if let Some(count) = self.left_out.count(Instant::now()) {
                        let device = &self.shared.capture.device;
                        tracing::warn!("{device}: images left out: {count}, the last: {reason}");
                    }
                    defect = Some(reason);
                }
                // Nothing is expected of a camera that was told to send nothing.
                None if !self.session.is_sending() => last_image = Instant::now(),
                None => {}
            }
            if last_image.elapsed() > self.shared.frame_timeout {
                return Err(timed_out(self.shared.frame_timeout, defect));
            }
        }
        Ok(())
    }

    /// Takes the newest frame, if there is one, and hands its image to the readers.
    fn take(&mut self) -> Result<Option<Result<(), FrameError>>, DeviceError> {
        let time = clock::now();
        let camera = self.session.camera_mut()?;
        let taken = camera.take(|frame| (frame.packet_bytes, images(frame)))?;
        let Some((packet_bytes, images)) = taken else {
            return Ok(None);
        };
        self.session.last_packet_bytes = Some(packet_bytes);
        Ok(Some(
            images.map(|(image, raw)| self.publish(image, raw, time)),
        ))
    }

    fn publish(&self, image: Image, raw: Option<Image>, time: f64) {
        let image = match self.shared.state().mirrored {
            true => mirrored(&image).unwrap_or(image),
            false => image,
        };
        self.shared.capture.publish(image, raw, time);
    }
}

/// Returns the image of a frame in red, green and blue, and the values of the sensor if the frame has them.
fn images(frame: &FrameView<'_>) -> Result<(Image, Option<Image>), FrameError> {
    if frame.damaged {
        return Err(FrameError::Damaged);
    }
    let layout = FrameLayout::new(
        frame.size,
        index(frame.coding, FIRST_CODING),
        frame.filter.map(|filter| index(filter, FIRST_FILTER)),
        frame.depth,
        frame.little_endian,
    )?;
    Ok((layout.image(frame.bytes)?, layout.raw_image(frame.bytes)?))
}

fn of_stream(error: &DeviceError) -> Failure {
    Failure {
        step: "taking an image",
        cause: chain(error),
        advice: "plugging the camera in again; it is opened by itself then",
    }
}

fn timed_out(timeout: Duration, defect: Option<FrameError>) -> Failure {
    Failure {
        step: "waiting for an image",
        cause: match defect {
            Some(defect) => format!("no usable image within {timeout:?}, the last: {defect}"),
            None => format!("no image within {timeout:?}"),
        },
        advice: "a lower rate or a smaller size, and a bus that no other camera shares",
    }
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
    use std::thread;

    use super::*;
    use crate::camera::IidcOptions;

    fn refusal(sender: &TaskSender) -> String {
        sender.run(|_| Ok(())).unwrap_err().to_string()
    }

    #[test]
    fn no_more_tasks_wait_than_there_is_room_for() {
        let (sender, queue) = task_queue("camera", CALL_TIMEOUT).unwrap();
        thread::scope(|scope| {
            let waiting: Vec<_> = (0..16).map(|_| scope.spawn(|| refusal(&sender))).collect();
            // Those that wait fill the queue; the next one is refused at once.
            yarp_testing::until_within(Duration::from_secs(10), "a full queue", || {
                let mut count = [0; 8];
                rustix::io::read(&*queue.wake, &mut count).ok()?;
                let woken = u64::from_ne_bytes(count);
                rustix::io::write(&*queue.wake, &count).ok()?;
                (woken == 16).then_some(())
            });
            assert!(refusal(&sender).contains("too many requests"));
            drop(queue);
            for thread in waiting {
                let words = thread.join().unwrap();
                assert!(words.contains("starting the camera again"), "{words}");
            }
        });
        assert!(refusal(&sender).contains("starting the camera again"));
    }

    #[test]
    fn a_task_that_is_not_executed_fails_in_time() {
        let (sender, queue) = task_queue("camera", Duration::from_millis(10)).unwrap();
        let words = refusal(&sender);
        assert!(words.contains("a call of its library blocks"), "{words}");
        let executed = Arc::new(AtomicBool::new(false));
        let by_task = Arc::clone(&executed);
        let outcome = sender.run(move |_| {
            by_task.store(true, Ordering::Release);
            Ok(())
        });
        assert!(outcome.is_err());
        // It is not executed later, when the caller may have asked for something else.
        let shared = Arc::new(Shared::new("camera", false, CALL_TIMEOUT));
        let session = Session::new(IidcOptions::new(), Arc::clone(&shared));
        let mut thread = CaptureThread::new(shared, session, queue);
        thread.run_task();
        thread.run_task();
        assert!(thread.queue.tasks.try_recv().is_err());
        assert!(!executed.load(Ordering::Acquire));
    }

    #[test]
    fn images_left_out_are_reported_once_in_an_interval() {
        let mut left_out = LeftOut::default();
        let start = Instant::now();
        assert_eq!(left_out.count(start), Some(1));
        let at = |millis| start + Duration::from_millis(millis);
        for millis in [1, 5000, 9999] {
            assert_eq!(left_out.count(at(millis)), None);
        }
        assert_eq!(left_out.count(at(10_000)), Some(4));
        assert_eq!(left_out.count(at(10_001)), None);
    }

    #[test]
    fn one_task_is_executed_in_a_round() {
        let (sender, queue) = task_queue("camera", CALL_TIMEOUT).unwrap();
        let shared = Arc::new(Shared::new("camera", false, CALL_TIMEOUT));
        let session = Session::new(IidcOptions::new(), Arc::clone(&shared));
        let mut thread = CaptureThread::new(shared, session, queue);
        let count = Arc::new(AtomicUsize::new(0));
        thread::scope(|scope| {
            for _ in 0..3 {
                let (sender, count) = (&sender, Arc::clone(&count));
                scope.spawn(move || {
                    sender.run(move |_| {
                        count.fetch_add(1, Ordering::AcqRel);
                        Ok(())
                    })
                });
            }
            for executed in 1..=3 {
                yarp_testing::until_within(Duration::from_secs(10), "a task", || {
                    thread.run_task();
                    (count.load(Ordering::Acquire) > executed - 1).then_some(())
                });
                assert_eq!(count.load(Ordering::Acquire), executed);
                // The thread does not wait while there are tasks, nor when it looks whether there are.
                let files = &mut [PollFd::new(&*thread.queue.wake, PollFlags::IN)];
                let woken = poll(files, Some(&Timespec::default())).unwrap();
                assert_eq!(woken, 1);
            }
        });
    }

    #[test]
    fn a_camera_that_is_not_there_says_so() {
        let (sender, queue) = task_queue("camera", CALL_TIMEOUT).unwrap();
        let shared = Arc::new(Shared::new("camera", false, CALL_TIMEOUT));
        let session = Session::new(IidcOptions::new(), Arc::clone(&shared));
        let mut thread = CaptureThread::new(shared, session, queue);
        thread::scope(|scope| {
            let asked = scope.spawn(|| sender.run(|session| session.mode()));
            while !asked.is_finished() {
                thread.wait(POLL_INTERVAL);
                thread.run_task();
            }
            let words = asked.join().unwrap().unwrap_err().to_string();
            assert!(
                words.contains("whether the camera is plugged in"),
                "{words}"
            );
        });
    }
}
