//! The newest message of a stream.

use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use yarp_devices::{DeviceError, SensorStatus};

/// The newest value received, written by a stream and read by callers.
#[derive(Debug)]
pub(crate) struct LatestValue<T> {
    newest: Mutex<Option<(T, Instant)>>,
    /// When the wait for a value began.
    since: Mutex<Instant>,
    /// Name of the value in errors.
    what: &'static str,
    max_age: Duration,
}

impl<T> LatestValue<T> {
    /// No value yet; one is trusted until it is `max_age` old.
    pub(crate) fn new(what: &'static str, max_age: Duration) -> Self {
        Self {
            newest: Mutex::default(),
            since: Mutex::new(Instant::now()),
            what,
            max_age,
        }
    }

    /// Stores a value that has just been received.
    pub(crate) fn store(&self, value: T) {
        *self.newest() = Some((value, Instant::now()));
    }

    /// Forgets the value, as if none had ever been received.
    pub(crate) fn clear(&self) {
        *self.newest() = None;
        *self.since() = Instant::now();
    }

    /// Returns whether no value has been received for so long.
    pub(crate) fn is_older_than(&self, age: Duration) -> bool {
        self.arrived().unwrap_or_else(|| *self.since()).elapsed() > age
    }

    /// Returns the arrival time of the newest value.
    pub(crate) fn arrived(&self) -> Option<Instant> {
        self.newest().as_ref().map(|(_, arrived)| *arrived)
    }

    /// Reads the newest value in place.
    ///
    /// Errors: [`DeviceError::NoDataYet`], [`DeviceError::Stale`].
    pub(crate) fn read<R>(&self, read: impl FnOnce(&T) -> R) -> Result<R, DeviceError> {
        self.read_part(self.what, read)
    }

    /// Reads a part of the newest value in place; `what` is the name of the part in errors.
    ///
    /// Errors: [`DeviceError::NoDataYet`], [`DeviceError::Stale`].
    pub(crate) fn read_part<R>(
        &self,
        what: &'static str,
        read: impl FnOnce(&T) -> R,
    ) -> Result<R, DeviceError> {
        let newest = self.newest();
        let (value, arrived) = newest.as_ref().ok_or(DeviceError::NoDataYet { what })?;
        let (age, limit) = (arrived.elapsed(), self.max_age);
        if age > limit {
            return Err(DeviceError::Stale { what, age, limit });
        }
        Ok(read(value))
    }

    /// Shows `inspect` the newest value, of whatever age, and the state of a sensor whose value it is.
    pub(crate) fn inspect<R>(&self, inspect: impl FnOnce(Option<&T>, SensorStatus) -> R) -> R {
        match &*self.newest() {
            None => inspect(None, SensorStatus::WaitingForFirstRead),
            Some((value, arrived)) => {
                let status = match arrived.elapsed() > self.max_age {
                    true => SensorStatus::Timeout,
                    false => SensorStatus::Ok,
                };
                inspect(Some(value), status)
            }
        }
    }

    fn since(&self) -> MutexGuard<'_, Instant> {
        self.since.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn newest(&self) -> MutexGuard<'_, Option<(T, Instant)>> {
        self.newest.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_value_is_read_until_it_is_too_old() {
        let value = LatestValue::new("number", Duration::from_secs(3600));
        let error = value.read(|_: &i32| ()).unwrap_err();
        assert!(matches!(error, DeviceError::NoDataYet { what: "number" }));
        assert!(!value.is_older_than(Duration::from_secs(3600)));
        value.store(7);
        assert_eq!(value.read(|number| *number).unwrap(), 7);
        value.clear();
        assert!(matches!(
            value.read(|_| ()),
            Err(DeviceError::NoDataYet { .. })
        ));
        let value = LatestValue::new("number", Duration::ZERO);
        value.store(7);
        let arrived = value.arrived().expect("it was stored");
        while arrived.elapsed().is_zero() {}
        assert!(matches!(value.read(|_| ()), Err(DeviceError::Stale { .. })));
        assert!(value.is_older_than(Duration::ZERO));
    }

    #[test]
    fn a_value_too_old_is_still_shown_with_its_state() {
        let inspect =
            |value: &LatestValue<i32>| value.inspect(|newest, status| (newest.copied(), status));
        let value = LatestValue::new("number", Duration::ZERO);
        assert_eq!(inspect(&value), (None, SensorStatus::WaitingForFirstRead));
        value.store(7);
        let arrived = value.arrived().expect("it was stored");
        while arrived.elapsed().is_zero() {}
        assert_eq!(inspect(&value), (Some(7), SensorStatus::Timeout));
        let value = LatestValue::new("number", Duration::from_secs(3600));
        value.store(7);
        assert_eq!(inspect(&value), (Some(7), SensorStatus::Ok));
    }
}
