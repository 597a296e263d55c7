//! Layout of an inertial sensor in YARP 3.x.

use crate::SensorKind;

/// Kinds of sensors in the order of their channels, three of each.
pub(crate) const KINDS: [SensorKind; 4] = [
    SensorKind::Orientation,
    SensorKind::LinearAccelerometer,
    SensorKind::Gyroscope,
    SensorKind::Magnetometer,
];
/// Number of channels.
pub(crate) const CHANNELS: usize = 3 * KINDS.len();
