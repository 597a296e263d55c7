//! Answers, written by the server and read by the client: `[ack]` and the result, or `[nack]`.

use yarp_devices::{
    CartesianInfo, Limits, PoseSolution, Priority, StampedPose, TaskPose, TaskVelocity,
    TweakChange, Tweaks,
};
use yarp_wire::{Bottle, Value};

use super::cartesian_request::{
    group, numbers, priority_word, read_pose, read_priority, read_tweaks, read_velocity,
    tweak_list, velocity_list,
};
use super::cartesian_vocabulary::*;
use super::motion_event::KINDS;
use crate::cartesian::CartesianVersion;
use crate::control_board::messages::{count, float, floats};

/// `[ack]`.
pub(crate) fn acknowledged() -> Bottle {
    Bottle::of(ACK)
}

/// `[nack]`.
pub(crate) fn refused() -> Bottle {
    Bottle::of(NACK)
}

/// Values after `[ack]`.
#[derive(Debug)]
pub(crate) struct Values(Vec<Value>);

/// An answer is yes, with values, or no; `None` for other values.
pub(crate) fn read(reply: Bottle) -> Option<Option<Values>> {
    let mut items = reply.into_items();
    match items.first()?.as_vocab()? {
        ACK => {
            items.remove(0);
            Some(Some(Values(items)))
        }
        NACK => Some(None),
        _ => None,
    }
}

pub(crate) fn tracking(on: bool) -> Bottle {
    acknowledged().with(if on { TRACK } else { SINGLE })
}

pub(crate) fn yes_or_no(value: bool) -> Bottle {
    acknowledged().with(flag(value))
}

pub(crate) fn priority(priority: Priority) -> Bottle {
    acknowledged().with(priority_word(priority))
}

pub(crate) fn number(number: f64) -> Bottle {
    acknowledged().with(number)
}

pub(crate) fn id(id: i32) -> Bottle {
    acknowledged().with(id)
}

pub(crate) fn limits(limits: Limits) -> Bottle {
    acknowledged().with(limits.min).with(limits.max)
}

pub(crate) fn dof(dof: &[bool]) -> Bottle {
    let list: Bottle = dof.iter().map(|&on| Value::Int32(on.into())).collect();
    acknowledged().with(list)
}

pub(crate) fn list(values: &[f64]) -> Bottle {
    acknowledged().with(numbers(values))
}

pub(crate) fn reach(reach: &PoseSolution) -> Bottle {
    acknowledged()
        .with(Bottle::of(X).with(numbers(&reach.pose.to_array())))
        .with(Bottle::of(Q).with(numbers(&reach.joints)))
}

pub(crate) fn velocity(velocity: &TaskVelocity) -> Bottle {
    acknowledged().with(velocity_list(velocity))
}

pub(crate) fn stamped(stamped: &StampedPose, number: i32) -> Bottle {
    acknowledged()
        .with(numbers(&stamped.pose.to_array()))
        .with(Bottle::of(number).with(stamped.time))
}

pub(crate) fn pose(pose: &TaskPose) -> Bottle {
    list(&pose.to_array())
}

/// `version` is the one that the client expects, instead of the device's.
pub(crate) fn info(info: &CartesianInfo, version: CartesianVersion) -> Bottle {
    let pair = |key: &str, value: &str| Bottle::of(key).with(value);
    let events: Bottle = KINDS.iter().map(|&kind| Value::from(kind)).collect();
    acknowledged().with(
        Bottle::new()
            .with(Bottle::of("server_version").with(version.value()))
            .with(pair(&format!("{}_version", info.part), &info.part_version))
            .with(pair(&format!("{}_type", info.part), &info.part_type))
            .with(Bottle::of("events").with(events)),
    )
}

pub(crate) fn tweaks(tweaks: &Tweaks) -> Bottle {
    acknowledged().with(tweak_list(&TweakChange {
        straightness: Some(tweaks.straightness),
        tolerance: Some(tweaks.tolerance),
        constraint_tolerance: Some(tweaks.constraint_tolerance),
        iterations: Some(tweaks.iterations),
    }))
}

impl Values {
    fn first_list(&self) -> Option<&Bottle> {
        self.0.first()?.as_list()
    }

    pub(crate) fn tracking(&self) -> Option<bool> {
        match self.0.first()?.as_vocab()? {
            TRACK => Some(true),
            SINGLE => Some(false),
            _ => None,
        }
    }

    pub(crate) fn yes_or_no(&self) -> Option<bool> {
        match self.0.first()?.as_vocab()? {
            TRUE => Some(true),
            FALSE => Some(false),
            _ => None,
        }
    }

    pub(crate) fn priority(&self) -> Option<Priority> {
        read_priority(self.0.first()?)
    }

    pub(crate) fn number(&self) -> Option<f64> {
        float(self.0.first()?)
    }

    pub(crate) fn id(&self) -> Option<i32> {
        self.0.first()?.as_i32()
    }

    pub(crate) fn limits(&self) -> Option<Limits> {
        Some(Limits::new(self.number()?, float(self.0.get(1)?)?))
    }

    pub(crate) fn dof(&self) -> Option<Vec<bool>> {
        let each = self.first_list()?.iter();
        each.map(|value| Some(count(value)? != 0)).collect()
    }

    pub(crate) fn list(&self) -> Option<Vec<f64>> {
        floats(self.first_list()?)
    }

    pub(crate) fn reach(&self) -> Option<PoseSolution> {
        Some(PoseSolution {
            pose: read_pose(group(&self.0, X)?.get(1)?.as_list()?)?,
            joints: floats(group(&self.0, Q)?.get(1)?.as_list()?)?,
        })
    }

    pub(crate) fn velocity(&self) -> Option<TaskVelocity> {
        read_velocity(self.first_list()?)
    }

    pub(crate) fn pose(&self) -> Option<TaskPose> {
        read_pose(self.first_list()?)
    }

    pub(crate) fn stamped(&self) -> Option<StampedPose> {
        let stamp = self.0.get(1)?.as_list()?;
        Some(StampedPose {
            pose: self.pose()?,
            time: float(stamp.get(1)?)?,
        })
    }

    /// Stock names the part in the keys: `arm_version`, `left_arm_type`.
    pub(crate) fn info(&self) -> Option<CartesianInfo> {
        let mut info = CartesianInfo::default();
        for pair in self.first_list()?.iter().filter_map(Value::as_list) {
            let (Some(key), Some(value)) = (pair.get(0).and_then(Value::as_str), pair.get(1))
            else {
                continue;
            };
            // A version may be a number.
            let value = match value.as_f64() {
                Some(number) => number.to_string(),
                None => value.to_plain_string(),
            };
            if key == "server_version" {
                info.server_version = value;
            } else if let Some(part) = key.strip_suffix("_version") {
                info.part = part.to_owned();
                info.part_version = value;
            } else if key.ends_with("_type") {
                info.part_type = value;
            }
        }
        Some(info)
    }

    pub(crate) fn tweaks(&self) -> Option<Tweaks> {
        // Stock has a second task in the middle; it is left out.
        let known = |value: &&Value| {
            value
                .as_list()
                .is_none_or(|pair| pair.get(0).and_then(Value::as_str) != Some("task_2"))
        };
        let list: Bottle = self.first_list()?.iter().filter(known).cloned().collect();
        let read = read_tweaks(&list)?;
        Some(Tweaks {
            straightness: read.straightness?,
            tolerance: read.tolerance?,
            constraint_tolerance: read.constraint_tolerance?,
            iterations: read.iterations?,
        })
    }
}
