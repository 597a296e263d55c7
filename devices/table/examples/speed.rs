//! Measures rendering and simulation: `cargo run -p yarp-table --example speed`. Prints wall clock and processor time.

use std::error::Error;
use std::time::{Duration, Instant};

use yarp_table::{Class, Effects, Placement, Renderer, Scene, SimulationOptions, TableSimulation};

/// Processor time of this process, s: two fields of 10 ms units.
fn processor() -> f64 {
    let text = std::fs::read_to_string("/proc/self/stat").unwrap_or_default();
    let fields: Vec<&str> = text
        .rsplit(')')
        .next()
        .unwrap_or("")
        .split_whitespace()
        .collect();
    let ticks = |index: usize| fields.get(index).and_then(|word| word.parse::<f64>().ok());
    (ticks(11).unwrap_or(0.0) + ticks(12).unwrap_or(0.0)) / 100.0
}

fn measure(what: &str, count: u32, mut job: impl FnMut()) {
    let (wall, cpu) = (Instant::now(), processor());
    for _ in 0..count {
        job();
    }
    let wall = wall.elapsed().as_secs_f64() / f64::from(count);
    let cpu = (processor() - cpu) / f64::from(count);
    println!(
        "{what}: {:.1} ms wall clock, {:.1} ms processor",
        wall * 1e3,
        cpu * 1e3
    );
}

fn main() -> Result<(), Box<dyn Error>> {
    let renderer = Renderer::new();
    let scene = Scene::random(1, &Placement::default().with_count(10).with_clutter(2))?;
    let camera = scene.camera();
    let render = |effects: &Effects| {
        renderer.render(&scene, &camera, effects);
    };
    render(&Effects::default());
    measure("rendering with usual effects", 10, || {
        render(&Effects::default())
    });
    measure("rendering without effects", 10, || render(&Effects::none()));
    let classes = [Class::Glass, Class::Box, Class::Prism, Class::Brick];
    let crowd = Placement::default()
        .with_count(30)
        .with_classes(&classes)
        .with_gap(0.0);
    let scene = (1..50)
        .find_map(|seed| Scene::random(seed, &crowd).ok())
        .ok_or("no room")?;
    println!("{} objects", scene.objects.len());
    let mut table = TableSimulation::new(scene.clone(), SimulationOptions::default());
    measure("the first second, objects at rest", 1, || {
        table.run(Duration::from_secs(1))
    });
    measure("a second, objects at rest", 3, || {
        table.run(Duration::from_secs(1))
    });
    let mut scene = scene;
    for (index, object) in scene.objects.iter_mut().enumerate() {
        object.pose.translation.z += 0.1 + 0.05 * index as f64;
        object.pose.translation.x = 0.55 + 0.3 * (object.pose.translation.x - 0.55);
        object.pose.translation.y *= 0.3;
    }
    let mut table = TableSimulation::new(scene, SimulationOptions::default());
    measure("a second of a falling heap", 2, || {
        table.run(Duration::from_secs(1))
    });
    Ok(())
}
