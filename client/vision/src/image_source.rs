//! Image sources: the latest image of a camera, of a thread or of a recorded sequence (sections 5.3.2 and 5.4.2 of the
//! thesis).

use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use yarp_client::Camera;
use yarp_client::devices::FrameGrabberImage;
use yarp_devices::image::image_file;

use crate::{Crop, Frame, Result, VisionError};

/// Default maximum time without a new image, after which a stream counts as stopped.
pub const DEFAULT_STREAM_TIMEOUT: Duration = Duration::from_secs(2);
/// Interval between two requests of a [`ThreadedImages`] whose images failed.
const RETRY_INTERVAL: Duration = Duration::from_millis(20);

/// A source of images.
pub trait ImageSource: Send {
    /// Returns the latest image with its timestamp; never waits for the next.
    ///
    /// Errors: [`VisionError::StreamStopped`] if no new image has come for too long, [`VisionError::EndOfSequence`] after
    /// the last image of a recorded sequence, [`VisionError::Device`], [`VisionError::File`].
    fn latest(&mut self) -> Result<Frame>;
}

/// Notes when the number of the latest image last changed.
#[derive(Debug)]
struct StreamWatch {
    source: String,
    timeout: Duration,
    newest: Option<(u64, Instant)>,
}

impl StreamWatch {
    fn new(source: String, timeout: Duration) -> Self {
        Self {
            source,
            timeout,
            newest: None,
        }
    }

    fn check(&mut self, frame: Frame) -> Result<Frame> {
        let now = Instant::now();
        match self.newest {
            Some((number, since)) if number == frame.number => {
                if now - since >= self.timeout {
                    return Err(VisionError::StreamStopped {
                        source_name: self.source.clone(),
                        timeout: self.timeout,
                    });
                }
            }
            _ => self.newest = Some((frame.number, now)),
        }
        Ok(frame)
    }
}

/// Images of a YARP frame grabber anywhere on the network, raw or compressed.
#[derive(Debug)]
pub struct RemoteImages {
    camera: Camera,
    watch: StreamWatch,
}

impl RemoteImages {
    /// Uses a connected camera; without a new image for `timeout`, its stream counts as stopped.
    pub fn new(camera: Camera, timeout: Duration) -> Self {
        let watch = StreamWatch::new(camera.remote().to_owned(), timeout);
        Self { camera, watch }
    }

    /// Connects to the camera `remote` on the network of the environment.
    ///
    /// Errors: [`VisionError::Client`] if there is no name server, no such camera, or no image.
    pub fn connect(remote: &str) -> Result<Self> {
        Ok(Self::new(Camera::connect(remote)?, DEFAULT_STREAM_TIMEOUT))
    }
}

impl ImageSource for RemoteImages {
    fn latest(&mut self) -> Result<Frame> {
        let frame = self.camera.image()?;
        self.watch.check(frame)
    }
}

type Latest = Arc<Mutex<Option<Frame>>>;

/// Images that a thread of its own fetches, so that processing never delays the stream.
#[derive(Debug)]
pub struct ThreadedImages {
    latest: Latest,
    stop: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
    watch: StreamWatch,
}

impl ThreadedImages {
    /// Starts a thread that calls `grab` again and again; `grab` waits for the next image and returns it.
    ///
    /// Dropping the source waits for the call of `grab` that is under way.
    ///
    /// Errors: [`VisionError::Thread`].
    pub fn start<G>(name: &str, timeout: Duration, mut grab: G) -> Result<Self>
    where
        G: FnMut() -> Result<Frame> + Send + 'static,
    {
        let latest = Latest::default();
        let stop = Arc::new(AtomicBool::new(false));
        let (shared, stopped) = (Arc::clone(&latest), Arc::clone(&stop));
        let run = move || {
            while !stopped.load(Ordering::Relaxed) {
                match grab() {
                    Ok(frame) => *lock(&shared) = Some(frame),
                    Err(error) => {
                        tracing::debug!("no image: {error}");
                        std::thread::sleep(RETRY_INTERVAL);
                    }
                }
            }
        };
        let thread = std::thread::Builder::new().name(name.to_owned()).spawn(run);
        Ok(Self {
            latest,
            stop,
            thread: Some(thread.map_err(VisionError::Thread)?),
            watch: StreamWatch::new(name.to_owned(), timeout),
        })
    }
}

impl ImageSource for ThreadedImages {
    fn latest(&mut self) -> Result<Frame> {
        let frame = lock(&self.latest).clone();
        let frame = frame.ok_or_else(|| VisionError::NoImageYet {
            source_name: self.watch.source.clone(),
        })?;
        self.watch.check(frame)
    }
}

impl Drop for ThreadedImages {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// A recorded sequence: the images of a folder in the order of their names, one per call.
#[derive(Debug)]
pub struct RecordedImages {
    folder: PathBuf,
    paths: Vec<PathBuf>,
    next: usize,
    interval: f64,
}

impl RecordedImages {
    /// Lists the PNG, JPEG, PPM and PGM files of a folder; their times are `interval` s apart, from 0.
    ///
    /// Errors: [`VisionError::File`], [`VisionError::Unsuitable`] if the folder has no images.
    pub fn open(folder: &Path, interval: f64) -> Result<Self> {
        let paths = image_paths(folder)?;
        if paths.is_empty() {
            return Err(VisionError::Unsuitable {
                what: format!("folder {}", folder.display()),
                expected: "PNG, JPEG, PPM or PGM files".to_owned(),
                actual: "none".to_owned(),
            });
        }
        Ok(Self {
            folder: folder.to_owned(),
            paths,
            next: 0,
            interval,
        })
    }
}

impl ImageSource for RecordedImages {
    fn latest(&mut self) -> Result<Frame> {
        let path = self.paths.get(self.next);
        let path = path.ok_or_else(|| VisionError::EndOfSequence {
            folder: self.folder.clone(),
            images: self.paths.len(),
        })?;
        let frame = Frame {
            image: image_file::read(path)?,
            number: self.next as u64,
            time: self.interval * self.next as f64,
        };
        self.next += 1;
        Ok(frame)
    }
}

/// Returns the image files of a folder, sorted by name.
pub(crate) fn image_paths(folder: &Path) -> Result<Vec<PathBuf>> {
    let failed = || VisionError::file::<std::io::Error>("read images from", folder);
    let mut paths = Vec::new();
    for entry in std::fs::read_dir(folder).map_err(failed())? {
        let path = entry.map_err(failed())?.path();
        let extension = path.extension().and_then(|extension| extension.to_str());
        if matches!(extension, Some("png" | "jpg" | "jpeg" | "ppm" | "pgm")) {
            paths.push(path);
        }
    }
    paths.sort();
    Ok(paths)
}

/// The part of each image of another source that a crop selects.
#[derive(Debug)]
pub struct RegionOfInterest<S> {
    source: S,
    crop: Crop,
}

impl<S: ImageSource> RegionOfInterest<S> {
    /// Selects a part of each image of `source`.
    pub fn new(source: S, crop: Crop) -> Self {
        Self { source, crop }
    }
}

impl<S: ImageSource> ImageSource for RegionOfInterest<S> {
    fn latest(&mut self) -> Result<Frame> {
        Ok(self.source.latest()?.cropped(&self.crop)?)
    }
}
