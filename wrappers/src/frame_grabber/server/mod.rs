//! A camera on ports.
//!
//! | file | content |
//! | --- | --- |
//! | `camera_request_handler` | executes requests on the device |
//! | `image_publisher` | the newest image, every period |

mod camera_request_handler;
mod image_publisher;
mod served_firewire;

use std::sync::Arc;
use std::time::Duration;

use yarp_devices::Device;
use yarp_ports::{Network, Port, PortOptions, Received};

use self::camera_request_handler::RequestHandler;
use self::image_publisher::Content;
use crate::OpenError;
use crate::device_ports::{ServedPort, ServedPorts};
use crate::open_ports::request_port;
use crate::page_request::request_of;
use crate::periodic_thread::check_period;

/// Default interval between checks for a new image: 30 times a second, as stock.
const DEFAULT_PERIOD: Duration = Duration::from_millis(33);

/// Kind of images that are streamed.
#[derive(Clone, Copy, Debug, Default, Eq, PartialEq)]
pub enum Capability {
    /// In colour (stock: `COLOR`).
    #[default]
    Colour,
    /// Raw sensor images (stock: `RAW`).
    Raw,
}

/// Port of the sound of a camera with a microphone.
#[derive(Clone, Debug, Eq, PartialEq)]
pub enum SoundPort {
    /// That of the images: each message is an image and its sound (stock: `shared-ports`).
    Shared,
    /// A port of this name (stock: `name2`).
    Separate(String),
}

/// Options of a camera server.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct FrameGrabberOptions {
    period: Duration,
    capability: Capability,
    sound: Option<SoundPort>,
}

impl Default for FrameGrabberOptions {
    fn default() -> Self {
        Self {
            period: DEFAULT_PERIOD,
            capability: Capability::default(),
            sound: None,
        }
    }
}

impl FrameGrabberOptions {
    /// Images in colour, checked every 33 ms.
    pub fn new() -> Self {
        Self::default()
    }

    /// Sets the interval between checks for a new image, 1 ms to 60 s (stock: `period`).
    pub fn period(mut self, period: Duration) -> Self {
        self.period = period;
        self
    }

    /// Selects the images that are streamed (stock: `capabilities`).
    pub fn capability(mut self, capability: Capability) -> Self {
        self.capability = capability;
        self
    }

    /// Streams the sound too, if the device has [images with sound](yarp_devices::AudioVisualGrabber), like stock's `grabber` of 3.5.
    /// Images are then in colour. By default there are images alone.
    pub fn sound(mut self, port: SoundPort) -> Self {
        self.sound = Some(port);
        self
    }
}

/// A camera, served like stock's `frameGrabber_nws_yarp`, to clients of 3.x and of 4.0 at once.
///
/// * `NAME` sends images to each reader that has finished the previous one, each image once: a slow reader misses
///   images, and never gets an old one after a newer one. Their envelope is the number and time of the image. Without
///   readers, the camera is not called.
/// * `NAME/rpc` answers queries and executes commands of both wire versions; so does `NAME`.
/// * With [`FrameGrabberOptions::sound`] each image is sent with the sound since the previous one, or the sound goes to a port of its own; a reader that
///   misses an image misses its sound. While nobody reads, sound is dropped.
/// * Pixels are not copied on their way from the camera to a port where a row is a multiple of 8 bytes.
/// * A request that is malformed, or that the camera has no interface for or refuses, is answered at once, as its
///   wire version reads it. Cameras on IEEE 1394 are not supported: calls for them are refused by name.
///
/// ```no_run
/// # async fn example() -> Result<(), Box<dyn std::error::Error>> {
/// use std::sync::Arc;
/// use yarp_devices::camera::{CameraOptions, SimulatedCamera};
/// use yarp_ports::Network;
/// use yarp_wrappers::{FrameGrabberOptions, FrameGrabberServer};
///
/// let network = Network::from_process()?;
/// let camera = Arc::new(SimulatedCamera::start(CameraOptions::new())?);
/// let server = FrameGrabberServer::open(&network, camera, "/grabber", FrameGrabberOptions::new()).await?;
/// tokio::signal::ctrl_c().await?;
/// server.close().await;
/// # Ok(()) }
/// ```
///
/// Dropping it closes the ports in the background.
///
/// Source: `FrameGrabber_nws_yarp.cpp` of 3.5 and 4.0; answers of 3.5.0 and 4.0.0, recorded traffic of both.
#[derive(Debug)]
pub struct FrameGrabberServer {
    ports: ServedPorts,
}

impl FrameGrabberServer {
    /// Opens the two ports, and that of the sound, and begins to publish.
    ///
    /// * `name`: begins with `/`; the ports are `NAME/rpc` and `NAME`.
    /// * Errors: [`OpenError::NoInterface`] when the device does not have the selected images, [`OpenError::Period`],
    ///   [`OpenError::NameTaken`], [`OpenError::Port`], [`OpenError::Thread`]; then all that was opened is closed
    ///   again.
    ///
    /// Cancelling closes the ports in the background.
    pub async fn open(
        network: &Network,
        device: Arc<dyn Device>,
        name: &str,
        options: FrameGrabberOptions,
    ) -> Result<Self, OpenError> {
        let FrameGrabberOptions {
            period,
            capability,
            sound,
        } = options;
        check_period(period)?;
        let sound = sound.filter(|_| has_sound(device.as_ref()));
        match capability {
            _ if sound.is_some() => {}
            Capability::Colour if device.frame_grabber_image().is_none() => {
                return Err(OpenError::NoInterface("images in colour"));
            }
            Capability::Raw if device.frame_grabber_image_raw().is_none() => {
                return Err(OpenError::NoInterface("raw images"));
            }
            _ => {}
        }
        let camera = Arc::new(RequestHandler::new(device.clone(), name));
        let mut wanted = vec![
            ServedPort::input("rpc", answering(&camera).input_only()),
            ServedPort::output("", answering(&camera).type_name("yarp/image")),
        ];
        if let Some(SoundPort::Separate(name)) = &sound {
            wanted.push(ServedPort::output("", PortOptions::new()).named(name));
        }
        let start = |outputs: &[Arc<Port>]| {
            let content = match outputs.get(1) {
                Some(sound) => Content::SeparateSound(sound.clone()),
                None if sound.is_some() => Content::ImagesWithSound,
                None => Content::Images(capability),
            };
            image_publisher::start(device, outputs[0].clone(), content, period)
        };
        let ports = ServedPorts::open(network, name, wanted, start).await?;
        tracing::info!(name, ?period, ?capability, ?sound, "camera served");
        Ok(Self { ports })
    }

    /// The name of the port with the images.
    pub fn name(&self) -> &str {
        self.ports.name()
    }

    /// Ends publishing, closes the ports and unregisters their names.
    ///
    /// Takes a few seconds at most, even if peers do not answer. The camera continues.
    pub async fn close(self) {
        self.ports.close().await;
    }
}

/// Returns true if the device has images with sound, and does not say that one of them is missing.
fn has_sound(device: &dyn Device) -> bool {
    let stream = device.audio_visual_stream();
    let is_whole = stream.is_none_or(|stream| stream.has_audio() && stream.has_video());
    device.audio_visual_grabber().is_some() && is_whole
}

fn answering(camera: &Arc<RequestHandler>) -> PortOptions {
    let camera = camera.clone();
    request_port().handler(move |received: &mut Received| {
        let request = request_of(received);
        camera.answer(&request, &received.from)
    })
}
