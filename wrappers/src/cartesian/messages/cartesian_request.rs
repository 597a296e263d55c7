//! Queries and commands.

use yarp_devices::{AxisIndex, Limits, Priority, Target, TaskPose, TaskVelocity, TweakChange};
use yarp_wire::{Bottle, Value, Vocab32};

use super::cartesian_vocabulary::*;
use crate::control_board::messages::{axis, count, float, floats, integer};

/// A request of a client.
#[derive(Clone, Debug, PartialEq)]
pub enum Request {
    /// Ends the motion.
    Stop,
    /// Goes to a target in so many seconds; none above 0 for the time that is set.
    Go(Target, f64),
    /// Moves at a velocity. On the port for commands only.
    Move(TaskVelocity),
    /// Solve for a target, from these joints.
    Ask(Target, Option<Vec<f64>>),
    /// Keeps the settings.
    Store,
    /// Takes kept settings again; without a number stock answers an empty message.
    Restore(Option<i32>),
    /// Forgets kept settings; as with [`Restore`](Self::Restore).
    Delete(Option<Vec<i32>>),
    /// A query.
    Get(Query),
    /// A setting.
    Set(Setting),
    /// Announces a fraction of the path.
    Register(f64),
    /// Takes that back.
    Unregister(f64),
    /// The announced fractions.
    Checkpoints,
}

/// A query.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
#[allow(missing_docs, reason = "each is a question of the interface")]
pub enum Query {
    Tracking,
    Reference,
    Priority,
    Time,
    Tolerance,
    Done,
    IsOn,
    Limits(AxisIndex),
    Dof,
    Rest,
    Weights,
    Desired,
    JointVelocities,
    TaskVelocity,
    Pose(AxisIndex),
    Tip,
    Info,
    Tweaks,
}

/// A setting.
#[derive(Clone, Debug, PartialEq)]
#[allow(missing_docs, reason = "each is a setting of the interface")]
pub enum Setting {
    Tracking(bool),
    Reference(bool),
    Priority(Priority),
    Time(f64),
    Tolerance(f64),
    Limits(AxisIndex, Limits),
    Dof(Vec<Option<bool>>),
    Rest(Vec<f64>),
    Weights(Vec<f64>),
    Tip(TaskPose),
    Tweaks(TweakChange),
}

/// A message that is no request.
#[derive(Clone, Copy, Debug, Eq, PartialEq, thiserror::Error)]
#[error("not a request to a cartesian controller")]
pub struct Malformed;

/// The queries without arguments.
const QUERIES: [(Query, Vocab32); 16] = [
    (Query::Tracking, MODE),
    (Query::Reference, REFERENCE),
    (Query::Priority, PRIORITY),
    (Query::Time, TIME),
    (Query::Tolerance, TOLERANCE),
    (Query::Done, DONE),
    (Query::IsOn, IS_ON),
    (Query::Dof, DOF),
    (Query::Rest, REST),
    (Query::Weights, WEIGHTS),
    (Query::Desired, DESIRED),
    (Query::JointVelocities, Q_VELOCITY),
    (Query::TaskVelocity, X_VELOCITY),
    (Query::Tip, TIP),
    (Query::Info, INFO),
    (Query::Tweaks, TWEAK),
];

fn array<const N: usize>(list: &Bottle) -> Option<[f64; N]> {
    floats(list)?.try_into().ok()
}

/// A list of numbers.
pub(super) fn numbers(numbers: &[f64]) -> Bottle {
    numbers.iter().copied().map(Value::from).collect()
}

/// A list that begins with a word, somewhere in a message.
pub(super) fn group(message: &[Value], key: Vocab32) -> Option<&Bottle> {
    let mut lists = message.iter().filter_map(Value::as_list);
    lists.find(|list| list.get(0).and_then(Value::as_vocab) == Some(key))
}

fn target(kind: Vocab32, list: &Bottle) -> Option<Target> {
    match kind {
        FULL => array(list).map(TaskPose::from_array).map(Target::Pose),
        PLACE => array(list).map(Target::Position),
        _ => None,
    }
}

fn target_words(target: &Target) -> (Vocab32, Bottle) {
    match target {
        Target::Pose(pose) => (FULL, numbers(&pose.to_array())),
        Target::Position(place) => (PLACE, numbers(place)),
    }
}

fn id(value: &Value) -> Option<i32> {
    count(value).and_then(|id| i32::try_from(id).ok())
}

fn switch(value: &Value) -> Option<Option<bool>> {
    // Stock interprets any other number as "as it is", its documentation says 2.
    match count(value)? {
        0 => Some(Some(false)),
        1 => Some(Some(true)),
        _ => Some(None),
    }
}

fn tweaks(list: &Bottle) -> Option<TweakChange> {
    let mut change = TweakChange::default();
    for pair in list.iter() {
        let [key, value] = pair.as_list()?.as_slice() else {
            return None;
        };
        match key.as_str()? {
            STRAIGHTNESS => change.straightness = Some(float(value)?),
            SOLVER_TOLERANCE => change.tolerance = Some(float(value)?),
            CONSTRAINT_TOLERANCE => change.constraint_tolerance = Some(float(value)?),
            ITERATIONS => change.iterations = Some(count(value)?),
            _ => return None,
        }
    }
    Some(change)
}

impl Request {
    /// Reads a request; numbers must be numbers, and as many as are needed.
    pub fn parse(message: &Bottle) -> Result<Self, Malformed> {
        read(message.as_slice()).ok_or(Malformed)
    }

    /// Encodes the request as stock does.
    pub fn to_bottle(&self) -> Bottle {
        match self {
            Self::Stop => Bottle::of(STOP),
            Self::Go(target, time) => {
                let (kind, list) = target_words(target);
                Bottle::of(GO).with(kind).with(*time).with(list)
            }
            Self::Move(velocity) => Bottle::of(TASK_VELOCITY).with(velocity_list(velocity)),
            Self::Ask(target, start) => {
                let (kind, list) = target_words(target);
                let mut message = Bottle::of(ASK).with(Bottle::of(X_DESIRED).with(list));
                if let Some(start) = start {
                    message.push(Bottle::of(Q).with(numbers(start)));
                }
                message.with(Bottle::of(POSE).with(kind))
            }
            Self::Store => Bottle::of(STORE),
            Self::Restore(id) => id.iter().fold(Bottle::of(RESTORE), |all, &id| all.with(id)),
            Self::Delete(None) => Bottle::of(DELETE),
            Self::Delete(Some(ids)) => {
                let ids: Bottle = ids.iter().copied().map(Value::from).collect();
                Bottle::of(DELETE).with(ids)
            }
            Self::Get(question) => question.to_bottle(),
            Self::Set(setting) => setting.to_bottle(),
            Self::Register(at) => Bottle::of(EVENT).with(REGISTER).with(ONGOING).with(*at),
            Self::Unregister(at) => Bottle::of(EVENT).with(UNREGISTER).with(ONGOING).with(*at),
            Self::Checkpoints => Bottle::of(EVENT).with(LIST).with(ONGOING),
        }
    }
}

fn read(message: &[Value]) -> Option<Request> {
    let (first, rest) = message.split_first()?;
    Some(match (first.as_vocab()?, rest) {
        (STOP, _) => Request::Stop,
        (GO, [kind, time, list, ..]) => {
            Request::Go(target(kind.as_vocab()?, list.as_list()?)?, float(time)?)
        }
        (TASK_VELOCITY, [list, ..]) => Request::Move(read_velocity(list.as_list()?)?),
        (ASK, options) => {
            let list = group(options, X_DESIRED)?.get(1)?.as_list()?;
            let start = match group(options, Q) {
                Some(start) => Some(floats(start.get(1)?.as_list()?)?),
                None => None,
            };
            let kind = match group(options, POSE) {
                Some(kind) => kind.get(1)?.as_vocab()?,
                None => FULL,
            };
            Request::Ask(target(kind, list)?, start)
        }
        (STORE, _) => Request::Store,
        (RESTORE, []) => Request::Restore(None),
        (RESTORE, [number, ..]) => Request::Restore(Some(id(number)?)),
        (DELETE, []) => Request::Delete(None),
        (DELETE, [ids, ..]) => {
            let ids: Option<Vec<i32>> = ids.as_list()?.iter().map(id).collect();
            Request::Delete(Some(ids?))
        }
        (GET, [word, rest @ ..]) => Request::Get(Query::read(word.as_vocab()?, rest)?),
        (SET, [word, value, rest @ ..]) => {
            Request::Set(Setting::read(word.as_vocab()?, value, rest)?)
        }
        (EVENT, [what, kind, rest @ ..]) if kind.as_vocab()? == ONGOING => {
            match (what.as_vocab()?, rest) {
                (REGISTER, [at, ..]) => Request::Register(float(at)?),
                (UNREGISTER, [at, ..]) => Request::Unregister(float(at)?),
                (LIST, _) => Request::Checkpoints,
                _ => return None,
            }
        }
        _ => return None,
    })
}

pub(super) fn velocity_list(velocity: &TaskVelocity) -> Bottle {
    let [x, y, z] = velocity.linear;
    let [ax, ay, az] = velocity.axis;
    numbers(&[x, y, z, ax, ay, az, velocity.speed])
}

pub(super) fn read_velocity(list: &Bottle) -> Option<TaskVelocity> {
    let [x, y, z, ax, ay, az, speed] = array(list)?;
    Some(TaskVelocity {
        linear: [x, y, z],
        axis: [ax, ay, az],
        speed,
    })
}

pub(super) fn read_pose(list: &Bottle) -> Option<TaskPose> {
    array(list).map(TaskPose::from_array)
}

pub(super) fn read_priority(value: &Value) -> Option<Priority> {
    match value.as_str()? {
        POSITION => Some(Priority::Position),
        ORIENTATION => Some(Priority::Orientation),
        _ => None,
    }
}

pub(super) fn priority_word(priority: Priority) -> &'static str {
    match priority {
        Priority::Position => POSITION,
        Priority::Orientation => ORIENTATION,
    }
}

pub(super) fn tweak_list(change: &TweakChange) -> Bottle {
    let pair = |key: &str, value: Option<Value>| {
        value.map(|value| Value::from(Bottle::of(key).with(value)))
    };
    let pairs = [
        pair(STRAIGHTNESS, change.straightness.map(Value::from)),
        pair(SOLVER_TOLERANCE, change.tolerance.map(Value::from)),
        pair(
            CONSTRAINT_TOLERANCE,
            change.constraint_tolerance.map(Value::from),
        ),
        pair(ITERATIONS, change.iterations.map(integer)),
    ];
    pairs.into_iter().flatten().collect()
}

pub(super) fn read_tweaks(list: &Bottle) -> Option<TweakChange> {
    tweaks(list)
}

impl Query {
    fn read(word: Vocab32, rest: &[Value]) -> Option<Self> {
        match word {
            LIMITS => axis(rest.first()?).map(Self::Limits),
            POSE => axis(rest.first()?).map(Self::Pose),
            _ => {
                let found = QUERIES.iter().find(|(_, known)| *known == word);
                found.map(|(question, _)| *question)
            }
        }
    }

    fn to_bottle(self) -> Bottle {
        let ask = Bottle::of(GET);
        match self {
            Self::Limits(axis) => ask.with(LIMITS).with(integer(axis.index())),
            Self::Pose(axis) => ask.with(POSE).with(integer(axis.index())),
            plain => {
                let found = QUERIES.iter().find(|(known, _)| *known == plain);
                found.iter().fold(ask, |ask, (_, word)| ask.with(*word))
            }
        }
    }
}

impl Setting {
    fn read(word: Vocab32, value: &Value, rest: &[Value]) -> Option<Self> {
        Some(match word {
            MODE => match value.as_vocab()? {
                TRACK => Self::Tracking(true),
                SINGLE => Self::Tracking(false),
                _ => return None,
            },
            REFERENCE => match value.as_vocab()? {
                TRUE => Self::Reference(true),
                FALSE => Self::Reference(false),
                _ => return None,
            },
            PRIORITY => Self::Priority(read_priority(value)?),
            TIME => Self::Time(float(value)?),
            TOLERANCE => Self::Tolerance(float(value)?),
            LIMITS => match rest {
                [min, max, ..] => Self::Limits(axis(value)?, Limits::new(float(min)?, float(max)?)),
                _ => return None,
            },
            DOF => Self::Dof(value.as_list()?.iter().map(switch).collect::<Option<_>>()?),
            REST => Self::Rest(floats(value.as_list()?)?),
            WEIGHTS => Self::Weights(floats(value.as_list()?)?),
            TIP => Self::Tip(read_pose(value.as_list()?)?),
            TWEAK => Self::Tweaks(tweaks(value.as_list()?)?),
            _ => return None,
        })
    }

    fn to_bottle(&self) -> Bottle {
        let set = Bottle::of(SET);
        match self {
            Self::Tracking(on) => set.with(MODE).with(if *on { TRACK } else { SINGLE }),
            Self::Reference(on) => set.with(REFERENCE).with(flag(*on)),
            Self::Priority(priority) => set.with(PRIORITY).with(priority_word(*priority)),
            Self::Time(time) => set.with(TIME).with(*time),
            Self::Tolerance(tolerance) => set.with(TOLERANCE).with(*tolerance),
            Self::Limits(axis, limits) => {
                let set = set.with(LIMITS).with(integer(axis.index()));
                set.with(limits.min).with(limits.max)
            }
            Self::Dof(dof) => {
                let number = |on: &Option<bool>| Value::Int32(on.map_or(2, i32::from));
                set.with(DOF)
                    .with(dof.iter().map(number).collect::<Bottle>())
            }
            Self::Rest(rest) => set.with(REST).with(numbers(rest)),
            Self::Weights(weights) => set.with(WEIGHTS).with(numbers(weights)),
            Self::Tip(tip) => set.with(TIP).with(numbers(&tip.to_array())),
            Self::Tweaks(change) => set.with(TWEAK).with(tweak_list(change)),
        }
    }
}
