//! Tidying: every object into the container of its class, until the table is empty or somebody stops it (Fig. 37).

use crate::detector::{DetectError, Detector};
use crate::item::{Class, Item};
use crate::picker::{PickError, Picker, ReleaseMoment, Step};
use crate::stop_request::StopRequest;
use crate::task_event::TaskEvent;
use crate::workcell::Workcell;

/// Options of tidying.
#[derive(Clone, Copy, Debug)]
#[non_exhaustive]
pub struct TidyOptions {
    /// Attempts for each object on the table before the others come first; 2 by default.
    pub attempts: usize,
    /// Maximum number of attempts of a run, as a multiple of the objects that were first seen; 4 by default.
    pub max_attempts_per_object: usize,
}

impl Default for TidyOptions {
    fn default() -> Self {
        Self {
            attempts: 2,
            max_attempts_per_object: 4,
        }
    }
}

/// An error that ends tidying.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum TidyError {
    /// Nothing is known about the table.
    #[error(transparent)]
    Detect(#[from] DetectError),
    /// Arm or hand failed.
    #[error(transparent)]
    Pick(PickError),
}

/// The end of tidying.
#[derive(Debug, Default)]
pub struct TidyReport {
    /// Name of the detector.
    pub detector: &'static str,
    /// Objects that were released above their container.
    pub released: usize,
    /// Attempts to pick an object.
    pub attempts: usize,
    /// Number of the object of each attempt, as the detector gave it, and whether it was released above its container.
    pub log: Vec<(u32, bool)>,
    /// Grasps that closed on nothing.
    pub missed: usize,
    /// Objects that are left on the table, with the reason.
    pub left: Vec<(String, String)>,
    /// True if somebody stopped it.
    pub stopped: bool,
    /// The error that ended it early.
    pub error: Option<TidyError>,
}

/// Maximum number of attempts in a row after which tidying goes on although the arm did not follow.
const MAX_BLOCKED: usize = 2;
/// Distance within which an object of a later detection is the same one, m.
const SAME_PLACE: f64 = 0.03;

/// Attempts at a place.
struct Tried {
    place: [f64; 2],
    count: usize,
    why: String,
}

fn tried<'a>(all: &'a mut Vec<Tried>, item: &Item) -> &'a mut Tried {
    let place = item.pose.translation.vector;
    let near =
        |tried: &Tried| (place.x - tried.place[0]).hypot(place.y - tried.place[1]) < SAME_PLACE;
    let index = all.iter().position(near).unwrap_or_else(|| {
        all.push(Tried {
            place: [place.x, place.y],
            count: 0,
            why: String::new(),
        });
        all.len() - 1
    });
    &mut all[index]
}

/// Detects, picks and places objects until none is left that can be placed.
///
/// The first stop request ends it after the current object, the second at once. Errors are in the report: what was done
/// until then counts.
pub fn tidy<W: Workcell>(
    picker: &mut Picker<W>,
    detector: &mut dyn Detector,
    options: &TidyOptions,
) -> TidyReport {
    let mut report = TidyReport {
        detector: detector.name(),
        ..TidyReport::default()
    };
    match run(picker, detector, options, &mut report) {
        Ok(()) => {}
        Err(TidyError::Detect(DetectError::Stopped)) => report.stopped = true,
        Err(error) => report.error = Some(error),
    }
    let error = report.error.as_ref().map(|error| error as _);
    picker.notify_end(report.stopped, error);
    report
}

/// Returns the number of the container for objects of a class, and its name.
fn container_of(class: Class) -> (usize, &'static str) {
    match class {
        Class::Polygon => (0, "the basket of polygons"),
        Class::Glass => (1, "the basket of glasses"),
        Class::Plate => (2, "the basket of plates"),
    }
}

/// Returns whether the next attempt may follow a failed one, after this many in a row that something blocked.
///
/// An arm that is blocked with an object in the hand keeps it.
fn may_go_on(error: &PickError, blocked: usize) -> bool {
    match error {
        PickError::Blocked { step, .. } => *step != Step::Transport && blocked < MAX_BLOCKED,
        _ => true,
    }
}

type Seen = Result<Vec<Item>, DetectError>;

/// Returns the objects in the order in which they are to be tried: those that were seen during the last release, or else what is
/// detected now.
fn look<W: Workcell>(
    picker: &mut Picker<W>,
    detector: &mut dyn Detector,
    seen: Option<Seen>,
    history: &mut Vec<Tried>,
    report: &TidyReport,
) -> Result<Vec<Item>, TidyError> {
    let found = seen.unwrap_or_else(|| detector.detect())?;
    let mut items: Vec<Item> = found.iter().map(Item::at_rest).collect();
    picker.notify(&TaskEvent::Detected { items: &items });
    picker.notify(&TaskEvent::Progress {
        done: report.released,
        all: report.released + items.len(),
    });
    // What failed comes last; of the rest the highest first, which is in the way of the others.
    items.sort_by(|one, other| {
        let key = |item: &Item, history: &mut Vec<Tried>| tried(history, item).count;
        let (first, second) = (key(one, history), key(other, history));
        first.cmp(&second).then(other.top().total_cmp(&one.top()))
    });
    Ok(items)
}

/// Tries to bring an object into its container, and counts that if the arm moved. `first` skips grasps. `seen` gets what
/// the detector sees during the release.
fn attempt<W: Workcell>(
    picker: &mut Picker<W>,
    item: &Item,
    items: &[Item],
    first: usize,
    detector: &mut dyn Detector,
    seen: &mut Option<Seen>,
    report: &mut TidyReport,
) -> Result<(), PickError> {
    let others = items.iter().filter(|other| other.id != item.id);
    let others: Vec<Item> = others.cloned().collect();
    let (container, destination) = container_of(item.class);
    picker.notify(&TaskEvent::Chosen { item, destination });
    let look = |moment| match moment {
        ReleaseMoment::Arrived => detector.begin_detection(),
        ReleaseMoment::Opening => *seen = Some(detector.finish_detection()),
    };
    let outcome = picker.pick_and_place_with(item, &others, container, first, look);
    if !outcome.as_ref().is_err_and(PickError::moves_nothing) {
        report.attempts += 1;
        report.log.push((item.id, outcome.is_ok()));
    }
    outcome
}

fn run<W: Workcell>(
    picker: &mut Picker<W>,
    detector: &mut dyn Detector,
    options: &TidyOptions,
    report: &mut TidyReport,
) -> Result<(), TidyError> {
    let mut history: Vec<Tried> = Vec::new();
    let mut budget = 0;
    let mut looked_again = false;
    let mut blocked = 0;
    let mut seen = None;
    loop {
        if picker.stop().request() != StopRequest::None {
            report.stopped = true;
            return Ok(());
        }
        let items = look(picker, detector, seen.take(), &mut history, report)?;
        // The arm may hide some at first.
        budget = budget.max(items.len() * options.max_attempts_per_object);
        report.left.clear();
        let mut progress = false;
        for item in &items {
            let before = tried(&mut history, item).count;
            if before >= 2 * options.attempts || report.attempts >= budget {
                let why = tried(&mut history, item).why.clone();
                report.left.push((item.label.clone(), why));
                continue;
            }
            match attempt(picker, item, &items, before, detector, &mut seen, report) {
                Ok(()) => {
                    report.released += 1;
                    progress = true;
                    blocked = 0;
                }
                // Perhaps another object is in the way, or the place where the arm is now.
                Err(error) if error.moves_nothing() => {
                    tracing::info!(%error, "skipped");
                    report.left.push((item.label.clone(), error.to_string()));
                    continue;
                }
                Err(PickError::Stopped { .. }) => {
                    report.stopped = true;
                    return Ok(());
                }
                Err(
                    error @ (PickError::Missed { .. }
                    | PickError::Lost { .. }
                    | PickError::Plan { .. }
                    | PickError::Blocked { .. }),
                ) if may_go_on(&error, blocked) => {
                    tracing::info!(%error, "the attempt failed");
                    report.missed += usize::from(matches!(error, PickError::Missed { .. }));
                    blocked = match error {
                        PickError::Blocked { .. } => blocked + 1,
                        _ => 0,
                    };
                    let entry = tried(&mut history, item);
                    entry.count += 1;
                    entry.why = error.to_string();
                    progress = true;
                }
                Err(error) => return Err(TidyError::Pick(error)),
            }
            break;
        }
        if progress {
            looked_again = false;
            continue;
        }
        // What the arm hides is on the table all the same.
        let moved = !looked_again && picker.clear_view(&items).map_err(TidyError::Pick)?;
        if !moved {
            return Ok(());
        }
        looked_again = true;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::picker::PlanFailure;

    /// It counted as an attempt, and an object was left when the arm stood where no path began.
    #[test]
    fn no_path_to_an_object_moves_nothing_and_none_with_it_does() {
        let plan = |step| PickError::Plan {
            step,
            source: PlanFailure::NoLine,
        };
        assert!(plan(Step::PreGrasp).moves_nothing());
        assert!(!plan(Step::Transport).moves_nothing());
        let item = "box".to_owned();
        assert!(!PickError::Missed { item }.moves_nothing());
    }

    #[test]
    fn a_blocked_arm_ends_the_run_if_it_holds_something_or_stays_blocked() {
        let blocked = |step| PickError::Blocked {
            step,
            joint: 0,
            error: 0.2,
        };
        for step in [Step::PreGrasp, Step::Approach, Step::Lift, Step::Release] {
            assert!(may_go_on(&blocked(step), MAX_BLOCKED - 1));
            assert!(!may_go_on(&blocked(step), MAX_BLOCKED));
        }
        assert!(!may_go_on(&blocked(Step::Transport), 0));
    }
}
