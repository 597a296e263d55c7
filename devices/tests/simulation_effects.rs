//! Each effect of a real arm has the size that its parameters say, measured from outside the simulator.

use std::f64::consts::TAU;
use std::time::Duration;

use yarp_devices::dynamics::{Dynamics, MassMatrix};
use yarp_devices::kinematics::Joints;
use yarp_devices::simulation::{
    ArmEffects, CableElasticity, SafetyLimits, SimulatedArm, Simulator, SimulatorOptions,
    VoltageLimits,
};
use yarp_devices::wam::{Friction, WamModel};

type Seven = Joints<7>;

/// Elbow bent, away from every stop.
const POSE: [f64; 7] = [0.11, 0.52, 0.13, 1.54, 0.15, 0.16, 0.17];
/// Friction that lets no motor move.
const STUCK: Friction = Friction {
    coulomb: 1e4,
    viscous: 0.0,
};
const FREE: Friction = Friction {
    coulomb: 0.0,
    viscous: 0.0,
};

/// Options with these effects, without safety limits and without noise of friction.
fn options(effects: ArmEffects) -> SimulatorOptions {
    SimulatorOptions {
        friction_noise: 0.0,
        safety: SafetyLimits {
            velocity_warning: 0.0,
            velocity_fault: 0.0,
            torque_warning: 0.0,
            torque_fault: 0.0,
            voltage: VoltageLimits::default(),
            heartbeat: 0.0,
        },
        effects,
        ..SimulatorOptions::real_arm()
    }
}

/// An arm without gravity whose joints have this friction, active.
fn weightless(options: SimulatorOptions, friction: [Friction; 7]) -> Simulator<7> {
    let mut model = WamModel::<7>::new();
    model.gravity = 0.0;
    model.friction = friction;
    let mut arm = Simulator::new(model, options);
    arm.safety_mut().press_activate();
    arm.place(&POSE.into());
    arm
}

fn only(joint: usize, torque: f64) -> Seven {
    let mut torques = Seven::zeros();
    torques[joint] = torque;
    torques
}

/// Returns the mass matrix of the links in a pose, without rotors.
fn link_masses(pose: &Seven) -> MassMatrix<7> {
    let model = WamModel::<7>::new();
    Dynamics::new(model.chain.clone(), model.bodies, Seven::zeros(), 0.0).mass_matrix(pose)
}

mod latency {
    use super::*;

    /// Returns the time from a command to its acceleration, µs, from the speed that the joint has at the end of a period.
    fn measured(arm: &mut Simulator<7>) -> f64 {
        let before = arm.velocities()[0];
        arm.step(Some(&only(0, 10.0)));
        let gained = arm.velocities()[0] - before;
        // Until the next measurement nothing pushes.
        let before = arm.velocities()[0];
        arm.step(Some(&Seven::zeros()));
        let more = arm.velocities()[0] - before;
        // The torque acts for a whole period in all.
        2000.0 * more / (gained + more)
    }

    fn only_latency() -> ArmEffects {
        ArmEffects {
            latency: ArmEffects::real_arm().latency,
            ..ArmEffects::default()
        }
    }

    #[test]
    fn a_torque_acts_when_it_has_passed_the_bus() {
        let mut effects = only_latency();
        effects.latency.jitter = Duration::ZERO;
        let mut arm = weightless(options(effects), [FREE; 7]);
        // Barrett's wiki: 75 us for the query and each of seven positions, 125 us for each of two frames of torques.
        let bus = 75.0 + 7.0 * 75.0 + 2.0 * 125.0;
        let found = measured(&mut arm);
        assert!((found - bus).abs() < 5.0, "{found} us");
        let mut arm = weightless(options(ArmEffects::default()), [FREE; 7]);
        let none = measured(&mut arm);
        assert!(none.abs() < 1.0, "{none} us");
    }

    #[test]
    fn the_delay_varies_by_the_jitter() {
        let mut arm = weightless(options(only_latency()), [FREE; 7]);
        // The zeros that follow are late as well, by another amount: what is measured is the first of both.
        let start = arm.velocities()[0];
        arm.step(Some(&only(0, 10.0)));
        let whole = {
            let mut ideal = weightless(options(ArmEffects::default()), [FREE; 7]);
            ideal.step(Some(&only(0, 10.0)));
            ideal.velocities()[0]
        };
        let mut found = vec![2000.0 * (1.0 - (arm.velocities()[0] - start) / whole)];
        for seed in 1..300 {
            let with_seed = SimulatorOptions {
                seed,
                ..options(only_latency())
            };
            let mut arm = weightless(with_seed, [FREE; 7]);
            arm.step(Some(&only(0, 10.0)));
            found.push(2000.0 * (1.0 - arm.velocities()[0] / whole));
        }
        let least = found.iter().copied().fold(f64::INFINITY, f64::min);
        let most = found.iter().copied().fold(0.0, f64::max);
        assert!(least > 849.0 && most < 951.0, "{least} to {most} us");
        assert!(most - least > 90.0, "{least} to {most} us");
    }

    #[test]
    fn a_delay_may_be_longer_than_a_period() {
        let mut effects = ArmEffects::default();
        effects.latency.least = Duration::from_micros(5000);
        let mut arm = weightless(options(effects), [FREE; 7]);
        let speeds: Vec<f64> = (0..4)
            .map(|_| {
                arm.step(Some(&only(0, 10.0)));
                arm.velocities()[0]
            })
            .collect();
        assert_eq!(&speeds[..2], &[0.0, 0.0]);
        // Half of the third period, and all of the fourth.
        let ratio = (speeds[3] - speeds[2]) / speeds[2];
        assert!((ratio - 2.0).abs() < 0.01, "{ratio}");
    }
}

mod encoders {
    use super::*;

    /// Returns the standard deviations of the readings of each encoder of an arm at rest in several poses, counts.
    fn deviations(effects: ArmEffects) -> Vec<f64> {
        const READINGS: usize = 2000;
        let mut found = Vec::new();
        for pose in 0..12 {
            let mut arm = weightless(options(effects), [STUCK; 7]);
            arm.place(&(Seven::from(POSE) + Seven::repeat(1e-5 * f64::from(pose))));
            let start = arm.counts();
            let mut sums = [(0.0, 0.0); 7];
            for _ in 0..READINGS {
                let counts = arm.step(None);
                for (motor, sum) in sums.iter_mut().enumerate() {
                    let off = f64::from(counts[motor] - start[motor]);
                    *sum = (sum.0 + off, sum.1 + off * off);
                }
            }
            let count = READINGS as f64;
            found.extend(sums.map(|(sum, squares)| squares / count - (sum / count).powi(2)));
        }
        found.into_iter().map(f64::sqrt).collect()
    }

    #[test]
    fn readings_at_rest_vary_like_those_of_a_magnetic_encoder() {
        let effects = ArmEffects {
            encoder_noise: ArmEffects::real_arm().encoder_noise,
            ..ArmEffects::default()
        };
        // 0.03 degrees of noise, and rounding to counts, whose share depends on where between two counts the rotor is.
        let noise: f64 = 0.03 / 360.0 * 4096.0;
        let found = deviations(effects);
        let mean_square = found.iter().map(|one| one * one).sum::<f64>() / found.len() as f64;
        let expected = noise.powi(2) + 1.0 / 12.0;
        assert!(
            (mean_square / expected - 1.0).abs() < 0.05,
            "{mean_square}, {expected}"
        );
        let still = deviations(ArmEffects::default());
        assert!(still.iter().all(|one| *one == 0.0), "{still:?}");
    }
}

mod torque_variation {
    use super::*;

    /// Returns the torque of the base joint that a controller needs to hold it at an angle, Nm.
    fn holding(effects: ArmEffects, angle: f64) -> f64 {
        let mut friction = [STUCK; 7];
        friction[0] = Friction {
            coulomb: 0.0,
            viscous: 60.0,
        };
        let mut arm = weightless(options(effects), friction);
        let mut pose = Seven::from(POSE);
        pose[0] = angle;
        arm.place(&pose);
        let mut torque = 0.0;
        let mut integral = 0.0;
        for _ in 0..400 {
            let off = angle - arm.angles()[0];
            integral += 20.0 * off;
            torque = 2000.0 * off + integral;
            arm.step(Some(&only(0, torque)));
        }
        torque
    }

    #[test]
    fn holding_takes_a_torque_that_varies_with_the_angle_of_the_rotor() {
        let mut effects = ArmEffects {
            torque_variation: ArmEffects::real_arm().torque_variation,
            ..ArmEffects::default()
        };
        for variation in &mut effects.torque_variation {
            variation.ripple = 0.0;
        }
        // 1 % of 1.49 Nm, through a gear of 42; 12 poles, three periods for each.
        let amplitude = 0.01 * 1.49 * 42.0;
        let periods = 36.0 * 42.0;
        let (mut largest, mut off) = (0.0_f64, 0.0_f64);
        for step in 0..16 {
            let angle = 0.2 + 2.0 * TAU / periods * f64::from(step) / 16.0;
            let found = holding(effects, angle);
            largest = largest.max(found.abs());
            // The base joint turns its motor backwards.
            off = off.max((found + amplitude * (periods * angle).sin()).abs());
        }
        assert!((largest / amplitude - 1.0).abs() < 0.1, "{largest} Nm");
        assert!(off < 0.1 * amplitude, "{off} Nm off");
        let smooth = holding(ArmEffects::default(), 0.2);
        assert!(smooth.abs() < 0.02, "{smooth} Nm");
    }

    #[test]
    fn the_torque_of_a_current_ripples() {
        let mut effects = ArmEffects {
            torque_variation: ArmEffects::real_arm().torque_variation,
            ..ArmEffects::default()
        };
        for variation in &mut effects.torque_variation {
            variation.cogging = 0.0;
        }
        let mut friction = [STUCK; 7];
        friction[0] = FREE;
        let gained = |angle: f64| {
            let mut arm = weightless(options(effects), friction);
            let mut pose = Seven::from(POSE);
            pose[0] = angle;
            arm.place(&pose);
            arm.step(Some(&only(0, 10.0)));
            arm.velocities()[0]
        };
        let half_a_period = TAU / 36.0 / 42.0 / 2.0;
        let ratio = gained(0.0) / gained(half_a_period);
        assert!((ratio - 1.02 / 0.98).abs() < 0.002, "{ratio}");
    }
}

mod elasticity {
    use super::*;

    /// Stiffness of the cables of each joint, Nm/rad.
    const STIFFNESSES: [f64; 7] = [10_000.0, 10_000.0, 4000.0, 4000.0, 500.0, 500.0, 150.0];

    fn only_cables() -> ArmEffects {
        ArmEffects {
            elasticity: ArmEffects::real_arm().elasticity,
            ..ArmEffects::default()
        }
    }

    #[test]
    fn a_push_turns_a_link_by_torque_over_stiffness_and_its_motor_not_at_all() {
        for (joint, stiffness) in STIFFNESSES.into_iter().enumerate() {
            let mut effects = only_cables();
            for cable in effects.elasticity.iter_mut().flatten() {
                // It comes to rest soon.
                cable.damping *= 30.0;
            }
            let mut arm = weightless(options(effects), [STUCK; 7]);
            let (counts, start) = (arm.counts(), arm.angles());
            let torque = stiffness / 500.0;
            arm.twist(only(joint, torque));
            for _ in 0..1500 {
                arm.step(None);
            }
            let turned = (arm.angles() - start)[joint];
            let expected = torque / stiffness;
            assert!(
                (turned / expected - 1.0).abs() < 0.01,
                "joint {joint}: {turned}"
            );
            assert_eq!(arm.counts(), counts);
            assert!((arm.motor_angles() - start).amax() < 1e-9);
        }
    }

    /// An oscillation of a link on the cables of its joint.
    struct Oscillation {
        /// Hz.
        frequency: f64,
        /// Decay of the amplitude, 1/s.
        decay: f64,
    }

    /// Returns how a link swings after a blow when all other joints are rigid and stand still.
    fn oscillation(joint: usize, rotor_is_free: bool, is_damped: bool) -> Oscillation {
        let mut effects = only_cables();
        for (other, cable) in effects.elasticity.iter_mut().flatten().enumerate() {
            if other != joint {
                cable.stiffness = 1e9;
            }
            if other != joint || !is_damped {
                cable.damping = 0.0;
            }
        }
        let mut friction = [STUCK; 7];
        if rotor_is_free {
            friction[joint] = FREE;
        }
        let fine = SimulatorOptions {
            period: Duration::from_micros(200),
            ..options(effects)
        };
        let mut arm = weightless(fine, friction);
        arm.twist(only(joint, 20.0));
        for _ in 0..5 {
            arm.step(None);
        }
        arm.twist(Seven::zeros());
        let twist = |arm: &Simulator<7>| (arm.angles() - arm.motor_angles())[joint];
        let (mut crossings, mut peaks) = (Vec::new(), Vec::new());
        let (mut peak, mut last) = (0.0_f64, twist(&arm));
        while crossings.len() < 11 {
            arm.step(None);
            let now = twist(&arm);
            peak = peak.max(now);
            if last < 0.0 && now >= 0.0 {
                crossings.push(arm.time().as_secs_f64());
                peaks.push(std::mem::take(&mut peak));
            }
            last = now;
            assert!(
                arm.time() < Duration::from_secs(20),
                "it does not oscillate"
            );
        }
        // The first peak is of the blow.
        let (time, peaks) = (crossings[10] - crossings[1], (peaks[1], peaks[10]));
        Oscillation {
            frequency: 9.0 / time,
            decay: (peaks.0 / peaks.1).ln() / time,
        }
    }

    #[test]
    fn a_link_swings_at_the_frequency_of_its_mass_on_its_cable() {
        let masses = link_masses(&POSE.into());
        for joint in [0, 1, 3] {
            let (stiffness, link) = (STIFFNESSES[joint], masses[(joint, joint)]);
            let expected = (stiffness / link).sqrt() / TAU;
            let found = oscillation(joint, false, false).frequency;
            assert!(
                (found / expected - 1.0).abs() < 0.01,
                "joint {joint}: {found}, {expected} Hz"
            );
            // Against its rotor, which is free, it swings faster.
            let rotor = WamModel::<7>::new().rotors[joint];
            let expected = (stiffness * (1.0 / link + 1.0 / rotor)).sqrt() / TAU;
            let found = oscillation(joint, true, false).frequency;
            assert!(
                (found / expected - 1.0).abs() < 0.01,
                "joint {joint}: {found}, {expected} Hz"
            );
        }
    }

    #[test]
    fn the_amplitude_decays_by_damping_over_mass() {
        let masses = link_masses(&POSE.into());
        for joint in [0, 1, 3] {
            // A millisecond of the stiffness.
            let damping = 1e-3 * STIFFNESSES[joint];
            let expected = damping / masses[(joint, joint)] / 2.0;
            let found = oscillation(joint, false, true).decay;
            assert!(
                (found / expected - 1.0).abs() < 0.05,
                "joint {joint}: {found}, {expected} 1/s"
            );
            let none = oscillation(joint, false, false).decay;
            assert!(none.abs() < 0.02 * expected, "joint {joint}: {none} 1/s");
        }
    }

    /// Lets periods pass, and returns the largest energy meanwhile, J.
    fn largest_energy(arm: &mut Simulator<7>, periods: usize) -> f64 {
        let mut most = 0.0_f64;
        for _ in 0..periods {
            arm.step(None);
            most = most.max(arm.energy());
        }
        most
    }

    /// Returns by what the largest energy of an arm that was pushed grows, from a while after the push to a long while after.
    fn growth(stiffness: f64, period: Duration, friction: Friction) -> f64 {
        let cable = CableElasticity {
            stiffness,
            damping: 0.0,
        };
        let effects = ArmEffects {
            elasticity: Some([cable; 7]),
            ..ArmEffects::default()
        };
        let coarse = SimulatorOptions {
            period,
            substeps: 1,
            ..options(effects)
        };
        let mut arm = weightless(coarse, [friction; 7]);
        arm.twist(Seven::repeat(0.05));
        arm.step(None);
        arm.twist(Seven::zeros());
        // Within an oscillation the energy varies, for speeds are those between two steps.
        let first = largest_energy(&mut arm, 200);
        largest_energy(&mut arm, 1000);
        largest_energy(&mut arm, 200) / first
    }

    #[test]
    fn no_stiffness_and_no_step_makes_it_unstable() {
        for stiffness in [1.0, 1e4, 1e8, 1e12] {
            for millis in [2, 20] {
                let found = growth(stiffness, Duration::from_millis(millis), STUCK);
                assert!(found < 1.1, "{stiffness} Nm/rad, {millis} ms: {found}");
            }
            // Free, the arm turns, and steps of 20 ms are too long for the forces of that.
            let found = growth(stiffness, Duration::from_millis(1), FREE);
            assert!(found < 1.5, "{stiffness} Nm/rad, free: {found}");
        }
    }

    #[test]
    fn an_oscillation_keeps_its_energy_without_damping_and_loses_it_with() {
        let energies = |damping: f64| {
            let mut effects = only_cables();
            for cable in effects.elasticity.iter_mut().flatten() {
                cable.damping *= damping;
            }
            let mut arm = weightless(options(effects), [STUCK; 7]);
            arm.twist(only(0, 20.0));
            arm.step(None);
            arm.twist(Seven::zeros());
            let start = largest_energy(&mut arm, 100);
            largest_energy(&mut arm, 400);
            largest_energy(&mut arm, 100) / start
        };
        let (kept, damped) = (energies(0.0), energies(1.0));
        assert!((kept - 1.0).abs() < 0.02, "{kept}");
        assert!(damped < 0.2, "{damped}");
    }

    #[test]
    fn a_placed_arm_hangs_in_its_cables_at_rest() {
        let mut arm = SimulatedArm::new(WamModel::<7>::new(), options(only_cables()));
        arm.place(&POSE.into());
        let gravity = WamModel::<7>::new().dynamics().gravity(&POSE.into());
        let twist = arm.simulator().motor_angles() - arm.simulator().angles();
        for joint in 0..7 {
            assert!((twist[joint] * STIFFNESSES[joint] - gravity[joint]).abs() < 1e-6);
        }
        let start = arm.simulator().angles();
        arm.run(Duration::from_millis(300));
        let moved = (arm.simulator().angles() - start).amax();
        assert!(moved < 2e-4, "{moved}");
    }
}

mod stiction {
    use super::*;

    /// Returns the torque at which the base joint begins to move, Nm.
    fn breakaway(effects: ArmEffects) -> f64 {
        let friction = WamModel::<7>::new().friction;
        let mut arm = weightless(options(effects), friction);
        for step in 0.. {
            let torque = 0.02 * f64::from(step);
            for _ in 0..3 {
                arm.step(Some(&only(0, torque)));
            }
            if arm.velocities()[0] > 1e-6 {
                return torque;
            }
        }
        unreachable!("any joint moves at some torque")
    }

    fn only_stiction() -> ArmEffects {
        ArmEffects {
            stiction: ArmEffects::real_arm().stiction,
            ..ArmEffects::default()
        }
    }

    #[test]
    fn a_joint_at_rest_needs_more_torque_than_one_that_moves() {
        let coulomb = WamModel::<7>::new().friction[0].coulomb;
        let found = breakaway(only_stiction());
        assert!((found / (1.2 * coulomb) - 1.0).abs() < 0.03, "{found} Nm");
        let found = breakaway(ArmEffects::default());
        assert!((found / coulomb - 1.0).abs() < 0.03, "{found} Nm");
    }

    #[test]
    fn a_joint_that_moves_has_coulomb_friction() {
        let mut friction = WamModel::<7>::new().friction;
        let coulomb = friction[0].coulomb;
        friction[0].viscous = 0.0;
        // As fast as the Stribeck speed, 37 % of the excess is left.
        for (speed, factor) in [(0.02, 1.0 + 0.2 / 1_f64.exp()), (0.1, 1.0)] {
            let mut arm = weightless(options(only_stiction()), friction);
            while arm.velocities()[0] < speed {
                arm.step(Some(&only(0, 1.5 * coulomb)));
            }
            let before = arm.velocities()[0];
            let accelerated = |arm: &mut Simulator<7>, torque: f64| {
                let start = arm.velocities()[0];
                arm.step(Some(&only(0, torque)));
                arm.velocities()[0] - start
            };
            // What one Nm more does, and what is left without any.
            let mut other = arm.clone();
            let pushed = accelerated(&mut other, 1.0);
            let coasting = accelerated(&mut arm, 0.0);
            let found = -coasting / (pushed - coasting);
            assert!(
                (found / (factor * coulomb) - 1.0).abs() < 0.03,
                "{found} Nm at {before} rad/s"
            );
        }
    }
}

mod motors {
    use super::*;

    /// Currents of the continuous torques of the motors' table at their torque constants, A.
    const CONTINUOUS: [f64; 7] = [3.2604, 3.2604, 3.2604, 3.2604, 1.5085, 1.5085, 1.3582];

    fn only_windings() -> ArmEffects {
        ArmEffects {
            windings: ArmEffects::real_arm().windings,
            ..ArmEffects::default()
        }
    }

    /// An arm whose motors push against what does not yield, in steps of a second.
    fn pushing() -> Simulator<7> {
        let slow = SimulatorOptions {
            period: Duration::from_secs(1),
            substeps: 1,
            ..options(only_windings())
        };
        weightless(slow, [STUCK; 7])
    }

    fn units(amperes: f64) -> [i16; 7] {
        CONTINUOUS.map(|current| (1024.0 * current * amperes) as i16)
    }

    #[test]
    fn the_continuous_current_heats_a_winding_to_its_limit() {
        let mut arm = pushing();
        // Five hours.
        for _ in 0..5 * 3600 {
            arm.step_units(Some(&units(1.0)));
        }
        for (motor, found) in arm.winding_temperatures().into_iter().enumerate() {
            // Class F: 155 °C.
            assert!((found - 155.0).abs() < 3.0, "motor {motor}: {found} °C");
        }
        for _ in 0..5 * 3600 {
            arm.step_units(Some(&[0; 7]));
        }
        assert!(
            arm.winding_temperatures()
                .iter()
                .all(|now| (now - 25.0).abs() < 0.1)
        );
    }

    #[test]
    fn a_winding_heats_as_fast_as_its_time_constant_says() {
        let mut arm = pushing();
        let half = 0.5;
        for _ in 0..250 {
            arm.step_units(Some(&units(half)));
        }
        let resistances = [3.473, 3.473, 3.473, 3.473, 6.213, 6.213, 5.205];
        let thermal = [2.33, 2.33, 2.33, 2.33, 6.1, 6.1, 8.97];
        let times = [800.0, 800.0, 800.0, 800.0, 700.0, 700.0, 250.0];
        for (motor, found) in arm.winding_temperatures().into_iter().enumerate() {
            let current = f64::from(units(half)[motor]) / 1024.0;
            let cold: f64 = thermal[motor] * resistances[motor] * current * current;
            // Copper has more resistance when it is warm: x' = (cold (1 + 0.00393 x) - x) / time.
            let slower = 1.0 - 0.00393 * cold;
            let expected = cold / slower * (1.0 - (-slower * 250.0 / times[motor]).exp());
            assert!(
                ((found - 25.0) / expected - 1.0).abs() < 0.01,
                "motor {motor}: {found}"
            );
        }
    }

    #[test]
    fn a_hot_motor_is_weaker() {
        let mut arm = pushing();
        let accelerated = |arm: &Simulator<7>| {
            let mut arm = arm.clone();
            arm.set_friction([FREE; 7]);
            arm.step_units(Some(&[-10, 0, 0, 0, 0, 0, 0]));
            arm.velocities()[0]
        };
        let cold = accelerated(&arm);
        for _ in 0..5 * 3600 {
            arm.step_units(Some(&units(1.0)));
        }
        arm.step_units(Some(&[0; 7]));
        let rise = arm.winding_temperatures()[0] - 25.0;
        // Ferrite: 0.2 % for each °C.
        let expected = 1.0 - 0.002 * rise;
        let found = accelerated(&arm) / cold;
        assert!(
            expected < 0.78 && (found / expected - 1.0).abs() < 0.01,
            "{found}"
        );
    }

    #[test]
    fn the_supply_limits_the_speed_of_a_motor() {
        let fastest = |supply_voltage: f64| {
            let effects = ArmEffects {
                supply_voltage,
                ..only_windings()
            };
            let mut friction = [STUCK; 7];
            friction[0] = FREE;
            let mut arm = weightless(options(effects), friction);
            let mut pose = Seven::from(POSE);
            pose[0] = -2.5;
            arm.place(&pose);
            while arm.angles()[0] < 2.5 {
                arm.step_units(Some(&[-4860, 0, 0, 0, 0, 0, 0]));
            }
            arm.velocities()[0] * 42.0
        };
        let real = ArmEffects::real_arm().supply_voltage;
        // The table of motors has 100.2 rad/s without load, with the friction of the motor.
        let found = fastest(real);
        assert!((95.0..106.0).contains(&found), "{found} rad/s");
        assert!(fastest(0.0) > 300.0);
    }
}

mod rest {
    use super::*;

    /// Returns how far an arm without power sinks from its home pose, rad.
    fn sunk(effects: ArmEffects) -> f64 {
        let mut arm = Simulator::new(WamModel::<7>::new(), options(effects));
        for _ in 0..3000 {
            arm.step(None);
        }
        (arm.angles() - WamModel::<7>::new().home).amax()
    }

    #[test]
    fn a_folded_arm_rests_on_its_stops() {
        let found = sunk(ArmEffects::real_arm());
        assert!(found < 1e-3, "{found} rad");
        let found = sunk(ArmEffects::default());
        assert!((found - 0.03).abs() < 1e-3, "{found} rad");
    }
}
