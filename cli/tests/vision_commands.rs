//! `yarp table render` writes what `yarp vision detect` reads; `yarp vision evaluate` tells by its exit code.

#![cfg(all(unix, feature = "table", feature = "vision"))]

mod common;

use common::{Ended, Home};
use serde_json::Value;

/// Seed of training tables, so that no test seed is used up.
const SEED: u64 = 9000;

fn json(ended: &Ended) -> Value {
    serde_json::from_str(ended.out.last().unwrap())
        .unwrap_or_else(|error| panic!("{error}: {ended:?}"))
}

fn labels(report: &Value) -> Vec<&str> {
    let objects = report["objects"].as_array().unwrap();
    objects
        .iter()
        .map(|object| object["label"].as_str().unwrap())
        .collect()
}

#[test]
fn rendered_tables_are_recognised() {
    let home = Home::new();
    let directory = home.path().join("tables");
    let at = |name: &str| directory.join(name).display().to_string();
    let out = directory.display();
    let line = format!(
        "table render --seed {SEED} --count 1 --objects 5 --models --depth --json --out {out}"
    );
    let rendered = home.run(&line);
    let report = json(&rendered);
    // How long it took is not the matter of a test; that the exit code says the same as the report is.
    let passed = report["passed"].as_bool().unwrap();
    assert_eq!(rendered.code, Some(i32::from(!passed)), "{rendered:?}");
    assert_eq!(report["images"], 1);
    assert!(report["rendering_ms"]["p50"].as_f64().unwrap() > 0.0);

    // The image alone: printed objects by the folder of models.
    let line = format!(
        "vision detect {} --models {} --json",
        at("000000.png"),
        at("models")
    );
    let found = json(&home.run(&line).with(0));
    let objects = found["objects"].as_array().unwrap();
    assert!(!objects.is_empty());
    for object in objects {
        assert!(object["contour"].as_array().unwrap().len() >= 3, "{object}");
        assert!(object["score"].as_f64().unwrap() > 0.0, "{object}");
        assert!(object.get("position").is_none(), "{object}");
    }

    // With depth: each object of the truth that is in sight, where it is.
    let line = format!(
        "vision detect {} --depth {} --calibration {} --depth-calibration {} --objects {} --json --out {}",
        at("000000.png"),
        at("000000-depth.png"),
        at("camera.yml"),
        at("depth-camera.yml"),
        at("models/objects.xml"),
        at("found.png")
    );
    let found = json(&home.run(&line).with(0));
    assert!(std::fs::metadata(at("found.png")).unwrap().len() > 10_000);
    let text = std::fs::read_to_string(at("000000.xml")).unwrap();
    let truth = yarp_table::GroundTruth::from_xml(&text).unwrap();
    let mut present = 0;
    for target in &truth.objects {
        let class = target.object.class().word();
        if class == "clutter" || target.visible < 0.9 || target.truncated {
            continue;
        }
        present += 1;
        let place = target.object.pose.translation.vector;
        let near = |object: &&Value| {
            let position = &object["position"];
            let gap = |axis: usize| position[axis].as_f64().unwrap() - place[axis];
            gap(0).hypot(gap(1)) < 0.005
        };
        let found = found["objects"].as_array().unwrap();
        let found = found.iter().find(near);
        let found = found.unwrap_or_else(|| panic!("no {class} at {place}: {:?}", labels(&report)));
        if class != "brick" {
            assert_eq!(found["label"], class);
        }
    }
    assert!(present >= 3, "{present}");
}

#[test]
fn wrong_files_are_named() {
    let home = Home::new();
    let missing = home.run("vision detect no-image.png --json").with(1);
    missing.complains("no-image.png");
    let image = home.path().join("grey.png");
    let grey = yarp_devices::image::Image::new(
        yarp_devices::image::PixelFormat::Mono,
        64,
        48,
        vec![90; 64 * 48],
    );
    yarp_table::write_image(&image, &grey.unwrap()).unwrap();
    let image = image.display();
    home.run(&format!("vision detect {image} --models no-folder"))
        .with(1)
        .complains("no-folder");
    home.run(&format!("vision detect {image} --json"))
        .with(1)
        .complains("lens cover");
    // Depth needs calibrations and an object database.
    home.run(&format!("vision detect {image} --depth {image}"))
        .with(1)
        .complains("--calibration");
    let line = format!(
        "vision detect {image} --depth {image} --calibration a.yml --depth-calibration a.yml --objects a.xml"
    );
    home.run(&line).with(1).complains("16 bits");
}

#[test]
fn evaluation_exits_with_1_below_the_targets() {
    let home = Home::new();
    let parameters = home.path().join("parameters.json");
    let line = format!("vision evaluate --seed {SEED} --count 1 --set circles --json");
    let evaluated = home.run(&line);
    let report = json(&evaluated);
    assert_eq!(report["split"], "training");
    assert_eq!(report["rows"]["circles"]["passed"], true, "{report}");
    // A busy machine may be too slow; the exit code must say so, too.
    let passed = report["passed"].as_bool().unwrap();
    assert_eq!(
        passed,
        report["detection_ms"]["passed"].as_bool().unwrap(),
        "{report}"
    );
    assert_eq!(evaluated.code, Some(i32::from(!passed)), "{evaluated:?}");

    // No outline has that much support: nothing is found.
    std::fs::write(&parameters, r#"{"min_support": 1.1}"#).unwrap();
    let line = format!("{line} --parameters {}", parameters.display());
    let report = json(&home.run(&line).with(1));
    assert_eq!(report["passed"], false);
    assert_eq!(report["rows"]["circles"]["recall"], 0.0);

    std::fs::write(&parameters, r#"{"min_suport": 0.3}"#).unwrap();
    home.run(&line).with(1).complains("min_suport");
}
