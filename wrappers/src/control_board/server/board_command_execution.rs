//! Executes queries and commands on the device; generated from the descriptions in `devices/src/iface/`.

use yarp_devices::{
    AmplifierLimit, Axes, AxisIndex, Device, DeviceError, EncoderReading, Mode, PidValue,
};

use super::super::messages::{
    Action, Choices, Get, Outcome, Quantity, Query, Selection, Set, Setting,
};
use super::board_request_handler::{Refusal, RequestHandler};
use crate::thrift::Item;

/// Refusal of a query for several joints that devices answer for one; both protocols forbid it.
const ONE_AXIS_ONLY: Refusal = Refusal::NoInterface("way to answer this for several joints");

/// Reads one number per axis, by the call of a row.
macro_rules! read_numbers {
    ($interface:expr, $axes:ident, $total:expr, (each $method:ident)) => {
        $interface.$method($axes)?
    };
    ($interface:expr, $axes:ident, $total:expr, (axis $method:ident)) => {
        of_each($axes, $total, |axis| Ok($interface.$method(axis)?))?
    };
    ($interface:expr, $axes:ident, $total:expr, (of_axis |$control:ident, $axis:ident| $read:expr)) => {
        of_each($axes, $total, |$axis| {
            let $control = $interface;
            Ok($read?)
        })?
    };
    ($interface:expr, $axes:ident, $total:expr, (by |$control:ident, $selected:ident| $read:expr)) => {{
        let ($control, $selected) = ($interface, $axes);
        let numbers: Result<Vec<f64>, DeviceError> = $read;
        numbers?
    }};
}

/// Sets one number per axis, by the call of a row.
macro_rules! set_numbers {
    ($interface:expr, $axes:ident, $values:ident, $total:expr, (each $method:ident $what:literal)) => {
        $interface.$method($axes, $values)?
    };
    ($interface:expr, $axes:ident, $values:ident, $total:expr, (axis $method:ident $what:literal)) => {{
        $axes.check_command($total, "values", $values.len())?;
        for (axis, value) in $axes.iter($total).zip($values) {
            $interface.$method(axis, *value)?;
        }
    }};
    ($interface:expr, $axes:ident, $values:ident, $total:expr,
        (of_axis |$control:ident, $axis:ident, $value:ident| $set:expr)) => {{
        $axes.check_command($total, "values", $values.len())?;
        for ($axis, $value) in $axes.iter($total).zip($values.iter().copied()) {
            let $control = $interface;
            $set?;
        }
    }};
    ($interface:expr, $axes:ident, $values:ident, $total:expr,
        (by |$control:ident, $selected:ident, $new:ident| $set:expr)) => {{
        let ($control, $selected, $new) = ($interface, $axes, $values);
        $set?
    }};
}

/// Acts on axes, by the call of a row.
macro_rules! act {
    ($interface:expr, $axes:ident, (axes $method:ident $verb:literal)) => {
        $interface.$method($axes)?
    };
    ($interface:expr, $axes:ident, (board $method:ident)) => {
        $interface.$method()?
    };
    ($interface:expr, $axes:ident, (by |$control:ident, $selected:pat_param| $act:expr)) => {{
        let ($control, $selected) = ($interface, $axes);
        $act?
    }};
}

/// Queries, by the call of a row.
macro_rules! ask {
    ($handler:ident, $interface:expr, $selection:ident, (axis $method:ident)) => {
        match $selection {
            Selection::One(axis) => $interface.$method(*axis)?,
            _ => return Err(ONE_AXIS_ONLY),
        }
    };
    ($handler:ident, $interface:expr, $selection:ident, (of_axis |$control:ident, $axis:ident| $ask:expr)) => {
        match $selection {
            Selection::One($axis) => {
                let ($control, $axis) = ($interface, *$axis);
                $ask?
            }
            _ => return Err(ONE_AXIS_ONLY),
        }
    };
    ($handler:ident, $interface:expr, $selection:ident, (each $method:ident)) => {
        $interface.$method($handler.known($selection)?)?
    };
    ($handler:ident, $interface:expr, $selection:ident, (axes $method:ident)) => {
        $interface.$method($handler.known($selection)?)?
    };
    ($handler:ident, $interface:expr, $selection:ident, (board $method:ident)) => {
        $interface.$method()?
    };
    ($handler:ident, $interface:expr, $selection:ident, (by |$control:ident, $selected:pat_param| $ask:expr)) => {{
        let $selected = $handler.known($selection)?;
        let $control = $interface;
        let answer: Result<_, DeviceError> = $ask;
        answer?
    }};
}

/// Commands, by the call of a row.
macro_rules! command {
    ($interface:expr, ($($field:ident),*), (axis $method:ident)) => {
        $interface.$method($(*$field),*)?
    };
    ($interface:expr, ($($field:ident),*), (by |$control:ident| $command:expr)) => {{
        let $control = $interface;
        $command?
    }};
}

macro_rules! execute {
    ($($method:ident: $interface:ident, $wire:literal, $words:literal {
        numbers { $(
            $(#[$n_doc:meta])* $number:ident $({ $n_kind:ident: $n_type:ident })?:
                $n_prefix:literal $n_words:tt $n_functions:tt => $n_call:tt;
        )* }
        settings { $(
            $(#[$s_doc:meta])* $setting:ident $({ $s_kind:ident: $s_type:ident })?:
                $s_prefix:literal $s_words:tt $s_functions:tt => $s_call:tt;
        )* }
        actions { $(
            $(#[$a_doc:meta])* $action:ident $({ $a_kind:ident: $a_type:ident })?:
                $a_prefix:literal $a_words:tt $a_functions:tt => $a_call:tt;
        )* }
        queries { $(
            $(#[$q_doc:meta])* $query:ident $({ $q_kind:ident: $q_type:ident })? -> $result:ty:
                $q_prefix:literal $q_words:tt $q_functions:tt => $q_call:tt;
        )* }
        commands { $(
            $(#[$c_doc:meta])* $command:ident($($field:ident: $field_type:ty),*):
                $c_prefix:literal $c_words:tt $c_functions:tt => $c_call:tt;
        )* }
    })*) => {
        /// The device's interfaces, or an error if there is none.
        impl RequestHandler {$(
            pub(super) fn $method(&self) -> Result<&dyn yarp_devices::$interface, Refusal> {
                self.device().$method().ok_or(Refusal::NoInterface($words))
            }
        )*}

        impl RequestHandler {
            fn numbers(&self, quantity: Quantity, axes: Axes<'_>) -> Result<Vec<f64>, Refusal> {
                // The length of an answer is bounded only once the axes are known to exist.
                axes.check(self.axes())?;
                Ok(match quantity {
                    $($( Quantity::$number $(($n_kind))? => {
                        read_numbers!(self.$method()?, axes, self.axes(), $n_call)
                    } )*)*
                })
            }

            fn set_numbers(&self, setting: Setting, axes: Axes<'_>, values: &[f64]) -> Result<(), Refusal> {
                match setting {
                    $($( Setting::$setting $(($s_kind))? => {
                        set_numbers!(self.$method()?, axes, values, self.axes(), $s_call);
                    } )*)*
                }
                Ok(())
            }

            fn act(&self, action: Action, axes: Axes<'_>) -> Result<(), Refusal> {
                match action {
                    $($( Action::$action $(($a_kind))? => act!(self.$method()?, axes, $a_call), )*)*
                }
                Ok(())
            }

            fn about(&self, query: Query, selection: &Selection) -> Result<Vec<Item>, Refusal> {
                let one = matches!(selection, Selection::One(_));
                Ok(match query {
                    $($( Query::$query $(($q_kind))? => {
                        ask!(self, self.$method()?, selection, $q_call).into_items(one)
                    } )*)*
                })
            }

            fn command(&self, set: &Set) -> Result<(), Refusal> {
                match set {
                    Set::Values(setting, selection, values) => {
                        self.set_numbers(*setting, selection.axes(), values)?;
                    }
                    Set::Act(action, selection) => self.act(*action, selection.axes())?,
                    $($( Set::$command($($field),*) => {
                        command!(self.$method()?, ($($field),*), $c_call);
                    } )*)*
                }
                Ok(())
            }
        }

        /// The name of each interface in 4.0, and whether the device has it; names are empty for parts of others.
        pub(super) fn interfaces(device: &dyn Device) -> Vec<(&'static str, bool)> {
            vec![$(($wire, device.$method().is_some())),*]
        }
    };
}

yarp_devices::describe_board!(execute);

impl RequestHandler {
    /// Results of a query.
    pub(super) fn ask(&self, get: &Get) -> Result<Vec<Item>, Refusal> {
        match get {
            Get::Values(quantity, selection) => {
                let values = self.numbers(*quantity, selection.axes())?;
                Ok(values.into_items(matches!(selection, Selection::One(_))))
            }
            // Any device here knows how many axes it has, also one without information about them.
            Get::About(Query::Axes, _) => Ok(self.axes().into_items(false)),
            Get::About(query, selection) => self.about(*query, selection),
            Get::Variable(name) => {
                let value = self.remote_variables()?.variable(name)?;
                Ok(value.into_items(true))
            }
        }
    }

    /// Executes a command. The device checks counts, axes and values before anything moves.
    pub(super) fn order(&self, set: &Set) -> Result<(), Refusal> {
        self.command(set)
    }

    /// Returns the axes of a query whose length is bounded only once the axes are known to exist.
    fn known<'a>(&self, selection: &'a Selection) -> Result<Axes<'a>, Refusal> {
        let axes = selection.axes();
        axes.check(self.axes())?;
        Ok(axes)
    }
}

/// Reads a number of each axis, from a device that returns it for one axis at a time.
fn of_each(
    axes: Axes<'_>,
    total: usize,
    read: impl Fn(AxisIndex) -> Result<f64, Refusal>,
) -> Result<Vec<f64>, Refusal> {
    axes.iter(total).map(read).collect()
}

fn each(readings: &[EncoderReading], value: impl Fn(&EncoderReading) -> f64) -> Vec<f64> {
    readings.iter().map(value).collect()
}
