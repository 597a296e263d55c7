//! The services of several devices.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use crate::error::chain;
use crate::{Device, DeviceError, Service, ServiceStart, ServiceUpdate};

/// Several devices whose services are started, updated and stopped as one, like stock's device `group`.
///
/// * A member whose service ends or fails is stopped and logged; the others go on. Stock ignores the result and updates it again.
/// * The service of the group ends when those of all members have ended or failed, with the last error if there was one.
/// * Devices without a service may be members, too. They do not keep the service of the group running.
///
/// ```
/// use std::sync::Arc;
/// use yarp_devices::fake::SimulatedBattery;
/// use yarp_devices::services::DeviceGroup;
/// use yarp_devices::{Service, ServiceStart};
///
/// # fn main() -> Result<(), yarp_devices::DeviceError> {
/// let battery = Arc::new(SimulatedBattery::new(10.0, 5.0));
/// let group = DeviceGroup::new([("battery".to_owned(), battery as Arc<_>)]);
/// assert_eq!(group.start_service()?, ServiceStart::InBackground);
/// group.stop_service()?;
/// # Ok(())
/// # }
/// ```
pub struct DeviceGroup(Mutex<State>);

struct State {
    members: Vec<Member>,
    /// Error of the member that failed last.
    failure: Option<DeviceError>,
}

struct Member {
    name: String,
    device: Arc<dyn Device>,
    state: MemberState,
}

#[derive(Clone, Copy, Debug, Eq, PartialEq)]
enum MemberState {
    Stopped,
    InBackground,
    NeedsUpdates,
}

impl std::fmt::Debug for DeviceGroup {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let state = self.state();
        let states = state
            .members
            .iter()
            .map(|member| (&member.name, member.state));
        f.debug_map().entries(states).finish()
    }
}

impl DeviceGroup {
    /// Groups devices, each with its name for the log.
    pub fn new(members: impl IntoIterator<Item = (String, Arc<dyn Device>)>) -> Self {
        let members = members.into_iter().map(|(name, device)| Member {
            name,
            device,
            state: MemberState::Stopped,
        });
        Self(Mutex::new(State {
            members: members.collect(),
            failure: None,
        }))
    }

    fn state(&self) -> MutexGuard<'_, State> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Member {
    fn start(&mut self) -> Result<(), DeviceError> {
        if let Some(service) = self.device.service() {
            self.state = match service.start_service()? {
                ServiceStart::InBackground => MemberState::InBackground,
                ServiceStart::NeedsUpdates => MemberState::NeedsUpdates,
            };
        }
        Ok(())
    }

    /// Updates the service and stops it when it has ended or failed.
    fn update(&mut self) -> Result<ServiceUpdate, DeviceError> {
        let Some(service) = self.device.service() else {
            return Ok(ServiceUpdate::Ended);
        };
        let updated = service.update_service();
        match &updated {
            Ok(ServiceUpdate::Ended) => tracing::info!("the service of {} has ended", self.name),
            Err(error) => tracing::error!("the service of {} failed: {}", self.name, chain(error)),
            _ => return updated,
        }
        if let Err(error) = self.stop() {
            tracing::warn!(
                "the service of {} did not stop: {}",
                self.name,
                chain(&error)
            );
        }
        updated
    }

    fn stop(&mut self) -> Result<(), DeviceError> {
        let state = std::mem::replace(&mut self.state, MemberState::Stopped);
        match self.device.service() {
            Some(service) if state != MemberState::Stopped => service.stop_service(),
            _ => Ok(()),
        }
    }
}

impl Service for DeviceGroup {
    /// Starts the services in their order; if one does not start, those before it are stopped.
    fn start_service(&self) -> Result<ServiceStart, DeviceError> {
        let State { members, failure } = &mut *self.state();
        *failure = None;
        for place in 0..members.len() {
            if let Err(error) = members[place].start() {
                stop_all(&mut members[..place]).unwrap_or_else(|error| {
                    tracing::warn!("a service of the group did not stop: {}", chain(&error));
                });
                return Err(error);
            }
        }
        let mut states = members.iter().map(|member| member.state);
        Ok(
            match states.any(|state| state == MemberState::NeedsUpdates) {
                true => ServiceStart::NeedsUpdates,
                false => ServiceStart::InBackground,
            },
        )
    }

    fn update_service(&self) -> Result<ServiceUpdate, DeviceError> {
        let State { members, failure } = &mut *self.state();
        let mut worked = false;
        let waiting = |member: &&mut Member| member.state == MemberState::NeedsUpdates;
        for member in members.iter_mut().filter(waiting) {
            match member.update() {
                Ok(update) => worked |= update == ServiceUpdate::Worked,
                Err(error) => *failure = Some(error),
            }
        }
        let is_stopped = |member: &Member| member.state == MemberState::Stopped;
        if members.iter().all(is_stopped) {
            return failure.take().map_or(Ok(ServiceUpdate::Ended), Err);
        }
        Ok(match worked {
            true => ServiceUpdate::Worked,
            false => ServiceUpdate::Idle,
        })
    }

    fn stop_service(&self) -> Result<(), DeviceError> {
        stop_all(&mut self.state().members)
    }
}

/// Stops members in reverse order; returns the first error.
fn stop_all(members: &mut [Member]) -> Result<(), DeviceError> {
    let mut result = Ok(());
    for member in members.iter_mut().rev() {
        result = result.and(member.stop());
    }
    result
}

impl Device for DeviceGroup {
    crate::offers! { service: Service }
}

#[cfg(test)]
mod tests {
    use super::*;

    type Log = Arc<Mutex<Vec<String>>>;

    /// A service that writes down its calls.
    struct Noting {
        name: &'static str,
        log: Log,
        start: Option<ServiceStart>,
        /// Results of the updates, from the last to the first; without one it fails.
        updates: Mutex<Vec<ServiceUpdate>>,
    }

    impl Noting {
        fn note(&self, what: &str) {
            self.log
                .lock()
                .unwrap()
                .push(format!("{} {what}", self.name));
        }
    }

    fn refused() -> DeviceError {
        DeviceError::NotSupported {
            what: "it".to_owned(),
        }
    }

    impl Service for Noting {
        fn start_service(&self) -> Result<ServiceStart, DeviceError> {
            self.note("starts");
            self.start.ok_or_else(refused)
        }
        fn update_service(&self) -> Result<ServiceUpdate, DeviceError> {
            self.note("updates");
            self.updates.lock().unwrap().pop().ok_or_else(refused)
        }
        fn stop_service(&self) -> Result<(), DeviceError> {
            self.note("stops");
            Ok(())
        }
    }

    impl Device for Noting {
        crate::offers! { service: Service }
    }

    fn member(
        log: &Log,
        name: &'static str,
        start: Option<ServiceStart>,
        updates: &[ServiceUpdate],
    ) -> (String, Arc<dyn Device>) {
        let device = Noting {
            name,
            log: log.clone(),
            start,
            updates: Mutex::new(updates.iter().rev().copied().collect()),
        };
        (name.to_owned(), Arc::new(device))
    }

    fn taken(log: &Log) -> Vec<String> {
        std::mem::take(&mut *log.lock().unwrap())
    }

    #[test]
    fn services_are_started_updated_and_stopped_as_one() {
        use ServiceUpdate::{Ended, Idle, Worked};
        let log = Log::default();
        let group = DeviceGroup::new([
            member(&log, "a", Some(ServiceStart::NeedsUpdates), &[Idle, Ended]),
            member(&log, "b", Some(ServiceStart::InBackground), &[]),
            member(&log, "c", Some(ServiceStart::NeedsUpdates), &[Worked, Idle]),
        ]);
        assert_eq!(group.start_service().unwrap(), ServiceStart::NeedsUpdates);
        assert_eq!(taken(&log), ["a starts", "b starts", "c starts"]);
        assert_eq!(group.update_service().unwrap(), Worked);
        assert_eq!(taken(&log), ["a updates", "c updates"]);
        assert_eq!(group.update_service().unwrap(), Idle);
        assert_eq!(taken(&log), ["a updates", "a stops", "c updates"]);
        // The third update of the last one fails.
        assert_eq!(group.update_service().unwrap(), Idle);
        assert_eq!(taken(&log), ["c updates", "c stops"]);
        assert_eq!(group.update_service().unwrap(), Idle);
        assert_eq!(taken(&log), [""; 0]);
        group.stop_service().unwrap();
        assert_eq!(taken(&log), ["b stops"]);
    }

    #[test]
    fn a_group_ends_with_its_last_member_and_fails_if_one_failed() {
        use ServiceUpdate::{Ended, Idle, Worked};
        let needs_updates = Some(ServiceStart::NeedsUpdates);
        let log = Log::default();
        let group = DeviceGroup::new([
            member(&log, "a", needs_updates, &[Ended]),
            member(&log, "b", needs_updates, &[Idle, Ended]),
        ]);
        group.start_service().unwrap();
        assert_eq!(group.update_service().unwrap(), Idle);
        assert_eq!(group.update_service().unwrap(), Ended);
        let group = DeviceGroup::new([
            member(&log, "a", needs_updates, &[]),
            member(&log, "b", needs_updates, &[Worked, Ended]),
        ]);
        group.start_service().unwrap();
        assert_eq!(group.update_service().unwrap(), Worked);
        let error = group.update_service().unwrap_err();
        assert_eq!(error.to_string(), refused().to_string());
        taken(&log);
        group.stop_service().unwrap();
        assert_eq!(taken(&log), [""; 0], "each was stopped when it ended");
    }

    #[test]
    fn a_member_that_does_not_start_stops_those_before_it() {
        let log = Log::default();
        let group = DeviceGroup::new([
            member(&log, "a", Some(ServiceStart::InBackground), &[]),
            member(&log, "b", Some(ServiceStart::NeedsUpdates), &[]),
            member(&log, "c", None, &[]),
            member(&log, "d", Some(ServiceStart::InBackground), &[]),
        ]);
        assert!(group.start_service().is_err());
        assert_eq!(
            taken(&log),
            ["a starts", "b starts", "c starts", "b stops", "a stops"]
        );
        group.stop_service().unwrap();
        assert_eq!(taken(&log), [""; 0]);
    }
}
