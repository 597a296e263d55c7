//! Arm, hand and bodies together, stepped by their owner.

use std::time::Duration;

use nalgebra::{Matrix3, Vector3};
use yarp_devices::dynamics::Body;
use yarp_devices::hand::gcl::Motor;
use yarp_devices::hand::simulated::Firmware;
use yarp_devices::kinematics::Joints;
use yarp_devices::simulation::SimulatorOptions;
use yarp_devices::wam::{DynamicArm, WamModel};

use crate::physics::{Physics, RobotState, STEP};
use crate::simulated_robot::{HandPosture, RobotPosture};
use crate::{Pose, Scene};

/// Mass of the BH8-262, its centre of mass beyond the tool plate, and its inertia (owd `WAM.cc`, btclient `WAM7.conf`).
const HAND_MASS: f64 = 1.2;
const HAND_CENTRE: f64 = 0.045;
const HAND_INERTIA: [f64; 3] = [2558.1e-6, 2558.1e-6, 1242.2e-6];

/// Timeout of a command of the hand, s.
const LONGEST_COMMAND: f64 = 15.0;

/// Returns the arm with a BarrettHand on its tool plate, which gravity compensation knows.
pub fn arm_model() -> WamModel<7> {
    WamModel::<7>::new().with_load(Body {
        mass: HAND_MASS,
        centre: Vector3::new(0.0, 0.0, HAND_CENTRE),
        inertia: Matrix3::from_diagonal(&Vector3::from(HAND_INERTIA)),
    })
}

/// Options of a simulation.
#[derive(Clone, Debug, Default)]
#[non_exhaustive]
pub struct SimulationOptions {
    /// Joint angles at the start, rad; `None` folds the arm at home.
    pub joints: Option<[f64; 7]>,
    /// Seed of the friction in the arm's joints.
    pub seed: u64,
}

/// A table with arm and hand that nobody but its owner steps: as fast as the machine allows, and the same every time.
///
/// ```
/// use std::time::Duration;
/// use yarp_table::{Finish, Scene, Shape, SimulationOptions, TableSimulation};
///
/// let mut scene = Scene::empty();
/// let cube = Shape::Box { size: [0.05, 0.05, 0.05] };
/// scene.put(cube, 0.5, 0.0, 0.0, Finish::default());
/// scene.objects[0].pose.translation.z += 0.02;
/// let mut table = TableSimulation::new(scene, SimulationOptions::default());
/// table.run(Duration::from_millis(500));
/// // It fell back onto the table.
/// let height = table.scene().objects[0].pose.translation.z;
/// assert!((height - -0.025).abs() < 0.001);
/// ```
#[derive(Debug)]
pub struct TableSimulation {
    scene: Scene,
    arm: DynamicArm,
    hand: Firmware,
    physics: Physics,
    steps: u64,
}

impl TableSimulation {
    /// Creates arm and hand beside the table of this scene, the arm in position mode, the hand initialised and open.
    pub fn new(mut scene: Scene, options: SimulationOptions) -> Self {
        let simulator = SimulatorOptions {
            period: STEP,
            seed: options.seed,
            ..SimulatorOptions::default()
        };
        let mut arm = DynamicArm::new(arm_model(), simulator);
        if let Some(joints) = options.joints {
            arm.place(&Joints::<7>::from(joints));
        }
        let hand = initialised();
        scene.robot = Some(RobotPosture {
            joints: arm.simulator().angles(),
            hand: Some(HandPosture::default()),
        });
        let physics = Physics::new(&scene);
        Self {
            scene,
            arm,
            hand,
            physics,
            steps: 0,
        }
    }

    /// Lets one control period of 2 ms pass.
    pub fn step(&mut self) {
        self.arm.tick();
        self.hand.advance(STEP.as_secs_f64());
        let state = RobotState {
            joints: self.arm.simulator().angles(),
            hand: Some((self.hand.positions(), self.hand.clutches())),
        };
        let reaction = self.physics.step(&mut self.scene, &state);
        self.arm
            .simulator_mut()
            .set_contact_torques(reaction.torques);
        for (motor, load) in [Motor::F1, Motor::F2, Motor::F3]
            .into_iter()
            .zip(reaction.loads)
        {
            self.hand.set_load(motor, load);
        }
        self.steps += 1;
    }

    /// Lets time pass.
    pub fn run(&mut self, time: Duration) {
        let end = self.time() + time;
        while self.time() < end {
            self.step();
        }
    }

    /// Sends a command line to the hand and runs until it answers; returns the answer.
    ///
    /// A hand that does not answer within 15 s gives what it has said so far.
    pub fn command_hand(&mut self, line: &str) -> String {
        self.hand.receive(line.as_bytes());
        self.hand.receive(b"\r");
        let mut said = self.hand.take_output();
        let end = self.time() + Duration::from_secs_f64(LONGEST_COMMAND);
        while self.hand.is_busy() && self.time() < end {
            self.step();
            said.extend(self.hand.take_output());
        }
        String::from_utf8_lossy(&said).into_owned()
    }

    /// Returns how long it has run.
    pub fn time(&self) -> Duration {
        STEP * u32::try_from(self.steps).unwrap_or(u32::MAX)
    }

    /// Returns the scene as it is now.
    pub fn scene(&self) -> &Scene {
        &self.scene
    }

    /// Puts an object somewhere else, at rest, by its place in the scene.
    pub fn place(&mut self, index: usize, pose: Pose) {
        self.physics.place(&mut self.scene, index, pose);
    }

    /// Returns the bodies.
    pub fn physics(&self) -> &Physics {
        &self.physics
    }

    /// Returns the arm.
    pub fn arm(&self) -> &DynamicArm {
        &self.arm
    }

    /// Returns the arm, to command it.
    pub fn arm_mut(&mut self) -> &mut DynamicArm {
        &mut self.arm
    }

    /// Returns the hand: its processor and motors.
    pub fn hand(&self) -> &Firmware {
        &self.hand
    }

    /// Returns the hand, to send it bytes.
    pub fn hand_mut(&mut self) -> &mut Firmware {
        &mut self.hand
    }
}

/// A hand that is switched on, initialised and open.
fn initialised() -> Firmware {
    let mut hand = Firmware::new();
    hand.advance(1.0);
    hand.receive(b"HI\r");
    for _ in 0..1000 {
        if !hand.is_busy() {
            break;
        }
        hand.advance(0.02);
    }
    hand.take_output();
    hand
}
