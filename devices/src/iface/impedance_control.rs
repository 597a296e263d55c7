//! Impedance of compliant joints.

use crate::{AxisIndex, AxisInfo, DeviceError, Limits};

/// Stiffness and damping of compliant joints (stock: `IImpedanceControl`, one axis at a time).
pub trait ImpedanceControl: AxisInfo {
    /// Stiffness and damping of a joint (`getImpedance`).
    ///
    /// Errors: [`DeviceError::NoSuchAxis`].
    fn impedance(&self, axis: AxisIndex) -> Result<Impedance, DeviceError>;

    /// Sets stiffness and damping of a joint (`setImpedance`).
    ///
    /// Errors: [`DeviceError::NoSuchAxis`], [`DeviceError::NotFinite`], [`DeviceError::OutOfRange`].
    fn set_impedance(&self, axis: AxisIndex, impedance: Impedance) -> Result<(), DeviceError>;

    /// The torque that is added to that of the spring, Nm (`getImpedanceOffset`).
    ///
    /// Errors: [`DeviceError::NoSuchAxis`].
    fn impedance_offset(&self, axis: AxisIndex) -> Result<f64, DeviceError>;

    /// Sets the torque that is added to that of the spring, Nm (`setImpedanceOffset`).
    ///
    /// Errors: as [`set_impedance`](Self::set_impedance).
    fn set_impedance_offset(&self, axis: AxisIndex, offset: f64) -> Result<(), DeviceError>;

    /// Returns the ranges of stiffness and damping (`getCurrentImpedanceLimit`).
    ///
    /// Errors: [`DeviceError::NoSuchAxis`].
    fn impedance_limits(&self, axis: AxisIndex) -> Result<ImpedanceLimits, DeviceError>;
}

/// A spring and a damper.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Impedance {
    /// Nm/deg, N/m.
    pub stiffness: f64,
    /// Nm s/deg, N s/m.
    pub damping: f64,
}

/// Ranges of an [`Impedance`].
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ImpedanceLimits {
    /// Nm/deg, N/m.
    pub stiffness: Limits,
    /// Nm s/deg, N s/m.
    pub damping: Limits,
}

/// Describes the requests about impedance of compliant joints; the columns are explained in [`iface`](crate::iface).
#[doc(hidden)]
#[macro_export]
macro_rules! describe_impedance_control {
    ($then:ident, [$($rest:ident)*] $($described:tt)*) => {
        $crate::describe_board! {
            @next $then, [$($rest)*] $($described)*
            impedance_control: ImpedanceControl, "iImpedanceControl", "impedance control" {
                numbers {
                    /// Torque added to that of the spring.
                    ImpedanceOffset: "iimp" ["iof" "" ""] ["getImpedanceOffset" "" ""] => (axis impedance_offset);
                }
                settings {
                    /// Torque added to that of the spring.
                    ImpedanceOffset: "iimp" ["iof" "" ""] ["setImpedanceOffset" "" ""]
                        => (axis set_impedance_offset "impedance offset");
                }
                actions {}
                queries {
                    /// Stiffness and damping of an axis.
                    Impedance -> Impedance: "iimp" ["ipr" "" ""] ["getImpedance" "" ""] => (axis impedance);
                    /// Ranges of stiffness and damping.
                    ImpedanceLimits -> ImpedanceLimits: "iimp" ["llim" "" ""] ["getCurrentImpedanceLimit" "" ""]
                        => (axis impedance_limits);
                }
                commands {
                    /// Stiffness and damping of an axis.
                    Impedance(axis: AxisIndex, impedance: Impedance): "iimp" ["ipr" "" ""] ["setImpedance" "" ""]
                        => (axis set_impedance);
                }
            }
        }
    };
}
