//! The experiments of the thesis run without a network and print their tables.

#![cfg(unix)]

mod common;

use common::Home;

#[test]
fn repeatability_prints_the_thesis_beside_ours() {
    let home = Home::new();
    let told = home.run("demo repeatability --repeat 2").with(0);
    assert!(told.says("thesis: mean"), "{told:?}");
    for point in 1..=4 {
        assert!(told.says(&format!("Point {point}")), "{told:?}");
    }
    // Average error and spread of the thesis.
    assert!(told.says("7.08  0.2711"), "{told:?}");
}

#[test]
fn sync_prints_joint_delays_and_straightness() {
    let home = Home::new();
    let told = home.run("demo sync").with(0);
    assert!(told.says("All joints together"), "{told:?}");
    assert!(told.says("damped least squares"), "{told:?}");
}

#[test]
fn statefeed_prints_the_tables_and_writes_the_plots() {
    let home = Home::new();
    let folder = home.path().join("plots");
    let line = format!(
        "demo statefeed --repeat 2 --seconds 1 --out {}",
        folder.display()
    );
    let told = home.run(&line).with(0);
    for text in ["thesis: mean", "damped least squares", "49.95"] {
        assert!(told.says(text), "{text}: {told:?}");
    }
    for name in [
        "table-5.svg",
        "table-6.svg",
        "figure-13-xz.svg",
        "figure-13-yz.svg",
        "figure-19.svg",
    ] {
        let plot = std::fs::read_to_string(folder.join(name)).unwrap();
        assert!(
            plot.contains("<circle") || plot.contains("<polyline"),
            "{name}"
        );
    }
    let missing = home.run("demo statefeed --repeat 1 --arm /nobody").with(1);
    missing.complains("/nobody/stateExt:o");
    assert!(missing.out.is_empty(), "{missing:?}");
    home.run("demo statefeed --seconds 0").with(1);
}

#[test]
fn unknown_demos_are_refused() {
    let home = Home::new();
    home.run("demo dance").with(1);
    home.run("demo repeatability --repeat 0").with(1);
}
