//! Messages that show a task in the live view: what was detected, and what the robot is about to do.

use std::f64::consts::TAU;
use std::sync::mpsc::{RecvTimeoutError, Sender, channel};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use std::time::Duration;

use nalgebra::Point3;
use yarp_client::{Bottle, Network, Publisher, bottle};
use yarp_manipulation::{Item, ItemShape, Step, TaskEvent};
use yarp_table::{Camera, Scene};
use yarp_wire::Value;

/// Interval at which the messages are repeated, for viewers that come later.
const REPEAT_INTERVAL: Duration = Duration::from_millis(500);
/// Number of corners of the outline of a cylinder.
const CIRCLE_CORNERS: u32 = 24;

/// Two ports that tell viewers about a task (`docs/live-view.md`): `NAME/detections:o` and `NAME/plan:o`.
///
/// Dropping it closes them.
#[derive(Debug)]
pub(super) struct TaskDisplay {
    shared: Arc<Shared>,
    ends: Option<Sender<()>>,
    repeats: Option<JoinHandle<()>>,
}

#[derive(Debug)]
struct Shared {
    detections: Publisher<Bottle>,
    plan: Publisher<Bottle>,
    camera: Camera,
    state: Mutex<State>,
}

/// The task as it was told so far.
#[derive(Debug, Default)]
struct State {
    detections: Option<Bottle>,
    phase: &'static str,
    text: String,
    target: Option<u32>,
    progress: [usize; 2],
    /// Degrees.
    path: Vec<[f64; 7]>,
}

impl TaskDisplay {
    /// Names of the ports, after that of the task.
    pub(super) const PORTS: [&str; 2] = ["detections:o", "plan:o"];

    /// Opens the ports of a task with this name, such as `/tidy`, on a table under the camera of
    /// `docs/table-simulation.md`.
    ///
    /// Errors: those of [`Publisher::open_on`].
    pub(super) fn open(network: &Network, name: &str) -> yarp_client::Result<Self> {
        let port = |part: &str| Publisher::open_on(network, &format!("{name}/{part}"));
        let [detections, plan] = Self::PORTS;
        let shared = Arc::new(Shared {
            detections: port(detections)?,
            plan: port(plan)?,
            camera: Scene::empty().camera(),
            state: Mutex::new(State {
                phase: "idle",
                ..State::default()
            }),
        });
        let (ends, ended) = channel();
        let repeated = Arc::clone(&shared);
        let repeats = std::thread::spawn(move || {
            while ended.recv_timeout(REPEAT_INTERVAL) == Err(RecvTimeoutError::Timeout) {
                repeated.publish(true);
            }
        });
        Ok(Self {
            shared,
            ends: Some(ends),
            repeats: Some(repeats),
        })
    }

    /// Returns a callback for the events of the task.
    pub(super) fn observer(&self) -> impl FnMut(&TaskEvent<'_>) + Send + 'static {
        let shared = Arc::clone(&self.shared);
        move |event| {
            let is_detection = shared.state().take(event, &shared.camera);
            shared.publish(is_detection);
        }
    }
}

impl Drop for TaskDisplay {
    fn drop(&mut self) {
        drop(self.ends.take());
        if let Some(repeats) = self.repeats.take() {
            // A panic there has been printed.
            let _ = repeats.join();
        }
    }
}

impl Shared {
    fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Publishes the plan, and what was detected if it is asked for.
    fn publish(&self, detections: bool) {
        let (found, plan) = {
            let state = self.state();
            let found = state.detections.clone().filter(|_| detections);
            (found, state.plan())
        };
        if let Some(found) = found {
            self.detections.publish(&found);
        }
        self.plan.publish(&plan);
    }
}

impl State {
    /// Takes over what an event tells; returns whether there are new detections.
    fn take(&mut self, event: &TaskEvent<'_>, camera: &Camera) -> bool {
        match *event {
            TaskEvent::Detected { items } => {
                self.detections = Some(detections(items, camera));
                self.path.clear();
                self.phase = "detect";
                self.target = None;
                return true;
            }
            TaskEvent::Progress { done, all } => self.progress = [done, all],
            TaskEvent::Chosen { item, destination } => {
                self.phase = "plan";
                self.target = Some(item.id);
                self.text = format!("{} {} into {destination}", item.label, item.id);
            }
            TaskEvent::Step { step, path } => {
                self.phase = phase(step);
                self.path = path
                    .iter()
                    .map(|joints| joints.map(f64::to_degrees).into())
                    .collect();
            }
            TaskEvent::Failed { reason } => reason.clone_into(&mut self.text),
            TaskEvent::Ended { stopped, error } => {
                self.phase = match stopped || error.is_some() {
                    true => "stopped",
                    false => "done",
                };
                self.text = error.unwrap_or_default().to_owned();
                self.target = None;
                self.path.clear();
            }
            _ => {}
        }
        false
    }

    fn plan(&self) -> Bottle {
        let mut plan = bottle!["plan"];
        plan.push(Value::List(bottle!["phase", self.phase]));
        if !self.text.is_empty() {
            plan.push(Value::List(bottle!["text", self.text.as_str()]));
        }
        if let Some(target) = self.target {
            plan.push(Value::List(bottle!["target", target as i32]));
        }
        let [done, all] = self.progress.map(|count| count as i32);
        plan.push(Value::List(bottle!["progress", done, all]));
        if !self.path.is_empty() {
            let mut joints = bottle!["joints"];
            for posture in &self.path {
                joints.push(Value::List(list(*posture)));
            }
            plan.push(Value::List(joints));
        }
        plan
    }
}

/// Returns the phase of a step, in the words of the view.
fn phase(step: Step) -> &'static str {
    match step {
        Step::Plan => "plan",
        Step::PreGrasp | Step::Approach => "approach",
        Step::Grasp => "grasp",
        Step::Lift => "lift",
        Step::Transport => "place",
        Step::Release => "retreat",
    }
}

fn list(numbers: impl IntoIterator<Item = f64>) -> Bottle {
    numbers.into_iter().fold(Bottle::new(), Bottle::with)
}

/// Returns the message about detected objects, with the outlines of their upper faces in the image.
fn detections(items: &[Item], camera: &Camera) -> Bottle {
    let [width, height] = [camera.lens.width, camera.lens.height].map(|size| size as i32);
    let mut message = bottle!["detections"];
    message.push(Value::List(bottle!["image", width, height]));
    for item in items {
        let mut object = bottle!["object", item.id as i32, item.label.as_str(), 1.0];
        let mut polygon = bottle!["polygon"];
        let corners = outline(&item.shape);
        for [x, y] in corners {
            let corner = item.pose * Point3::new(x, y, item.shape.height() / 2.0);
            if let Some(pixel) = camera.project(&corner) {
                polygon.push(Value::List(list(pixel)));
            }
        }
        object.push(Value::List(polygon));
        let place = item.pose.translation.vector;
        let pose = bottle!["pose", place.x, place.y, place.z, item.yaw()];
        object.push(Value::List(pose));
        message.push(Value::List(object));
    }
    message
}

/// Returns the outline of an item's upper face in its own frame, m.
fn outline(shape: &ItemShape) -> Vec<[f64; 2]> {
    match *shape {
        ItemShape::Cuboid { size: [x, y, _] } => {
            let [x, y] = [x / 2.0, y / 2.0];
            vec![[x, y], [-x, y], [-x, -y], [x, -y]]
        }
        ItemShape::Prism { side, .. } => yarp_table::Shape::triangle(side).into(),
        ItemShape::Cylinder { radius, .. } => (0..CIRCLE_CORNERS)
            .map(|corner| {
                let angle = TAU * f64::from(corner) / f64::from(CIRCLE_CORNERS);
                [radius * angle.cos(), radius * angle.sin()]
            })
            .collect(),
    }
}

#[cfg(test)]
mod tests {
    use yarp_devices::kinematics::{Joints, Pose};
    use yarp_manipulation::Class;

    use super::*;

    fn item(shape: ItemShape) -> Item {
        Item {
            id: 3,
            label: "cup".into(),
            class: Class::Glass,
            shape,
            pose: Pose::translation(0.55, 0.0, 0.0),
        }
    }

    #[test]
    fn outlines_surround_the_object_in_the_image() {
        let camera = Scene::empty().camera();
        let shapes = [
            ItemShape::Cuboid {
                size: [0.05, 0.08, 0.10],
            },
            ItemShape::Prism {
                side: 0.08,
                height: 0.10,
            },
            ItemShape::Cylinder {
                radius: 0.04,
                height: 0.10,
            },
        ];
        for shape in shapes {
            let message = detections(&[item(shape)], &camera);
            let object = message.find_group("object").unwrap();
            let polygon = object.find_group("polygon").unwrap();
            let corners: Vec<[f64; 2]> = polygon
                .iter()
                .filter_map(Value::as_list)
                .map(|corner| [0, 1].map(|axis| corner.get(axis).unwrap().as_f64().unwrap()))
                .collect();
            assert_eq!(corners.len(), outline(&shape).len());
            // The object is below the camera: its outline is around the middle of the image, some 1.8 pixels a millimetre.
            let [width, height] = [camera.lens.width, camera.lens.height].map(|size| size as f64);
            let mean = |axis: usize| {
                corners.iter().map(|corner| corner[axis]).sum::<f64>() / corners.len() as f64
            };
            assert!(
                (mean(0) - width / 2.0).abs() < 15.0,
                "{shape:?}: {corners:?}"
            );
            assert!(
                (mean(1) - height / 2.0).abs() < 15.0,
                "{shape:?}: {corners:?}"
            );
            let reach = corners.iter().map(|corner| (corner[0] - mean(0)).abs());
            let reach = reach.fold(0.0, f64::max);
            assert!((60.0..110.0).contains(&reach), "{shape:?}: {reach}");
        }
    }

    #[test]
    fn a_task_is_told_as_it_goes_on() {
        let camera = Scene::empty().camera();
        let mut state = State::default();
        let cup = item(ItemShape::Cylinder {
            radius: 0.04,
            height: 0.10,
        });
        let items = [cup.clone()];
        assert!(state.take(&TaskEvent::Detected { items: &items }, &camera));
        assert!(!state.take(&TaskEvent::Progress { done: 2, all: 3 }, &camera));
        let destination = "the basket of glasses";
        let chosen = TaskEvent::Chosen {
            item: &cup,
            destination,
        };
        state.take(&chosen, &camera);
        let path = [Joints::<7>::zeros(), Joints::<7>::repeat(1.0)];
        let step = Step::Transport;
        state.take(&TaskEvent::Step { step, path: &path }, &camera);
        let text = state.plan().to_string();
        assert!(
            text.starts_with(
                "plan (phase place) (text \"cup 3 into the basket of glasses\") (target 3) (progress 2 3) (joints (0.0 "
            ),
            "{text}"
        );
        assert!(text.contains("(57.29"), "{text}");
        let error = Some("the hand is gone");
        let stopped = false;
        state.take(&TaskEvent::Ended { stopped, error }, &camera);
        let text = state.plan().to_string();
        assert_eq!(
            text,
            "plan (phase stopped) (text \"the hand is gone\") (progress 2 3)"
        );
        let ended = TaskEvent::Ended {
            stopped: false,
            error: None,
        };
        state.take(&ended, &camera);
        assert_eq!(state.plan().to_string(), "plan (phase done) (progress 2 3)");
    }
}
