//! Files of the page, compiled into the program, and those that describe the robot.

use std::future::ready;

use serde_json::{Value as Json, json};
use yarp_devices::wam::WamModel;
use yarp_ports::{Network, Page};
use yarp_wire::http::{Request, Response};

use crate::robot_urdf::RobotDescription;

const SCRIPT: &str = "text/javascript";

/// Address, media type and content of each file.
const FILES: [(&str, &str, &str); 9] = [
    ("", "text/html", include_str!("../web/page/index.html")),
    (
        "view/view.css",
        "text/css",
        include_str!("../web/page/view.css"),
    ),
    (
        "view/icon.svg",
        "image/svg+xml",
        include_str!("../web/page/icon.svg"),
    ),
    ("view/main.js", SCRIPT, include_str!("../web/page/main.js")),
    (
        "view/connection.js",
        SCRIPT,
        include_str!("../web/page/connection.js"),
    ),
    (
        "view/plots.js",
        SCRIPT,
        include_str!("../web/page/plots.js"),
    ),
    (
        "view/panels.js",
        SCRIPT,
        include_str!("../web/page/panels.js"),
    ),
    (
        "view/camera.js",
        SCRIPT,
        include_str!("../web/page/camera.js"),
    ),
    (
        "view/controls.js",
        SCRIPT,
        include_str!("../web/page/controls.js"),
    ),
];

/// Address of the three-dimensional part.
const SCENE: &str = "view/scene.js";
/// The three-dimensional part, which the build script bundles.
const SCENE_SCRIPT: &str = include_str!(concat!(env!("OUT_DIR"), "/scene.js"));

/// Address below which the description of the robot is.
const ROBOT: &str = "robot/";
/// Address of the URDF document.
const URDF: &str = "robot/wam.urdf";

/// The page and the description of the robot.
#[derive(Debug)]
pub(crate) struct PageFiles {
    robot: RobotDescription,
    config: Json,
}

impl PageFiles {
    /// * `hand`, `camera`: true if the view shows one.
    /// * `control`: true if the page commands the robot.
    pub(crate) fn new(network: &Network, arm: &str, [hand, camera, control]: [bool; 3]) -> Self {
        let limits = WamModel::<7>::new()
            .chain
            .limits()
            .map(|limit| [limit.min.to_degrees(), limit.max.to_degrees()]);
        let server = network
            .server()
            .map(|(host, port)| format!("http://{host}:{port}/"));
        Self {
            robot: RobotDescription::wam(hand),
            config: json!({
                "arm": arm,
                "hand": hand,
                "camera": camera,
                "control": control,
                "scene": crate::HAS_SCENE,
                "limits": limits,
                "server": server,
                "version": env!("CARGO_PKG_VERSION"),
            }),
        }
    }

    /// Returns the facts about this view that do not change.
    pub(crate) fn config(&self) -> &Json {
        &self.config
    }

    /// Returns the page at an address, if the view has one.
    pub(crate) fn page(&self, request: &Request) -> Option<Page> {
        // `/?...` belongs to the port.
        if !request.fields.is_empty() || request.target.contains('?') {
            return None;
        }
        let found = self.at(&request.target)?;
        Some(Box::pin(ready(found)))
    }

    fn at(&self, path: &str) -> Option<Response> {
        if path == SCENE {
            return Some(match crate::HAS_SCENE {
                true => Response::new(SCRIPT, SCENE_SCRIPT),
                false => Response::not_found("This program was built without 3D.\n".to_owned()),
            });
        }
        if let Some((_, mime, content)) = FILES.iter().find(|(known, ..)| *known == path) {
            return Some(Response::new(mime, *content));
        }
        if path == URDF {
            return Some(Response::new("application/xml", self.robot.urdf.clone()));
        }
        let name = path.strip_prefix(ROBOT)?.strip_suffix(".obj")?;
        let (_, mesh) = self.robot.meshes.iter().find(|(known, _)| known == name)?;
        Some(Response::new("model/obj", mesh.clone()))
    }
}
