//! Cameras: a simulated one, a server, and a client of a camera that another program serves.
//!
//! Parameters are those of stock's `fakeFrameGrabber`, `frameGrabber_nws_yarp` and `frameGrabber_nwc_yarp`.
//! Source: `FakeFrameGrabber.cpp`, `FrameGrabber_nws_yarp.cpp` and `FrameGrabber_nwc_yarp.cpp` of YARP 3.5.

use std::path::PathBuf;
use std::sync::Arc;
use std::time::Duration;

use yarp_devices::camera::{CameraOptions, Pattern, Scene, SimulatedCamera};
use yarp_devices::{Device, Intrinsics};
use yarp_wire::PortName;
use yarp_wire::settings::Parameters;
use yarp_wrappers::frame_grabber::Capability;
use yarp_wrappers::{
    FrameGrabberOptions, FrameGrabberServer, RemoteFrameGrabber, RemoteFrameGrabberOptions,
    SoundPort,
};

use super::attached_server::{AttachedServer, check_period};
use super::local_device::{self, LocalDevice};
use super::remote_board::cast;
use super::{OpenResult, Opening};
use crate::shared_parameters::{flag, warn_of_ignored};
use crate::{Attached, HostError};

/// Parameters of stock's simulated camera that have no effect here.
const IGNORED_PARAMETERS: [&str; 9] = [
    "fakeFrameGrabber_rpc_port",
    "syncro",
    "topIsLow",
    "rectificationMatrix",
    "timestamp",
    "noise",
    "snr",
    "bayer",
    "mono",
];
/// Port of the sound of stock's `grabber`.
const DEFAULT_SOUND_NAME: &str = "/grabber2";
const PERIODS_IN_MILLISECONDS: &str = "1 to 60000 milliseconds";
/// Rates of a server, images a second: the periods of a server are 1 ms to 60 s.
const VALID_GRABBER_RATES: std::ops::RangeInclusive<f64> = 1.0 / 60.0..=1000.0;
const VALID_RATES: std::ops::RangeInclusive<f64> = 0.1..=1000.0;

pub(super) async fn simulated(opening: Opening<'_>) -> OpenResult {
    let parameters = opening.parameters;
    let options = simulated_options(parameters)?;
    let camera = local_device::start(parameters, move || SimulatedCamera::start(options)).await?;
    Ok(Box::new(LocalDevice::camera(camera)))
}

/// Reads the options of a simulated camera, and warns of those without an effect.
pub(super) fn simulated_options(parameters: &Parameters) -> Result<CameraOptions, HostError> {
    let options = options(parameters)?;
    warn_of_ignored(parameters, &IGNORED_PARAMETERS);
    Ok(options)
}

fn options(parameters: &Parameters) -> Result<CameraOptions, HostError> {
    let word: Option<String> = parameters.get("mode")?;
    let pattern = match &word {
        None => Pattern::default(),
        Some(word) => Pattern::from_word(word).ok_or_else(|| {
            let words: Vec<_> = Pattern::words().collect();
            parameters.refuse("mode", format!("one of {}", words.join(", ")))
        })?,
    };
    let scene = match parameters.get::<String>("src")? {
        Some(path) => Scene::File(PathBuf::from(path)),
        None => Scene::Pattern(pattern),
    };
    let (name, rate) = match parameters.get::<f64>("freq")? {
        Some(rate) => ("freq", rate),
        None => {
            let period = parameters.get::<Duration>("period")?;
            (
                "period",
                period.map_or(30.0, |period| 1.0 / period.as_secs_f64()),
            )
        }
    };
    if !VALID_RATES.contains(&rate) {
        return Err(parameters
            .refuse(name, "0.1 to 1000 images a second")
            .into());
    }
    let usual = CameraOptions::new();
    let width = parameters.get_or("width", 320)?;
    let height = parameters.get_or("height", 240)?;
    let options = usual.scene(scene).size(width, height).rate(rate);
    let options = options.mirrored(parameters.get_or("mirror", false)?);
    let options = options.firewire(parameters.get_or("firewire", false)?);
    let across = parameters.get_or("horizontalFov", 60.0)?;
    let down = parameters.get_or("verticalFov", 46.8)?;
    let number = |name: &str, usual: f64| parameters.get_or(name, usual);
    Ok(options.field_of_view(across, down).intrinsics(Intrinsics {
        physical_focal_length: number("physFocalLength", 0.0)?,
        focal_length: (
            number("focalLengthX", 277.1)?,
            number("focalLengthY", 277.1)?,
        ),
        principal_point: (
            number("principalPointX", 160.0)?,
            number("principalPointY", 120.0)?,
        ),
        distortion_model: parameters.get_or("distortionModel", "none".to_owned())?,
        radial: [number("k1", 0.0)?, number("k2", 0.0)?, number("k3", 0.0)?],
        tangential: [number("t1", 0.0)?, number("t2", 0.0)?],
        ..Intrinsics::default()
    }))
}

pub(super) async fn remote(opening: Opening<'_>) -> OpenResult {
    let parameters = opening.parameters;
    let remote: PortName = parameters.need("remote")?;
    let local: PortName = parameters.need("local")?;
    let mut options = RemoteFrameGrabberOptions::new(remote.to_string(), local.to_string());
    if let Some(carrier) = parameters.get::<String>("stream")? {
        options = options.carrier(carrier);
    }
    if parameters.has("no_stream") {
        options = options.no_stream();
    }
    let network = opening.network.clone();
    let camera = cast(parameters, move || {
        RemoteFrameGrabber::open(&network, options)
    })
    .await?;
    Ok(Box::new(LocalDevice::camera(camera)))
}

pub(super) async fn server(opening: Opening<'_>) -> OpenResult {
    let period = opening.parameters.get::<Duration>("period")?;
    with_period(
        opening,
        FrameGrabberOptions::new(),
        period,
        "0.001 to 60 seconds",
    )
}

/// Opens a server under its old name `grabberDual`: the period is a whole number of milliseconds.
pub(super) async fn old_server(opening: Opening<'_>) -> OpenResult {
    let period = period_in_milliseconds(opening.parameters)?;
    with_period(
        opening,
        FrameGrabberOptions::new(),
        period,
        PERIODS_IN_MILLISECONDS,
    )
}

/// Opens a server under its oldest name `grabber`, which serves the sound of a camera with a microphone, too: on the port `name2`, or with
/// `shared-ports` together with the images.
///
/// Source: `ServerFrameGrabber.cpp` of 3.5. Its port of the images answers requests, as here.
pub(super) async fn server_with_sound(opening: Opening<'_>) -> OpenResult {
    let parameters = opening.parameters;
    let mut period = period_in_milliseconds(parameters)?;
    // Without a rate, and with one that is not above 0, `period` counts. A camera without parameters of its own reads the same
    // `framerate`, and -1 is its default rate in `usbCamera`.
    let rate = parameters.get_or("framerate", 0.0)?;
    if rate > 0.0 {
        if !VALID_GRABBER_RATES.contains(&rate) {
            let expected = "1/60 to 1000 images a second";
            return Err(parameters.refuse("framerate", expected).into());
        }
        period = Some(Duration::from_secs_f64(1.0 / rate));
    }
    let name: Option<PortName> = parameters.get("name2")?;
    let name = name.map_or_else(|| DEFAULT_SOUND_NAME.to_owned(), |name| name.to_string());
    let sound = match flag(parameters, "shared-ports")? {
        true => SoundPort::Shared,
        false => SoundPort::Separate(name),
    };
    // Every image has a stamp here, and the server has a thread of its own.
    for name in ["stamp", "single_threaded"] {
        parameters.has(name);
    }
    let options = FrameGrabberOptions::new().sound(sound);
    with_period(opening, options, period, PERIODS_IN_MILLISECONDS)
}

fn period_in_milliseconds(parameters: &Parameters) -> Result<Option<Duration>, HostError> {
    let period = parameters.get::<usize>("period")?;
    Ok(period.map(|period| Duration::from_millis(period as u64)))
}

fn with_period(
    opening: Opening<'_>,
    mut options: FrameGrabberOptions,
    period: Option<Duration>,
    expected: &str,
) -> OpenResult {
    let parameters = opening.parameters;
    let name: Option<PortName> = parameters.get("name")?;
    if let Some(period) = period {
        options = options.period(check_period(parameters, period, expected)?);
    }
    options = match parameters.get::<String>("capabilities")?.as_deref() {
        None | Some("COLOR") => options.capability(Capability::Colour),
        Some("RAW") => options.capability(Capability::Raw),
        Some(_) => return Err(parameters.refuse("capabilities", "COLOR or RAW").into()),
    };
    // Every reader gets the latest image here.
    parameters.has("no_drop");
    let name = name.map_or("/grabber".to_owned(), |name| name.to_string());
    let server = AttachedServer::<FrameGrabberServer, _>::boxed;
    Ok(server(opening, name, options, camera_of))
}

/// Returns the camera that a server serves.
fn camera_of(others: &[Attached]) -> Result<Arc<dyn Device>, HostError> {
    let [other] = others else {
        return Err(HostError::SeveralCameras { got: others.len() });
    };
    let camera = other.parts.camera.clone();
    camera.ok_or_else(|| HostError::Unsuitable {
        device: other.device.clone(),
        expected: "a camera",
    })
}
