//! Simulated joints, with the parameters of stock's `fakeMotionControl`.
//!
//! Source: `fakeMotionControl.cpp` of YARP 3.5. Stock's joints reach their targets at once; these
//! move there. Some programs set variables of boards that only these know; `GENERAL::Variables` names those that the joints
//! accept and store.

use std::sync::Arc;

use yarp_devices::fake::AxisParameters;
use yarp_devices::guard::{Guarded, GuardedOptions};
use yarp_devices::wam::SimulatedWam;
use yarp_devices::{JointType, Limits};
use yarp_wire::settings::{Expected, Parameters};

use super::local_device::{self, LocalDevice};
use super::{OpenResult, Opening};
use crate::HostError;

/// Maximum number of joints that fit the state of a board on the wire.
const MAX_JOINTS: usize = 1000;
/// Maximum speed of stock's joints, deg/s.
const MAX_SPEED: f64 = 50.0;
const REFERENCE_SPEED: f64 = 10.0;
/// Default limits, deg. Stock's are 0 and 100, which its joints ignore; these joints start at 0 and must be able to move
/// both ways.
const DEFAULT_LIMITS: (f64, f64) = (-180.0, 180.0);
/// Maximum acceleration, deg/s²; stock has none.
const MAX_ACCELERATION: f64 = 500.0;
const REFERENCE_ACCELERATION: f64 = 100.0;

/// Parameters that stock reads and ignores without hardware.
const IGNORED_PARAMETERS: [&str; 5] = [
    "GENERAL::AxisMap",
    "GENERAL::Encoder",
    "GENERAL::ampsToSensor",
    "GENERAL::fullscalePWM",
    "GENERAL::Verbose",
];

pub(super) async fn open(opening: Opening<'_>) -> OpenResult {
    let parameters = opening.parameters;
    let axes = axes(parameters)?;
    let joints = Arc::new(SimulatedWam::with_axes(axes));
    let variables = parameters.list::<String>("GENERAL::Variables")?;
    joints.store_variables(variables.unwrap_or_default());
    // Without limits and watchdogs it offers the software stop.
    let joints = local_device::start(parameters, || {
        Guarded::around(joints, GuardedOptions::default())
    })
    .await?;
    Ok(Box::new(LocalDevice::machine(joints)))
}

fn axes(parameters: &Parameters) -> Result<Vec<AxisParameters>, HostError> {
    let joints = parameters.get_or("GENERAL::Joints", 1)?;
    if !(1..=MAX_JOINTS).contains(&joints) {
        let expected = format!("1 to {MAX_JOINTS} joints");
        return Err(parameters.refuse("GENERAL::Joints", expected).into());
    }
    let usual_names = (0..joints).map(|joint| format!("joint{joint}"));
    let names = row(
        parameters,
        "GENERAL::AxisName",
        joints,
        usual_names.collect(),
    )?;
    let repeated = names
        .iter()
        .enumerate()
        .any(|(at, name)| names[..at].contains(name));
    if repeated {
        let error = parameters.refuse("GENERAL::AxisName", "another name for each joint");
        return Err(error.into());
    }
    let usual_types = vec!["revolute".to_owned(); joints];
    let types = row(parameters, "GENERAL::AxisType", joints, usual_types)?;
    let types: Option<Vec<_>> = types.iter().map(|word| joint_type(word)).collect();
    let types = types.ok_or_else(|| {
        parameters.refuse("GENERAL::AxisType", "revolute or prismatic for each joint")
    })?;
    let least = row(
        parameters,
        "LIMITS::Min",
        joints,
        vec![DEFAULT_LIMITS.0; joints],
    )?;
    let most = row(
        parameters,
        "LIMITS::Max",
        joints,
        vec![DEFAULT_LIMITS.1; joints],
    )?;
    for name in IGNORED_PARAMETERS {
        parameters.has(name);
    }
    let mut axes = Vec::with_capacity(joints);
    for (joint, name) in names.into_iter().enumerate() {
        if least[joint] >= most[joint] {
            let expected = format!("more than the {} of LIMITS::Min", least[joint]);
            return Err(parameters.refuse("LIMITS::Max", expected).into());
        }
        let limits = Limits::new(least[joint], most[joint]);
        axes.push(AxisParameters {
            name,
            joint_type: types[joint],
            limits,
            max_speed: MAX_SPEED,
            max_acceleration: MAX_ACCELERATION,
            reference_speed: REFERENCE_SPEED,
            reference_acceleration: REFERENCE_ACCELERATION,
            home: limits.clamp(0.0),
        });
    }
    Ok(axes)
}

/// Reads one value per joint.
fn row<T: Expected>(
    parameters: &Parameters,
    name: &str,
    joints: usize,
    usual: Vec<T>,
) -> Result<Vec<T>, HostError> {
    match parameters.list(name)? {
        None => Ok(usual),
        Some(values) if values.len() == joints => Ok(values),
        Some(_) => {
            let expected = format!("{joints} values, one for each joint");
            Err(parameters.refuse(name, expected).into())
        }
    }
}

fn joint_type(word: &str) -> Option<JointType> {
    match word {
        "revolute" => Some(JointType::Revolute),
        "prismatic" => Some(JointType::Prismatic),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use yarp_wire::settings::{NoSource, Origin, Settings};

    use super::*;

    fn of(text: &str) -> Result<Vec<AxisParameters>, String> {
        let mut settings = Settings::new();
        settings.read_text("f.ini", text, &NoSource);
        let parameters = Parameters::new("fake", settings, Origin::line("f.ini", 1));
        axes(&parameters).map_err(|error| error.to_string())
    }

    #[test]
    fn joints_are_as_stock_describes_them() {
        let axes = of("[GENERAL]\nJoints 2\nAxisName a b\nAxisType (prismatic revolute)\n[LIMITS]\nMin 10 -5\nMax (20 5)").unwrap();
        assert_eq!(
            (axes[0].name.as_str(), axes[0].limits),
            ("a", Limits::new(10.0, 20.0))
        );
        assert_eq!(
            (axes[0].joint_type, axes[0].home),
            (JointType::Prismatic, 10.0)
        );
        assert_eq!(
            (axes[1].joint_type, axes[1].home),
            (JointType::Revolute, 0.0)
        );
        let usual = of("").unwrap();
        assert_eq!((usual.len(), usual[0].name.as_str()), (1, "joint0"));
        let (limits, home) = (usual[0].limits, usual[0].home);
        assert!(limits.clamp(home - 90.0) < home && limits.clamp(home + 90.0) > home);
    }

    #[test]
    fn inconsistent_parameters_are_refused_with_their_line() {
        for (text, expected) in [
            (
                "[GENERAL]\nJoints 0",
                "f.ini:2: device fake: parameter GENERAL::Joints: expected 1 to 1000 joints, got 0",
            ),
            (
                "[GENERAL]\nJoints two",
                "f.ini:2: device fake: parameter GENERAL::Joints: expected a whole number from 0, got two",
            ),
            (
                "[GENERAL]\nJoints 2\nAxisName a",
                "f.ini:3: device fake: parameter GENERAL::AxisName: expected 2 values, one for each joint, got a",
            ),
            (
                "[GENERAL]\nJoints 2\nAxisName a a",
                "f.ini:3: device fake: parameter GENERAL::AxisName: expected another name for each joint, got a a",
            ),
            (
                "[GENERAL]\nAxisType round",
                "f.ini:2: device fake: parameter GENERAL::AxisType: expected revolute or prismatic for each joint, got round",
            ),
            (
                "[LIMITS]\nMin 5\nMax 5",
                "f.ini:3: device fake: parameter LIMITS::Max: expected more than the 5 of LIMITS::Min, got 5",
            ),
        ] {
            assert_eq!(of(text).unwrap_err(), expected);
        }
    }
}
