//! Reordering the table over the network: every object into the slot that another program commanded, or by class.

use std::io::Write;

use serde_json::json;
use yarp_client::Network;
use yarp_manipulation::{ReorderOptions, ReorderReport, SlotGrid, SlotOrders, Stop, reorder};
use yarp_table::{Class, Placement};

use super::demo_session::{TableEnd, connect, show_task, with_table, write_result};
use super::slot_orders::PortOrders;
use super::{TableDemoError, TableDemoOptions, TablePlace};
use crate::DemoError;

/// Name of the ports that show the task.
const NAME: &str = "/reorder";
/// The port at which slots are commanded.
pub const ORDERS_PORT: &str = "/reorder/rpc:i";
/// Height below the table's surface at which an object has fallen, m.
const FALLEN: f64 = 0.01;

/// Sorts the objects of a table into slots and writes the result; returns whether all are where they shall be.
///
/// Blocks until all orders are carried out, or `stop` is pressed; with `waits` until the end is commanded at
/// [`ORDERS_PORT`].
pub fn run(
    options: &TableDemoOptions,
    waits: bool,
    stop: &Stop,
    json: bool,
    out: &mut dyn Write,
) -> Result<bool, DemoError> {
    let grid = ReorderOptions::default().grid;
    let ((report, orders), truth) = match &options.place {
        TablePlace::Remote(network, prefix) => {
            (reorder_on(network, prefix, options, waits, stop)?, None)
        }
        TablePlace::Isolated | TablePlace::Here(_) => {
            let classes = [Class::Glass, Class::Box, Class::Prism];
            let placement = Placement::default()
                .with_count(options.objects)
                .with_classes(&classes);
            let (outcome, end) = with_table(options, &placement, NAME, out, |network| {
                reorder_on(network, "", options, waits, stop)
            })?;
            (outcome, Some(end))
        }
    };
    let truth = truth.map(|end| Judgement::of(&end, &grid, &orders));
    let passed = report.error.is_none()
        && report.left.is_empty()
        && truth.as_ref().is_none_or(Judgement::passes);
    let truth = truth.as_ref();
    let result = json!({
        "demo": "reorder",
        "seed": options.seed,
        "objects": orders.len(),
        "detector": report.detector,
        "noise_m": options.noise,
        "placed": truth.map(|truth| truth.placed),
        "attempts": report.attempts,
        "set_aside": report.set_aside,
        "dropped": truth.map(|truth| truth.dropped),
        "lost": truth.map(|truth| truth.lost),
        "misclassified": truth.map(|truth| truth.misclassified),
        "collisions": truth.map(|truth| truth.collisions),
        "simulated_seconds": truth.map(|truth| truth.simulated),
        "wall_seconds": truth.map(|truth| truth.wall),
        "stopped": report.stopped,
        "left": report.left.iter().map(|(id, why)| json!({"id": id, "reason": why})).collect::<Vec<_>>(),
        "error": report.error.as_ref().map(ToString::to_string),
        "passed": passed,
    });
    write_result(&result, json, out)?;
    Ok(passed)
}

/// The end of a run, judged by the table itself.
struct Judgement {
    ordered: usize,
    placed: usize,
    /// On the table, outside of all slots.
    dropped: usize,
    lost: usize,
    /// In the slot of another object.
    misclassified: usize,
    collisions: u64,
    simulated: f64,
    wall: f64,
}

impl Judgement {
    fn of(end: &TableEnd, grid: &SlotGrid, orders: &SlotOrders) -> Self {
        let mut judgement = Self {
            ordered: orders.len(),
            placed: 0,
            dropped: 0,
            lost: 0,
            misclassified: 0,
            collisions: end.collisions,
            simulated: end.simulated,
            wall: end.wall,
        };
        for object in &end.scene.objects {
            let place = object.pose.translation.vector;
            if place.z < end.scene.table.surface - FALLEN {
                judgement.lost += 1;
            } else if let Some(slot) = orders.get(&object.id) {
                match grid.slot_at([place.x, place.y]) {
                    Some(at) if at == *slot => judgement.placed += 1,
                    Some(_) => judgement.misclassified += 1,
                    None => judgement.dropped += 1,
                }
            }
        }
        judgement
    }

    fn passes(&self) -> bool {
        self.placed == self.ordered && self.lost == 0 && self.collisions == 0
    }
}

/// Reorders a table that is somewhere on the network; returns the orders at the end, too.
fn reorder_on(
    network: &Network,
    prefix: &str,
    options: &TableDemoOptions,
    waits: bool,
    stop: &Stop,
) -> Result<(ReorderReport, SlotOrders), TableDemoError> {
    let task = ReorderOptions::default();
    let mut orders = PortOrders::open(network, ORDERS_PORT, task.grid, waits, stop.clone())?;
    let (mut picker, mut detector) = connect(network, prefix, options, stop)?;
    let _display = show_task(&mut picker, network, NAME);
    let report = reorder(&mut picker, detector.as_mut(), &mut orders, &task);
    Ok((report, orders.in_force()))
}
