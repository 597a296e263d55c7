//! The device behind the ports, and what becomes of a message.

use std::fmt::Display;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{SystemTime, UNIX_EPOCH};

use yarp_devices::{
    AxisInfo, ControlLimits, ControlMode, Device, DeviceError, Encoders, MotionControl,
    PositionControl, VelocityControl,
};
use yarp_wire::{Bottle, Stamp};

use super::super::messages::{Command, Malformed, ProtocolVersion, Reply, Request};
use super::usage;

/// A device with what its server must remember.
pub(super) struct Board {
    device: Arc<dyn Device>,
    name: String,
    axes: usize,
    /// Of the last answer to a question.
    stamp: Mutex<Stamp>,
    /// Whether the last streamed command was refused: the first of a run is reported aloud.
    refusing: AtomicBool,
}

/// Why a request was not carried out. On the wire all of them are `[fail]`.
#[derive(Debug, thiserror::Error)]
pub(super) enum Refusal {
    #[error(transparent)]
    Malformed(#[from] Malformed),
    #[error(transparent)]
    Device(#[from] DeviceError),
    #[error("the device has no {0}")]
    NoInterface(&'static str),
}

impl Board {
    /// `None` for a device without axes.
    pub(super) fn new(device: Arc<dyn Device>, name: &str) -> Option<Self> {
        let axes = count_axes(device.as_ref()).filter(|&axes| axes > 0)?;
        Some(Self {
            device,
            name: name.to_owned(),
            axes,
            // Answers are counted from 0.
            stamp: Mutex::new(Stamp::new(-1, 0.0)),
            refusing: AtomicBool::new(false),
        })
    }

    pub(super) fn axes(&self) -> usize {
        self.axes
    }

    /// What a request is answered with, after it was carried out.
    pub(super) fn answer(&self, message: &Bottle, from: &str) -> Reply {
        let request = match Request::parse(message) {
            Ok(request) => request,
            Err(Malformed::TooShort) => return Reply::not_understood(),
            Err(error) => {
                tracing::debug!(board = %self.name, from, %message, "refused: {error}");
                return Reply::fail();
            }
        };
        let outcome = match &request {
            Request::Help => Ok(usage::reply()),
            Request::ProtocolVersion => Ok(Reply::version(ProtocolVersion::CURRENT)),
            Request::Get(get) => {
                let echo = message.get(1).cloned();
                self.ask(get, echo).map(|(echo, values)| {
                    let stamp = self.next_stamp();
                    Reply::is(echo, values, stamp)
                })
            }
            Request::Set(set) => self.order(set).map(|()| Reply::ok()),
        };
        outcome.unwrap_or_else(|error| {
            match request {
                // What a person ordered in vain is worth a line; polling clients ask for what there is not.
                Request::Set(_) => {
                    tracing::info!(board = %self.name, from, %message, "refused: {error}");
                }
                _ => tracing::debug!(board = %self.name, from, %message, "refused: {error}"),
            }
            Reply::fail()
        })
    }

    /// Carries out a streamed command, or leaves everything as it is.
    pub(super) fn obey(&self, command: &Command, from: &str) {
        match self.stream(command) {
            Ok(()) => self.refusing.store(false, Ordering::Relaxed),
            Err(error) => self.refused(&error, from),
        }
    }

    pub(super) fn cannot_read(&self, error: &dyn Display, from: &str) {
        self.refused(error, from);
    }

    fn refused(&self, error: &dyn Display, from: &str) {
        if self.refusing.swap(true, Ordering::Relaxed) {
            tracing::debug!(board = %self.name, from, "streamed command refused: {error}");
        } else {
            tracing::warn!(board = %self.name, from, "streamed command refused: {error}");
        }
    }

    fn next_stamp(&self) -> Stamp {
        let mut stamp = self.stamp.lock().unwrap_or_else(PoisonError::into_inner);
        *stamp = stamp.next(wall_clock());
        *stamp
    }

    pub(super) fn info(&self) -> Result<&dyn AxisInfo, Refusal> {
        self.device
            .axis_info()
            .ok_or(Refusal::NoInterface("axis information"))
    }

    pub(super) fn position(&self) -> Result<&dyn PositionControl, Refusal> {
        self.device
            .position_control()
            .ok_or(Refusal::NoInterface("position control"))
    }

    pub(super) fn velocity(&self) -> Result<&dyn VelocityControl, Refusal> {
        self.device
            .velocity_control()
            .ok_or(Refusal::NoInterface("velocity control"))
    }

    /// What position and velocity control have in common, from whichever there is.
    pub(super) fn motion(&self) -> Result<&dyn MotionControl, Refusal> {
        match self.device.position_control() {
            Some(position) => Ok(position),
            None => Ok(self.velocity()?),
        }
    }

    pub(super) fn encoders(&self) -> Result<&dyn Encoders, Refusal> {
        self.device
            .encoders()
            .ok_or(Refusal::NoInterface("encoders"))
    }

    pub(super) fn modes(&self) -> Result<&dyn ControlMode, Refusal> {
        self.device
            .control_mode()
            .ok_or(Refusal::NoInterface("control modes"))
    }

    pub(super) fn limits(&self) -> Result<&dyn ControlLimits, Refusal> {
        self.device
            .control_limits()
            .ok_or(Refusal::NoInterface("control limits"))
    }
}

/// Any interface knows how many axes there are.
fn count_axes(device: &dyn Device) -> Option<usize> {
    device
        .axis_info()
        .map(AxisInfo::axes)
        .or_else(|| device.position_control().map(AxisInfo::axes))
        .or_else(|| device.velocity_control().map(AxisInfo::axes))
        .or_else(|| device.encoders().map(AxisInfo::axes))
        .or_else(|| device.control_mode().map(AxisInfo::axes))
        .or_else(|| device.control_limits().map(AxisInfo::axes))
}

/// Seconds since the start of 1970.
pub(super) fn wall_clock() -> f64 {
    SystemTime::now()
        .duration_since(UNIX_EPOCH)
        .unwrap_or_default()
        .as_secs_f64()
}

#[cfg(test)]
#[path = "board_tests.rs"]
mod tests;
