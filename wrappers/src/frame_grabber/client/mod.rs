//! The camera at the other end.
//!
//! | file | content |
//! | --- | --- |
//! | `remote_camera_options` | names, carrier and timeouts |
//! | `camera_link` | the two ports, opening, calls |
//! | `latest_image` | the newest image received |
//! | `remote_camera_interfaces` | the device interfaces |

mod camera_link;
mod latest_image;
mod remote_camera_interfaces;
mod remote_camera_options;
mod remote_firewire;

use yarp_devices::Device;
use yarp_ports::{Network, blocking};
use yarp_wire::WireVersion;

use self::camera_link::CameraLink;
use crate::OpenError;
use crate::device_ports::SharedLink;
pub use remote_camera_options::RemoteFrameGrabberOptions;

/// A camera in another program, as stock's `frameGrabber_nwc_yarp` casts it back. The client finds out the wire
/// version of the server; one that supports both is used as 4.0.
///
/// * **Images** are those that the server streams; asking for one waits for nothing. It fails with
///   [`DeviceError::NoDataYet`](yarp_devices::DeviceError::NoDataYet) before the first, and with
///   [`DeviceError::Stale`](yarp_devices::DeviceError::Stale) when the newest is older than the trusted age
///   ([`RemoteFrameGrabberOptions::max_state_age`]). Number and time are those of the server's stamp. With
///   [`RemoteFrameGrabberOptions::no_stream`] each image is requested, and its time is that of its arrival.
/// * **Raw images** are requested from 3.x. 4.0 has no call for them: there they are the colour images in grey.
/// * **Blocking calls.** Every other call is a message and its reply, and waits at most
///   [`RemoteFrameGrabberOptions::rpc_timeout`]. Calls may come from any thread, also from one that runs async code,
///   which they then hold up.
/// * **Refusals** are [`DeviceError::Refused`](yarp_devices::DeviceError::Refused). A server of 3.5 to 3.9 does not
///   report that it refused to set a feature.
/// * **Lost connections** are reconnected when the server is back, if it has the same wire version. Until then calls
///   fail.
///
/// Dropping it closes its ports and unregisters their names; that takes a few seconds at the most.
///
/// ```no_run
/// # fn example() -> Result<(), Box<dyn std::error::Error>> {
/// use yarp_devices::FrameGrabberImage;
/// use yarp_ports::Network;
/// use yarp_wrappers::{RemoteFrameGrabber, RemoteFrameGrabberOptions};
///
/// let network = Network::from_process()?;
/// let options = RemoteFrameGrabberOptions::new("/grabber", "/me/camera");
/// let camera = RemoteFrameGrabber::open(&network, options)?;
/// let frame = camera.image()?;
/// # Ok(()) }
/// ```
///
/// Source: `FrameGrabber_nwc_yarp.cpp` of 3.5 and 4.0; recorded traffic of 3.12.3 and 4.0.0.
#[derive(Debug)]
pub struct RemoteFrameGrabber {
    link: SharedLink<CameraLink>,
}

impl RemoteFrameGrabber {
    /// Opens two ports of its own and connects them to the server.
    ///
    /// * Ports: `LOCAL` for images, unless there are none to be streamed, and `LOCAL/rpc_client`.
    /// * Asks for the version of the protocol. Does not wait for the first image.
    /// * Blocks for a few deadlines at the most.
    /// * Errors: [`OpenError::NoRemote`], [`OpenError::NameTaken`], [`OpenError::Port`], [`OpenError::Connect`],
    ///   [`OpenError::ProtocolVersion`], [`OpenError::Query`]; then nothing stays open.
    pub fn open(network: &Network, options: RemoteFrameGrabberOptions) -> Result<Self, OpenError> {
        let network = network.with_timeout(options.common.rpc_timeout);
        let link = blocking::wait(async move { CameraLink::open(&network, &options).await })?;
        let (remote, wire_version) = (link.ports.remote(), link.wire_version);
        tracing::info!(remote, %wire_version, "remote camera connected");
        Ok(Self {
            link: SharedLink::new(link),
        })
    }

    /// Returns the name of the server, as it was given.
    pub fn remote(&self) -> &str {
        self.link.ports.remote()
    }

    /// Ends the stream of images until [`RemoteFrameGrabber::resume`]: the network and the camera have nothing to do
    /// meanwhile, and asking for an image fails as before the first one.
    ///
    /// Without a stream there is nothing to end. If the server cannot be reached, it goes on sending.
    pub fn pause(&self) {
        self.link
            .run(|link| async move { link.set_paused(true).await });
    }

    /// Begins the stream of images anew. The first one that comes may have been taken before this call.
    ///
    /// Does not wait for the first one. If the server cannot be reached, it is asked again until an image comes.
    pub fn resume(&self) {
        self.link
            .run(|link| async move { link.set_paused(false).await });
    }

    /// The wire version of YARP that is spoken with the server.
    pub fn wire_version(&self) -> WireVersion {
        self.link.wire_version
    }
}

impl Device for RemoteFrameGrabber {
    yarp_devices::offers! {
        frame_grabber_image: FrameGrabberImage,
        frame_grabber_image_raw: FrameGrabberImageRaw,
        frame_grabber_controls: FrameGrabberControls,
        rgb_visual_params: RgbVisualParams,
        firewire_controls: FirewireControls,
    }
}
