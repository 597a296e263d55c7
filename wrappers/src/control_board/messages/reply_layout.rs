//! Replies to queries: the same results in the layouts of both wire versions.
//!
//! A server replies with [`Item`]s, laid out as in 4.0; 3.x puts some of them into lists, and gains in another order.
//! A client gets [`Value`]s in that same layout, from either wire version.

use yarp_devices::VariableValue;
use yarp_wire::{Stamp, Value, WireVersion};

use super::axis_selection::{Form, Selection};
use super::board_reply::Reply;
use super::board_request::Get;
use super::board_vocabulary as word;
use super::pid_messages;
use super::request_table::{Quantity, Query};
use super::results::{Outcome, gains, read_gains};
use crate::thrift::Item;

const V3: WireVersion = WireVersion::V3;

impl Get {
    /// The results that accompany an error in 4.0, where all are present even then.
    pub(crate) fn nothing(&self) -> Vec<Item> {
        match self {
            Self::Values(_, selection) => <Vec<f64>>::nothing(selection.form() == Form::One),
            Self::Variable(_) => <Vec<VariableValue>>::nothing(true),
            // The code itself is the answer.
            Self::About(Query::CalibrationDone, _) => Vec::new(),
            Self::About(query, selection) => query.nothing(selection.form() == Form::One),
        }
    }

    /// The answer of 3.x that holds `results`; `echo` is item 1 of the query as received.
    pub(crate) fn answer_v3(&self, echo: Value, results: Vec<Item>, stamp: Stamp) -> Reply {
        let values = self.as_v3(results);
        match (self, self.layout()) {
            (Self::About(Query::CalibrationDone, _), _) => {
                let done = values.first().and_then(Value::as_i32) == Some(1);
                if done { Reply::ok() } else { Reply::fail() }
            }
            (Self::About(Query::ControlModes, selection), _) => {
                let echo = match selection {
                    // The joint in the place of the word.
                    Selection::One(axis) => Value::Int32(axis.index() as i32),
                    Selection::Group(_) => word::CONTROL_MODE_GROUP.into(),
                    Selection::All => word::CONTROL_MODES.into(),
                };
                Reply::is(echo, values, stamp)
            }
            (_, Layout::Bare) => Reply::bare(values, Some(stamp)),
            (_, Layout::NoEcho) => {
                let values = std::iter::once(word::IS.into()).chain(values);
                Reply::bare(values, None)
            }
            (_, Layout::NoTime) => {
                let values = [word::IS.into(), echo].into_iter().chain(values);
                Reply::bare(values, None)
            }
            (_, Layout::Full) => Reply::is(echo, values, stamp),
        }
    }

    /// The results in an answer of 3.x, laid out as 4.0 has them.
    pub(crate) fn read_v3(&self, reply: &Reply) -> Option<Vec<Value>> {
        if let Self::About(Query::CalibrationDone, _) = self {
            return Some(vec![Value::Int32(i32::from(reply.is_ok()))]);
        }
        let skipped = match self.layout() {
            Layout::Bare => 0,
            Layout::NoEcho => 1,
            Layout::NoTime | Layout::Full => 2,
        };
        let mut values = reply.results(skipped)?;
        if self.is_listed() {
            let first = values.into_iter().next()?;
            values = first.as_list()?.clone().into_items();
        }
        let reordered = |value: &Value| {
            let pid = pid_messages::read_gains(value.as_list()?, V3)?;
            Some(Value::from(gains(&pid)))
        };
        match self {
            Self::About(Query::Pids(_), Selection::One(_)) => {
                Some(vec![reordered(values.first()?)?])
            }
            Self::About(Query::Pids(_), _) => {
                let all = values.first()?.as_list()?.iter().map(reordered);
                Some(vec![Value::List(all.collect::<Option<_>>()?)])
            }
            _ => Some(values),
        }
    }

    fn as_v3(&self, results: Vec<Item>) -> Vec<Value> {
        let values: Vec<Value> = results.into_iter().map(Value::from).collect();
        let reordered = |value: &Value| {
            let pid = read_gains(value).unwrap_or_default();
            let gains = pid_messages::gains(&pid, V3).map(Value::Float64);
            Value::List(gains.into_iter().collect())
        };
        match self {
            Self::About(Query::Pids(_), Selection::One(_)) => {
                values.iter().map(reordered).collect()
            }
            Self::About(Query::Pids(_), _) => {
                let lists = values.iter().filter_map(Value::as_list);
                lists
                    .map(|list| Value::List(list.iter().map(reordered).collect()))
                    .collect()
            }
            // 4.0 has a list of bottles, of which one is used.
            Self::About(Query::Variables, _) => {
                let lists = values.iter().filter_map(Value::as_list);
                lists.filter_map(|list| list.get(0).cloned()).collect()
            }
            _ if self.is_listed() => vec![Value::List(values.into_iter().collect())],
            _ => values,
        }
    }

    /// Returns whether 3.x puts the results into a list of their own.
    fn is_listed(&self) -> bool {
        matches!(
            self,
            Self::Values(Quantity::ImpedanceOffset, _)
                | Self::About(
                    Query::Impedance | Query::ImpedanceLimits | Query::MotorParameters,
                    _
                )
        )
    }

    fn layout(&self) -> Layout {
        let interface = match self {
            Self::Values(quantity, _) => quantity.spelling().interface,
            Self::About(question, _) => question.spelling().interface,
            Self::Variable(_) => Some(word::REMOTE_VARIABLES_INTERFACE),
        };
        match interface {
            Some(word::INTERACTION_MODE_INTERFACE) => Layout::Bare,
            Some(word::FAULT_INTERFACE) => Layout::NoEcho,
            Some(
                word::PID_INTERFACE
                | word::CURRENT_INTERFACE
                | word::PWM_INTERFACE
                | word::REMOTE_VARIABLES_INTERFACE
                | word::REMOTE_CALIBRATOR_INTERFACE,
            ) => Layout::NoTime,
            _ => Layout::Full,
        }
    }
}

/// Layout of the results in 3.x.
enum Layout {
    /// `[is] ECHO .. [tsta] count time [ok]`
    Full,
    /// `[is] ECHO .. [ok]`
    NoTime,
    /// `[is] .. [ok]`
    NoEcho,
    /// `.. [tsta] count time [ok]`
    Bare,
}
