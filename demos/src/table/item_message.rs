//! Objects on a table as bottles: what a program that detects them answers to `list`.

use nalgebra::{Rotation3, Translation3};
use yarp_client::{Bottle, Network, RpcServer, Value, bottle};
use yarp_devices::kinematics::Pose;
use yarp_manipulation::{Class, Item, ItemShape};

/// Maximum number of objects of a reply.
const MAX_OBJECTS: usize = 1000;

/// Returns an entry: `id word x y z roll pitch yaw (sizes) label`, in m and rad.
///
/// Words are `box`, `brick`, `prism`, `glass` and `plate`. Sizes are edges along x, y and z of a box or brick, side and height of a
/// prism, radius and height of a glass or plate.
pub(super) fn entry(id: u32, word: &str, pose: &Pose, sizes: &[f64], label: &str) -> Bottle {
    let place = pose.translation.vector;
    let (roll, pitch, yaw) = pose.rotation.euler_angles();
    let mut all = Bottle::new();
    all.push(i32::try_from(id).unwrap_or(i32::MAX));
    all.push(word);
    for number in [place.x, place.y, place.z, roll, pitch, yaw] {
        all.push(number);
    }
    let list = sizes
        .iter()
        .fold(Bottle::new(), |list, size| list.with(*size));
    all.push(Value::List(list));
    all.push(label);
    all
}

/// Returns the entry of an item.
#[cfg(feature = "vision")]
pub(super) fn of_item(item: &Item) -> Bottle {
    let (word, sizes) = match item.shape {
        ItemShape::Cuboid { size } => ("box", size.to_vec()),
        ItemShape::Prism { side, height } => ("prism", vec![side, height]),
        ItemShape::Cylinder { radius, height } => match item.class {
            Class::Plate => ("plate", vec![radius, height]),
            Class::Glass | Class::Polygon => ("glass", vec![radius, height]),
        },
    };
    entry(item.id, word, &item.pose, &sizes, &item.label)
}

/// Returns the item of an entry; `None` if it is none. Without a label its word is the label.
pub(super) fn read(entry: &Bottle) -> Option<Item> {
    let finite = |value: &Value| value.as_f64().filter(|number| number.is_finite());
    let number = |index: usize| entry.get(index).and_then(finite);
    let id = u32::try_from(entry.get(0).and_then(Value::as_i32)?).ok()?;
    let word = entry.get(1).and_then(Value::as_str)?;
    let sizes = entry.get(8).and_then(Value::as_list)?;
    let size = |index: usize| {
        let size = sizes.get(index).and_then(finite);
        size.filter(|size| *size > 0.0)
    };
    let (class, shape) = match word {
        "box" | "brick" => {
            let size = [size(0)?, size(1)?, size(2)?];
            (Class::Polygon, ItemShape::Cuboid { size })
        }
        "prism" => {
            let (side, height) = (size(0)?, size(1)?);
            (Class::Polygon, ItemShape::Prism { side, height })
        }
        "glass" | "plate" => {
            let class = match word {
                "glass" => Class::Glass,
                _ => Class::Plate,
            };
            let (radius, height) = (size(0)?, size(1)?);
            (class, ItemShape::Cylinder { radius, height })
        }
        _ => return None,
    };
    let place = Translation3::new(number(2)?, number(3)?, number(4)?);
    let turn = Rotation3::from_euler_angles(number(5)?, number(6)?, number(7)?);
    let label = entry.get(9).and_then(Value::as_str).unwrap_or(word);
    Some(Item {
        id,
        label: label.to_owned(),
        class,
        shape,
        pose: Pose::from_parts(place, turn),
    })
}

/// Opens a port that answers `list` with `is` and the entries of `list`, at most [`MAX_OBJECTS`], or with `fail` and the reason.
pub(super) fn serve(
    network: &Network,
    name: &str,
    list: impl Fn() -> Result<Vec<Bottle>, String> + Send + Sync + 'static,
) -> yarp_client::Result<RpcServer> {
    RpcServer::open_on(network, name, move |request: Bottle| {
        if request.get(0).and_then(Value::as_str) != Some("list") {
            return bottle!["fail", "expected list"];
        }
        match list() {
            Ok(entries) => {
                let entries = entries.into_iter().take(MAX_OBJECTS).map(Value::List);
                entries.fold(bottle!["is"], Bottle::with)
            }
            Err(why) => bottle!["fail", why],
        }
    })
}

/// Returns the entries of a reply, at most [`MAX_OBJECTS`].
pub(super) fn entries(reply: &Bottle) -> impl Iterator<Item = &Bottle> {
    let entries = reply.iter().skip(1).take(MAX_OBJECTS);
    entries.filter_map(Value::as_list)
}

#[cfg(test)]
mod tests {
    use yarp_client::bottle;

    use super::*;

    fn prism() -> Item {
        Item {
            id: 7,
            label: "wedge".to_owned(),
            class: Class::Polygon,
            shape: ItemShape::Prism {
                side: 0.06,
                height: 0.07,
            },
            pose: Pose::from_parts(
                Translation3::new(0.5, -0.1, 0.02),
                Rotation3::from_euler_angles(0.1, -0.2, 0.3),
            ),
        }
    }

    #[cfg(feature = "vision")]
    #[test]
    fn items_are_read_as_they_were_written() {
        let cuboid = ItemShape::Cuboid {
            size: [0.05, 0.09, 0.04],
        };
        let cylinder = ItemShape::Cylinder {
            radius: 0.04,
            height: 0.1,
        };
        for (class, shape) in [
            (Class::Polygon, prism().shape),
            (Class::Polygon, cuboid),
            (Class::Glass, cylinder),
            (Class::Plate, cylinder),
        ] {
            let item = Item {
                class,
                shape,
                ..prism()
            };
            let read = read(&of_item(&item)).expect("it is an item");
            let (before, after) = (item.pose.to_homogeneous(), read.pose.to_homogeneous());
            assert!((before - after).amax() < 1e-12, "{before} {after}");
            let pose = item.pose;
            assert_eq!(Item { pose, ..read }, item);
        }
    }

    /// A size of zero or less, or what is no number, would be planned with.
    #[test]
    fn entries_that_are_no_objects_are_left_out() {
        let pose = prism().pose;
        let written = |word: &str, sizes: &[f64]| read(&entry(7, word, &pose, sizes, "x"));
        assert!(written("prism", &[0.06, 0.07]).is_some());
        for (word, sizes) in [
            ("prism", &[0.06][..]),
            ("prism", &[0.06, 0.0]),
            ("box", &[0.06, f64::NAN, 0.1]),
            ("sphere", &[0.06, 0.07]),
        ] {
            assert!(written(word, sizes).is_none(), "{word} {sizes:?}");
        }
        let nowhere = Pose::from_parts(Translation3::new(f64::INFINITY, 0.0, 0.0), pose.rotation);
        assert!(read(&entry(7, "prism", &nowhere, &[0.06, 0.07], "x")).is_none());
        assert!(read(&entry(0, "prism", &pose, &[0.06, 0.07], "x")).is_some());
        assert!(read(&bottle![-1, "prism"]).is_none());
    }
}
