//! Passes calls on to the devices, generated from the descriptions in `iface/`.

/// Implements an interface for [`Remapper`](super::Remapper): the methods of its description that go to the devices of
/// the selected joints, and those given here. A method that has neither is a compile error.
///
/// Settings of several joints are written by hand: each has its own rule by which a device will probably refuse it. So
/// are commands to the whole board.
macro_rules! remapped {
    ($describe:ident { $($by_hand:tt)* }) => {
        crate::$describe! { remapped_interface, [] { $($by_hand)* } }
    };
}

macro_rules! remapped_interface {
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
        impl crate::$interface for super::Remapper {
            $($by_hand)*
            $( remapped_method! { number $method $n_call } )*
            $( remapped_method! { setting $method $s_call } )*
            $( remapped_method! { action $method $a_call } )*
            $( remapped_method! { query $method $q_call ($result) } )*
            $( remapped_method! { command $method $c_call ($($field: $field_type),*) } )*
        }
    };
}

/// The method of a row; none if it is written by hand.
macro_rules! remapped_method {
    (number $interface:ident (each $method:ident)) => {
        fn $method(&self, axes: Axes<'_>) -> Result<Vec<f64>, DeviceError> {
            self.ask(Interface::$interface(), axes, |device, axes| {
                Some(device.$interface()?.$method(axes))
            })
        }
    };
    (number $interface:ident (axis $method:ident)) => {
        fn $method(&self, axis: AxisIndex) -> Result<f64, DeviceError> {
            self.one(Interface::$interface(), axis, |device, axis| {
                Some(device.$interface()?.$method(axis))
            })
        }
    };
    (setting $interface:ident (axis $method:ident $what:literal)) => {
        fn $method(&self, axis: AxisIndex, value: f64) -> Result<(), DeviceError> {
            self.one(Interface::$interface(), axis, |device, axis| {
                Some(device.$interface()?.$method(axis, value))
            })
        }
    };
    (action $interface:ident (axes $method:ident $verb:literal)) => {
        fn $method(&self, axes: Axes<'_>) -> Result<(), DeviceError> {
            self.order(Interface::$interface(), axes, OnRefusal::StopThere, |device, axes| {
                Some(device.$interface()?.$method(axes))
            })
        }
    };
    (query $interface:ident (axis $method:ident) ($result:ty)) => {
        fn $method(&self, axis: AxisIndex) -> Result<$result, DeviceError> {
            self.one(Interface::$interface(), axis, |device, axis| {
                Some(device.$interface()?.$method(axis))
            })
        }
    };
    (query $interface:ident (each $method:ident) ($result:ty)) => {
        fn $method(&self, axes: Axes<'_>) -> Result<$result, DeviceError> {
            self.ask(Interface::$interface(), axes, |device, axes| {
                Some(device.$interface()?.$method(axes))
            })
        }
    };
    (command $interface:ident (axis $method:ident) ($axis:ident: $axis_type:ty $(, $field:ident: $type:ty)*)) => {
        fn $method(&self, $axis: AxisIndex $(, $field: $type)*) -> Result<(), DeviceError> {
            self.one(Interface::$interface(), $axis, |device, axis| {
                Some(device.$interface()?.$method(axis $(, $field)*))
            })
        }
    };
    ($section:ident $interface:ident ($by_hand:ident $($call:tt)*) $(($($types:tt)*))?) => {};
}
