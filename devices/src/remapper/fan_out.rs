//! Queries and commands to the devices, and the errors when one of them refuses.

use super::Remapper;
use super::axis_mapping::{DeviceShare, RemappedDevice};
use crate::{Axes, AxisIndex, Device, DeviceError};

/// An interface of devices.
#[derive(Clone, Copy)]
pub(super) struct Interface {
    /// Name in errors.
    pub(super) words: &'static str,
    pub(super) has: fn(&dyn Device) -> bool,
}

type Outcome<T> = Result<T, DeviceError>;
/// Result of a device's call; `None` if it lacks the interface.
type DeviceReply<T> = Option<Outcome<T>>;

/// Treatment of the other devices when one refuses.
#[derive(Clone, Copy, Eq, PartialEq)]
pub(super) enum OnRefusal {
    /// They are left as they are.
    StopThere,
    /// The command goes to them all the same: for commands that stop joints.
    TellOthers,
}

impl Remapper {
    pub(super) fn any_has(&self, interface: Interface) -> bool {
        let mut devices = self.parts.iter().map(|part| part.device.as_ref());
        devices.any(interface.has)
    }

    /// Queries several joints: one value per joint, in the order of the selection.
    pub(super) fn ask<T>(
        &self,
        interface: Interface,
        axes: Axes<'_>,
        call: impl Fn(&dyn Device, Axes<'_>) -> DeviceReply<Vec<T>>,
    ) -> Outcome<Vec<T>> {
        let shares = self.shares(axes)?;
        let mut answers: Vec<Option<T>> = Vec::new();
        answers.resize_with(axes.len(self.axes.len()), || None);
        for share in shares {
            let values = self.group(interface, &share, &call)?;
            if values.len() != share.places.len() {
                return Err(share.part.refused(DeviceError::WrongCount {
                    what: "values in an answer",
                    expected: share.places.len(),
                    got: values.len(),
                }));
            }
            for (at, value) in share.places.iter().zip(values) {
                answers[*at] = Some(value);
            }
        }
        // Each place is in one share.
        Ok(answers.into_iter().flatten().collect())
    }

    /// Queries like [`ask`](Self::ask), into slots of the caller; for one joint, and for all if the joints of a
    /// device are next to each other, without allocating.
    pub(super) fn fill<T: Copy>(
        &self,
        interface: Interface,
        axes: Axes<'_>,
        out: &mut [T],
        call: impl Fn(&dyn Device, Axes<'_>, &mut [T]) -> DeviceReply<()>,
    ) -> Outcome<()> {
        axes.check(self.axes.len())?;
        axes.check_count(self.axes.len(), "slots for answers", out.len())?;
        let fill = |share: DeviceShare<'_>, out: &mut [T]| {
            let device = share.part.device.as_ref();
            let said = match share.run() {
                Some(run) => call(device, share.axes(), &mut out[run]),
                None => {
                    let mut own = share.values(out);
                    let said = call(device, share.axes(), &mut own);
                    for (at, value) in share.places.iter().zip(own) {
                        out[*at] = value;
                    }
                    said
                }
            };
            self.heard(interface, share.part, share.theirs[0], said)
        };
        match axes {
            Axes::One(joint) => self.one(interface, joint, |device, axis| {
                call(device, axis.into(), out)
            }),
            Axes::All => self.every_share().try_for_each(|share| fill(share, out)),
            Axes::Group(_) => {
                let mut shares = self.shares(axes)?.into_iter();
                shares.try_for_each(|share| fill(share, out))
            }
        }
    }

    /// Queries one device for its share as a whole.
    pub(super) fn group<T>(
        &self,
        interface: Interface,
        share: &DeviceShare<'_>,
        call: impl FnOnce(&dyn Device, Axes<'_>) -> DeviceReply<T>,
    ) -> Outcome<T> {
        let said = call(share.part.device.as_ref(), share.axes());
        self.heard(interface, share.part, share.theirs[0], said)
    }

    /// A query or command for one joint.
    pub(super) fn one<T>(
        &self,
        interface: Interface,
        axis: AxisIndex,
        call: impl FnOnce(&dyn Device, AxisIndex) -> DeviceReply<T>,
    ) -> Outcome<T> {
        Axes::One(axis).check(self.axes.len())?;
        let place = self.axes[axis.index()];
        let part = &self.parts[place.part];
        let said = call(part.device.as_ref(), place.axis);
        self.heard(interface, part, place.axis, said)
    }

    /// A command with a value per joint.
    ///
    /// * `what`: the kind of values, for the error.
    /// * `doubtful`: whether a device will probably refuse its share; checked only if there are several devices.
    pub(super) fn tell<T: Clone>(
        &self,
        interface: Interface,
        axes: Axes<'_>,
        (what, values): (&'static str, &[T]),
        others: OnRefusal,
        doubtful: impl Fn(&DeviceShare<'_>, &[T]) -> bool,
        call: impl Fn(&dyn Device, Axes<'_>, &[T]) -> DeviceReply<()>,
    ) -> Outcome<()> {
        axes.check_command(self.axes.len(), what, values.len())?;
        let shares = self.shares(axes)?;
        let several = shares.len() > 1;
        let with_values = shares.into_iter().map(|share| {
            let own = share.values(values);
            (share, own)
        });
        // The doubtful ones first: a refusal comes before others have moved.
        let (mut targets, rest): (Vec<_>, Vec<_>) =
            with_values.partition(|(share, own)| several && doubtful(share, own));
        targets.extend(rest);
        self.all_of(interface, others, targets, |device, axes, values| {
            call(device, axes, values)
        })
    }

    /// A command without values.
    pub(super) fn order(
        &self,
        interface: Interface,
        axes: Axes<'_>,
        others: OnRefusal,
        call: impl Fn(&dyn Device, Axes<'_>) -> DeviceReply<()>,
    ) -> Outcome<()> {
        let shares = self.shares(axes)?;
        let targets = shares.into_iter().map(|share| (share, ())).collect();
        self.all_of(interface, others, targets, |device, axes, ()| {
            call(device, axes)
        })
    }

    /// Tells each device its share.
    pub(super) fn all_of<V>(
        &self,
        interface: Interface,
        others: OnRefusal,
        targets: Vec<(DeviceShare<'_>, V)>,
        call: impl Fn(&dyn Device, Axes<'_>, &V) -> DeviceReply<()>,
    ) -> Outcome<()> {
        let (shares, values): (Vec<_>, Vec<_>) = targets.into_iter().unzip();
        self.each_of(interface, others, &shares, &|place| {
            let share: &DeviceShare<'_> = &shares[place];
            call(share.part.device.as_ref(), share.axes(), &values[place])
        })
    }

    /// Makes a call for each share, by its place. What does not depend on the call is compiled once.
    fn each_of(
        &self,
        interface: Interface,
        others: OnRefusal,
        shares: &[DeviceShare<'_>],
        call: &dyn Fn(usize) -> DeviceReply<()>,
    ) -> Outcome<()> {
        if others == OnRefusal::StopThere {
            for share in shares {
                if !(interface.has)(share.part.device.as_ref()) {
                    return Err(self.lack(interface, share.part, share.theirs[0]));
                }
            }
        }
        let mut done = Vec::new();
        let mut undone = Vec::new();
        let mut refusal: Option<(&RemappedDevice, DeviceError)> = None;
        for (place, share) in shares.iter().enumerate() {
            let part = share.part;
            if refusal.is_some() && others == OnRefusal::StopThere {
                undone.push(part.name.clone());
                continue;
            }
            let error = match call(place) {
                Some(Ok(())) => {
                    done.push(part.name.clone());
                    continue;
                }
                Some(Err(error)) => part.renumbered(error),
                None => self.lack(interface, part, share.theirs[0]),
            };
            match refusal {
                None => refusal = Some((part, error)),
                Some(_) => undone.push(part.name.clone()),
            }
        }
        let Some((part, why)) = refusal else {
            return Ok(());
        };
        self.known.forget();
        Err(DeviceError::PartRefused {
            part: part.name.clone(),
            why: Box::new(why),
            done,
            undone,
        })
    }

    /// Processes the result of one device.
    fn heard<T>(
        &self,
        interface: Interface,
        part: &RemappedDevice,
        axis: AxisIndex,
        said: DeviceReply<T>,
    ) -> Outcome<T> {
        match said {
            Some(outcome) => outcome.map_err(|error| part.refused(error)),
            None => Err(self.lack(interface, part, axis)),
        }
    }

    /// Returns the error that the device of a joint, which the device calls `axis`, lacks an interface.
    fn lack(&self, interface: Interface, part: &RemappedDevice, axis: AxisIndex) -> DeviceError {
        let joint = part.number_here(axis).unwrap_or(axis);
        DeviceError::PartLacks {
            joint,
            name: self.names[joint.index()].clone(),
            part: part.name.clone(),
            what: interface.words,
        }
    }
}

impl RemappedDevice {
    /// Returns the error of a device that refused a call which went to no other one.
    pub(super) fn refused(&self, error: DeviceError) -> DeviceError {
        DeviceError::PartRefused {
            part: self.name.clone(),
            why: Box::new(self.renumbered(error)),
            done: Vec::new(),
            undone: Vec::new(),
        }
    }

    /// An error of the device, with the joints numbered as here.
    fn renumbered(&self, error: DeviceError) -> DeviceError {
        error.renumbered(&|joint| self.number_here(joint).unwrap_or(joint))
    }
}
