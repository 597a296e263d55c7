//! Messages to the browsers that show the page.
//!
//! A browser opens a web socket and asks the port to write to it. Every message is complete in itself, so one that a slow viewer misses is made
//! good by the next: the port skips a viewer that has not taken the earlier ones, and nobody waits for it.
//!
//! | message | content | rate |
//! | --- | --- | --- |
//! | `{"state": ..}` | arm and hand | with each state, at most 100 Hz |
//! | `{"scene": ..}` | table and objects | with each change, at most 20 Hz |
//! | `{"image": ..}` and a blob | image of the camera as JPEG | with each image |
//! | `{"status": ..}` | everything else | with each change, at most 10 Hz, and once a second |

use std::sync::Arc;
use std::time::Duration;

use bytes::Bytes;
use serde_json::{Value as Json, json};
use tokio::time::{Instant, MissedTickBehavior};
use yarp_devices::clock::wall_clock;
use yarp_ports::Port;
use yarp_wire::{Bottle, Value};

use crate::camera_image;
use crate::page_files::PageFiles;
use crate::port_sources::Sources;
use crate::view_model::Model;

/// Interval between two looks for new data while somebody watches.
const TICK: Duration = Duration::from_millis(10);
/// Interval between two looks for viewers while there is none.
const IDLE_TICK: Duration = Duration::from_millis(200);
/// Shortest interval between two scenes.
const SCENE_INTERVAL: Duration = Duration::from_millis(50);
/// Shortest interval between two statuses.
const STATUS_INTERVAL: Duration = Duration::from_millis(100);
/// Longest interval between two statuses.
const MAX_STATUS_INTERVAL: Duration = Duration::from_secs(1);
/// Maximum number of messages that a viewer may be behind before it is skipped.
const MAX_BACKLOG: usize = 4;

/// The stream to all viewers.
#[derive(Debug)]
pub(crate) struct ViewerStream {
    page: Arc<Port>,
    model: Arc<Model>,
    sources: Arc<Sources>,
    files: Arc<PageFiles>,
}

/// Versions that the viewers have been sent.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Versions {
    state: (u64, u64),
    scene: u64,
    image: u64,
    status: (u64, u64, u64, bool),
}

impl ViewerStream {
    pub(crate) fn new(
        page: Arc<Port>,
        model: Arc<Model>,
        sources: Arc<Sources>,
        files: Arc<PageFiles>,
    ) -> Self {
        Self {
            page,
            model,
            sources,
            files,
        }
    }

    /// Sends what is new; runs until it is aborted.
    pub(crate) async fn run(self) {
        let mut ticks = tokio::time::interval(TICK);
        ticks.set_missed_tick_behavior(MissedTickBehavior::Delay);
        let mut viewers = 0;
        let mut sent = Versions::default();
        let (mut scene_at, mut status_at) = (Instant::now(), Instant::now());
        loop {
            let before = std::mem::replace(&mut viewers, self.page.outputs().len());
            self.sources.set_watched(viewers > 0);
            if viewers == 0 {
                tokio::time::sleep(IDLE_TICK).await;
                continue;
            }
            ticks.tick().await;
            let now = Instant::now();
            // Everything is new to a new viewer.
            let is_refresh = viewers > before || now - status_at >= MAX_STATUS_INTERVAL;
            let new = self.versions();
            if new.state != sent.state {
                self.send_json(&self.state());
                sent.state = new.state;
            }
            if is_refresh || new.scene != sent.scene && now - scene_at >= SCENE_INTERVAL {
                let scene = self.model.latest().scene.value.clone();
                if let Some(scene) = scene {
                    self.send_json(&json!({ "scene": scene }));
                }
                (sent.scene, scene_at) = (new.scene, now);
            }
            if is_refresh || new.status != sent.status && now - status_at >= STATUS_INTERVAL {
                self.send_json(&self.status(viewers));
                (sent.status, status_at) = (new.status, now);
            }
            if new.image != sent.image {
                sent.image = new.image;
                self.send_image().await;
            }
        }
    }

    fn versions(&self) -> Versions {
        let log = self.model.log.count();
        let latest = self.model.latest();
        Versions {
            state: (latest.arm.version, latest.hand.version),
            scene: latest.scene.version,
            image: latest.image.version,
            status: (
                latest.detections.version,
                latest.plan.version,
                log,
                latest.stopped,
            ),
        }
    }

    fn state(&self) -> Json {
        let latest = self.model.latest();
        json!({ "state": {
            "time": wall_clock(),
            "arm": latest.arm.value.as_ref().map(|state| &state.json),
            "hand": latest.hand.value.as_ref().map(|state| &state.json),
        }})
    }

    fn status(&self, viewers: usize) -> Json {
        let sources = self.sources.to_json();
        let log = self.model.log.to_json();
        let dropped: u64 = self
            .page
            .counters()
            .connections
            .iter()
            .map(|link| link.traffic.dropped)
            .sum();
        let latest = self.model.latest();
        json!({ "status": {
            "config": self.files.config(),
            "viewers": viewers,
            "skipped": dropped,
            "stopped": latest.stopped,
            "age": latest.arm.value.as_ref().map(|state| state.age()),
            "detections": latest.detections.value,
            "plan": latest.plan.value,
            "network": latest.network,
            "sources": sources,
            "log": log,
        }})
    }

    fn send_json(&self, json: &Json) {
        let message = Bottle::of(json.to_string());
        self.page.try_write(&message, None, MAX_BACKLOG);
    }

    async fn send_image(&self) {
        let Some(image) = self.model.latest().image.value.clone() else {
            return;
        };
        // Encoding takes some milliseconds.
        let encoding = tokio::task::spawn_blocking(move || camera_image::encode(&image));
        let Ok(Some(shown)) = encoding.await else {
            return;
        };
        let head = json!({ "image": { "width": shown.width, "height": shown.height } });
        let message = Bottle::of(head.to_string()).with(Value::Blob(Bytes::from(shown.jpeg)));
        self.page.try_write(&message, None, MAX_BACKLOG);
    }
}
