//! Opens a device from its parameters, alone or together with its server.

use yarp_ports::Network;
use yarp_wire::settings::Parameters;

use crate::device_types::{self, DeviceType, OpenResult, Opening};
use crate::{Attached, Future, HostError, Hosted, Parts};

/// Opens a device from its parameters.
///
/// * `deviceBundler`, with `wrapper_device` and `attached_device`, opens both and attaches one to
///   the other. Both read the same parameters, as in stock. With `doNotAttach` they stay separate.
/// * `subdevice` is a device that a wrapper attaches to at once; it reads the same parameters too.
/// * Errors: [`HostError`]; then nothing stays open.
pub async fn open(
    network: &Network,
    kind: &str,
    parameters: &Parameters,
) -> Result<Box<dyn Hosted>, HostError> {
    open_in(Opening::new(network, parameters), kind).await
}

/// Opens a device among others: a name of one of those that are open already means this one.
pub(crate) fn open_in<'a>(opening: Opening<'a>, kind: &'a str) -> Future<'a, OpenResult> {
    Box::pin(async move {
        let parameters = opening.parameters;
        opening.check_depth()?;
        if let Some(link) = opening.link(kind) {
            return Ok(link);
        }
        if kind == device_types::BUNDLER {
            let wrapper: String = parameters.need("wrapper_device")?;
            // A name that is missing is reported before one that is unknown.
            parameters.need::<String>("attached_device")?;
            let wrapper = device_types::find(&wrapper, parameters, "wrapper_device")?;
            let apart = parameters.has("doNotAttach");
            let (name, inner) = open_inner(opening, "attached_device").await?;
            return bundle(opening, wrapper, &name, inner, apart).await;
        }
        let kind = device_types::find(kind, parameters, "device")?;
        if parameters.get::<String>("subdevice")?.is_none() {
            return kind.open(opening).await;
        }
        let (name, inner) = open_inner(opening, "subdevice").await?;
        bundle(opening, kind, &name, inner, false).await
    })
}

/// Opens the device that the parameter `asked` names; returns its name, too.
async fn open_inner(
    opening: Opening<'_>,
    asked: &str,
) -> Result<(String, Box<dyn Hosted>), HostError> {
    let parameters = opening.parameters;
    let name: String = parameters.need(asked)?;
    if let Some(link) = opening.link(&name) {
        return Ok((name, link));
    }
    let kind = device_types::find(&name, parameters, asked)?;
    Ok((kind.name.to_owned(), kind.open(opening).await?))
}

/// Opens a device together with the wrapper of its type, if it has one, as stock's `yarpdev` does.
pub async fn open_wrapped(
    network: &Network,
    kind: &str,
    parameters: &Parameters,
) -> Result<Box<dyn Hosted>, HostError> {
    if kind != device_types::BUNDLER {
        let inner = device_types::find(kind, parameters, "device")?;
        if let Some(wrapper) = inner.wrapper {
            let wrapper = device_types::find(wrapper, parameters, "device")?;
            let opening = Opening::new(network, parameters);
            // The device may have a subdevice of its own.
            let opened = open(network, kind, parameters).await?;
            return bundle(opening, wrapper, inner.name, opened, false).await;
        }
    }
    open(network, kind, parameters).await
}

/// Returns the types of the devices that [`open_wrapped`] opens, those that attach first.
///
/// Errors: [`HostError`] for an unknown type, and for a bundle without its parameters.
pub fn opened_types(
    kind: &str,
    parameters: &Parameters,
) -> Result<Vec<&'static DeviceType>, HostError> {
    let named = |name| device_types::find(&parameters.need::<String>(name)?, parameters, name);
    if kind == device_types::BUNDLER {
        return Ok(vec![named("wrapper_device")?, named("attached_device")?]);
    }
    let device = device_types::find(kind, parameters, "device")?;
    let wrapper = device
        .wrapper
        .map(|wrapper| device_types::find(wrapper, parameters, "device"));
    let mut types: Vec<_> = wrapper.transpose()?.into_iter().chain([device]).collect();
    if parameters.has("subdevice") {
        types.push(named("subdevice")?);
    }
    Ok(types)
}

async fn bundle(
    opening: Opening<'_>,
    wrapper: &DeviceType,
    inner_name: &str,
    inner: Box<dyn Hosted>,
    apart: bool,
) -> Result<Box<dyn Hosted>, HostError> {
    let wrapper = wrapper.open(opening).await;
    let mut wrapper = match wrapper {
        Ok(wrapper) => wrapper,
        Err(error) => {
            inner.close().await;
            return Err(error);
        }
    };
    if !apart {
        let attached = Attached {
            device: inner_name.to_owned(),
            network: "...".to_owned(),
            parts: inner.parts(),
        };
        if let Err(error) = wrapper.attach(vec![attached]).await {
            wrapper.close().await;
            inner.close().await;
            return Err(error);
        }
    }
    Ok(Box::new(Bundle { wrapper, inner }))
}

/// A device and its server.
struct Bundle {
    wrapper: Box<dyn Hosted>,
    inner: Box<dyn Hosted>,
}

impl Hosted for Bundle {
    /// Returns the parts of the server, if it has any.
    fn parts(&self) -> Parts {
        let front = self.wrapper.parts();
        match front.is_empty() {
            true => self.inner.parts(),
            false => front,
        }
    }

    fn machine(&self) -> Option<std::sync::Arc<dyn yarp_devices::Device>> {
        self.inner.machine()
    }

    fn service(&self) -> Option<std::sync::Arc<dyn yarp_devices::Device>> {
        self.wrapper.service().or_else(|| self.inner.service())
    }

    fn attach(&mut self, others: Vec<Attached>) -> Future<'_, Result<(), HostError>> {
        self.wrapper.attach(others)
    }

    fn detach(&mut self) -> Future<'_, Result<(), HostError>> {
        self.wrapper.detach()
    }

    fn close(self: Box<Self>) -> Future<'static, ()> {
        Box::pin(async move {
            self.wrapper.close().await;
            self.inner.close().await;
        })
    }
}
