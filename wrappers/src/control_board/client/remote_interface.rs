//! Implements device interfaces by requests, generated from the descriptions in `devices/src/iface/`.

/// Implements an interface for [`RemoteControlBoard`](super::RemoteControlBoard): the methods that its description
/// tells how to call, and those given here. A method that has neither is a compile error.
macro_rules! remote {
    ($($describe:ident { $($by_hand:tt)* })*) => {
        $( yarp_devices::$describe! { remote_interface, [] { $($by_hand)* } } )*
    };
}

macro_rules! remote_interface {
    ({ $($by_hand:tt)* } $method:ident: $interface:ident, $wire:literal, $words:literal {
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
    }) => {
        impl yarp_devices::$interface for super::RemoteControlBoard {
            $($by_hand)*
            $( remote_method! { number $number $n_call } )*
            $( remote_method! { setting $setting $s_call } )*
            $( remote_method! { action $action $a_call } )*
            $( remote_method! { query $query $q_call ($result) } )*
            $( remote_method! { command $command $c_call ($($field: $field_type),*) } )*
        }
    };
}

/// The method of a row; none if it is written by hand.
macro_rules! remote_method {
    (number $row:ident (each $method:ident)) => {
        fn $method(&self, axes: Axes<'_>) -> Result<Vec<f64>, DeviceError> {
            self.values(Quantity::$row, axes)
        }
    };
    (number $row:ident (axis $method:ident)) => {
        fn $method(&self, axis: AxisIndex) -> Result<f64, DeviceError> {
            self.value(Quantity::$row, axis)
        }
    };
    (setting $row:ident (each $method:ident $what:literal)) => {
        fn $method(&self, axes: Axes<'_>, values: &[f64]) -> Result<(), DeviceError> {
            self.set(Setting::$row, $what, axes, values)
        }
    };
    (setting $row:ident (axis $method:ident $what:literal)) => {
        fn $method(&self, axis: AxisIndex, value: f64) -> Result<(), DeviceError> {
            self.set(Setting::$row, $what, axis.into(), &[value])
        }
    };
    (action $row:ident (axes $method:ident $verb:literal)) => {
        fn $method(&self, axes: Axes<'_>) -> Result<(), DeviceError> {
            self.act(Action::$row, $verb, axes)
        }
    };
    (action $row:ident (board $method:ident)) => {
        fn $method(&self) -> Result<(), DeviceError> {
            self.order(Set::Act(Action::$row, Selection::All))
        }
    };
    (query $row:ident (axis $method:ident) ($result:ty)) => {
        fn $method(&self, axis: AxisIndex) -> Result<$result, DeviceError> {
            self.about(Query::$row, axis)
        }
    };
    (query $row:ident (each $method:ident) ($result:ty)) => {
        fn $method(&self, axes: Axes<'_>) -> Result<$result, DeviceError> {
            self.about_each(Query::$row, axes)
        }
    };
    (query $row:ident (board $method:ident) ($result:ty)) => {
        fn $method(&self) -> Result<$result, DeviceError> {
            let answered = self.ask(Get::About(Query::$row, Selection::All))?;
            answered.read(|values| Outcome::read(values, false))
        }
    };
    (command $row:ident (axis $method:ident) ($axis:ident: $axis_type:ty $(, $field:ident: $type:ty)*)) => {
        fn $method(&self, $axis: AxisIndex $(, $field: $type)*) -> Result<(), DeviceError> {
            Axes::One($axis).check(self.axes)?;
            $( Checked::check(&$field, $axis)?; )*
            self.order(Set::$row($axis $(, $field)*))
        }
    };
    ($section:ident $row:ident ($by_hand:ident $($call:tt)*) $(($($types:tt)*))?) => {};
}
