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
fn unknown_demos_are_refused() {
    let home = Home::new();
    home.run("demo dance").with(1);
    home.run("demo repeatability --repeat 0").with(1);
}
