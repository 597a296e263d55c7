//! Reordering: each object into the slot that was commanded for it, until all are there or somebody stops it.

use std::collections::BTreeMap;

use crate::detector::{DetectError, Detector};
use crate::item::Item;
use crate::picker::{PickError, Picker, Step};
use crate::slot_grid::{SlotGrid, distance};
use crate::stop_request::StopRequest;
use crate::task_event::TaskEvent;
use crate::workcell::Workcell;

/// Slots that were commanded, by the number of the object.
pub type SlotOrders = BTreeMap<u32, usize>;

/// Options of reordering.
#[derive(Clone, Copy, Debug)]
#[non_exhaustive]
pub struct ReorderOptions {
    /// The slots.
    pub grid: SlotGrid,
    /// Maximum number of failed attempts for each object; 3 by default.
    pub attempts: usize,
    /// Smallest distance between objects that stand beside each other, m: room for the fingers.
    pub gap: f64,
}

impl Default for ReorderOptions {
    fn default() -> Self {
        Self {
            grid: SlotGrid::default(),
            attempts: 3,
            gap: 0.05,
        }
    }
}

/// An error that ends reordering.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ReorderError {
    /// Nothing is known about the table.
    #[error(transparent)]
    Detect(#[from] DetectError),
    /// Arm or hand failed.
    #[error(transparent)]
    Pick(PickError),
}

/// The end of reordering.
#[derive(Debug, Default)]
pub struct ReorderReport {
    /// Name of the detector.
    pub detector: &'static str,
    /// Attempts to move an object.
    pub attempts: usize,
    /// Objects that were set down in their slots.
    pub set_down: usize,
    /// Objects that were set down elsewhere, to make room.
    pub set_aside: usize,
    /// Number of the object of each attempt, and whether it was set down.
    pub log: Vec<(u32, bool)>,
    /// Objects that are not in their slots, with the reason.
    pub left: Vec<(u32, String)>,
    /// True if somebody stopped it.
    pub stopped: bool,
    /// The error that ended it early.
    pub error: Option<ReorderError>,
}

/// Maximum number of objects that are set aside, as a multiple of those on the table.
const MAX_ASIDE: usize = 4;

/// A source of orders: the slots that objects shall stand in.
pub trait SlotCommander {
    /// Returns the slot of each object; objects without one stay where they are unless they are in the way.
    ///
    /// `items` are the objects on the table now.
    fn orders(&mut self, items: &[Item]) -> SlotOrders;

    /// Waits for other orders once all are carried out; `false` ends reordering.
    fn wait(&mut self) -> bool;
}

/// Orders that do not change: objects in the order of their classes and numbers, from slot 0 on.
#[derive(Clone, Debug, Default)]
pub struct ByClass {
    orders: Option<SlotOrders>,
    slots: usize,
}

impl ByClass {
    /// Returns the orders for a grid; objects beyond its slots stay where they are.
    pub fn new(grid: &SlotGrid) -> Self {
        Self {
            orders: None,
            slots: grid.len(),
        }
    }
}

impl SlotCommander for ByClass {
    fn orders(&mut self, items: &[Item]) -> SlotOrders {
        let slots = self.slots;
        let first = || {
            let mut numbers: Vec<_> = items.iter().map(|item| (item.class, item.id)).collect();
            numbers.sort_by_key(|(class, id)| (*class as u8, *id));
            let numbers = numbers.into_iter().map(|(_, id)| id);
            numbers.zip(0..slots).collect()
        };
        self.orders.get_or_insert_with(first).clone()
    }

    fn wait(&mut self) -> bool {
        false
    }
}

/// Moves objects until each is in its slot.
///
/// An object whose slot is taken waits for the one that stands there; where all wait for each other, one is set aside. The first
/// stop request ends it after the current object, the second at once. Errors are in the report.
pub fn reorder<W: Workcell>(
    picker: &mut Picker<W>,
    detector: &mut dyn Detector,
    commander: &mut dyn SlotCommander,
    options: &ReorderOptions,
) -> ReorderReport {
    let mut report = ReorderReport {
        detector: detector.name(),
        ..ReorderReport::default()
    };
    match run(picker, detector, commander, options, &mut report) {
        Ok(()) => {}
        Err(ReorderError::Detect(DetectError::Stopped)) => report.stopped = true,
        Err(error) => report.error = Some(error),
    }
    let error = report.error.as_ref().map(|error| error as _);
    picker.notify_end(report.stopped, error);
    report
}

fn run<W: Workcell>(
    picker: &mut Picker<W>,
    detector: &mut dyn Detector,
    commander: &mut dyn SlotCommander,
    options: &ReorderOptions,
    report: &mut ReorderReport,
) -> Result<(), ReorderError> {
    // Failures of each object for its order, and of all since something was moved.
    let mut failures: BTreeMap<u32, (usize, usize)> = BTreeMap::new();
    let mut fruitless = 0;
    loop {
        if picker.stop().request() != StopRequest::None {
            report.stopped = true;
            return Ok(());
        }
        let items: Vec<Item> = detector.detect()?.iter().map(Item::at_rest).collect();
        picker.notify(&TaskEvent::Detected { items: &items });
        let mut orders = commander.orders(&items);
        let in_place = |(id, slot): (&u32, &usize)| {
            let mut all = items.iter();
            let item = all.find(|item| item.id == *id);
            item.is_some_and(|item| options.grid.slot_at(place_of(item)) == Some(*slot))
        };
        picker.notify(&TaskEvent::Progress {
            done: orders.iter().filter(|order| in_place(*order)).count(),
            all: orders.len(),
        });
        failures.retain(|id, (slot, _)| orders.get(id) == Some(slot));
        orders.retain(|id, _| {
            let failed = failures.get(id).map_or(0, |(_, count)| *count);
            failed < options.attempts
        });
        let moves = next_moves(&items, &orders, options);
        let most_aside = MAX_ASIDE * items.len();
        let gives_up = fruitless >= options.attempts * items.len() || report.set_aside > most_aside;
        if moves.is_empty() || gives_up {
            // What the arm hides is on the table all the same.
            if picker.clear_view(&items).map_err(ReorderError::Pick)? {
                continue;
            }
            if commander.wait() {
                (fruitless, report.set_aside) = (0, 0);
                continue;
            }
            return Ok(());
        }
        report.left.clear();
        for next in moves {
            let attempt = carry_out(picker, &items, &next, options, report)?;
            match attempt {
                Attempt::SetDown => {
                    fruitless = 0;
                    break;
                }
                Attempt::Stopped => return Ok(()),
                Attempt::Failed | Attempt::NothingMoved => fruitless += 1,
            }
            let slot = orders.get(&next.id).copied().unwrap_or(usize::MAX);
            let entry = failures.entry(next.id).or_insert((slot, 0));
            entry.1 += 1;
            if matches!(attempt, Attempt::Failed) {
                // The next move begins with what is on the table now.
                break;
            }
        }
    }
}

/// Returns whether the arm was blocked on the way: then it keeps the object in the hand.
fn keeps_object(error: &PickError) -> bool {
    matches!(
        error,
        PickError::Blocked {
            step: Step::Transport,
            ..
        }
    )
}

/// The end of a move that is no error.
enum Attempt {
    SetDown,
    /// The object may be elsewhere now.
    Failed,
    /// Perhaps another object can go first.
    NothingMoved,
    Stopped,
}

/// Carries a move out.
fn carry_out<W: Workcell>(
    picker: &mut Picker<W>,
    items: &[Item],
    next: &Move,
    options: &ReorderOptions,
    report: &mut ReorderReport,
) -> Result<Attempt, ReorderError> {
    let (mine, others): (Vec<Item>, Vec<Item>) =
        items.iter().cloned().partition(|item| item.id == next.id);
    let slot = options.grid.slot_at(next.place);
    let destination = match slot.filter(|_| !next.is_aside) {
        Some(slot) => format!("slot {slot}"),
        None => "a free place".to_owned(),
    };
    let item = &mine[0];
    picker.notify(&TaskEvent::Chosen {
        item,
        destination: &destination,
    });
    let outcome = picker.pick_and_set_down(item, &others, next.place, 0);
    let attempt = match &outcome {
        Ok(()) => Attempt::SetDown,
        Err(PickError::Stopped { .. }) => Attempt::Stopped,
        Err(error) if error.moves_nothing() => Attempt::NothingMoved,
        Err(_) => Attempt::Failed,
    };
    if !matches!(attempt, Attempt::NothingMoved) {
        report.attempts += 1;
        report.log.push((next.id, outcome.is_ok()));
    }
    match outcome {
        Ok(()) => {
            report.set_down += usize::from(!next.is_aside);
            report.set_aside += usize::from(next.is_aside);
        }
        Err(PickError::Stopped { .. }) => report.stopped = true,
        Err(
            error @ (PickError::NoGrasp { .. }
            | PickError::Unreachable { .. }
            | PickError::Missed { .. }
            | PickError::Lost { .. }
            | PickError::Plan { .. }
            | PickError::Blocked { .. }),
        ) if !keeps_object(&error) => {
            tracing::info!(%error, "not moved");
            report.left.push((next.id, error.to_string()));
        }
        Err(error) => return Err(ReorderError::Pick(error)),
    }
    Ok(attempt)
}

/// An object and the place that it shall be set down at.
#[derive(Clone, Debug, PartialEq)]
struct Move {
    id: u32,
    place: [f64; 2],
    /// It only makes room for another one.
    is_aside: bool,
}

/// Returns the moves that are possible now, the best first; none if every object is in its slot.
fn next_moves(items: &[Item], orders: &SlotOrders, options: &ReorderOptions) -> Vec<Move> {
    let grid = &options.grid;
    let target = |item: &Item| grid.place(*orders.get(&item.id)?);
    let is_there = |item: &Item| {
        let slot = orders.get(&item.id);
        slot.is_some() && grid.slot_at(place_of(item)) == slot.copied()
    };
    let waiting: Vec<(&Item, [f64; 2])> = items
        .iter()
        .filter(|item| !is_there(item))
        .filter_map(|item| Some((item, target(item)?)))
        .collect();
    let mut moves: Vec<Move> = waiting
        .iter()
        .filter(|(item, place)| in_the_way(item, *place, items, options).is_empty())
        .map(|(item, place)| Move {
            id: item.id,
            place: *place,
            is_aside: false,
        })
        .collect();
    if !moves.is_empty() {
        return moves;
    }
    // All wait for others: these make room.
    for (item, place) in &waiting {
        for blocker in in_the_way(item, *place, items, options) {
            let aside = free_place(blocker, items, &waiting, options);
            moves.extend(aside.map(|place| Move {
                id: blocker.id,
                place,
                is_aside: true,
            }));
        }
    }
    moves
}

fn place_of(item: &Item) -> [f64; 2] {
    let place = item.pose.translation.vector;
    [place.x, place.y]
}

/// Returns the smallest distance between the middles of two objects that stand beside each other, m.
fn room(one: &Item, other: &Item, options: &ReorderOptions) -> f64 {
    one.shape.radius() + other.shape.radius() + options.gap
}

/// Returns the other objects that leave no room for an item at a place.
fn in_the_way<'a>(
    item: &Item,
    place: [f64; 2],
    items: &'a [Item],
    options: &ReorderOptions,
) -> Vec<&'a Item> {
    let near = |other: &&Item| {
        other.id != item.id && distance(place, place_of(other)) < room(item, other, options)
    };
    items.iter().filter(near).collect()
}

/// Step between the places that are tried to set an object aside, m, and how far they go from the middle of the grid.
const ASIDE_STEP: f64 = 0.03;
const ASIDE_REACH: [f64; 2] = [0.24, 0.30];

/// Returns the place nearest to an item where it is in nobody's way: neither of those on the table nor of those that wait.
fn free_place(
    item: &Item,
    items: &[Item],
    waiting: &[(&Item, [f64; 2])],
    options: &ReorderOptions,
) -> Option<[f64; 2]> {
    let middle = options.grid.middle;
    let steps = ASIDE_REACH.map(|reach| (reach / ASIDE_STEP) as i32);
    let mut places: Vec<[f64; 2]> = Vec::new();
    for row in -steps[0]..=steps[0] {
        for column in -steps[1]..=steps[1] {
            places.push([
                middle[0] + f64::from(row) * ASIDE_STEP,
                middle[1] + f64::from(column) * ASIDE_STEP,
            ]);
        }
    }
    let from = place_of(item);
    places.sort_by(|one, other| distance(from, *one).total_cmp(&distance(from, *other)));
    places.into_iter().find(|place| {
        let mut targets = waiting.iter().filter(|(other, _)| other.id != item.id);
        let takes_target =
            targets.any(|(other, target)| distance(*place, *target) < room(item, other, options));
        !takes_target && in_the_way(item, *place, items, options).is_empty()
    })
}

#[cfg(test)]
mod tests {
    use yarp_devices::kinematics::Pose;

    use super::*;
    use crate::item::{Class, ItemShape};

    fn glass(id: u32, place: [f64; 2]) -> Item {
        let shape = ItemShape::Cylinder {
            radius: 0.035,
            height: 0.1,
        };
        Item {
            id,
            label: format!("glass {id}"),
            class: Class::Glass,
            shape,
            pose: Pose::translation(place[0], place[1], 0.0),
        }
    }

    fn slot(number: usize) -> [f64; 2] {
        SlotGrid::default().place(number).expect("a slot")
    }

    fn moves(items: &[Item], orders: &[(u32, usize)]) -> Vec<Move> {
        let orders = orders.iter().copied().collect();
        next_moves(items, &orders, &ReorderOptions::default())
    }

    #[test]
    fn objects_in_their_slots_and_those_without_one_stay() {
        let items = [glass(1, slot(0)), glass(2, slot(4))];
        assert_eq!(moves(&items, &[(1, 0)]), []);
    }

    #[test]
    fn an_object_whose_slot_is_free_moves_first() {
        let items = [glass(1, slot(0)), glass(2, slot(1))];
        let next = moves(&items, &[(1, 1), (2, 2)]);
        assert_eq!(next.len(), 1);
        assert_eq!((next[0].id, next[0].is_aside), (2, false));
        assert!(distance(next[0].place, slot(2)) < 1e-9);
    }

    #[test]
    fn of_two_that_change_places_one_is_set_aside_where_it_is_in_nobodys_way() {
        let items = [glass(1, slot(0)), glass(2, slot(1)), glass(3, slot(4))];
        let next = moves(&items, &[(1, 1), (2, 0)]);
        assert!(next.iter().all(|next| next.is_aside && next.id != 3));
        for next in next {
            for other in [slot(0), slot(1), slot(4)] {
                assert!(distance(next.place, other) >= 0.12, "{next:?}");
            }
        }
    }

    #[test]
    fn an_object_without_an_order_makes_room() {
        let items = [glass(1, slot(5)), glass(2, slot(0))];
        let next = moves(&items, &[(1, 0)]);
        assert_eq!((next[0].id, next[0].is_aside), (2, true));
    }

    #[test]
    fn classes_stand_together_and_orders_do_not_change() {
        let mut items = vec![glass(1, [0.4, 0.2]), glass(3, [0.4, 0.0])];
        items.push(Item {
            class: Class::Polygon,
            ..glass(2, [0.6, 0.0])
        });
        let mut commander = ByClass::new(&SlotGrid::default());
        let orders = commander.orders(&items);
        assert_eq!(orders, SlotOrders::from([(2, 0), (1, 1), (3, 2)]));
        items.pop();
        assert_eq!(commander.orders(&items), orders);
    }
}
