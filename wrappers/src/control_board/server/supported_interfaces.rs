//! Lists the interfaces of a device, as 4.0 queries them at once.

use yarp_devices::Device;

use crate::thrift::Item;

/// A map from the names of the interfaces to whether the device has them, in the order of stock.
pub(super) fn list(device: &dyn Device) -> Item {
    let entries = [
        ("iAmplifierControl", device.amplifier_control().is_some()),
        ("iAxisInfo", device.axis_info().is_some()),
        (
            "iControlCalibration",
            device.control_calibration().is_some(),
        ),
        ("iControlLimits", device.control_limits().is_some()),
        ("iControlMode", device.control_mode().is_some()),
        ("iCurrentControl", device.current_control().is_some()),
        ("iEncodersTimed", device.encoders().is_some()),
        ("iImpedanceControl", device.impedance_control().is_some()),
        ("iInteractionMode", device.interaction_mode().is_some()),
        ("iJointBrake", device.joint_brake().is_some()),
        ("iJointFault", device.joint_fault().is_some()),
        ("iMotor", device.motor().is_some()),
        ("iMotorEncoders", device.motor_encoders().is_some()),
        ("iPWMControl", device.pwm_control().is_some()),
        ("iPidControl", device.pid_control().is_some()),
        ("iPositionControl", device.position_control().is_some()),
        ("iPositionDirect", device.position_direct().is_some()),
        // Times come with encoder readings; nothing else has a time of its own.
        ("iPreciselyTimed", false),
        ("iRemoteCalibrator", device.remote_calibrator().is_some()),
        ("iRemoteVariables", device.remote_variables().is_some()),
        ("iTorqueControl", device.torque_control().is_some()),
        ("iVelocityControl", device.velocity_control().is_some()),
        ("iVelocityDirect", device.velocity_direct().is_some()),
    ];
    let entry = |(name, there): (&str, bool)| {
        Item::List(vec![Item::Text(name.to_owned()), Item::Bool(there)])
    };
    Item::List(entries.map(entry).to_vec())
}
