//! Reorders random tables in lockstep and prints what happened:
//! `cargo run -p yarp-manipulation --example reorder -- SEED RUNS OBJECTS`.

#[path = "../tests/support/mod.rs"]
mod support;

use support::{SimulatedCell, Truth, shared};
use yarp_manipulation::{ByClass, Item, ReorderOptions, SlotCommander, SlotOrders, reorder};
use yarp_table::{Class, Placement, Random, Scene, SimulationOptions};

/// Keeps the orders for the judgement at the end.
struct Kept(ByClass, SlotOrders);

impl SlotCommander for Kept {
    fn orders(&mut self, items: &[Item]) -> SlotOrders {
        self.1 = self.0.orders(items);
        self.1.clone()
    }

    fn wait(&mut self) -> bool {
        false
    }
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let number = |index: usize, default: u64| {
        let word = words.get(index).and_then(|word| word.parse().ok());
        word.unwrap_or(default)
    };
    let (seed, runs, count) = (number(0, 1), number(1, 1), number(2, 4));
    let task = ReorderOptions::default();
    for run in seed..seed + runs {
        let classes = [Class::Glass, Class::Box, Class::Prism];
        let placement = Placement::default()
            .with_count(count as usize)
            .with_classes(&classes);
        let scene = Scene::random(run, &placement)?;
        let mut options = SimulationOptions::default();
        options.seed = run;
        let table = shared(scene, options);
        table.borrow_mut().step(0.3);
        let mut detector = Truth {
            table: table.clone(),
            random: Random::for_purpose(run, 7),
            noise: 0.001,
        };
        let mut picker = support::picker(SimulatedCell(table.clone()))?;
        let mut orders = Kept(ByClass::new(&task.grid), SlotOrders::new());
        let report = reorder(&mut picker, &mut detector, &mut orders, &task);
        table.borrow_mut().step(1.0);
        let table = table.borrow();
        let scene = table.simulation.scene();
        let mut placed = 0;
        for object in &scene.objects {
            let place = object.pose.translation;
            let slot = orders.1.get(&object.id).copied();
            let there = task.grid.slot_at([place.x, place.y]);
            placed += usize::from(slot.is_some() && slot == there);
            if slot != there {
                println!("  {} for {slot:?} is at {place:.3}", object.class());
            }
        }
        println!(
            "{run}: {placed} of {count} in their slots, {} attempts, {} aside, {} contacts, {:.1} s, left {:?}, error {:?}",
            report.attempts,
            report.set_aside,
            table.touched,
            table.simulation.time().as_secs_f64(),
            report.left,
            report.error.map(|error| error.to_string()),
        );
    }
    Ok(())
}
