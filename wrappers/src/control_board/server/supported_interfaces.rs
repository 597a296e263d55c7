//! Lists the interfaces of a device, as 4.0 queries them at once.

use yarp_devices::Device;

use super::board_command_execution;
use crate::thrift::Item;

/// A map from the names of the interfaces to whether the device has them, in the order of stock.
pub(super) fn list(device: &dyn Device) -> Item {
    let mut entries = board_command_execution::interfaces(device);
    entries.retain(|(name, _)| !name.is_empty());
    // Times come with encoder readings; nothing else has a time of its own.
    entries.push(("iPreciselyTimed", false));
    entries.sort_unstable();
    let entry = |(name, there): (&str, bool)| {
        Item::List(vec![Item::Text(name.to_owned()), Item::Bool(there)])
    };
    Item::List(entries.into_iter().map(entry).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use yarp_devices::wam::SimulatedWam;

    /// The names and their order in the answer of a stock 4.0.0 board.
    #[test]
    fn the_interfaces_are_those_of_stock_in_its_order() {
        let Item::List(entries) = list(&SimulatedWam::new()) else {
            panic!("a map is a list");
        };
        let name = |entry: &Item| match entry {
            Item::List(pair) => match &pair[0] {
                Item::Text(name) => name.clone(),
                other => panic!("{other:?}"),
            },
            other => panic!("{other:?}"),
        };
        let names: Vec<String> = entries.iter().map(name).collect();
        let stock = "iAmplifierControl iAxisInfo iControlCalibration iControlLimits iControlMode iCurrentControl \
            iEncodersTimed iImpedanceControl iInteractionMode iJointBrake iJointFault iMotor iMotorEncoders iPWMControl \
            iPidControl iPositionControl iPositionDirect iPreciselyTimed iRemoteCalibrator iRemoteVariables \
            iTorqueControl iVelocityControl iVelocityDirect";
        assert_eq!(names.join(" "), stock);
    }
}
