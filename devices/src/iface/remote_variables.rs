//! Variables of the device's own.

use crate::{AxisInfo, DeviceError};

/// Numbers and words that a device offers by name (stock: `IRemoteVariables`).
pub trait RemoteVariables: AxisInfo {
    /// The names, in a fixed order (`getRemoteVariablesList`).
    fn variables(&self) -> Result<Vec<String>, DeviceError>;

    /// The value of a variable (`getRemoteVariable`).
    ///
    /// Errors: [`DeviceError::NotSupported`] for a name that is not in the list.
    fn variable(&self, name: &str) -> Result<Vec<VariableValue>, DeviceError>;

    /// Sets a variable (`setRemoteVariable`).
    ///
    /// Errors: [`DeviceError::NotSupported`] for a name that is not in the list or cannot be set, [`DeviceError::Unsuitable`]
    /// and others for a value that it cannot have.
    fn set_variable(&self, name: &str, value: &[VariableValue]) -> Result<(), DeviceError>;
}

/// A part of the value of a variable.
#[derive(Clone, Debug, PartialEq)]
pub enum VariableValue {
    /// A whole number.
    Integer(i64),
    /// A number.
    Number(f64),
    /// Characters.
    Text(String),
    /// Several.
    List(Vec<VariableValue>),
}

impl VariableValue {
    /// The numbers of a value: one list of them, or the numbers themselves; `None` if anything else is among them.
    pub fn numbers(value: &[Self]) -> Option<Vec<f64>> {
        let values = match value {
            [Self::List(values)] => values,
            values => values,
        };
        values.iter().map(Self::as_number).collect()
    }

    /// The value as a number, if it is one.
    pub fn as_number(&self) -> Option<f64> {
        match self {
            Self::Integer(value) => Some(*value as f64),
            Self::Number(value) => Some(*value),
            _ => None,
        }
    }
}

/// Describes the requests about variables of the device; the columns are explained in [`iface`](crate::iface).
#[doc(hidden)]
#[macro_export]
macro_rules! describe_remote_variables {
    ($then:ident, [$($rest:ident)*] $($described:tt)*) => {
        $crate::describe_board! {
            @next $then, [$($rest)*] $($described)*
            remote_variables: RemoteVariables, "iRemoteVariables", "variables" {
                numbers {}
                settings {}
                actions {}
                queries {
                    /// The names of the variables.
                    Variables -> Vec<String>: "ivar" ["" "" "lvar"] ["" "" "getRemoteVariablesList"] => (board variables);
                }
                commands {
                    /// The value of a variable.
                    Variable(name: String, value: Vec<VariableValue>): "ivar" ["" "" "mvar"] ["" "" "setRemoteVariable"]
                        => (by |variables| variables.set_variable(name, value));
                }
            }
        }
    };
}
