//! The truth about a simulated table as a port, and a detector that asks it.

use std::sync::{Arc, Mutex, PoisonError};

use nalgebra::{Rotation3, Translation3};
use yarp_client::{Bottle, Network, RpcClient, RpcServer, Value, bottle};
use yarp_devices::kinematics::Pose;
use yarp_manipulation::{Class, DetectError, Detector, Item, ItemShape};
use yarp_table::{Object, Random, Scene, Shape};

/// Maximum number of objects of a reply.
const MAX_OBJECTS: usize = 1000;
/// Height above the table's surface below which an object's bottom counts as standing on it, m: higher ones are held.
const ON_TABLE: f64 = 0.03;

/// Opens a port that answers `list` with the objects: `[is] (id class x y z roll pitch yaw (sizes)) ...` in m and rad.
///
/// Sizes are edges along x, y and z of a box or carton, side and height of a prism, radius and height of a glass or plate.
pub fn serve_truth(
    network: &Network,
    name: &str,
    scene: Arc<Mutex<Scene>>,
) -> yarp_client::Result<RpcServer> {
    RpcServer::open_on(network, name, move |request: Bottle| {
        let list = request.get(0).and_then(Value::as_str) == Some("list");
        if !list {
            return bottle!["fail", "expected list"];
        }
        let mut reply = bottle!["is"];
        let scene = scene.lock().unwrap_or_else(PoisonError::into_inner);
        for object in scene.objects.iter().take(MAX_OBJECTS) {
            reply.push(Value::List(described(object)));
        }
        reply
    })
}

fn described(object: &Object) -> Bottle {
    let place = object.pose.translation.vector;
    let (roll, pitch, yaw) = object.pose.rotation.euler_angles();
    let sizes: Vec<f64> = match object.shape {
        Shape::Prism { side, height } => vec![side, height],
        Shape::Glass { radius, height, .. } | Shape::Plate { radius, height } => {
            vec![radius, height]
        }
        ref other => other.extent().to_vec(),
    };
    let mut list = Bottle::new();
    for size in sizes {
        list.push(size);
    }
    let mut all = Bottle::new();
    all.push(object.id as i32);
    all.push(object.class().word());
    for number in [place.x, place.y, place.z, roll, pitch, yaw] {
        all.push(number);
    }
    all.push(Value::List(list));
    all
}

/// A detector that asks the simulated table, with noise of the order of a calibrated camera's.
#[derive(Debug)]
pub struct RemoteTruth {
    client: RpcClient,
    peer: String,
    random: Random,
    noise: f64,
    surface: f64,
    table: [[f64; 2]; 2],
}

impl RemoteTruth {
    /// Name in reports.
    pub const NAME: &'static str = "truth";

    /// Connects to the port of the truth.
    ///
    /// * `noise`: standard deviation of a place along x and along y, m; also of the yaw, as if on a radius of 50 mm.
    /// * Errors: those of [`RpcClient::connect_on`].
    pub fn connect(
        network: &Network,
        peer: &str,
        noise: f64,
        seed: u64,
    ) -> yarp_client::Result<Self> {
        let scene = Scene::empty();
        Ok(Self {
            client: RpcClient::connect_on(network, "...", peer)?,
            peer: peer.to_owned(),
            random: Random::for_purpose(seed, 0x7247),
            noise,
            surface: scene.table.surface,
            table: [scene.table.x, scene.table.y],
        })
    }

    fn item(&mut self, entry: &Bottle) -> Option<Item> {
        let number = |index: usize| entry.get(index).and_then(Value::as_f64);
        let id = u32::try_from(entry.get(0).and_then(Value::as_i32)?).ok()?;
        let word = entry.get(1).and_then(Value::as_str)?;
        let sizes = entry.get(8).and_then(Value::as_list)?;
        let size = |index: usize| sizes.get(index).and_then(Value::as_f64);
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
                let class = if word == "glass" {
                    Class::Glass
                } else {
                    Class::Plate
                };
                let (radius, height) = (size(0)?, size(1)?);
                (class, ItemShape::Cylinder { radius, height })
            }
            _ => return None,
        };
        let (x, y, z) = (number(2)?, number(3)?, number(4)?);
        let mut noise = |scale: f64| self.random.gaussian() * scale;
        let place = Translation3::new(x + noise(self.noise), y + noise(self.noise), z);
        let yaw = number(7)? + noise(self.noise / 0.05);
        let turn = Rotation3::from_euler_angles(number(5)?, number(6)?, yaw);
        let item = Item {
            id,
            label: word.to_owned(),
            class,
            shape,
            pose: Pose::from_parts(place, turn),
        };
        // Whichever side it lies on.
        let item = item.at_rest();
        let inside = |value: f64, [from, to]: [f64; 2]| (from..=to).contains(&value);
        let bottom = z - item.shape.height() / 2.0;
        let is_there = inside(x, self.table[0])
            && inside(y, self.table[1])
            && (-ON_TABLE..ON_TABLE).contains(&(bottom - self.surface));
        is_there.then_some(item)
    }
}

impl Detector for RemoteTruth {
    fn name(&self) -> &'static str {
        Self::NAME
    }

    fn detect(&mut self) -> Result<Vec<Item>, DetectError> {
        let reply: Bottle = self.client.call(bottle!["list"]).map_err(|source| {
            let detector = "truth";
            tracing::warn!(peer = %self.peer, "no truth");
            DetectError::Failed {
                detector,
                source: Box::new(source),
            }
        })?;
        let entries: Vec<Bottle> = reply
            .iter()
            .skip(1)
            .filter_map(Value::as_list)
            .take(MAX_OBJECTS)
            .cloned()
            .collect();
        Ok(entries
            .iter()
            .filter_map(|entry| self.item(entry))
            .collect())
    }
}
