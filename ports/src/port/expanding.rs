//! Pictures on their way to images, in threads of their own: expanding takes milliseconds, and others shall
//! not wait for it.
//!
//! A thread goes on with the next picture as long as there is one; another joins it where they pile up. Two from
//! the beginning would take the processors from the writer, if that is on this machine.

use std::collections::VecDeque;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread;
use std::time::{Duration, Instant};

use bytes::{Bytes, BytesMut};
use tokio::sync::oneshot;
use tokio::task::spawn_blocking;
use yarp_wire::Dialect;
use yarp_wire::message::{Payload, Pieces, WireObject};
use yarp_wire::mjpeg::{self, Part};
use yarp_wire::typed::Image;

use super::picture::{self, PictureError};

/// Pictures that are taken in before the first has become an image.
const MOST: usize = 4;
/// Those that wait where another thread joins.
const PILE: usize = 2;
/// The most threads.
const THREADS: usize = 2;
/// A thread that has nothing to do looks for the next picture for so long before it ends, if the last one came that
/// soon: one that is begun for each picture is begun beside the writer, whom it keeps from its work.
const SOON: Duration = Duration::from_micros(300);
/// Images whose memory is kept: new memory costs a tenth of expanding.
const KEPT: usize = 3;

/// What became of a picture; `None` if expanding it panicked.
pub(super) type Expanded = Option<Result<Payload, PictureError>>;

/// Pictures of one connection, in their order.
#[derive(Default)]
pub(super) struct Expanding {
    /// The images, or where they will be, with their envelopes.
    coming: VecDeque<(Option<Bytes>, oneshot::Receiver<Expanded>)>,
    work: Arc<Mutex<Work>>,
}

#[derive(Default)]
struct Work {
    waiting: VecDeque<(Part, oneshot::Sender<Expanded>)>,
    threads: usize,
    /// When a picture was last missing, and whether the next one came soon.
    missing_since: Option<Instant>,
    comes_soon: bool,
    /// The pixels of the last images, whose memory is used again once nobody else has them.
    last: VecDeque<Bytes>,
}

impl Expanding {
    /// Whether there is room for another picture.
    pub(super) fn has_room(&self) -> bool {
        self.coming.len() < MOST
    }

    /// Takes in a picture.
    pub(super) fn push(&mut self, part: Part) {
        let envelope = mjpeg::comment(&part.body);
        let (image, coming) = oneshot::channel();
        self.coming.push_back((envelope, coming));
        let mut work = lock(&self.work);
        if let Some(since) = work.missing_since.take() {
            work.comes_soon = since.elapsed() < SOON;
        }
        work.waiting.push_back((part, image));
        let joins = work.threads == 0 || work.waiting.len() >= PILE;
        if joins && work.threads < THREADS {
            work.threads += 1;
            let work = self.work.clone();
            spawn_blocking(move || expand(&work));
        }
    }

    /// The next image, in the order in which the pictures came, and its envelope; `None` if no picture is on its way.
    /// May be cancelled.
    pub(super) async fn next(&mut self) -> Option<(Expanded, Option<Bytes>)> {
        let (_, coming) = self.coming.front_mut()?;
        let image = coming.await.unwrap_or_default();
        let (envelope, _) = self.coming.pop_front()?;
        Some((image, envelope))
    }
}

fn lock(work: &Mutex<Work>) -> MutexGuard<'_, Work> {
    work.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Expands pictures until none waits.
fn expand(work: &Mutex<Work>) {
    let mut idle_since = None;
    loop {
        let mut held = lock(work);
        let Some((part, image)) = held.waiting.pop_front() else {
            let now = Instant::now();
            held.missing_since.get_or_insert(now);
            if !held.comes_soon || now - *idle_since.get_or_insert(now) >= SOON {
                held.threads -= 1;
                return;
            }
            drop(held);
            thread::yield_now();
            continue;
        };
        idle_since = None;
        // Nobody waits for it once the connection is gone.
        if image.is_closed() {
            continue;
        }
        let buffer = held.buffer();
        drop(held);
        let expanded = catch_unwind(AssertUnwindSafe(|| picture::expand(&part.body, buffer)));
        let expanded = expanded.ok().map(|expanded| {
            let expanded = expanded?;
            lock(work).keep(&expanded);
            let mut pieces = Pieces::new();
            expanded.write_pieces(&mut pieces, Dialect::V3);
            Ok(Payload::of_pieces(&pieces, Dialect::V3))
        });
        let _ = image.send(expanded);
    }
}

impl Work {
    /// The memory of an image that nobody has any more.
    fn buffer(&mut self) -> BytesMut {
        let free = self.last.iter().position(Bytes::is_unique);
        let free = free.and_then(|place| self.last.remove(place));
        free.and_then(|pixels| pixels.try_into_mut().ok())
            .unwrap_or_default()
    }

    /// Its memory will be used again.
    fn keep(&mut self, image: &Image) {
        if self.last.len() == KEPT {
            self.last.pop_front();
        }
        self.last.push_back(image.pixels().clone());
    }
}

#[cfg(test)]
mod tests {
    use yarp_wire::message::ReadObject;
    use yarp_wire::typed::PixelCode;

    use super::*;

    /// An image of one grey, large enough to be shared.
    fn grey(level: u8) -> Image {
        Image::from_packed(PixelCode::RGB, 256, 96, vec![level; 3 * 256 * 96]).unwrap()
    }

    fn part(level: u8) -> Part {
        let body = picture::compress(&grey(level)).unwrap();
        let kind = "image/jpeg".to_owned();
        Part { kind, body }
    }

    fn is_grey(image: &Image, level: u8) -> bool {
        image.packed().iter().all(|byte| byte.abs_diff(level) < 4)
    }

    async fn next(expanding: &mut Expanding) -> Image {
        let (image, _) = expanding.next().await.expect("a picture is on its way");
        Image::read(&image.unwrap().unwrap()).unwrap()
    }

    #[tokio::test]
    async fn an_image_stays_what_it_is_for_as_long_as_somebody_has_it() {
        let mut expanding = Expanding::default();
        let mut kept = Vec::new();
        for round in 0..4 {
            let mut passed = Vec::new();
            while expanding.has_room() {
                let level = (20 * round + passed.len() * 3) as u8;
                expanding.push(part(level));
                passed.push(level);
            }
            for level in passed {
                let image = next(&mut expanding).await;
                assert!(is_grey(&image, level), "{level}");
                if level % 2 == 0 {
                    kept.push((image, level));
                }
            }
        }
        assert!(expanding.next().await.is_none());
        for (image, level) in kept {
            assert!(is_grey(&image, level), "{level} later");
        }
    }

    #[tokio::test]
    async fn memory_is_used_again() {
        let mut expanding = Expanding::default();
        let mut places = Vec::new();
        for _ in 0..3 {
            expanding.push(part(100));
            let image = next(&mut expanding).await;
            places.push(image.pixels().as_ptr());
        }
        assert!(places.iter().all(|place| *place == places[0]));
    }
}
