//! The nine ports of a client, the conversation at opening, and calls.

use std::sync::Arc;
use std::time::Duration;

use yarp_devices::{DeviceError, GazeTarget};
use yarp_ports::{Network, PortOptions, Received};
use yarp_wire::Bottle;

use super::latest_gaze::LatestGaze;
use super::messages::gaze_request::{get, not_finite, target_list};
use super::messages::{GazeReply, GazeValues};
use super::remote_gaze_options::RemoteGazeOptions;
use crate::OpenError;
use crate::device_ports::{Link, RemotePorts, RpcPort, stream_port};
use crate::reconnect::to_text;

const RPC: RpcPort = RpcPort {
    local: "rpc",
    remote: "rpc",
};
/// Ports for targets: ours, and those of the controller, in the order of stock.
const TARGETS: [(&str, &str); 4] = [
    ("xd:o", "xd:i"),
    ("angles:o", "angles:i"),
    ("mono:o", "mono:i"),
    ("stereo:o", "stereo:i"),
];
/// Streams of the controller.
const STREAMS: [&str; 4] = ["x:o", "angles:o", "q:o", "events:o"];
/// Versions of the protocol with the words of this client: of icub-main 2 and, as a number, of the last of 1.
const VERSIONS: [&str; 2] = ["2.0", "1.2"];
/// Maximum length of a reply in an error, characters.
const MAX_QUOTED: usize = 200;

/// Ports connected to a controller.
#[derive(Debug)]
pub(super) struct GazeLink {
    pub(super) ports: RemotePorts,
    pub(super) latest: Arc<LatestGaze>,
}

impl Link for GazeLink {
    fn close(self) -> impl Future<Output = ()> + Send {
        self.ports.close()
    }
}

impl GazeLink {
    /// Opens and connects the ports in the order of stock; on an error nothing stays open.
    pub(super) async fn open(
        network: &Network,
        options: &RemoteGazeOptions,
    ) -> Result<Self, OpenError> {
        let options = &options.common;
        let needed = [RPC.remote].into_iter();
        let needed = needed.chain(TARGETS.map(|(_, remote)| remote));
        let needed: Vec<_> = needed.chain(STREAMS).collect();
        options.check_remote(network, &needed).await?;
        let latest = Arc::new(LatestGaze::new(options.max_state_age));
        let stream = |take: fn(&LatestGaze, &Received)| {
            let latest = latest.clone();
            stream_port(move |received| take(&latest, received))
        };
        let targets = TARGETS.map(|(local, _)| (local, PortOptions::new()));
        let mut wanted = Vec::from(targets);
        wanted.extend([
            ("x:i", stream(LatestGaze::take_point)),
            ("angles:i", stream(LatestGaze::take_angles)),
            ("q:i", stream(LatestGaze::take_joints)),
            ("events:i", stream(LatestGaze::take_event)),
            (RPC.local, PortOptions::new().rpc_client()),
        ]);
        let mut link = Self {
            ports: RemotePorts::open(network, options, "gaze controller", RPC, wanted).await?,
            latest,
        };
        let greeted = link.greet().await;
        link.unless_failed(greeted).await.map(|(link, ())| link)
    }

    async fn greet(&mut self) -> Result<(), OpenError> {
        self.ports.connect_rpc().await?;
        let request = get("info");
        let asked = self.ask(&request).await;
        let info = asked.and_then(|values| self.read(&request, &values, GazeValues::info));
        let info = info.map_err(|source| OpenError::Query {
            question: "its version",
            source,
        })?;
        let version = info.server_version.as_str();
        let is_known = VERSIONS.contains(&version);
        self.ports
            .check_version(version, is_known, &VERSIONS.join(" or "))?;
        for (port, (_, remote)) in TARGETS.into_iter().enumerate() {
            self.ports.connect(port, remote).await?;
        }
        let (latest, ports) = (&self.latest, &mut self.ports);
        let [point, angles, joints, events] = STREAMS;
        let first = TARGETS.len();
        ports
            .subscribe_with_events((point, first), (events, first + 3), &latest.point)
            .await?;
        ports
            .subscribe(angles, first + 1, &latest.angles, Duration::ZERO)
            .await?;
        ports
            .subscribe(joints, first + 2, &latest.joints, Duration::ZERO)
            .await
    }

    /// Sends a request, and waits for the reply.
    ///
    /// Errors: [`DeviceError::Unsuitable`] for numbers that are not finite, [`DeviceError::Refused`],
    /// [`DeviceError::Remote`].
    pub(super) async fn ask(&self, request: &Bottle) -> Result<GazeValues, DeviceError> {
        check_finite(request)?;
        let reply = self.ports.call(request).await?;
        match GazeReply::read(&reply) {
            Some(GazeReply::Done(values)) => Ok(values),
            Some(GazeReply::Refused) => {
                let advice = "the log of iKinGazeCtrl";
                Err(self.ports.refused(to_text(request), advice))
            }
            None => Err(self.unreadable(request, &quoted(&reply))),
        }
    }

    /// Returns what `read` makes of the values of the reply to `request`.
    pub(super) fn read<T>(
        &self,
        request: &Bottle,
        values: &GazeValues,
        read: impl Fn(&GazeValues) -> Option<T>,
    ) -> Result<T, DeviceError> {
        read(values).ok_or_else(|| self.unreadable(request, &quoted(&values.to_bottle())))
    }

    fn unreadable(&self, request: &Bottle, reply: &str) -> DeviceError {
        let step = format!(
            "understanding the reply `{reply}` to `{}`",
            to_text(request)
        );
        let advice = "whether it is iKinGazeCtrl, and which version";
        self.ports.unreadable(step, advice)
    }

    /// Sends a target without waiting for a reply.
    ///
    /// Errors: [`DeviceError::Unsuitable`] for numbers that are not finite, [`DeviceError::Remote`] without a connection.
    pub(super) async fn send_target(&self, target: &GazeTarget) -> Result<(), DeviceError> {
        let message = target_list(target);
        check_finite(&message)?;
        let port = match target {
            GazeTarget::Point(_) => 0,
            GazeTarget::Angles { .. } => 1,
            GazeTarget::Pixel { .. } | GazeTarget::PixelWithVergence { .. } => 2,
            GazeTarget::StereoPixels { .. } => 3,
        };
        let suffix = TARGETS[port].1;
        self.ports
            .write(port, suffix, &message, "sending the target ")
            .await
    }
}

fn check_finite(message: &Bottle) -> Result<(), DeviceError> {
    match not_finite(message) {
        Some(number) => Err(DeviceError::Unsuitable {
            what: "number",
            asked: number.to_string(),
            expected: format!("finite numbers in `{}`", to_text(message)),
        }),
        None => Ok(()),
    }
}

/// Returns the beginning of a message as text.
fn quoted(message: &Bottle) -> String {
    let text = to_text(message);
    match text.char_indices().nth(MAX_QUOTED) {
        Some((end, _)) => format!("{}...", &text[..end]),
        None => text,
    }
}
