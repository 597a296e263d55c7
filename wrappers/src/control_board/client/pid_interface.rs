//! Control loops.

use yarp_devices::{Axes, AxisIndex, DeviceError, Pid, PidInfo, PidKind, PidValue};

use super::super::messages::{Action, Choices, Quantity, Query, Set, Setting};

remote! {
    describe_pid_control {
        /// [`DeviceError::NotSupported`] from 3.x, which has no query for it.
        fn available_pids(&self, axis: AxisIndex) -> Result<Vec<PidKind>, DeviceError> {
            self.asking_4("listing control loops")?;
            self.about(Query::AvailablePids, axis).map(|Choices(kinds)| kinds)
        }

        fn pids(&self, kind: PidKind, axes: Axes<'_>) -> Result<Vec<Pid>, DeviceError> {
            self.about_each(Query::Pids(kind), axes)
        }

        /// [`DeviceError::NotSupported`] from 3.x, which has no query for it.
        fn pid_info(&self, kind: PidKind, axes: Axes<'_>) -> Result<Vec<PidInfo>, DeviceError> {
            self.asking_4("asking what gains mean")?;
            self.about_each(Query::PidInfo(kind), axes)
        }

        fn set_pids(&self, kind: PidKind, axes: Axes<'_>, pids: &[Pid]) -> Result<(), DeviceError> {
            axes.check_command(self.axes, "pids", pids.len())?;
            if pids.is_empty() {
                return Ok(());
            }
            let words = Query::Pids(kind).spelling().words;
            for selection in words.sayable(axes, self.axes, "set the gains of", false)? {
                self.order(Set::Pids(kind, selection, pids.to_vec()))?;
            }
            Ok(())
        }

        fn pid_values(&self, kind: PidKind, value: PidValue, axes: Axes<'_>) -> Result<Vec<f64>, DeviceError> {
            let quantity = match value {
                PidValue::Reference => Quantity::PidReference(kind),
                PidValue::ErrorLimit => Quantity::PidErrorLimit(kind),
                PidValue::Error => Quantity::PidError(kind),
                PidValue::Output => Quantity::PidOutput(kind),
                PidValue::Offset => Quantity::PidOffset(kind),
                PidValue::Feedforward => Quantity::PidFeedforward(kind),
            };
            self.values(quantity, axes)
        }

        fn set_pid_values(
            &self,
            kind: PidKind,
            value: PidValue,
            axes: Axes<'_>,
            values: &[f64],
        ) -> Result<(), DeviceError> {
            let setting = match value {
                PidValue::Reference => Setting::PidReference(kind),
                PidValue::ErrorLimit => Setting::PidErrorLimit(kind),
                PidValue::Offset => Setting::PidOffset(kind),
                PidValue::Feedforward => Setting::PidFeedforward(kind),
                PidValue::Error | PidValue::Output => {
                    return Err(DeviceError::NotSupported {
                        what: "setting an error or an output".to_owned(),
                    });
                }
            };
            self.set(setting, "values", axes, values)
        }

        fn pids_enabled(&self, kind: PidKind, axes: Axes<'_>) -> Result<Vec<bool>, DeviceError> {
            axes.check(self.axes)?;
            axes.iter(self.axes).map(|axis| self.about(Query::PidEnabled(kind), axis)).collect()
        }

        fn enable_pids(&self, kind: PidKind, axes: Axes<'_>, enabled: bool) -> Result<(), DeviceError> {
            match enabled {
                true => self.act(Action::EnablePids(kind), "close loops of", axes),
                false => self.act(Action::DisablePids(kind), "open loops of", axes),
            }
        }

        fn reset_pids(&self, kind: PidKind, axes: Axes<'_>) -> Result<(), DeviceError> {
            self.act(Action::ResetPids(kind), "reset loops of", axes)
        }
    }
}
