//! The experiments of the thesis run without a network and print what they measured.

#![cfg(unix)]

use crate::common;

use common::Home;

/// Returns the numbers of a text, in their order.
fn numbers(text: &str) -> Vec<f64> {
    let is_separator = |each: char| !(each.is_ascii_digit() || "+-.".contains(each));
    text.split(is_separator)
        .filter_map(|word| word.parse().ok())
        .collect()
}

/// Returns the errors of the poses in the table that a command prints, mm.
fn errors(told: &common::Ended) -> Vec<f64> {
    let lines = told.out.iter().filter(|line| line.starts_with("Point"));
    let errors = lines.map(|line| numbers(line.split('|').nth(2).expect("three columns"))[3]);
    errors.collect()
}

/// Nothing is fitted to the thesis's table, whose errors are 7.08 mm on average, and 14.16 at most.
#[test]
fn an_arm_with_the_effects_of_a_real_one_is_as_exact_as_the_thesis() {
    let home = Home::new();
    let real = home
        .run("demo repeatability --repeat 2 --simulation real")
        .with(0);
    let found = errors(&real);
    assert_eq!(found.len(), 4, "{real:?}");
    assert!(
        found.iter().all(|error| (0.0..14.16).contains(error)),
        "{real:?}"
    );
    assert!(found.iter().sum::<f64>() / 4.0 < 7.08, "{real:?}");
    let ideal = home.run("demo repeatability --repeat 2").with(0);
    assert_ne!(found, errors(&ideal), "{real:?}");
    home.run("demo sync --simulation ghost").with(1);
}

#[test]
fn the_arm_comes_to_rest_near_each_pose() {
    let home = Home::new();
    let told = home.run("demo repeatability --repeat 2").with(0);
    let mut means: Vec<Vec<f64>> = Vec::new();
    for line in told.out.iter().filter(|line| line.starts_with("Point")) {
        let [target, _, here] = line.split('|').collect::<Vec<_>>()[..] else {
            panic!("three columns, not {line:?}");
        };
        // The number of the pose comes before its target.
        let target = &numbers(target)[1..];
        let [x, y, z, error, spread] = numbers(here)[..] else {
            panic!("a position, an error and a spread, not {here:?}");
        };
        let mean = vec![x, y, z];
        let squares = target.iter().zip(&mean).map(|(a, b)| (a - b).powi(2));
        let off = squares.sum::<f64>().sqrt();
        assert!(off < 15.0, "{off} mm from the target: {line}");
        // The mean distance to the target is at least the distance of the mean; both have two decimals.
        assert!(error > 0.0 && error >= off - 0.03, "{line}");
        assert!((0.0..5.0).contains(&spread), "{line}");
        means.push(mean);
    }
    assert_eq!(means.len(), 4, "{told:?}");
}

#[test]
fn joints_move_together_and_the_tool_in_a_straight_line() {
    let home = Home::new();
    for words in ["demo sync", "demo sync --simulation real"] {
        check_synchronisation(&home.run(words).with(0));
    }
}

fn check_synchronisation(told: &common::Ended) {
    let mut last = vec![0.0; 7];
    for tenth in 1..=10 {
        let label = format!("{:>4} %", tenth * 10);
        let line = told.out.iter().find(|line| line.starts_with(&label));
        let shares = numbers(&line.expect("a line per tenth of the time")[label.len()..]);
        assert_eq!(shares.len(), 7, "{told:?}");
        assert!(
            shares.iter().zip(&last).all(|(now, before)| now > before),
            "{shares:?} after {last:?}"
        );
        let (min, max) = (
            shares.iter().copied().fold(f64::INFINITY, f64::min),
            shares.iter().copied().fold(0.0, f64::max),
        );
        assert!(
            max - min < 10.0,
            "the joints do not move together: {line:?}"
        );
        last = shares;
    }
    assert!(
        last.iter().all(|share| (95.0..105.0).contains(share)),
        "{last:?}"
    );
    for method in ["damped least squares", "transposed Jacobian"] {
        let line = told.out.iter().find(|line| line.starts_with(method));
        let [samples, mean, most, ..] = numbers(line.expect("a line per method"))[..] else {
            panic!("expected numbers: {line:?}");
        };
        assert!(samples > 20.0 && mean > 0.0 && mean <= most, "{line:?}");
        assert!(most < 20.0, "the path is not straight: {line:?}");
    }
}

#[test]
fn statefeed_prints_the_tables_and_writes_the_plots() {
    let home = Home::new();
    let folder = home.path().join("plots");
    let line = format!(
        "demo statefeed --repeat 2 --seconds 1 --simulation real --out {}",
        folder.display()
    );
    let told = home.run(&line).with(0);
    for text in ["thesis: mean", "damped least squares"] {
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
    for (words, named) in [
        ("demo dance", "dance"),
        ("demo repeatability --repeat 0", "--repeat"),
    ] {
        let ended = home.run(words).with(1);
        let mut lines = ended.out.iter().chain(&ended.err);
        assert!(lines.any(|line| line.contains(named)), "{ended:?}");
    }
}
