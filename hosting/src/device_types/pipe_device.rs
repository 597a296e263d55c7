//! Images and sound of one device to another, with the parameters of stock's `pipe` of 3.5: `source` and `sink`.
//!
//! Each is the type of a device, which reads the other parameters of the pipe, or a group of parameters of its own with `device`. In a group of
//! devices it may be the name of another part.
//!
//! Source: `DevicePipe.cpp` of YARP 3.5.

use std::sync::Arc;

use yarp_devices::Device;
use yarp_devices::services::DevicePipe;
use yarp_wire::settings::{Group, Parameters, Settings};

use super::{OpenResult, Opening};
use crate::device_bundle::open_in;
use crate::{Future, HostError, Hosted};

/// Parameters that belong to the pipe, not to its devices.
const OF_THE_PIPE: [&str; 5] = ["device", "source", "sink", "subdevice", "wrapped"];

/// Types that would read the parameters of the pipe as their own.
const WITH_ENDS_OR_PARTS: [&str; 2] = ["pipe", "group"];
const GIVES: &str = "a device that gives images or sound";
const TAKES: &str = "a device that takes images or sound";

/// Opens both devices. The pipe works once its service is started.
pub(super) async fn open(opening: Opening<'_>) -> OpenResult {
    let source = open_end(opening, "source").await?;
    let sink = match open_end(opening, "sink").await {
        Ok(sink) => sink,
        Err(error) => {
            source.close().await;
            return Err(error);
        }
    };
    match connect(opening.parameters, source.as_ref(), sink.as_ref()) {
        Ok(pipe) => Ok(Box::new(HostedPipe { pipe, source, sink })),
        Err(error) => {
            source.close().await;
            sink.close().await;
            Err(error)
        }
    }
}

/// Opens the device that the parameter `end` describes.
async fn open_end(opening: Opening<'_>, end: &str) -> OpenResult {
    let outer = opening.parameters;
    let first = outer.settings().get(end);
    let group = first.filter(|first| first.items().is_some());
    if let Some(group) = group.and_then(|_| outer.settings().group(end)) {
        outer.has(end);
        let (inner, kind) = nested(outer, end, group)?;
        let opened = open_in(opening.inside(&inner, opening.opened), &kind).await?;
        report_unused(&inner);
        return Ok(opened);
    }
    let kind: String = outer.need(end)?;
    if WITH_ENDS_OR_PARTS.contains(&kind.as_str()) && opening.link(&kind).is_none() {
        let expected = "a type that reads the other parameters of the pipe; a pipe or group needs a group of parameters of its own";
        return Err(outer.refuse(end, expected).into());
    }
    let mut settings = outer.settings().clone();
    for name in OF_THE_PIPE {
        settings.remove(name);
    }
    let inner = Parameters::new(outer.device(), settings, outer.origin().clone());
    let opened = open_in(opening.inside(&inner, opening.opened), &kind).await?;
    mark_used(outer, &inner);
    Ok(opened)
}

/// Returns the parameters in a group, for the device of this name, and its type.
pub(super) fn nested(
    outer: &Parameters,
    name: &str,
    group: Group<'_>,
) -> Result<(Parameters, String), HostError> {
    let mut settings = Settings::new();
    for items in group.values().iter().filter_map(|entry| entry.items()) {
        if let Some(first) = items.first() {
            settings.put_entry(first.to_plain_string(), items.to_vec());
        }
    }
    let origin = group.origin().unwrap_or(outer.origin()).clone();
    let inner = Parameters::new(name, settings, origin);
    let kind = inner.need("device")?;
    Ok((inner, kind))
}

/// Warns of parameters that no device read.
pub(super) fn report_unused(parameters: &Parameters) {
    for (name, origin) in parameters.unused() {
        let device = parameters.device();
        tracing::warn!("{origin}: device {device} ignores parameter {name}");
    }
}

/// Marks the parameters of `outer` that were read through `inner`.
fn mark_used(outer: &Parameters, inner: &Parameters) {
    let unused: Vec<String> = inner.unused().map(|(name, _)| name).collect();
    for name in inner.settings().names() {
        let inside = format!("{name}::");
        let is_unused = |unused: &String| unused == name || unused.starts_with(&inside);
        if !unused.iter().any(is_unused) {
            outer.has(name);
        }
    }
}

fn connect(
    parameters: &Parameters,
    source: &dyn Hosted,
    sink: &dyn Hosted,
) -> Result<Arc<DevicePipe>, HostError> {
    let part = |end: &dyn Hosted, is_suitable: fn(&dyn Device) -> bool, name, expected| {
        let parts = end.parts();
        let found = parts.devices().find(|device| is_suitable(device.as_ref()));
        found
            .cloned()
            .ok_or_else(|| parameters.refuse(name, expected))
    };
    let source = part(source, gives, "source", GIVES)?;
    let sink = part(sink, takes, "sink", TAKES)?;
    let pipe = DevicePipe::new(source, sink).map_err(|source| HostError::Device {
        origin: parameters.origin().clone(),
        device: parameters.device().to_owned(),
        source: Box::new(source),
    })?;
    tracing::info!("{}: passes on {:?}", parameters.device(), pipe.content());
    Ok(Arc::new(pipe))
}

fn gives(device: &dyn Device) -> bool {
    device.audio_visual_grabber().is_some()
        || device.frame_grabber_image().is_some()
        || device.audio_grabber().is_some()
}

fn takes(device: &dyn Device) -> bool {
    device.frame_writer_audio_visual().is_some()
        || device.frame_writer_image().is_some()
        || device.audio_render().is_some()
}

/// A pipe with its devices.
struct HostedPipe {
    pipe: Arc<DevicePipe>,
    source: Box<dyn Hosted>,
    sink: Box<dyn Hosted>,
}

impl Hosted for HostedPipe {
    fn service(&self) -> Option<Arc<dyn Device>> {
        Some(self.pipe.clone())
    }

    fn close(self: Box<Self>) -> Future<'static, ()> {
        Box::pin(async move {
            // It holds the devices.
            drop(self.pipe);
            self.source.close().await;
            self.sink.close().await;
        })
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use yarp_devices::fake::{FakeMicrophone, FakeSpeaker};
    use yarp_devices::{AudioGrabber, AudioRender};
    use yarp_testing::eventually;
    use yarp_wire::settings::{NoSource, Origin};

    use super::*;
    use crate::{Attached, Parts, RunningService};

    fn attached(device: &str, other: Arc<dyn Device>) -> Attached {
        Attached {
            device: device.to_owned(),
            network: device.to_owned(),
            parts: Parts {
                other: Some(other),
                ..Parts::default()
            },
        }
    }

    #[tokio::test(flavor = "multi_thread")]
    async fn a_pipe_passes_sound_from_a_microphone_to_a_loudspeaker() {
        let names = yarp_nameserver::ServerOptions::default().at("127.0.0.1", 0);
        let names = yarp_nameserver::Server::start(names).await.unwrap();
        let network = names.network();
        let (microphone, speaker) = (
            Arc::new(FakeMicrophone::new()),
            Arc::new(FakeSpeaker::new(1, 16_000)),
        );
        let devices = [
            attached("ear", microphone.clone()),
            attached("mouth", speaker.clone()),
        ];
        let mut settings = Settings::new();
        settings.read_text("d.ini", "source ear\nsink mouth\n", &NoSource);
        let parameters = Parameters::new("d", settings, Origin::line("d.ini", 1));
        let outer = Opening::new(&network, &parameters);
        let pipe = open(outer.inside(&parameters, &devices)).await.unwrap();
        let service = pipe.service().unwrap();
        let running = RunningService::start("it", service).await.unwrap();
        eventually("sound at the loudspeaker", || {
            speaker.unplayed().unwrap().samples > 0
        });
        assert!(running.stop().await);
        assert!(!microphone.is_recording().unwrap() && !speaker.is_playing().unwrap());
        let left = speaker.unplayed().unwrap();
        tokio::time::sleep(Duration::from_millis(20)).await;
        assert_eq!(speaker.unplayed().unwrap(), left, "it was stopped");
        pipe.close().await;
    }
}
