//! Configuration of a simulated arm: its effects, in ini files, in XML and, with `--arm-config`, on the command line.
//!
//! | parameter | value |
//! | --- | --- |
//! | `effects` | `none` or `real`: the effects that the other parameters change; default `none` for `dynamicWam`, `real` for `simulatedCanWam` |
//! | `seed` | seed of everything that varies; default 0 |
//! | `commandLatency`, `latencyJitter` | delay of torque commands, and what is added to it at most, s; at most 0.01 each |
//! | `encoderNoise` | standard deviation, counts |
//! | `coggingTorques` | amplitudes, one for each joint, Nm of the motors |
//! | `torqueRipple` | amplitude as a share of the torque |
//! | `torquePeriods` | periods of cogging and ripple per turn of the motors, one number for each |
//! | `cableStiffness`, `cableDamping` | one number for each joint, Nm/rad and Nm s/rad; damping alone changes elastic cables only |
//! | `rigidCables` | the cables are rigid |
//! | `breakawayFactor` | friction at rest as a multiple of Coulomb friction, 1 or more |
//! | `stribeckSpeed` | speed at which 37 % of the excess is left, degrees/s |
//! | `coldMotors` | motors neither heat up nor are limited by the supply |
//! | `supplyVoltage` | V, 30 to 57; 0: without limit |

use std::time::Duration;

use yarp_devices::Limits;
use yarp_devices::simulation::{ArmEffects, CableElasticity, SimulatorOptions, VoltageLimits};
use yarp_wire::settings::Parameters;

use crate::HostError;
use crate::shared_parameters::{flag, numbers_of};

/// Most that a command may be delayed, and that may be added: five periods.
const MAX_LATENCY: Duration = Duration::from_millis(10);

/// Reads the options of a simulated arm whose parameters change `default`.
///
/// Errors: [`HostError::Parameter`] with the position of the parameter and the expected value.
pub(crate) fn simulator_options(
    parameters: &Parameters,
    joints: usize,
    default: SimulatorOptions,
) -> Result<SimulatorOptions, HostError> {
    let mut options = match parameters.get::<String>("effects")?.as_deref() {
        None => default,
        Some("none") => SimulatorOptions::default(),
        Some("real") => SimulatorOptions::real_arm(),
        Some(_) => return Err(parameters.refuse("effects", "none or real").into()),
    };
    if let Some(seed) = parameters.get::<usize>("seed")? {
        options.seed = seed as u64;
    }
    let before = options.effects;
    let effects = &mut options.effects;
    electric_effects(effects, parameters, joints)?;
    mechanic_effects(effects, parameters, joints)?;
    // Elastic cables and fast changes need the shorter steps of the real arm.
    if *effects != before {
        options.substeps = options.substeps.max(SimulatorOptions::real_arm().substeps);
    }
    Ok(options)
}

/// Reads a number within a range.
fn number(
    parameters: &Parameters,
    name: &str,
    range: Limits,
    expected: &str,
) -> Result<Option<f64>, HostError> {
    let found = parameters.get::<f64>(name)?;
    match found.filter(|number| !range.contains(*number)) {
        Some(_) => Err(parameters.refuse(name, expected).into()),
        None => Ok(found),
    }
}

/// Returns the number of a joint in a list; `None` without a list, and for a joint that the arm has not.
fn of_joint(list: &Option<Vec<f64>>, joint: usize) -> Option<f64> {
    list.as_ref()?.get(joint).copied()
}

/// Reads what happens between the controller and the torques of the motors.
fn electric_effects(
    effects: &mut ArmEffects,
    parameters: &Parameters,
    joints: usize,
) -> Result<(), HostError> {
    for (name, time) in [
        ("commandLatency", &mut effects.latency.least),
        ("latencyJitter", &mut effects.latency.jitter),
    ] {
        if let Some(found) = parameters.get::<Duration>(name)? {
            if found > MAX_LATENCY {
                let expected = "a time of at most 0.01 seconds";
                return Err(parameters.refuse(name, expected).into());
            }
            *time = found;
        }
    }
    let noise = number(
        parameters,
        "encoderNoise",
        Limits::new(0.0, 100.0),
        "a standard deviation of 0 to 100 counts",
    )?;
    effects.encoder_noise = noise.unwrap_or(effects.encoder_noise);
    let cogging = numbers_of(
        parameters,
        "coggingTorques",
        joints,
        Limits::new(0.0, 1.0),
        &format!("{joints} torques of motors of 0 to 1 Nm"),
    )?;
    let periods = numbers_of(
        parameters,
        "torquePeriods",
        joints,
        Limits::new(0.0, 1000.0),
        &format!("{joints} numbers of periods per turn, at most 1000"),
    )?;
    let ripple = number(
        parameters,
        "torqueRipple",
        Limits::new(0.0, 0.5),
        "a share of 0 to 0.5",
    )?;
    for (motor, variation) in effects.torque_variation.iter_mut().enumerate() {
        variation.cogging = of_joint(&cogging, motor).unwrap_or(variation.cogging);
        variation.periods_per_turn =
            of_joint(&periods, motor).unwrap_or(variation.periods_per_turn);
        variation.ripple = ripple.unwrap_or(variation.ripple);
    }
    if flag(parameters, "coldMotors")? {
        effects.windings = None;
    }
    // Beyond the limits of faults the safety module would never let the arm become active.
    let limits = VoltageLimits::default();
    let supply = match parameters.get::<f64>("supplyVoltage")? {
        Some(0.0) => Some(0.0),
        _ => number(
            parameters,
            "supplyVoltage",
            Limits::new(limits.low_fault, limits.high_fault),
            "a voltage of 30 to 57 V, which the safety module permits, or 0",
        )?,
    };
    effects.supply_voltage = supply.unwrap_or(effects.supply_voltage);
    Ok(())
}

/// Reads what happens between the motors and the links.
fn mechanic_effects(
    effects: &mut ArmEffects,
    parameters: &Parameters,
    joints: usize,
) -> Result<(), HostError> {
    let stiffness = numbers_of(
        parameters,
        "cableStiffness",
        joints,
        Limits::new(1.0, 1e9),
        &format!("{joints} stiffnesses of 1 to 1e9 Nm/rad"),
    )?;
    let damping = numbers_of(
        parameters,
        "cableDamping",
        joints,
        Limits::new(0.0, 1e6),
        &format!("{joints} dampings of 0 to 1e6 Nm s/rad"),
    )?;
    if stiffness.is_some() {
        let before = effects.elasticity.unwrap_or_default();
        effects.elasticity = Some(std::array::from_fn(|joint| CableElasticity {
            stiffness: of_joint(&stiffness, joint).unwrap_or(before[joint].stiffness),
            ..before[joint]
        }));
    }
    if let (Some(damping), Some(cables)) = (damping, &mut effects.elasticity) {
        for (cable, damping) in cables.iter_mut().zip(damping) {
            cable.damping = damping;
        }
    }
    if flag(parameters, "rigidCables")? {
        effects.elasticity = None;
    }
    let breakaway = number(
        parameters,
        "breakawayFactor",
        Limits::new(1.0, 10.0),
        "a factor of 1 to 10",
    )?;
    let speed = number(
        parameters,
        "stribeckSpeed",
        Limits::new(1e-3, 360.0),
        "a speed of 0.001 to 360 degrees/s",
    )?;
    let stiction = &mut effects.stiction;
    stiction.breakaway = breakaway.unwrap_or(stiction.breakaway);
    stiction.stribeck_speed = speed.map_or(stiction.stribeck_speed, f64::to_radians);
    Ok(())
}

#[cfg(test)]
mod tests {
    use yarp_wire::settings::{NoSource, Origin, Settings};

    use super::*;

    fn read(text: &str) -> Result<SimulatorOptions, String> {
        let mut settings = Settings::new();
        settings.read_text("f.ini", text, &NoSource);
        let parameters = Parameters::new("arm", settings, Origin::line("f.ini", 1));
        simulator_options(&parameters, 7, SimulatorOptions::default())
            .map_err(|error| error.to_string())
    }

    #[test]
    fn the_effects_of_a_real_arm_are_one_word() {
        assert_eq!(read(""), Ok(SimulatorOptions::default()));
        assert_eq!(read("effects none"), Ok(SimulatorOptions::default()));
        assert_eq!(read("effects real"), Ok(SimulatorOptions::real_arm()));
        let seeded = read("effects real\nseed 7").unwrap();
        assert_eq!(seeded.seed, 7);
    }

    #[test]
    fn each_effect_is_a_parameter() {
        let text = "commandLatency 0.002\nlatencyJitter 0.001\nencoderNoise 2\n\
            coggingTorques (0.1 0.2 0.3 0.4 0.5 0.6 0.7)\ntorqueRipple 0.1\ntorquePeriods (1 2 3 4 5 6 7)\n\
            cableStiffness (10 20 30 40 50 60 70)\ncableDamping (1 2 3 4 5 6 7)\n\
            breakawayFactor 1.5\nstribeckSpeed 2\nsupplyVoltage 36\n";
        let found = read(text).unwrap();
        assert_eq!(found.substeps, SimulatorOptions::real_arm().substeps);
        let effects = found.effects;
        let times = [effects.latency.least, effects.latency.jitter];
        assert_eq!(times, [2, 1].map(Duration::from_millis));
        assert_eq!((effects.encoder_noise, effects.supply_voltage), (2.0, 36.0));
        let last = effects.torque_variation[6];
        assert_eq!(
            (last.cogging, last.ripple, last.periods_per_turn),
            (0.7, 0.1, 7.0)
        );
        let cable = effects.elasticity.unwrap()[6];
        assert_eq!((cable.stiffness, cable.damping), (70.0, 7.0));
        let stiction = effects.stiction;
        assert_eq!(
            (stiction.breakaway, stiction.stribeck_speed),
            (1.5, 2_f64.to_radians())
        );
        let unlimited = read("supplyVoltage 0").unwrap();
        assert_eq!(unlimited.effects.supply_voltage, 0.0);
        let without = read("effects real\nrigidCables\ncoldMotors\n")
            .unwrap()
            .effects;
        assert_eq!((without.elasticity, without.windings), (None, None));
    }

    #[test]
    fn values_out_of_range_are_refused_with_what_is_expected() {
        for (text, expected) in [
            ("effects some", "none or real"),
            ("commandLatency 1", "at most 0.01 seconds"),
            ("latencyJitter 1", "at most 0.01 seconds"),
            ("encoderNoise -1", "0 to 100 counts"),
            ("coggingTorques (1 2)", "7 torques of motors"),
            ("torqueRipple 2", "0 to 0.5"),
            ("torquePeriods (-1 1 1 1 1 1 1)", "at most 1000"),
            ("cableStiffness (0 1 1 1 1 1 1)", "1 to 1e9 Nm/rad"),
            ("cableDamping (1)", "7 dampings"),
            ("breakawayFactor 0.5", "1 to 10"),
            ("stribeckSpeed 0", "degrees/s"),
            ("supplyVoltage -1", "30 to 57 V"),
            ("supplyVoltage 29", "30 to 57 V"),
            ("supplyVoltage 58", "30 to 57 V"),
        ] {
            let refused = read(text).expect_err(text);
            assert!(refused.contains(expected), "{text}: {refused}");
        }
    }
}
