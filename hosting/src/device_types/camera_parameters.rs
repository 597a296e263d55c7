//! Parameters that the types of cameras share: lens and features, as in stock.

use yarp_devices::{Feature, Intrinsics};
use yarp_wire::settings::Parameters;

use crate::HostError;

/// Group with the distortion of the lens.
const DISTORTION: &str = "cameraDistortionModelGroup";
/// Name of the matrix that turns images of two cameras into one plane, and stock's spelling of it.
const RECTIFICATION: [&str; 2] = ["rectificationMatrix", "retificationMatrix"];
/// Features that can be set at the start.
const FEATURES: [(&str, Feature); 9] = [
    ("gain", Feature::Gain),
    ("exposure", Feature::Exposure),
    ("brightness", Feature::Brightness),
    ("sharpness", Feature::Sharpness),
    ("hue", Feature::Hue),
    ("saturation", Feature::Saturation),
    ("gamma", Feature::Gamma),
    ("shutter", Feature::Shutter),
    ("iris", Feature::Iris),
];

/// Returns the features that are given, 0 to 1.
pub(super) fn features(parameters: &Parameters) -> Result<Vec<(Feature, f64)>, HostError> {
    let mut features = Vec::new();
    for (name, feature) in FEATURES {
        if let Some(value) = parameters.get::<f64>(name)? {
            features.push((feature, value));
        }
    }
    Ok(features)
}

/// Returns the two values of the white balance, in the order in which they are written.
pub(super) fn white_balance(
    parameters: &Parameters,
    expected: &str,
) -> Result<Option<(f64, f64)>, HostError> {
    let Some(values) = parameters.list::<f64>("white_balance")? else {
        return Ok(None);
    };
    match values[..] {
        [first, second] => Ok(Some((first, second))),
        _ => Err(parameters.refuse("white_balance", expected).into()),
    }
}

/// Returns the angles of view, degrees, if both are given.
pub(super) fn field_of_view(parameters: &Parameters) -> Result<Option<(f64, f64)>, HostError> {
    let across = parameters.get::<f64>("horizontalFov")?;
    let down = parameters.get::<f64>("verticalFov")?;
    Ok(across.zip(down))
}

/// Returns the description of the lens, if there is any.
pub(super) fn lens(parameters: &Parameters) -> Result<Option<Intrinsics>, HostError> {
    let of_group = |name: &str| format!("{DISTORTION}::{name}");
    let names = [
        "focalLengthX",
        "focalLengthY",
        "principalPointX",
        "principalPointY",
    ];
    let has = |name: &str| parameters.has(name);
    let given = names.iter().any(|name| has(name));
    let is_rectified = RECTIFICATION.iter().any(|name| has(name));
    if !given && !is_rectified && !has(&of_group("name")) {
        return Ok(None);
    }
    let number = |name: &str| parameters.get_or(name, 0.0);
    let in_group = |name: &str| number(&of_group(name));
    let mut lens = Intrinsics {
        focal_length: (number(names[0])?, number(names[1])?),
        principal_point: (number(names[2])?, number(names[3])?),
        distortion_model: parameters.get_or(&of_group("name"), "none".to_owned())?,
        radial: [in_group("k1")?, in_group("k2")?, in_group("k3")?],
        tangential: [in_group("t1")?, in_group("t2")?],
        ..Intrinsics::default()
    };
    // The right spelling is read last, and wins.
    for name in RECTIFICATION.into_iter().rev() {
        if let Some(matrix) = parameters.list::<f64>(name)? {
            let refused = |_| parameters.refuse(name, "nine numbers");
            lens.rectification = matrix.try_into().map_err(refused)?;
        }
    }
    // Stock names the group here.
    parameters.has("distortionModel");
    Ok(Some(lens))
}
