//! Interaction modes of joints: stiff or compliant.

use crate::{Axes, AxisInfo, DeviceError};

/// Reads and sets the interaction modes of joints (stock: `IInteractionMode`).
pub trait InteractionMode: AxisInfo {
    /// Returns whether the joints are stiff or compliant (`getInteractionMode(s)`).
    ///
    /// Errors: [`DeviceError::NoSuchAxis`]; behind a network also [`DeviceError::NoDataYet`] and
    /// [`DeviceError::Stale`].
    fn interactions(&self, axes: Axes<'_>) -> Result<Vec<Interaction>, DeviceError>;

    /// Makes the joints stiff or compliant (`setInteractionMode(s)`).
    ///
    /// Errors: [`DeviceError::NotSupported`] for [`Interaction::Unknown`], or an error of the selection; then none
    /// changes.
    fn set_interactions(
        &self,
        axes: Axes<'_>,
        interactions: &[Interaction],
    ) -> Result<(), DeviceError>;
}

/// Interaction mode of a joint (stock: `InteractionModeEnum`).
#[derive(Clone, Copy, Debug, Eq, Hash, PartialEq)]
pub enum Interaction {
    /// `[stif]`: holds its place.
    Stiff,
    /// `[comp]`: yields according to its impedance.
    Compliant,
    /// Any other word, as received.
    Unknown(u32),
}

const STIFF: u32 = u32::from_le_bytes(*b"stif");
const COMPLIANT: u32 = u32::from_le_bytes(*b"comp");

impl From<u32> for Interaction {
    fn from(code: u32) -> Self {
        match code {
            STIFF => Self::Stiff,
            COMPLIANT => Self::Compliant,
            other => Self::Unknown(other),
        }
    }
}

impl From<Interaction> for u32 {
    fn from(interaction: Interaction) -> Self {
        match interaction {
            Interaction::Stiff => STIFF,
            Interaction::Compliant => COMPLIANT,
            Interaction::Unknown(code) => code,
        }
    }
}

/// Describes the requests about interaction modes; the columns are explained in [`iface`](crate::iface).
#[doc(hidden)]
#[macro_export]
macro_rules! describe_interaction_mode {
    ($then:ident, [$($rest:ident)*] $($described:tt)*) => {
        $crate::describe_board! {
            @next $then, [$($rest)*] $($described)*
            interaction_mode: InteractionMode, "iInteractionMode", "interaction modes" {
                numbers {}
                settings {}
                actions {}
                queries {
                    /// Interaction modes.
                    Interactions -> Vec<Interaction>: "intm" ["mode" "modg" "mods"]
                        ["getInteractionModeOne" "getInteractionModesGroup" "getInteractionModesAll"]
                        => (by |modes, axes| modes.interactions(axes));
                }
                commands {
                    /// Interaction modes.
                    Interactions(selection: Selection, interactions: Vec<Interaction>): "intm" ["mode" "modg" "mods"]
                        ["setInteractionModeOne" "setInteractionModesGroup" "setInteractionModesAll"]
                        => (by |modes| modes.set_interactions(selection.axes(), interactions));
                }
            }
        }
    };
}
