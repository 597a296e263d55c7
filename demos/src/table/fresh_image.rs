//! Images that were taken after they were asked for, of cameras that rest in between.

use std::panic::resume_unwind;
use std::time::{Duration, Instant};

use yarp_client::{Camera, Network};
use yarp_devices::image::Frame;
use yarp_devices::{DeviceError, FrameGrabberImage};

/// Images after the first one of a resumed stream, until one is certainly new: when the stream was resumed, the first may have been on
/// its way already and the second being taken.
const NEW_IMAGES: u64 = 2;
/// Interval between two looks for an image.
const POLL_INTERVAL: Duration = Duration::from_millis(5);

/// Connects to a camera that rests until somebody looks.
///
/// Errors: those of [`Camera::connect_on`].
pub(super) fn connect_resting(network: &Network, name: &str) -> yarp_client::Result<Camera> {
    let camera = Camera::connect_on(network, name)?;
    camera.pause();
    Ok(camera)
}

/// Resumes the streams of all cameras, returns an image of each that was taken since then, and pauses the streams again.
pub(super) fn fresh_images<const N: usize>(
    cameras: [&Camera; N],
    timeout: Duration,
) -> [Result<Frame, NoImage>; N] {
    std::thread::scope(|scope| {
        let look = |camera: &Camera| {
            camera.resume();
            let image = fresh_image(|| camera.image(), timeout);
            camera.pause();
            image
        };
        // All begin before one is waited for.
        let looks = cameras.map(|camera| scope.spawn(move || look(camera)));
        looks.map(|look| look.join().unwrap_or_else(|panic| resume_unwind(panic)))
    })
}

/// Reasons why there is no new image.
#[derive(Debug, thiserror::Error)]
pub(super) enum NoImage {
    /// None that is new came in time.
    #[error("no new image came in time")]
    Stale,
    /// Images came, but all are the same: in a new one at least the noise is another.
    #[error("all images that came are the same")]
    Frozen,
    /// The camera failed.
    #[error(transparent)]
    Failed(DeviceError),
}

/// Waits for an image of a stream that was resumed just now, one that was taken since then.
fn fresh_image(
    mut latest: impl FnMut() -> Result<Frame, DeviceError>,
    timeout: Duration,
) -> Result<Frame, NoImage> {
    let start = Instant::now();
    let mut first: Option<Frame> = None;
    let mut outcome = NoImage::Stale;
    while start.elapsed() < timeout {
        match latest() {
            Ok(frame) => match &first {
                // A driver that was started again counts from the beginning.
                Some(seen) if frame.number >= seen.number => {
                    let is_new = frame.number >= seen.number + NEW_IMAGES;
                    if is_new && frame.image != seen.image {
                        return Ok(frame);
                    }
                    outcome = if is_new {
                        NoImage::Frozen
                    } else {
                        NoImage::Stale
                    };
                }
                _ => first = Some(frame),
            },
            Err(DeviceError::NoDataYet { .. } | DeviceError::Stale { .. }) => {
                outcome = NoImage::Stale;
            }
            Err(error) => return Err(NoImage::Failed(error)),
        }
        std::thread::sleep(POLL_INTERVAL);
    }
    Err(outcome)
}

#[cfg(test)]
mod tests {
    use yarp_devices::image::{Image, PixelFormat};

    use super::*;

    const TIMEOUT: Duration = Duration::from_millis(200);

    fn frame(number: u64, value: u8) -> Frame {
        let image = Image::new(PixelFormat::Mono, 1, 1, vec![value]);
        Frame {
            image: image.expect("the size fits"),
            number,
            time: 0.0,
        }
    }

    /// Looks through a camera whose images have these numbers and another content from a number on.
    fn look(numbers: impl Fn(u64) -> u64, changes_at: u64) -> Result<Frame, NoImage> {
        let mut count = 0;
        let latest = || {
            count += 1;
            let number = numbers(count);
            Ok(frame(number, u8::from(number >= changes_at)))
        };
        fresh_image(latest, TIMEOUT)
    }

    /// Objects were picked where they had been when the camera froze.
    #[test]
    fn a_camera_that_repeats_its_image_is_frozen() {
        let outcome = look(|count| count, u64::MAX);
        assert!(matches!(outcome, Err(NoImage::Frozen)), "{outcome:?}");
        assert_eq!(look(|count| count, 5).expect("a new image comes").number, 5);
    }

    #[test]
    fn an_image_that_was_under_way_is_not_new() {
        let new = look(|count| count, 2).expect("a new image comes");
        assert_eq!(new.number, 1 + NEW_IMAGES);
        let outcome = look(|count| count.min(NEW_IMAGES), 2);
        assert!(matches!(outcome, Err(NoImage::Stale)), "{outcome:?}");
    }

    #[test]
    fn a_driver_that_was_started_again_counts_from_the_beginning() {
        let new = look(|count| if count < 3 { 900 + count } else { count }, 4);
        assert!((5..100).contains(&new.expect("a new image comes").number));
    }

    #[test]
    fn a_camera_without_an_image_is_waited_for_and_one_that_fails_named() {
        let mut count = 0;
        let latest = || {
            count += 1;
            match count {
                1..5 => Err(DeviceError::NoDataYet { what: "image" }),
                _ => Ok(frame(count, count as u8)),
            }
        };
        assert_eq!(fresh_image(latest, TIMEOUT).expect("it comes").number, 7);
        let latest = || {
            let what = "images".to_owned();
            Err(DeviceError::NotSupported { what })
        };
        let outcome = fresh_image(latest, TIMEOUT);
        assert!(matches!(outcome, Err(NoImage::Failed(_))), "{outcome:?}");
    }
}
