//! The truth about a simulated table as a port, and a detector that asks it.

use std::sync::{Arc, Mutex, PoisonError};

use nalgebra::Rotation3;
use yarp_client::{Bottle, Network, RpcClient, RpcServer, bottle};
use yarp_manipulation::{DetectError, Detector, Item};
use yarp_table::{Object, Random, Scene, Shape};

use super::item_message;

/// Height above the table's surface below which an object's bottom counts as standing on it, m: higher ones are held.
const ON_TABLE: f64 = 0.03;

/// Opens a port that answers `list` with the objects: `is (id word x y z roll pitch yaw (sizes) label) ...` in m and rad.
pub fn serve_truth(
    network: &Network,
    name: &str,
    scene: Arc<Mutex<Scene>>,
) -> yarp_client::Result<RpcServer> {
    item_message::serve(network, name, move || {
        let scene = scene.lock().unwrap_or_else(PoisonError::into_inner);
        Ok(scene.objects.iter().map(described).collect())
    })
}

fn described(object: &Object) -> Bottle {
    let sizes: Vec<f64> = match object.shape {
        Shape::Prism { side, height } => vec![side, height],
        Shape::Glass { radius, height, .. } | Shape::Plate { radius, height } => {
            vec![radius, height]
        }
        ref other => other.extent().to_vec(),
    };
    let word = object.class().word();
    item_message::entry(object.id, word, &object.pose, &sizes, word)
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
        let mut item = item_message::read(entry)?;
        let place = item.pose.translation.vector;
        let mut noise = |scale: f64| self.random.gaussian() * scale;
        item.pose.translation.x += noise(self.noise);
        item.pose.translation.y += noise(self.noise);
        let (roll, pitch, yaw) = item.pose.rotation.euler_angles();
        let yaw = yaw + noise(self.noise / 0.05);
        item.pose.rotation = Rotation3::from_euler_angles(roll, pitch, yaw);
        // Whichever side it lies on.
        let item = item.at_rest();
        let inside = |value: f64, [from, to]: [f64; 2]| (from..=to).contains(&value);
        let bottom = place.z - item.shape.height() / 2.0;
        let is_there = inside(place.x, self.table[0])
            && inside(place.y, self.table[1])
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
        let entries = item_message::entries(&reply);
        Ok(entries.filter_map(|entry| self.item(entry)).collect())
    }
}
