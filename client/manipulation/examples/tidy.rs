//! Tidies random tables in lockstep and prints what happened:
//! `cargo run -p yarp-manipulation --example tidy -- SEED RUNS OBJECTS [CLASS]`.

#[path = "../tests/support/mod.rs"]
mod support;

use std::time::Instant;

use support::{SimulatedCell, Truth, shared};
use yarp_manipulation::{TaskEvent, TidyOptions, tidy};
use yarp_table::{Class, Placement, Random, Scene, SimulationOptions};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let number = |index: usize, default: u64| {
        words
            .get(index)
            .and_then(|word| word.parse().ok())
            .unwrap_or(default)
    };
    let (seed, runs, count) = (number(0, 1), number(1, 1), number(2, 1));
    let verbose = std::env::var_os("VERBOSE").is_some();
    for run in seed..seed + runs {
        let mut placement = Placement::default().with_count(count as usize);
        if let Some(class) = words.get(3).and_then(|word| Class::from_word(word)) {
            placement = placement.with_classes(&[class]);
        }
        let Ok(scene) = Scene::random(run, &placement) else {
            println!("{run}: no room");
            continue;
        };
        let mut options = SimulationOptions::default();
        options.seed = run;
        let before = scene.objects.clone();
        let table = shared(scene, options);
        table.borrow_mut().step(0.3);
        let cell = SimulatedCell(table.clone());
        let mut detector = Truth {
            table: table.clone(),
            random: Random::for_purpose(run, 7),
            noise: 0.001,
        };
        let start = Instant::now();
        let mut picker = support::picker(cell)?;
        if verbose {
            picker.observe(|event| match event {
                TaskEvent::Chosen { item, .. } => println!("  {} {}", item.label, item.id),
                TaskEvent::Step { step, .. } => println!("    {step}"),
                TaskEvent::Failed { reason } => println!("    failed: {reason}"),
                _ => {}
            });
        }
        let report = tidy(&mut picker, &mut detector, &TidyOptions::default());
        table.borrow_mut().step(1.0);
        let table = table.borrow();
        let scene = table.simulation.scene();
        let simulated = table.simulation.time().as_secs_f64();
        if let Some(touch) = &table.first_touch {
            println!("  touched: {touch}");
        }
        let mut placed = 0;
        for (object, was) in scene.objects.iter().zip(&before) {
            let inside = support::is_placed(scene, object);
            placed += usize::from(inside);
            if !inside || verbose {
                println!(
                    "  {} {:?} {:.3} kg: from {:.3?} to {:.3?} {inside}",
                    object.class(),
                    object.shape,
                    object.mass,
                    was.pose.translation.vector.as_slice(),
                    object.pose.translation.vector.as_slice()
                );
            }
        }
        println!(
            "{run}: {placed} of {} placed, {} attempts, {} missed, {} contacts, {:.1} s per object, {:.1} x real time, fault {:?}, left {:?}, error {:?}",
            before.len(),
            report.attempts,
            report.missed,
            table.touched,
            simulated / before.len() as f64,
            simulated / start.elapsed().as_secs_f64(),
            table.simulation.arm().simulator().safety().fault(),
            report.left,
            report.error.map(|error| error.to_string()),
        );
    }
    Ok(())
}
