//! Picking one object and placing it: the steps, their failures and what is done about them.
//!
//! | step | failure | recovery |
//! | --- | --- | --- |
//! | plan | no grasp fits, out of reach, no path | nothing has moved; the next grasp, then the next object |
//! | pre-grasp, approach | the arm does not follow | it holds where it is; the next attempt begins there |
//! | lift | the arm does not follow | put the object back, slower each time, twice; then it holds |
//! | transport | the arm does not follow | a new, slower motion from where it is, twice; then it holds and the object stays held |
//! | grasp, verify | the fingers closed on nothing | open, back up; the object is detected again and tried once more |
//! | transport | no free path to the container or place | put the object back where it was |
//! | release | the hand does not open | the arm holds above the container, the object stays held |
//! | any | stop, a device is gone | the arm holds, the hand keeps its grip |
//! | any | emergency stop, fault of the arm | nothing is commanded any more; the hand keeps its grip |

mod motion;
mod plan;

use yarp_devices::kinematics::Joints;
use yarp_devices::wam::WamModel;
use yarp_planning::PlanError;

use self::plan::{Line, PickPlan};
use crate::filling::Filling;
use crate::grasp::{Grasp, GraspOptions, GraspScripts};
use crate::item::{Item, ItemShape};
use crate::low_torque_ik::{PostureError, PostureSolver};
use crate::stop_request::{Stop, StopRequest};
use crate::surroundings::Surroundings;
use crate::task_event::{Observer, TaskEvent};
use crate::workcell::{Workcell, WorkcellError};

/// A step of picking and placing.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub enum Step {
    /// Nothing has moved yet.
    Plan,
    /// To a place above the object.
    PreGrasp,
    /// Down to the object.
    Approach,
    /// Closing the fingers.
    Grasp,
    /// Up with the object.
    Lift,
    /// To the container.
    Transport,
    /// Opening the fingers.
    Release,
}

impl std::fmt::Display for Step {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Plan => "plan",
            Self::PreGrasp => "pre-grasp",
            Self::Approach => "approach",
            Self::Grasp => "grasp",
            Self::Lift => "lift",
            Self::Transport => "transport",
            Self::Release => "release",
        })
    }
}

/// An error of picking and placing.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum PickError {
    /// No grasp fits the object's shape.
    #[error("no grasp fits {item}: it is too wide, or too low for the fingers")]
    NoGrasp {
        /// Label of the object.
        item: String,
    },
    /// No grasp can be reached without collision.
    #[error("none of {count} grasps of {item} is reachable; the last one failed: {last}")]
    Unreachable {
        /// Label of the object.
        item: String,
        /// Number of grasps.
        count: usize,
        /// The last failure.
        last: PlanFailure,
    },
    /// No place above the container can be reached.
    #[error("{step}: {source}")]
    Plan {
        /// The step.
        step: Step,
        /// Reason.
        source: PlanFailure,
    },
    /// The fingers closed on nothing; they are open again, and the arm is back above.
    #[error("the fingers closed on nothing at {item}")]
    Missed {
        /// Label of the object.
        item: String,
    },
    /// The object is no longer between the fingers; they are open.
    #[error("{item} was lost during {step}")]
    Lost {
        /// Label of the object.
        item: String,
        /// The step.
        step: Step,
    },
    /// The arm does not follow; it holds where it is.
    #[error(
        "{step}: joint {joint} is {error:.3} rad away from its set point; something blocks the arm"
    )]
    Blocked {
        /// The step.
        step: Step,
        /// Joint, counted from 0.
        joint: usize,
        /// Distance from the set point, rad.
        error: f64,
    },
    /// The hand holds something that no task here has picked, such as after a task that ended on its way.
    #[error(
        "the hand holds something: take it, open the hand (`GO` in its own language, or by `yarp view --control`), and start again"
    )]
    HoldsSomething,
    /// A stop was requested: the arm holds, the hand keeps its grip.
    #[error("stopped during {step}")]
    Stopped {
        /// The step.
        step: Step,
    },
    /// A device failed; the arm was told to hold.
    #[error("{step}: {source}")]
    Workcell {
        /// The step.
        step: Step,
        /// The failed call.
        source: WorkcellError,
    },
}

impl PickError {
    /// Returns whether the arm has not moved before this error: such an attempt does not count.
    pub(crate) fn moves_nothing(&self) -> bool {
        match self {
            Self::NoGrasp { .. } | Self::Unreachable { .. } => true,
            Self::Plan { step, .. } => *step == Step::PreGrasp,
            _ => false,
        }
    }
}

/// A failure of planning.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum PlanFailure {
    /// No posture.
    #[error(transparent)]
    Posture(#[from] PostureError),
    /// No path.
    #[error(transparent)]
    Path(#[from] PlanError),
    /// The arm cannot follow the straight line of the approach, or would collide on it.
    #[error("no straight approach")]
    NoLine,
}

/// Options of a [`Picker`].
#[derive(Clone, Copy, Debug)]
#[non_exhaustive]
pub struct PickerOptions {
    /// Distances of fingers and palm.
    pub grasp: GraspOptions,
    /// Interval of set points, s of the robot; 20 ms by default.
    pub interval: f64,
    /// Maximum speed of elbow and wrist, m/s; 0.6 by default. The safety module faults at 1.0, and an arm that catches up is faster than planned.
    pub max_speed: f64,
    /// Maximum joint speed, rad/s; 1 by default.
    pub joint_speed: f64,
    /// Maximum joint acceleration, rad/s²; 2 by default.
    pub joint_acceleration: f64,
    /// Difference between set point and measured angle at which the arm counts as blocked, rad; 0.25 by default.
    pub max_tracking_error: f64,
    /// Seed of the planner.
    pub seed: u64,
}

impl Default for PickerOptions {
    fn default() -> Self {
        Self {
            grasp: GraspOptions::default(),
            interval: 0.02,
            max_speed: 0.6,
            joint_speed: 1.0,
            joint_acceleration: 2.0,
            max_tracking_error: 0.25,
            seed: 1,
        }
    }
}

/// Motion of the fingers beyond the expected contact, counts: grip for 2 mm that the object may be elsewhere.
///
/// Fingers that close until they stall go on curling below a light object and turn it.
const GRIP: i32 = 500;
/// Position below which the outer links are steep at the contact and cannot curl below the object, and the grip then, counts.
const STEEP_CONTACT: i32 = 6000;
const STEEP_GRIP: i32 = 1500;
/// Closes the fingers further until they stall; they push on with controlled torque until the next command.
const TORQUE_CLOSE: &str = "GTC";
/// Switches the motors of the fingers off, which keep their grip: torque all the way would heat them.
const KEEP_CLOSED: &str = "GT";
/// Volume of a cuboid from which on it may be as heavy as a full carton, m³.
const HEAVY_VOLUME: f64 = 0.0005;
/// Factor by which motions with an object take longer: acceleration loosens it.
const LOADED: f64 = 1.5;
/// Posture near home with the elbow a little open, and the distance within which the arm counts as at home, rad.
const UNFOLDED: [f64; 7] = [0.0, -1.9, 0.0, 2.7, 0.0, 0.0, 0.0];
const AT_HOME: f64 = 0.2;
/// Strain of a finger above that of the open hand from which on it counts as pressing on something.
const MIN_STRAIN: i32 = 8;
/// Time for which the fingers settle after closing and opening, s.
const GRIP_TIME: f64 = 0.25;

/// Time for which a hot hand rests before its command is repeated, s, and the number of rests before it counts as failed. It
/// takes commands a little below its limit again, and one grasp would bring it there.
const COOLING_TIME: f64 = 90.0;
const MAX_RESTS: usize = 4;
/// Number of motions to the place of an object, or back to where it stood, each slower than the one before, that may be blocked before
/// the arm holds.
const MAX_TRANSPORTS: usize = 3;

/// Returns whether the grip on an object must be firm: a carton that is full slips through fingers that only reach their position. What is
/// light would be turned by fingers that curl below it.
fn may_be_heavy(item: &Item) -> bool {
    matches!(item.shape, ItemShape::Cuboid { size } if size.iter().product::<f64>() >= HEAVY_VOLUME)
}

/// Difference of the spread that does not matter, counts.
const SAME_SPREAD: i32 = 20;

/// Returns the command that opens the fingers after a grasp.
fn opening(grasp: &Grasp) -> String {
    format!("GM {}", grasp.released())
}

/// Asks the hand which clutches hold.
const CLUTCHES: &str = "FGET BD";

/// Returns whether fingers on both sides have met something, by the reply to [`CLUTCHES`]; `None` if the hand does not tell.
fn is_held(reply: &str) -> Option<bool> {
    let flags: Vec<bool> = reply
        .split_whitespace()
        .filter_map(|word| word.parse::<i32>().ok())
        .map(|flag| flag != 0)
        .collect();
    match flags[..] {
        [one, two, three, ..] => Some(three && (one || two)),
        _ => None,
    }
}

/// Moments of a release above a container.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub enum ReleaseMoment {
    /// The arm has come to its place.
    Arrived,
    /// The hand opens, and is waited for after this moment.
    Opening,
}

/// Picks and places objects with one arm and hand.
#[derive(Debug)]
pub struct Picker<W> {
    cell: W,
    model: WamModel<7>,
    solver: PostureSolver,
    surroundings: Surroundings,
    options: PickerOptions,
    scripts: GraspScripts,
    stop: Stop,
    /// Posture that the arm was sent to last, without correction.
    at: Joints<7>,
    /// Correction of the set point that brings the arm there, rad.
    correction: Joints<7>,
    /// Position of the spread, counts.
    spread: i32,
    /// Commands that the hand may still be carrying out.
    started: Vec<String>,
    plans: u64,
    /// Of each container, in the order of the surroundings.
    fillings: [Filling; 3],
    /// Strain of the open fingers.
    unstrained: [i32; 3],
    observer: Observer,
}

impl<W: Workcell> Picker<W> {
    /// Returns a picker for an arm whose model includes the hand as a load.
    ///
    /// Errors: [`PickError::Workcell`] if arm or hand are not ready, [`PickError::HoldsSomething`].
    pub fn new(
        mut cell: W,
        model: WamModel<7>,
        surroundings: Surroundings,
        options: PickerOptions,
        stop: Stop,
    ) -> Result<Self, PickError> {
        let step = Step::Plan;
        let failed = |source| PickError::Workcell { step, source };
        cell.prepare().map_err(failed)?;
        // Encoders read a little beyond a limit at which the arm rests.
        let at = model.chain.clamp(&cell.joints().map_err(failed)?);
        let spread = cell.fingers().map_err(failed)?[3] as i32;
        // The first motion of the hand would drop it, wherever the arm is.
        if is_held(&cell.command_hand(CLUTCHES).map_err(failed)?) == Some(true) {
            return Err(PickError::HoldsSomething);
        }
        let mut options = options;
        options.grasp.surface = surroundings.surface;
        let fillings = surroundings.containers.map(Filling::new);
        Ok(Self {
            solver: PostureSolver::new(&model),
            cell,
            model,
            surroundings,
            options,
            scripts: GraspScripts::default(),
            stop,
            at,
            correction: Joints::<7>::zeros(),
            spread,
            started: Vec::new(),
            plans: 0,
            fillings,
            unstrained: [0; 3],
            observer: Observer::default(),
        })
    }

    /// Prefers the grasps of an object database to those that follow from shapes.
    pub fn prefer_scripts(&mut self, scripts: GraspScripts) {
        self.scripts = scripts;
    }

    /// Calls `callback` for each event of the tasks that use this picker, in their thread: it must not block.
    pub fn observe(&mut self, callback: impl FnMut(&TaskEvent<'_>) + Send + 'static) {
        self.observer = Observer::new(callback);
    }

    pub(crate) fn notify(&mut self, event: &TaskEvent<'_>) {
        self.observer.notify(event);
    }

    /// Announces the end of a task.
    pub(crate) fn notify_end(&mut self, stopped: bool, error: Option<&dyn std::error::Error>) {
        let error = error.map(ToString::to_string);
        let error = error.as_deref();
        self.notify(&TaskEvent::Ended { stopped, error });
    }

    /// Returns arm and hand.
    pub fn cell(&mut self) -> &mut W {
        &mut self.cell
    }

    /// Returns the stop button.
    pub fn stop(&self) -> &Stop {
        &self.stop
    }

    /// Returns table and containers.
    pub fn surroundings(&self) -> &Surroundings {
        &self.surroundings
    }

    /// Returns what is in a container, by its number, as far as it is known.
    pub fn filling(&self, container: usize) -> &Filling {
        &self.fillings[container]
    }

    /// Picks `item` and drops it into a container, where what was released before lies lowest.
    ///
    /// `others` are the other objects on the table. `first` skips grasps: 0 begins with the preferred one.
    ///
    /// `container` is its number, below 3. Errors: [`PickError`].
    pub fn pick_and_place(
        &mut self,
        item: &Item,
        others: &[Item],
        container: usize,
        first: usize,
    ) -> Result<(), PickError> {
        self.pick_and_place_with(item, others, container, first, |_| ())
    }

    /// Picks and places as [`pick_and_place`](Self::pick_and_place), and calls `meanwhile` at each moment of the release, in which the arm
    /// is out of the view of cameras above the table. It is not called after an error.
    pub fn pick_and_place_with(
        &mut self,
        item: &Item,
        others: &[Item],
        container: usize,
        first: usize,
        meanwhile: impl FnMut(ReleaseMoment),
    ) -> Result<(), PickError> {
        let outcome = self.try_pick_and_place(item, others, container, first, meanwhile);
        self.hold_after(&outcome);
        outcome
    }

    /// Holds an arm that does not follow: the next motion begins where it is.
    fn hold_here(&mut self, step: Step) -> Result<(), PickError> {
        let failed = |source| PickError::Workcell { step, source };
        if self.cell.hold().is_err() {
            self.cell.resume().map_err(failed)?;
            self.cell.hold().map_err(failed)?;
        }
        let joints = self.cell.joints().map_err(failed)?;
        self.at = self.model.chain.clamp(&joints);
        self.correction = Joints::<7>::zeros();
        Ok(())
    }

    fn try_pick_and_place(
        &mut self,
        item: &Item,
        others: &[Item],
        container: usize,
        first: usize,
        mut meanwhile: impl FnMut(ReleaseMoment),
    ) -> Result<(), PickError> {
        let plan = self.pick(item, others, first, true)?;
        let planned = self.plan_transport(item, others, &plan.grasp, container);
        let (transport, mut spot) = match planned {
            Ok(transport) => transport,
            Err(error) => return Err(self.put_back(&plan).err().unwrap_or(error)),
        };
        let mut carried = self.carry(&transport.slowed(LOADED), Step::Transport);
        for transports in 1..MAX_TRANSPORTS {
            let Err(PickError::Blocked { .. }) = carried else {
                break;
            };
            self.hold_here(Step::Transport)?;
            let again = self.plan_transport(item, others, &plan.grasp, container);
            let Ok((transport, other)) = again else {
                return carried;
            };
            spot = other;
            let slower = transport.slowed(LOADED * (1 + transports) as f64);
            carried = self.carry(&slower, Step::Transport);
        }
        if let Err(PickError::Blocked { .. }) = carried {
            // An object that fell may be what is in the way.
            self.hold_here(Step::Transport)?;
            self.check_held(item, &plan.grasp, Step::Transport)?;
        }
        carried?;
        meanwhile(ReleaseMoment::Arrived);
        self.settle(Step::Transport)?;
        self.check_held(item, &plan.grasp, Step::Transport)?;
        self.fillings[container].add(&spot, item.shape.height());
        let step = Step::Release;
        self.start_hand(step, vec![opening(&plan.grasp)])?;
        meanwhile(ReleaseMoment::Opening);
        self.finish_hand(step)?;
        self.pause(GRIP_TIME, step)
    }

    /// Picks `item` and sets it down on the table with its middle at `place`, m, where its sides are along x and y.
    ///
    /// `others` are the other objects on the table. `first` skips grasps: 0 begins with the preferred one. Without a path to
    /// the place the object is put back where it was. Errors: [`PickError`].
    pub fn pick_and_set_down(
        &mut self,
        item: &Item,
        others: &[Item],
        place: [f64; 2],
        first: usize,
    ) -> Result<(), PickError> {
        let outcome = self.try_pick_and_set_down(item, others, place, first);
        self.hold_after(&outcome);
        outcome
    }

    fn try_pick_and_set_down(
        &mut self,
        item: &Item,
        others: &[Item],
        place: [f64; 2],
        first: usize,
    ) -> Result<(), PickError> {
        let plan = self.pick(item, others, first, false)?;
        let planned = self.plan_set_down(item, others, &plan.grasp, place);
        let set_down = match planned {
            Ok(set_down) => set_down,
            Err(error) => return Err(self.put_back(&plan).err().unwrap_or(error)),
        };
        self.carry(&set_down.transport.slowed(LOADED), Step::Transport)?;
        self.settle(Step::Transport)?;
        self.check_held(item, &plan.grasp, Step::Transport)?;
        self.carry(&set_down.line.down.slowed(LOADED), Step::Release)?;
        self.leave(&plan.grasp, &set_down.line)
    }

    /// Lets the arm hold where it is after an error that leaves it on its way, and announces the error; the first error is the one to
    /// report.
    fn hold_after(&mut self, outcome: &Result<(), PickError>) {
        match outcome {
            Err(PickError::Workcell { .. } | PickError::Stopped { .. }) => {
                let _ = self.cell.hold();
            }
            Err(PickError::Blocked { step, .. }) => {
                let _ = self.hold_here(*step);
            }
            _ => {}
        }
        if let Err(error) = outcome {
            let reason = &error.to_string();
            self.notify(&TaskEvent::Failed { reason });
        }
    }

    /// Sets an object that was picked down where it was.
    fn put_back(&mut self, plan: &PickPlan) -> Result<(), PickError> {
        self.follow(&plan.line.down, Step::Release)?;
        self.leave(&plan.grasp, &plan.line)
    }

    /// Leaves an object at the lower end of a line.
    fn leave(&mut self, grasp: &Grasp, line: &Line) -> Result<(), PickError> {
        self.settle(Step::Release)?;
        self.let_go(grasp, Step::Release)?;
        self.follow(&line.up, Step::Release)
    }

    /// Closes the fingers, and looks into the containers meanwhile if the object will be released into one: here the arm is not in
    /// their way.
    fn close(&mut self, contact: i32, into_container: bool) -> Result<(), PickError> {
        let step = Step::Grasp;
        let grip = match contact < STEEP_CONTACT {
            true => STEEP_GRIP,
            false => GRIP,
        };
        self.start_hand(step, vec![format!("GM {}", contact + grip)])?;
        if into_container {
            let points = self.call(step, Workcell::look_into_containers)?;
            for filling in &mut self.fillings {
                filling.measure(&points);
            }
        }
        self.finish_hand(step)?;
        self.pause(GRIP_TIME, step)
    }

    /// Grasps an object and lifts it. `into_container`: it will be released into one.
    fn pick(
        &mut self,
        item: &Item,
        others: &[Item],
        first: usize,
        into_container: bool,
    ) -> Result<PickPlan, PickError> {
        self.begin(Step::Plan);
        let items: Vec<Item> = others.iter().chain([item]).cloned().collect();
        self.unfold(&items)?;
        self.back_up(&items)?;
        let plan = self.plan_pick(item, others, first)?;
        self.approach(item, others, &plan)?;
        // Fingers that come down a few millimetres beside their place may land on the object.
        self.settle(Step::PreGrasp)?;
        self.carry(&plan.line.down, Step::Approach)?;
        self.settle(Step::Approach)?;
        self.begin(Step::Grasp);
        self.unstrained = self.strains(Step::Grasp)?;
        self.close(plan.grasp.contact, into_container)?;
        if self.is_empty(Step::Grasp)? {
            self.let_go(&plan.grasp, Step::Grasp)?;
            self.follow(&plan.line.up, Step::Lift)?;
            let item = item.label.clone();
            return Err(PickError::Missed { item });
        }
        if may_be_heavy(item) {
            self.hand(Step::Grasp, TORQUE_CLOSE)?;
            self.pause(GRIP_TIME, Step::Grasp)?;
        }
        let lifted = self.follow(&plan.line.up.slowed(LOADED), Step::Lift);
        if let Err(blocked @ PickError::Blocked { .. }) = lifted {
            self.lower(plan.line.down.end())?;
            self.let_go(&plan.grasp, Step::Release)?;
            self.follow(&plan.line.up, Step::Release)?;
            return Err(blocked);
        }
        lifted?;
        // The correction contains the weight from here on.
        self.settle(Step::Lift)?;
        self.check_held(item, &plan.grasp, Step::Lift)?;
        if may_be_heavy(item) {
            self.hand(Step::Lift, KEEP_CLOSED)?;
        }
        Ok(plan)
    }

    /// Brings an object that is blocked in its lift down again; an arm that is blocked on this way, too, tries it slower.
    fn lower(&mut self, end: Joints<7>) -> Result<(), PickError> {
        let mut outcome = Ok(());
        for tries in 1..=MAX_TRANSPORTS {
            self.hold_here(Step::Lift)?;
            let Some(back) = self.timed(vec![self.at, end]) else {
                return Ok(());
            };
            outcome = self.follow(&back.slowed(LOADED * tries as f64), Step::Transport);
            if !matches!(outcome, Err(PickError::Blocked { .. })) {
                break;
            }
        }
        outcome
    }

    /// Returns the readings of the strain gauges of F1, F2 and F3; zeros if the hand has none.
    fn strains(&mut self, step: Step) -> Result<[i32; 3], PickError> {
        let reply = self.hand(step, "GFGET SG")?;
        let numbers: Vec<i32> = reply
            .split_whitespace()
            .filter_map(|word| word.parse().ok())
            .collect();
        tracing::debug!(?numbers, %step, "strain");
        Ok(match numbers[..] {
            [one, two, three] => [one, two, three],
            _ => [0; 3],
        })
    }

    /// Opens the hand and reports a loss if no finger presses on anything.
    fn check_held(&mut self, item: &Item, grasp: &Grasp, step: Step) -> Result<(), PickError> {
        let now = self.strains(step)?;
        let presses = |finger: usize| now[finger] - self.unstrained[finger] >= MIN_STRAIN;
        if now == [0; 3] || (0..3).any(presses) {
            return Ok(());
        }
        self.let_go(grasp, step)?;
        let item = item.label.clone();
        Err(PickError::Lost { item, step })
    }

    /// Unfolds an arm whose parts are closer to each other than planned motions come, such as at home or on its way from there.
    fn unfold(&mut self, items: &[Item]) -> Result<(), PickError> {
        match self.plan_unfold(items) {
            Some(motion) => self.follow(&motion, Step::PreGrasp),
            None => Ok(()),
        }
    }

    /// Moves the arm out of the view of cameras above the table, with an empty hand; returns whether it moved.
    ///
    /// An arm that finds no path stays. Errors: [`PickError`].
    pub fn clear_view(&mut self, items: &[Item]) -> Result<bool, PickError> {
        let unfolded = Joints::<7>::from(UNFOLDED);
        let at_home = (self.at - self.model.home).amax() <= AT_HOME;
        if at_home || (self.at - unfolded).amax() <= AT_HOME {
            return Ok(false);
        }
        let outcome = self.try_clear_view(items, &unfolded);
        if outcome.is_err() {
            // The first error is the one to report.
            let _ = self.cell.hold();
        }
        outcome
    }

    fn try_clear_view(&mut self, items: &[Item], to: &Joints<7>) -> Result<bool, PickError> {
        self.unfold(items)?;
        self.back_up(items)?;
        // As planned.
        self.hand(Step::PreGrasp, "GO")?;
        match self.plan_retreat(items, to) {
            Ok(motion) => self.follow(&motion, Step::PreGrasp).map(|()| true),
            Err(error) => {
                tracing::info!(%error, "the arm stays in view");
                Ok(false)
            }
        }
    }

    /// Raises a hand that is nearer to an object than planned motions begin, such as beside one that fell.
    fn back_up(&mut self, items: &[Item]) -> Result<(), PickError> {
        match self.plan_back_up(items) {
            Some(motion) => self.follow(&motion, Step::PreGrasp),
            None => Ok(()),
        }
    }

    /// Moves above the object and brings spread and fingers into the shape of the grasp: on the way, where every shape in between has
    /// room, and before it otherwise.
    fn approach(&mut self, item: &Item, others: &[Item], plan: &PickPlan) -> Result<(), PickError> {
        let grasp = &plan.grasp;
        let transit = self.plan_transit(item, others, plan)?;
        // A hand that is busy with commands of an attempt that failed does not tell its positions.
        self.finish_hand(Step::Plan)?;
        let before = self.call(Step::Plan, Workcell::fingers)?;
        // Opening clears what the clutches reported.
        let mut lines = vec!["GO".to_owned()];
        if (self.spread - grasp.spread).abs() > SAME_SPREAD {
            lines.push(format!("SM {}", grasp.spread));
        }
        lines.push(format!("GM {}", grasp.open));
        let items = others.iter().chain([item]);
        let on_the_way = self.has_room_to_shape(&transit, &before, grasp, items);
        self.start_hand(Step::Plan, lines)?;
        self.spread = grasp.spread;
        if !on_the_way {
            self.finish_hand(Step::Plan)?;
        }
        self.follow(&transit, Step::PreGrasp)?;
        self.finish_hand(Step::PreGrasp)
    }

    /// Announces a step in which the arm rests.
    fn begin(&mut self, step: Step) {
        self.notify(&TaskEvent::Step { step, path: &[] });
    }

    fn let_go(&mut self, grasp: &Grasp, step: Step) -> Result<(), PickError> {
        self.hand(step, &opening(grasp))?;
        self.pause(GRIP_TIME, step)
    }

    /// Returns whether the fingers closed without meeting anything: the clutch of F3, or those of F1 and F2, held.
    fn is_empty(&mut self, step: Step) -> Result<bool, PickError> {
        let reply = self.hand(step, CLUTCHES)?;
        tracing::debug!(reply, %step, "clutches");
        // A hand that does not tell is not trusted to hold anything.
        Ok(is_held(&reply) != Some(true))
    }

    fn hand(&mut self, step: Step, line: &str) -> Result<String, PickError> {
        self.check_stop(step)?;
        // A started command of an attempt that failed.
        self.finish_hand(step)?;
        self.with_rests(step, |cell, _| cell.command_hand(line))
    }

    /// Starts commands of the hand, which carries them out while the arm moves.
    fn start_hand(&mut self, step: Step, lines: Vec<String>) -> Result<(), PickError> {
        self.check_stop(step)?;
        self.finish_hand(step)?;
        self.call(step, |cell| cell.start_hand(&lines))?;
        self.started = lines;
        Ok(())
    }

    /// Waits for the end of started commands; a hand that became too hot gets all of them again when it has cooled down.
    fn finish_hand(&mut self, step: Step) -> Result<(), PickError> {
        let lines = std::mem::take(&mut self.started);
        self.with_rests(step, |cell, rests| {
            if rests > 0 {
                cell.start_hand(&lines)?;
            }
            cell.finish_hand()
        })
    }

    /// Repeats commands that a hot hand refused, when it has cooled down; `command` gets the number of rests so far.
    fn with_rests<R>(
        &mut self,
        step: Step,
        mut command: impl FnMut(&mut W, usize) -> Result<R, WorkcellError>,
    ) -> Result<R, PickError> {
        let mut rests = 0;
        loop {
            match command(&mut self.cell, rests) {
                Ok(reply) => return Ok(reply),
                // Fingers without current keep their grip.
                Err(error) if error.is_overheated() && rests < MAX_RESTS => {
                    tracing::info!(%error, %step, "waiting until the hand has cooled down");
                    self.pause(COOLING_TIME, step)?;
                    rests += 1;
                }
                Err(source) => return Err(PickError::Workcell { step, source }),
            }
        }
    }

    fn check_stop(&self, step: Step) -> Result<(), PickError> {
        match self.stop.request() {
            StopRequest::Now => Err(PickError::Stopped { step }),
            StopRequest::None | StopRequest::AfterObject => Ok(()),
        }
    }
}
