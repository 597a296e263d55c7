//! Servers whose ports are open while they are attached to a device.

use std::sync::Arc;
use std::time::Duration;

use yarp_devices::Device;
use yarp_ports::Network;
use yarp_wire::settings::{Origin, ParameterError, Parameters};
use yarp_wrappers::{
    AnalogSensorOptions, AnalogSensorServer, AnalogSensorsOptions, AnalogSensorsServer,
    BatteryServer, BatteryServerOptions, CartesianServer, CartesianServerOptions,
    FrameGrabberOptions, FrameGrabberServer, InertialOptions, InertialServer, OpenError,
};

use super::Opening;
use crate::{Attached, Future, HostError, Hosted};

/// A server of a device on ports.
pub(super) trait Server: Sized + Send + 'static {
    /// Options of the server.
    type Options: Clone + Send + Sync + 'static;

    /// Opens the ports.
    fn open(
        network: &Network,
        device: Arc<dyn Device>,
        name: &str,
        options: Self::Options,
    ) -> impl std::future::Future<Output = Result<Self, OpenError>> + Send;

    /// Closes the ports.
    fn close(self) -> impl std::future::Future<Output = ()> + Send;
}

macro_rules! servers {
    ($($server:ident: $options:ident)*) => { $(
        impl Server for $server {
            type Options = $options;

            async fn open(
                network: &Network,
                device: Arc<dyn Device>,
                name: &str,
                options: $options,
            ) -> Result<Self, OpenError> {
                Self::open(network, device, name, options).await
            }

            async fn close(self) {
                Self::close(self).await;
            }
        }
    )* };
}

servers! {
    AnalogSensorServer: AnalogSensorOptions
    AnalogSensorsServer: AnalogSensorsOptions
    BatteryServer: BatteryServerOptions
    CartesianServer: CartesianServerOptions
    FrameGrabberServer: FrameGrabberOptions
    InertialServer: InertialOptions
}

/// Choice of the device that a server serves; a function of the devices that it attaches to is one.
pub(super) trait Choice: Send + 'static {
    /// Returns the device to serve.
    fn choose(&mut self, others: Vec<Attached>) -> Future<'_, Result<Arc<dyn Device>, HostError>>;
}

impl<F> Choice for F
where
    F: Fn(&[Attached]) -> Result<Arc<dyn Device>, HostError> + Send + 'static,
{
    fn choose(&mut self, others: Vec<Attached>) -> Future<'_, Result<Arc<dyn Device>, HostError>> {
        let chosen = self(&others);
        Box::pin(async move { chosen })
    }
}

/// Returns the one device that a server attaches to.
pub(super) fn single(others: &[Attached]) -> Result<&Attached, HostError> {
    match others {
        [other] => Ok(other),
        _ => Err(HostError::Several { got: others.len() }),
    }
}

/// A server whose ports are open while it is attached.
pub(super) struct AttachedServer<S: Server, C> {
    network: Network,
    name: String,
    options: S::Options,
    choice: C,
    /// Origin and name of the device, for errors.
    origin: Origin,
    device: String,
    running: Option<S>,
}

impl<S: Server, C: Choice> AttachedServer<S, C> {
    /// A server that will open its ports with the prefix `name`.
    pub(super) fn boxed(
        opening: Opening<'_>,
        name: String,
        options: S::Options,
        choice: C,
    ) -> Box<dyn Hosted> {
        Box::new(Self {
            network: opening.network.clone(),
            name,
            options,
            choice,
            origin: opening.parameters.origin().clone(),
            device: opening.parameters.device().to_owned(),
            running: None,
        })
    }

    async fn close_ports(&mut self) {
        if let Some(running) = self.running.take() {
            running.close().await;
        }
    }
}

impl<S: Server, C: Choice> Hosted for AttachedServer<S, C> {
    fn attach(&mut self, others: Vec<Attached>) -> Future<'_, Result<(), HostError>> {
        Box::pin(async move {
            if self.running.is_some() {
                return Err(HostError::Attached);
            }
            let device = self.choice.choose(others).await?;
            let opened = S::open(&self.network, device, &self.name, self.options.clone()).await;
            let opened = opened.map_err(|source| not_opened(&self.origin, &self.device, source))?;
            self.running = Some(opened);
            Ok(())
        })
    }

    fn detach(&mut self) -> Future<'_, Result<(), HostError>> {
        Box::pin(async move {
            self.close_ports().await;
            Ok(())
        })
    }

    fn close(mut self: Box<Self>) -> Future<'static, ()> {
        Box::pin(async move { self.close_ports().await })
    }
}

/// Returns the error for ports that could not be opened.
pub(super) fn not_opened(origin: &Origin, device: &str, source: OpenError) -> HostError {
    HostError::Open {
        origin: origin.clone(),
        device: device.to_owned(),
        source: Box::new(source),
    }
}

/// Checks the parameter `period`; `expected` is in the unit of the parameter.
pub(super) fn check_period(
    parameters: &Parameters,
    period: Duration,
    expected: &str,
) -> Result<Duration, ParameterError> {
    match (0.001..=60.0).contains(&period.as_secs_f64()) {
        true => Ok(period),
        false => Err(parameters.refuse("period", expected)),
    }
}
