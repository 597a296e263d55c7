//! Common part of servers that are open while they are attached.

use std::time::Duration;

use yarp_wire::settings::{Origin, ParameterError, Parameters};
use yarp_wrappers::{
    AnalogSensorServer, AnalogSensorsServer, CartesianServer, ControlBoardServer,
    FrameGrabberServer, OpenError,
};

use crate::HostError;

/// A server on ports.
pub(super) trait Server {
    /// Closes the ports.
    fn close(self) -> impl Future<Output = ()> + Send;
}

impl Server for ControlBoardServer {
    fn close(self) -> impl Future<Output = ()> + Send {
        Self::close(self)
    }
}

impl Server for AnalogSensorServer {
    fn close(self) -> impl Future<Output = ()> + Send {
        Self::close(self)
    }
}

impl Server for AnalogSensorsServer {
    fn close(self) -> impl Future<Output = ()> + Send {
        Self::close(self)
    }
}

impl Server for CartesianServer {
    fn close(self) -> impl Future<Output = ()> + Send {
        Self::close(self)
    }
}

impl Server for FrameGrabberServer {
    fn close(self) -> impl Future<Output = ()> + Send {
        Self::close(self)
    }
}

/// A server, if open, with its description for errors.
pub(super) struct AttachedServer<S> {
    origin: Origin,
    device: String,
    running: Option<S>,
}

impl<S: Server> AttachedServer<S> {
    pub(super) fn of(parameters: &Parameters) -> Self {
        Self {
            origin: parameters.origin().clone(),
            device: parameters.device().to_owned(),
            running: None,
        }
    }

    /// Returns an error while the server is open.
    pub(super) fn check_free(&self) -> Result<(), HostError> {
        match self.running {
            Some(_) => Err(HostError::Attached),
            None => Ok(()),
        }
    }

    pub(super) async fn open(
        &mut self,
        opening: impl Future<Output = Result<S, OpenError>>,
    ) -> Result<(), HostError> {
        let opened = opening.await;
        let opened = opened.map_err(|source| not_opened(&self.origin, &self.device, source))?;
        self.running = Some(opened);
        Ok(())
    }

    pub(super) async fn close(&mut self) {
        if let Some(running) = self.running.take() {
            running.close().await;
        }
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
