//! An arm under control: the simulator, its controller, and moves.

use std::time::Duration;

use super::{Fault, JointCommand, JointControllers, SafetyMode, Simulator, SimulatorOptions};
use crate::kinematics::{Joints, Pose, Solver, SolverOptions};
use crate::trajectory::{
    JointLimits, StraightLine, StraightLineError, StraightLineOptions, SynchronisedMove,
};
use crate::wam::WamModel;

/// Reasons why a move does not begin.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum MoveError<const N: usize> {
    /// A joint would leave its limits, or a target is not a number.
    #[error("joint {joint} asked for {asked:.3} rad, allowed {min} to {max} rad")]
    OutOfRange {
        /// Counted from 0.
        joint: usize,
        /// rad.
        asked: f64,
        /// rad.
        min: f64,
        /// rad.
        max: f64,
    },
    /// The line cannot be followed.
    #[error(transparent)]
    StraightLine(#[from] StraightLineError<N>),
    /// The safety module does not let the arm move.
    #[error("the arm is not active ({mode:?}{}); press idle and activate on the pendant", because(*fault))]
    NotActive {
        /// The mode.
        mode: SafetyMode,
        /// The fault, if one was the reason.
        fault: Option<Fault>,
    },
}

fn because(fault: Option<Fault>) -> String {
    fault.map_or_else(String::new, |fault| format!(", {fault}"))
}

/// A simulated arm that holds its pose and moves from pose to pose, stepped by its owner.
///
/// A move begins at the present **set point**, as with libbarrett, and takes the place of a running one. When the
/// safety module takes the arm out of active the move is dropped; when it is active again the arm holds its position
/// then. Units are rad and m; see [`wam::units`](crate::wam::wam_units) for degrees.
///
/// ```
/// use std::time::Duration;
/// use yarp_devices::kinematics::Joints;
/// use yarp_devices::simulation::{SimulatedArm, SimulatorOptions};
/// use yarp_devices::trajectory::JointLimits;
/// use yarp_devices::wam::WamModel;
///
/// let mut arm = SimulatedArm::new(WamModel::<7>::new(), SimulatorOptions::default());
/// let target = Joints::<7>::from([0.0, -1.5, 0.0, 2.5, 0.0, 0.0, 0.0]);
/// arm.move_joints(&target, &JointLimits::uniform(0.5, 0.5)).unwrap();
/// arm.finish(Duration::from_secs(1));
/// assert!((arm.measured() - target).amax() < 0.02);
/// ```
#[derive(Clone, Debug)]
pub struct SimulatedArm<const N: usize> {
    simulator: Simulator<N>,
    controller: JointControllers<N>,
    solver: Solver<N>,
    counts: [i32; N],
    set_point: Joints<N>,
    path: Option<Path<N>>,
    /// Posture that lines of the tool keep: that in which the first of them began.
    posture: Option<Joints<N>>,
    floating: bool,
}

#[derive(Clone, Debug)]
enum Path<const N: usize> {
    Joints(SynchronisedMove<N>),
    StraightLine(StraightLine<N>),
}

impl<const N: usize> SimulatedArm<N> {
    /// An arm in its home pose, active, holding.
    pub fn new(model: WamModel<N>, options: SimulatorOptions) -> Self {
        let solver = Solver::with_options(
            model.chain.clone(),
            SolverOptions {
                attempts: 1,
                ..SolverOptions::default()
            },
        );
        let controller = JointControllers::new(model.clone(), options.period);
        let mut simulator = Simulator::new(model, options);
        simulator.safety_mut().press_activate();
        Self {
            counts: simulator.counts(),
            set_point: simulator.angles(),
            simulator,
            controller,
            solver,
            path: None,
            posture: None,
            floating: false,
        }
    }

    /// Starts a move of all joints together.
    ///
    /// Errors: [`MoveError::OutOfRange`], [`MoveError::NotActive`]; then a running move continues.
    pub fn move_joints(
        &mut self,
        target: &Joints<N>,
        limits: &JointLimits<N>,
    ) -> Result<(), MoveError<N>> {
        self.check_active()?;
        self.check_range(target)?;
        let path = SynchronisedMove::new(self.set_point, *target, limits);
        self.path = Some(Path::Joints(path));
        self.posture = None;
        Ok(())
    }

    /// Starts a straight move of the tool; plans it completely before, which takes some milliseconds.
    ///
    /// Successive lines end near the posture in which the first of them began.
    ///
    /// Errors: [`MoveError::StraightLine`], [`MoveError::NotActive`]; then a running move continues.
    pub fn move_line(
        &mut self,
        target: &Pose,
        options: &StraightLineOptions,
    ) -> Result<(), MoveError<N>> {
        self.check_active()?;
        let period = self.simulator.options().period;
        let posture = self.posture.unwrap_or(self.set_point);
        let line = StraightLine::plan_near(
            &self.solver,
            &self.set_point,
            target,
            &posture,
            options,
            period,
        )?;
        self.path = Some(Path::StraightLine(line));
        self.posture = Some(posture);
        Ok(())
    }

    /// Makes these joint angles the set point at once, as a stream of positions does; drops a running move.
    ///
    /// Errors: [`MoveError::OutOfRange`], [`MoveError::NotActive`].
    pub fn follow(&mut self, joints: &Joints<N>) -> Result<(), MoveError<N>> {
        self.check_active()?;
        self.check_range(joints)?;
        self.path = None;
        self.posture = None;
        self.set_point = *joints;
        Ok(())
    }

    /// Lets go of the joints, or holds them where they are: gravity stays compensated, a hand can lead the arm.
    pub fn set_floating(&mut self, floating: bool) {
        self.floating = floating;
        self.hold_here();
    }

    /// Puts the arm into another pose, at rest, as by hand; it holds there.
    pub fn place(&mut self, joints: &Joints<N>) {
        self.simulator.place(joints);
        self.counts = self.simulator.counts();
        self.hold_here();
    }

    fn hold_here(&mut self) {
        self.path = None;
        self.posture = None;
        // Rounding can put a joint at its limit a count outside.
        self.set_point = self.solver.chain().clamp(&self.measured());
        self.controller.reset();
    }

    /// Lets one control period pass.
    pub fn tick(&mut self) {
        if self.simulator.safety().mode() == SafetyMode::Active {
            self.follow_path();
        } else {
            self.hold_here();
        }
        let orders = std::array::from_fn(|joint| {
            if self.floating {
                JointCommand::Float
            } else {
                JointCommand::At(self.set_point[joint])
            }
        });
        let torques = self.controller.step(&self.counts, &orders);
        self.counts = self.simulator.step(Some(&torques));
    }

    fn follow_path(&mut self) {
        let seconds = self.simulator.options().period.as_secs_f64();
        let next = match &mut self.path {
            None => return,
            Some(Path::Joints(path)) => {
                path.advance(seconds);
                (path.joints(), path.is_done())
            }
            Some(Path::StraightLine(line)) => match line.next_joints() {
                Some(joints) => (joints, false),
                None => (self.set_point, true),
            },
        };
        self.set_point = next.0;
        if next.1 {
            self.path = None;
        }
    }

    /// Lets time pass in control periods.
    pub fn run(&mut self, time: Duration) {
        let end = self.simulator.time() + time;
        while self.simulator.time() < end {
            self.tick();
        }
    }

    /// Runs until the present move has ended, and for `settle` longer.
    pub fn finish(&mut self, settle: Duration) {
        while self.is_moving() {
            self.tick();
        }
        self.run(settle);
    }

    /// Returns whether the set point moves.
    pub fn is_moving(&self) -> bool {
        self.path.is_some()
    }

    /// Returns the desired joint positions.
    pub fn set_point(&self) -> Joints<N> {
        self.set_point
    }

    /// Returns the joint positions by the encoders.
    pub fn measured(&self) -> Joints<N> {
        self.controller.measure(&self.counts)
    }

    /// Returns the pose of the tool by the encoders.
    pub fn measured_tool(&self) -> Pose {
        self.solver.chain().forward(&self.measured())
    }

    /// The machine.
    pub fn simulator(&self) -> &Simulator<N> {
        &self.simulator
    }

    /// The machine, to push it and to press buttons.
    pub fn simulator_mut(&mut self) -> &mut Simulator<N> {
        &mut self.simulator
    }

    /// The controller, to change its gains.
    pub fn controller_mut(&mut self) -> &mut JointControllers<N> {
        &mut self.controller
    }

    fn check_range(&self, target: &Joints<N>) -> Result<(), MoveError<N>> {
        for (joint, allowed) in self.solver.chain().limits().iter().enumerate() {
            let asked = target[joint];
            if !allowed.contains(asked) {
                return Err(MoveError::OutOfRange {
                    joint,
                    asked,
                    min: allowed.min,
                    max: allowed.max,
                });
            }
        }
        Ok(())
    }

    fn check_active(&self) -> Result<(), MoveError<N>> {
        let safety = self.simulator.safety();
        match safety.mode() {
            SafetyMode::Active => Ok(()),
            mode => Err(MoveError::NotActive {
                mode,
                fault: safety.fault(),
            }),
        }
    }
}
