//! Tidies random tables in lockstep, with one random fault in each run, and prints what happened:
//! `cargo run -p yarp-manipulation --example tidy_with_faults -- SEED RUNS OBJECTS`.
//!
//! A run has to end with a tidy table or with the reason why it stopped, and an object that was in the hand when the fault
//! came must stay there or reach its basket. Exit code 1 if one run does not.

#[path = "../tests/support/mod.rs"]
mod support;

use std::cell::RefCell;
use std::process::ExitCode;
use std::rc::Rc;

use support::{Intercepted, Interceptor, Shared, SimulatedCell, Truth, is_placed, shared};
use yarp_devices::kinematics::Joints;
use yarp_devices::{Axes, DeviceError, Mode};
use yarp_manipulation::{
    DetectError, Detector, Item, PickError, TidyOptions, Workcell, WorkcellError, tidy,
};
use yarp_table::{Placement, Random, Scene, SimulationOptions, arm_model};

/// Set points that one object takes, about: a fault comes at one of them.
const SET_POINTS: f64 = 600.0;
/// Set points that are lost, 0.4 s, and by which they come late.
const LOST: u64 = 20;
/// Height of an object above the table from which on it was lifted, and distance of its middle from the palm within which
/// it is in the hand, m.
const LIFTED: f64 = 0.03;
const IN_HAND: f64 = 0.25;
/// Time after the end of a run after which a held object counts as held, s.
const HOLDING_TIME: f64 = 5.0;

#[derive(Clone, Copy, Debug, PartialEq)]
enum Fault {
    /// The arm stops itself and holds, as it does when a joint stalls.
    ArmStops,
    /// All joints become idle and stay so.
    EmergencyStop,
    /// An emergency stop that is released a second later: then the joints are in position mode.
    ReleasedStop,
    /// Set points are lost for a while.
    LostSetPoints,
    /// The arm does not answer once.
    ArmSilent,
    /// The hand does not answer its next command.
    HandSilent,
    /// The next detection finds a frozen camera.
    CameraFrozen,
}

const FAULTS: [Fault; 7] = [
    Fault::ArmStops,
    Fault::EmergencyStop,
    Fault::ReleasedStop,
    Fault::LostSetPoints,
    Fault::ArmSilent,
    Fault::HandSilent,
    Fault::CameraFrozen,
];

/// A fault, when it comes, and what it found.
struct Plan {
    fault: Fault,
    /// Set points until the fault.
    after: u64,
    count: u64,
    /// Faults of the hand and the camera that have come and wait for their call.
    pending: bool,
    /// Number of the object that was in the hand.
    held: Option<u32>,
}

type SharedPlan = Rc<RefCell<Plan>>;

/// Arm and hand with a fault.
struct FaultyCell {
    cell: SimulatedCell,
    plan: SharedPlan,
}

fn silent(action: &'static str) -> WorkcellError {
    WorkcellError {
        device: "the simulated table".to_owned(),
        action,
        source: Box::new(DeviceError::NoDataYet { what: "reply" }),
    }
}

fn set_modes(table: &Shared, mode: Mode) {
    let mut table = table.borrow_mut();
    let arm = table.simulation.arm_mut();
    let set = arm.set_control_modes(Axes::All, &[mode; 7]);
    set.expect("the simulated arm is ready");
}

/// Returns the numbers of the objects that are at the palm and `lifted` above the table, m.
fn held(table: &Shared, lifted: f64) -> Vec<u32> {
    let joints = SimulatedCell(table.clone()).joints();
    let joints = joints.expect("the simulation has joints");
    let palm = arm_model().chain.forward(&joints).translation.vector;
    let table = table.borrow();
    let scene = table.simulation.scene();
    let found = scene.objects.iter().filter(|object| {
        let place = object.pose.translation.vector;
        let height = place.z - object.shape.half_height() - scene.table.surface;
        let inside = scene.baskets.iter().any(|basket| basket.contains(&place));
        height > lifted && !inside && (place - palm).norm() < IN_HAND
    });
    found.map(|object| object.id).collect()
}

impl FaultyCell {
    /// Lets the fault come when it is due; returns whether this set point is lost, or the error of the call.
    fn advance(&mut self) -> Result<bool, WorkcellError> {
        let mut plan = self.plan.borrow_mut();
        plan.count += 1;
        if plan.count < plan.after {
            return Ok(false);
        }
        let since = plan.count - plan.after;
        if since == 0 {
            plan.held = held(&self.cell.0, LIFTED).first().copied();
            match plan.fault {
                Fault::ArmStops => set_modes(&self.cell.0, Mode::Position),
                Fault::EmergencyStop | Fault::ReleasedStop => set_modes(&self.cell.0, Mode::Idle),
                Fault::ArmSilent => return Err(silent("command a posture")),
                Fault::HandSilent | Fault::CameraFrozen => plan.pending = true,
                Fault::LostSetPoints => {}
            }
        }
        Ok(plan.fault == Fault::LostSetPoints && since < LOST)
    }
}

impl FaultyCell {
    /// Fails the call of the hand whose turn it is.
    fn answer(&mut self) -> Result<(), WorkcellError> {
        let mut plan = self.plan.borrow_mut();
        if plan.fault == Fault::HandSilent && std::mem::take(&mut plan.pending) {
            plan.held = held(&self.cell.0, LIFTED).first().copied();
            return Err(silent("command the hand"));
        }
        Ok(())
    }
}

impl Interceptor for FaultyCell {
    fn cell(&mut self) -> &mut SimulatedCell {
        &mut self.cell
    }

    fn command(&mut self, joints: &Joints<7>) -> Result<(), WorkcellError> {
        match self.advance()? {
            true => Ok(()),
            false => self.cell.command(joints),
        }
    }

    fn command_hand(&mut self, line: &str) -> Result<String, WorkcellError> {
        self.answer()?;
        self.cell.command_hand(line)
    }

    fn start_hand(&mut self, lines: &[String]) -> Result<(), WorkcellError> {
        self.answer()?;
        self.cell.start_hand(lines)
    }
}

/// The truth, with a fault.
struct FaultyDetector {
    truth: Truth,
    plan: SharedPlan,
}

impl Detector for FaultyDetector {
    fn name(&self) -> &'static str {
        self.truth.name()
    }

    fn detect(&mut self) -> Result<Vec<Item>, DetectError> {
        let mut plan = self.plan.borrow_mut();
        if plan.fault == Fault::CameraFrozen && std::mem::take(&mut plan.pending) {
            return Err(DetectError::Frozen {
                detector: self.truth.name(),
                peer: "/camera".to_owned(),
                seconds: 20.0,
            });
        }
        drop(plan);
        self.truth.detect()
    }
}

/// Returns the numbers of the objects in their baskets.
fn placed(scene: &Scene) -> Vec<u32> {
    let inside = scene
        .objects
        .iter()
        .filter(|object| is_placed(scene, object));
    inside.map(|object| object.id).collect()
}

/// Tidies a table; returns whether the run is as it has to be.
pub fn run(seed: u64, count: usize) -> Result<bool, Box<dyn std::error::Error>> {
    let Ok(scene) = Scene::random(seed, &Placement::default().with_count(count)) else {
        println!("{seed}: no room");
        return Ok(true);
    };
    let mut options = SimulationOptions::default();
    options.seed = seed;
    let table = shared(scene, options);
    table.borrow_mut().step(0.3);
    let mut random = Random::for_purpose(seed, 11);
    let fault = FAULTS[seed as usize % FAULTS.len()];
    let after = 1 + (random.unit() * SET_POINTS * count as f64) as u64;
    let plan = Rc::new(RefCell::new(Plan {
        fault,
        after,
        count: 0,
        pending: false,
        held: None,
    }));
    let mut detector = FaultyDetector {
        truth: Truth {
            table: table.clone(),
            random: Random::for_purpose(seed, 7),
            noise: 0.001,
        },
        plan: plan.clone(),
    };
    let cell = Intercepted(FaultyCell {
        cell: SimulatedCell(table.clone()),
        plan: plan.clone(),
    });
    let mut picker = support::picker(cell)?;
    let report = tidy(&mut picker, &mut detector, &TidyOptions::default());
    let error = report.error.as_ref().map(ToString::to_string);
    if fault == Fault::ReleasedStop && error.is_some() {
        table.borrow_mut().step(1.0);
        set_modes(&table, Mode::Position);
    }
    table.borrow_mut().step(HOLDING_TIME);
    let at_fault = plan.borrow().held;
    // Without power the arm sinks, and what it holds with it.
    let on_table = [Fault::EmergencyStop, Fault::ReleasedStop].contains(&fault);
    let now = held(&table, if on_table { -LIFTED } else { LIFTED });
    let in_baskets = placed(table.borrow().simulation.scene());
    let tidy_table = error.is_none() && report.left.is_empty() && in_baskets.len() == count;
    // A program that is started again must not open a hand that holds something.
    let restarted = match at_fault.filter(|id| now.contains(id)) {
        Some(_) => matches!(
            support::picker(SimulatedCell(table.clone())),
            Err(PickError::HoldsSomething)
        ),
        None => true,
    };
    let kept = at_fault.is_none_or(|id| now.contains(&id) || in_baskets.contains(&id));
    let came = plan.borrow().count >= after;
    let good = (tidy_table || error.is_some()) && kept && restarted;
    println!(
        "{seed}: {fault:?} {}, {} of {count} placed, in the hand then {at_fault:?}, now {now:?}, {} contacts, {:?}, left {:?}, \
         stopped by {error:?}{}",
        if came { "came" } else { "did not come" },
        in_baskets.len(),
        table.borrow().touched,
        table.borrow().simulation.arm().simulator().safety().fault(),
        report.left,
        if good { "" } else { ": WRONG" },
    );
    Ok(good)
}

fn main() -> Result<ExitCode, Box<dyn std::error::Error>> {
    let words: Vec<u64> = std::env::args()
        .skip(1)
        .filter_map(|word| word.parse().ok())
        .collect();
    let number = |index: usize, default: u64| words.get(index).copied().unwrap_or(default);
    let (seed, runs, count) = (number(0, 1), number(1, 7), number(2, 4));
    let mut wrong = 0;
    for seed in seed..seed + runs {
        wrong += usize::from(!run(seed, count as usize)?);
    }
    println!("{runs} runs, {wrong} wrong");
    Ok(ExitCode::from(u8::from(wrong > 0)))
}
