//! Renders random tables and prints how long each takes: `cargo run -p yarp-table --example render -- DIR [COUNT] [SEED]`.

use std::path::PathBuf;
use std::time::Instant;

use yarp_table::{Effects, HandPosture, Placement, Renderer, RobotPosture, Scene, write_image};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut arguments = std::env::args().skip(1);
    let directory = PathBuf::from(arguments.next().unwrap_or_else(|| ".".into()));
    let count: u64 = arguments.next().map_or(Ok(3), |word| word.parse())?;
    let first: u64 = arguments.next().map_or(Ok(0), |word| word.parse())?;
    let renderer = Renderer::new();
    for seed in first..first + count {
        let placement = Placement::default().with_clutter(2);
        let mut scene = Scene::random(seed, &placement)?;
        if seed % 2 == 1 {
            scene.robot = Some(RobotPosture {
                joints: [-0.5, 0.9, 0.0, 1.9, 0.0, 0.4, 0.0].into(),
                hand: Some(HandPosture::default()),
            });
        }
        let start = Instant::now();
        let shot = renderer.render(&scene, &scene.camera(), &Effects::random(seed));
        println!("seed {seed}: {:.1} ms", start.elapsed().as_secs_f64() * 1e3);
        write_image(&directory.join(format!("{seed}.png")), &shot.image)?;
        std::fs::write(directory.join(format!("{seed}.xml")), shot.truth.to_xml())?;
    }
    Ok(())
}
