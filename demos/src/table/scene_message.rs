//! The scene of a table as a message for viewers (`docs/live-view.md`).

use yarp_table::{LiveTable, Scene, Shape};
use yarp_wire::{Bottle, Value};

use std::sync::Arc;
use std::time::Duration;

use yarp_ports::Port;

/// Interval between two scenes.
const INTERVAL: Duration = Duration::from_millis(50);

/// Publishes the scene while somebody reads it; runs until it is aborted.
pub(super) async fn publish(table: Arc<LiveTable>, port: Arc<Port>) {
    let mut ticks = tokio::time::interval(INTERVAL);
    loop {
        ticks.tick().await;
        if !port.outputs().is_empty() {
            port.write_if_idle(&message(&table.scene()), None);
        }
    }
}

fn numbers(values: impl IntoIterator<Item = f64>) -> Bottle {
    values.into_iter().fold(Bottle::new(), Bottle::with)
}

fn group(key: &str, values: impl IntoIterator<Item = f64>) -> Bottle {
    values.into_iter().fold(Bottle::of(key), Bottle::with)
}

/// Returns the message of a scene.
fn message(scene: &Scene) -> Bottle {
    let table = &scene.table;
    let edges = [
        table.surface,
        table.x[0],
        table.x[1],
        table.y[0],
        table.y[1],
    ];
    let mut message = Bottle::of("scene").with(group("table", edges));
    for basket in &scene.baskets {
        message.push(group(
            "basket",
            basket.bottom.into_iter().chain(basket.size),
        ));
    }
    for object in &scene.objects {
        let (word, size) = shape(&object.shape);
        let place = object.pose.translation.vector;
        let turn = nalgebra::UnitQuaternion::from_rotation_matrix(&object.pose.rotation);
        let pose = [place.x, place.y, place.z, turn.w, turn.i, turn.j, turn.k];
        let [r, g, b] = object.finish.colour.map(f64::from);
        let described = Bottle::of("object")
            .with(Value::Int32(object.id as i32))
            .with(object.class().word())
            .with(word)
            .with(numbers(size))
            .with(group("pose", pose))
            .with(group("colour", [r, g, b, f64::from(object.finish.opacity)]));
        message.push(described);
    }
    message
}

fn shape(shape: &Shape) -> (&'static str, Vec<f64>) {
    match *shape {
        Shape::Glass {
            radius,
            height,
            wall,
        } => ("cup", vec![radius, height, wall]),
        Shape::Plate { radius, height } => ("cylinder", vec![radius, height]),
        Shape::Prism { side, height } => ("prism", vec![side, height]),
        _ => ("box", shape.extent().to_vec()),
    }
}

#[cfg(test)]
mod tests {
    use yarp_table::Placement;

    use super::*;

    #[test]
    fn every_object_is_told() {
        let scene = Scene::random(3, &Placement::default()).unwrap();
        let told = message(&scene);
        let groups = |key: &str| {
            let lists = told.iter().filter_map(Value::as_list);
            lists
                .filter(|list| list.get(0).and_then(Value::as_str) == Some(key))
                .count()
        };
        assert_eq!(groups("object"), scene.objects.len());
        assert_eq!(groups("basket"), 3);
        let object = told.iter().filter_map(Value::as_list).last().unwrap();
        assert_eq!(object.find_group("pose").unwrap().len(), 8);
    }
}
