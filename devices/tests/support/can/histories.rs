//! Random histories of an arm on a bus: whatever happens to power, pucks, bus and driver, the driver believes no false
//! position, nothing moves without the pendant, and activation moves nothing.

use std::ops::Range;
use std::path::PathBuf;
use std::time::Duration;

use yarp_devices::can::puck::Node;
use yarp_devices::kinematics::Joints;
use yarp_devices::pseudo_random::Random;
use yarp_devices::simulation::{SafetyMode, WakeUp};
use yarp_devices::wam::WamModel;
use yarp_devices::wam::can::{CanOptions, CanWam};
use yarp_devices::{Axes, AxisIndex, Encoders, PositionControl};

use super::scenarios::options;
use super::{Plug, Rig, until};

/// Maximum error of a believed joint, rad.
const MAX_ERROR: f64 = 0.05;
/// Maximum motion of a joint on activation, degrees.
const MAX_ACTIVATION_MOTION: f64 = 0.5;
/// Error with which a person folds the arm, rad.
const FOLDING_ERROR: f64 = 0.01;
const EVENTS: u32 = 8;

/// Returns the seeds that `YARP_CAN_FIRST_HISTORY` and `YARP_CAN_HISTORIES` select, without them the first `count`.
pub fn seeds(count: u64) -> Range<u64> {
    let number = |name: &str, default: u64| {
        let asked = std::env::var(name).ok();
        asked
            .and_then(|asked| asked.parse().ok())
            .unwrap_or(default)
    };
    let first = number("YARP_CAN_FIRST_HISTORY", 0);
    first..first.saturating_add(number("YARP_CAN_HISTORIES", count))
}

struct History<'a> {
    rig: &'a dyn Rig,
    chance: Random,
    options: CanOptions,
    arm: Option<CanWam>,
    /// True if a person pressed Shift and Activate since the arm was last seen not to be active.
    pressed: bool,
    plugged: bool,
    story: Vec<String>,
}

/// Lives through a history; panics with its events when something is violated. `record` is a file of its own.
pub fn live(rig: &dyn Rig, seed: u64, record: PathBuf) {
    let _ = std::fs::remove_file(&record);
    let mut history = History {
        rig,
        chance: Random::new(seed),
        options: CanOptions {
            home_confirmed: false,
            home_marks: None,
            position_file: Some(record.clone()),
            ..options()
        },
        arm: None,
        pressed: false,
        plugged: true,
        story: vec![format!("seed {seed}")],
    };
    history.begin();
    for _ in 0..EVENTS {
        history.event();
        history.check();
    }
    drop(history);
    let _ = std::fs::remove_file(&record);
}

impl History<'_> {
    fn note(&mut self, what: impl Into<String>) {
        self.story.push(what.into());
    }

    /// The arm stands somewhere, and pucks wake as they like.
    fn begin(&mut self) {
        let mut pose = WamModel::<7>::new().home;
        if self.chance.below(2) == 0 {
            for joint in 0..7 {
                pose[joint] += self.chance.between(-0.8, 0.8);
            }
            self.note("starts elsewhere than home");
        }
        let pose = WamModel::<7>::new().chain.clamp(&pose);
        self.rig.pucks().lock().simulator_mut().place(&pose);
        for motor in 0..7 {
            let millis = self.chance.below(2500) as u64;
            let wake_up = WakeUp {
                wake_time: Some(Duration::from_millis(millis)),
                ..WakeUp::default()
            };
            self.rig
                .pucks()
                .lock()
                .set_wake_up(Node::of_motor(motor), wake_up);
        }
        self.restart_driver();
        self.check();
    }

    fn restart_driver(&mut self) {
        self.arm = None;
        let found = CanWam::start(WamModel::<7>::new(), self.options.clone(), self.rig.open());
        self.note(match &found {
            Ok(_) => "driver starts".to_owned(),
            Err(error) => format!("driver does not start: {error}"),
        });
        self.arm = found.ok();
    }

    fn connected(&self) -> bool {
        self.arm.as_ref().is_some_and(|arm| arm.status().connected)
    }

    fn event(&mut self) {
        match self.chance.below(12) {
            0 | 1 => self.confirm(),
            2 | 3 => self.activate(),
            4 => self.move_a_joint(),
            5 => {
                let plug = if self.plugged {
                    Plug::Pull
                } else {
                    Plug::PutBack
                };
                self.note(format!("{plug:?}"));
                (self.rig.switch())(plug);
                self.plugged = !self.plugged;
            }
            6 | 7 => {
                let motor = self.chance.below(7);
                self.note(format!("puck {} restarts", motor + 1));
                self.rig.pucks().lock().restart_motor(motor);
                self.pass(3.0);
            }
            8 => {
                self.note("safety module restarts");
                self.rig.pucks().lock().restart_safety();
                self.pass(3.0);
            }
            9 => {
                self.note("emergency stop, released");
                self.rig.pucks().lock().press_stop();
                self.pass(1.0);
                self.rig.pucks().lock().press_idle();
                self.pass(3.0);
            }
            10 => self.lead(),
            _ => self.restart_driver(),
        }
        self.settle();
    }

    /// Time passes for pucks that start.
    fn pass(&mut self, seconds: f64) {
        self.settle();
        let time = Duration::from_secs_f64(seconds);
        self.rig.pucks().lock().advance_start(time);
    }

    /// Lets the driver notice what happened: some periods, or some attempts to connect.
    fn settle(&mut self) {
        let Some(arm) = &self.arm else { return };
        let (before, start) = (arm.status(), std::time::Instant::now());
        until("thirty periods, or a loss", || {
            let status = arm.status();
            match status.connected {
                true => {
                    status.connections != before.connections || status.periods > before.periods + 30
                }
                false => start.elapsed() > Duration::from_millis(120),
            }
        });
    }

    /// A person folds the arm and says so: only then.
    fn confirm(&mut self) {
        if !self.plugged {
            return;
        }
        self.rig.pucks().lock().press_idle();
        let mut home = WamModel::<7>::new().home;
        for joint in 0..7 {
            home[joint] += self.chance.between(-FOLDING_ERROR, FOLDING_ERROR);
        }
        let lost = self
            .arm
            .as_ref()
            .is_some_and(|arm| arm.status().position_lost.is_some());
        if lost {
            self.rig.pucks().lock().simulator_mut().place(&home);
            let confirmed = self.arm.as_ref().map(CanWam::confirm_home);
            self.note(format!("folded and confirmed: {confirmed:?}"));
        }
    }

    /// A person presses the buttons, whatever the driver says; at rest.
    fn activate(&mut self) {
        let connected = self.connected();
        self.note(format!("activated, connected: {connected}"));
        if !connected {
            self.pressed = true;
            self.rig.pucks().lock().press_activate();
            return;
        }
        self.rig.pucks().lock().press_idle();
        until("rest", || {
            !self.connected() || self.rig.pucks().lock().simulator().speed() < 0.01
        });
        let before = self.truth();
        self.pressed = true;
        self.rig.pucks().lock().press_activate();
        let (periods, connections) = (self.periods(), self.connections());
        until("some periods", || {
            !self.connected() || self.connections() != connections || self.periods() > periods + 100
        });
        if self.connected() && self.connections() == connections {
            let moved = (self.truth() - before).map(f64::to_degrees).abs().max();
            assert!(
                moved < MAX_ACTIVATION_MOTION,
                "activation moved a joint by {moved} degrees: {:#?}",
                self.story
            );
        }
    }

    fn periods(&self) -> u64 {
        self.arm.as_ref().map_or(0, |arm| arm.status().periods)
    }

    fn connections(&self) -> u64 {
        self.arm.as_ref().map_or(0, |arm| arm.status().connections)
    }

    fn truth(&self) -> Joints<7> {
        self.rig.pucks().lock().simulator().angles()
    }

    /// Refused unless the arm is active.
    fn move_a_joint(&mut self) {
        let axis = Axes::One(AxisIndex::new(self.chance.below(7)));
        let by = self.chance.between(-40.0, 40.0);
        if let Some(arm) = &self.arm {
            let moved = arm.relative_move(axis, &[by]).is_ok();
            let start = std::time::Instant::now();
            while moved
                && !arm.motion_done(axis).unwrap_or(true)
                && start.elapsed() < Duration::from_secs(3)
            {
                std::thread::sleep(Duration::from_millis(5));
            }
            self.note(format!("move of {axis:?} by {by:.1}: {moved}"));
        }
    }

    /// Somebody leads the arm by hand while it is not active.
    fn lead(&mut self) {
        let mut pucks = self.rig.pucks().lock();
        if pucks.simulator().safety().mode() == SafetyMode::Active {
            return;
        }
        let mut pose = pucks.simulator().angles();
        for joint in 0..7 {
            pose[joint] += self.chance.between(-0.4, 0.4);
        }
        let pose = WamModel::<7>::new().chain.clamp(&pose);
        pucks.simulator_mut().place(&pose);
        drop(pucks);
        self.note("led by hand");
    }

    fn check(&mut self) {
        // While it is locked, the simulated arm stands still.
        let pucks = self.rig.pucks().lock();
        let mode = pucks.simulator().safety().mode();
        assert!(
            mode != SafetyMode::Active || self.pressed,
            "active without the pendant: {:#?}",
            self.story
        );
        self.pressed &= mode == SafetyMode::Active;
        let truth = pucks.simulator().angles();
        let believed = self.arm.as_ref().and_then(|arm| {
            let believed = arm.encoder_readings(Axes::All).ok()?;
            arm.status().connected.then_some(believed)
        });
        for (joint, reading) in believed.iter().flatten().enumerate() {
            let off = reading.position.to_radians() - truth[joint];
            assert!(
                off.abs() < MAX_ERROR,
                "joint {joint} is believed {off} rad off: {:#?}",
                self.story
            );
        }
    }
}
