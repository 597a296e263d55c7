//! The robot as URDF: joints from the kinematic models of arm and hand, links from generated meshes.
//!
//! Frames are those of the kinematic model: a link's mesh is placed in the frame behind its joint. Radii of links are estimated from pictures; lengths
//! and axes are those of the models.

use std::fmt::Write;

use nalgebra::{IsometryMatrix3, Point3, Rotation3, Translation3, Unit, Vector3};
use yarp_devices::hand::gcl::Finger;
use yarp_devices::hand::{FingerJoints, Links, finger_kinematics};
use yarp_devices::kinematics::Joints;
use yarp_devices::wam::WamModel;

use crate::mesh::Loft;

type Pose = IsometryMatrix3<f64>;

/// Height of the arm's base below the shoulder, m.
const BASE: f64 = 0.346;

/// One visible body of a link.
struct Part {
    /// Name of its mesh.
    mesh: String,
    /// Name of its material.
    material: &'static str,
    /// Pose of the mesh in the frame of the link.
    pose: Pose,
    body: Loft,
}

/// A link, and the joint that moves it.
struct Link {
    name: String,
    parent: String,
    joint: String,
    /// Pose of the joint in the frame of the parent.
    origin: Pose,
    axis: [f64; 3],
    /// Range, rad; `None` for a fixed joint.
    range: Option<[f64; 2]>,
    parts: Vec<Part>,
}

/// The robot's description and its meshes.
#[derive(Debug)]
pub(crate) struct RobotDescription {
    /// The URDF document; meshes are relative to its address.
    pub(crate) urdf: String,
    /// Name and OBJ text of each mesh.
    pub(crate) meshes: Vec<(String, String)>,
}

impl RobotDescription {
    /// Returns the WAM with 7 joints, with a BarrettHand or with a bare tool plate.
    pub(crate) fn wam(with_hand: bool) -> Self {
        let mut links = arm();
        if with_hand {
            links.extend(hand());
        }
        let mut urdf = String::from("<?xml version=\"1.0\"?>\n<robot name=\"wam\">\n");
        for (name, colour) in MATERIALS {
            let _ = writeln!(
                urdf,
                "  <material name=\"{name}\"><color rgba=\"{colour}\"/></material>"
            );
        }
        let base = base();
        write_link(&mut urdf, "base", &base);
        for link in &links {
            write_link(&mut urdf, &link.name, &link.parts);
            write_joint(&mut urdf, link);
        }
        urdf.push_str("</robot>\n");
        let parts = base
            .into_iter()
            .chain(links.into_iter().flat_map(|link| link.parts));
        let meshes = parts.map(|part| (part.mesh, part.body.to_obj())).collect();
        Self { urdf, meshes }
    }
}

/// Materials, with their colours.
const MATERIALS: [(&str, &str); 5] = [
    ("shell", "0.86 0.87 0.89 1"),
    ("graphite", "0.13 0.14 0.16 1"),
    ("metal", "0.62 0.64 0.67 1"),
    ("accent", "0.05 0.38 0.64 1"),
    ("rubber", "0.07 0.07 0.08 1"),
];

fn part(mesh: &str, material: &'static str, pose: Pose, body: Loft) -> Part {
    Part {
        mesh: mesh.to_owned(),
        material,
        pose,
        body,
    }
}

fn base() -> Vec<Part> {
    let foot = Loft::revolved(&[
        (0.0, -BASE),
        (0.150, -BASE),
        (0.150, -BASE + 0.020),
        (0.143, -BASE + 0.028),
        (0.118, -BASE + 0.034),
        (0.112, -BASE + 0.045),
        (0.108, -0.170),
        (0.100, -0.158),
        (0.0, -0.158),
    ]);
    let ring = Loft::drum(0.1125, -BASE + 0.075, -BASE + 0.087, 0.002);
    vec![
        part("base", "graphite", Pose::identity(), foot),
        part("base_ring", "accent", Pose::identity(), ring),
    ]
}

/// Returns the seven links of the arm.
fn arm() -> Vec<Link> {
    let model = WamModel::<7>::new();
    let frames = model.chain.frames(&Joints::<7>::zeros());
    let limits = model.chain.limits();
    let mut bodies = arm_bodies();
    let mut links = Vec::new();
    let mut behind = Pose::identity();
    let mut before = Pose::identity();
    for index in 0..7 {
        // Standard rows: a joint turns about z of the frame before it. `fixed` is what follows the turn.
        let fixed = before.inverse() * frames[index];
        let parts = bodies.remove(0).into_iter().map(|mut part| {
            part.pose = fixed * part.pose;
            part
        });
        links.push(Link {
            name: format!("link{}", index + 1),
            parent: match index {
                0 => "base".to_owned(),
                _ => format!("link{index}"),
            },
            joint: format!("joint{}", index + 1),
            origin: behind,
            axis: [0.0, 0.0, 1.0],
            range: Some([limits[index].min, limits[index].max]),
            parts: parts.collect(),
        });
        behind = fixed;
        before = frames[index];
    }
    links
}

/// Returns the bodies of each link of the arm, in the frames of the model.
fn arm_bodies() -> Vec<Vec<Part>> {
    let hub = Loft::capsule(0.066, 0.0, 0.062);
    let roll = Loft::revolved(&[
        (0.0, -0.034),
        (0.034, -0.034),
        (0.041, -0.028),
        (0.041, 0.030),
        (0.037, 0.044),
        (0.0, 0.044),
    ]);
    vec![
        shoulder_bodies(),
        vec![part("shoulder_hub", "graphite", Pose::identity(), hub)],
        upper_arm_bodies(),
        forearm_bodies(),
        wrist_bodies(),
        vec![part("wrist_roll", "shell", Pose::identity(), roll)],
        plate_bodies(),
    ]
}

/// Returns the bodies that turn about the vertical axis.
fn shoulder_bodies() -> Vec<Part> {
    // z of the shoulder's frame is the pitch axis, and -y is up.
    let up = along([0.0, 0.0, 0.0], [0.0, -1.0, 0.0]).0;
    let neck = Loft::revolved(&[
        (0.0, -0.156),
        (0.098, -0.156),
        (0.104, -0.148),
        (0.104, -0.110),
        (0.090, -0.070),
        (0.070, -0.030),
        (0.0, -0.030),
    ]);
    vec![
        part("shoulder_neck", "shell", up, neck),
        part(
            "shoulder_drum",
            "shell",
            Pose::identity(),
            Loft::drum(0.098, -0.086, 0.086, 0.014),
        ),
        part(
            "shoulder_cap_left",
            "graphite",
            Pose::identity(),
            Loft::drum(0.072, 0.080, 0.104, 0.006),
        ),
        part(
            "shoulder_cap_right",
            "graphite",
            Pose::identity(),
            Loft::drum(0.072, -0.104, -0.080, 0.006),
        ),
        part(
            "shoulder_mark",
            "accent",
            Pose::identity(),
            Loft::drum(0.030, 0.098, 0.1065, 0.002),
        ),
    ]
}

/// Returns the bodies of the upper arm and of the elbow.
fn upper_arm_bodies() -> Vec<Part> {
    // In the elbow's frame the upper arm points along -y at x = -0.045.
    let (axis, _) = along([-0.045, 0.55, 0.0], [-0.045, 0.0, 0.0]);
    let tube = Loft::revolved(&[
        (0.0, 0.070),
        (0.066, 0.070),
        (0.070, 0.078),
        (0.070, 0.135),
        (0.064, 0.150),
        (0.058, 0.300),
        (0.058, 0.430),
        (0.062, 0.440),
        (0.062, 0.478),
        (0.054, 0.490),
        (0.0, 0.490),
    ]);
    let (bracket, length) = along([-0.045, 0.075, 0.0], [0.0, 0.0, 0.0]);
    vec![
        part("upper_arm", "shell", axis, tube),
        part(
            "upper_ring",
            "graphite",
            axis,
            Loft::drum(0.0715, 0.100, 0.122, 0.003),
        ),
        part(
            "upper_mark",
            "accent",
            axis,
            Loft::drum(0.0625, 0.452, 0.462, 0.002),
        ),
        part(
            "elbow_bracket",
            "metal",
            bracket,
            Loft::capsule(0.044, 0.0, length),
        ),
        part(
            "elbow",
            "graphite",
            Pose::identity(),
            Loft::drum(0.056, -0.058, 0.058, 0.008),
        ),
        part(
            "elbow_mark",
            "accent",
            Pose::identity(),
            Loft::drum(0.022, -0.0605, 0.0605, 0.002),
        ),
    ]
}

/// Returns the bodies of the forearm.
fn forearm_bodies() -> Vec<Part> {
    // The elbow's axis is at x = 0.045 of the forearm's frame.
    let (bracket, length) = along([0.045, 0.0, 0.0], [0.0, 0.0, 0.060]);
    let tube = Loft::revolved(&[
        (0.0, 0.040),
        (0.050, 0.040),
        (0.055, 0.048),
        (0.055, 0.095),
        (0.050, 0.108),
        (0.045, 0.215),
        (0.045, 0.246),
        (0.040, 0.254),
        (0.0, 0.254),
    ]);
    vec![
        part(
            "forearm_bracket",
            "metal",
            bracket,
            Loft::capsule(0.036, 0.0, length),
        ),
        part("forearm", "shell", Pose::identity(), tube),
        part(
            "forearm_ring",
            "graphite",
            Pose::identity(),
            Loft::drum(0.0565, 0.064, 0.082, 0.003),
        ),
        part(
            "forearm_mark",
            "accent",
            Pose::identity(),
            Loft::drum(0.0465, 0.226, 0.234, 0.002),
        ),
    ]
}

/// Returns the bodies of the wrist.
fn wrist_bodies() -> Vec<Part> {
    // In the wrist's frame the forearm comes from +y.
    let (axis, _) = along([0.0, 0.050, 0.0], [0.0, 0.0, 0.0]);
    vec![
        part(
            "wrist_yaw",
            "metal",
            axis,
            Loft::drum(0.040, 0.004, 0.036, 0.004),
        ),
        part(
            "wrist",
            "graphite",
            Pose::identity(),
            Loft::drum(0.043, -0.046, 0.046, 0.008),
        ),
        part(
            "wrist_mark",
            "accent",
            Pose::identity(),
            Loft::drum(0.016, -0.048, 0.048, 0.002),
        ),
    ]
}

/// Returns the tool plate.
fn plate_bodies() -> Vec<Part> {
    vec![
        part(
            "tool_plate",
            "metal",
            Pose::identity(),
            Loft::drum(0.045, -0.014, 0.0, 0.002),
        ),
        part(
            "tool_ring",
            "accent",
            Pose::identity(),
            Loft::drum(0.0365, -0.0175, -0.013, 0.001),
        ),
    ]
}

/// Returns the palm and the links of the three fingers.
fn hand() -> Vec<Link> {
    let palm = Loft {
        half: [0.058, 0.045],
        exponent: 3.5,
        profile: vec![
            (0.0, 0.026),
            (0.94, 0.026),
            (1.0, 0.031),
            (1.0, 0.062),
            (0.95, 0.070),
            (0.0, 0.070),
        ],
    };
    let mut links = vec![Link {
        name: "palm".to_owned(),
        parent: "link7".to_owned(),
        joint: "hand".to_owned(),
        // The frame of the hand is that of the tool plate.
        origin: last_fixed(),
        axis: [0.0, 0.0, 1.0],
        range: None,
        parts: vec![
            part(
                "hand_body",
                "graphite",
                Pose::identity(),
                Loft::drum(0.046, 0.0, 0.030, 0.004),
            ),
            part("hand_palm", "shell", Pose::identity(), palm),
            part(
                "hand_face",
                "rubber",
                Pose::identity(),
                Loft::drum(0.026, 0.068, 0.0725, 0.002),
            ),
        ],
    }];
    let open = FingerJoints {
        spread: 0.0,
        links: Links::default(),
    };
    for (index, finger) in Finger::ALL.into_iter().enumerate() {
        links.extend(finger_links(index, finger, &open));
    }
    links
}

/// Returns the three links of a finger, whose joints are placed as in the hand that is `open`.
fn finger_links(index: usize, finger: Finger, open: &FingerJoints) -> Vec<Link> {
    let mut links = Vec::new();
    let frames = finger_kinematics::link_frames(finger, open);
    // F1 spreads against F2, and F3 does not.
    let spread = [-1.0, 1.0, 0.0][index];
    let number = index + 1;
    let name = |part: &str| format!("finger{number}_{part}");
    let range = |end: f64| Some([0.0, end.to_radians()]);
    links.push(Link {
        name: name("base"),
        parent: "palm".to_owned(),
        joint: name("spread"),
        origin: frames[0],
        axis: [0.0, 0.0, if spread == 0.0 { 1.0 } else { spread }],
        range: if spread == 0.0 { None } else { range(180.0) },
        parts: vec![finger_part(
            &name("knuckle"),
            "graphite",
            [0.006, 0.0, -0.010],
            [0.048, 0.0, 0.0],
            0.0130,
        )],
    });
    links.push(Link {
        name: name("proximal"),
        parent: name("base"),
        joint: name("inner"),
        origin: frames[0].inverse() * frames[1],
        axis: [0.0, 0.0, 1.0],
        range: range(140.0),
        parts: vec![
            finger_part(
                &name("link"),
                "metal",
                [0.0, 0.0, 0.0],
                [0.070, 0.0, 0.0],
                0.0108,
            ),
            part(
                &name("joint"),
                "graphite",
                Pose::identity(),
                Loft::drum(0.0125, -0.0125, 0.0125, 0.002),
            ),
        ],
    });
    links.push(Link {
        name: name("distal"),
        parent: name("proximal"),
        joint: name("outer"),
        origin: frames[1].inverse() * frames[2],
        axis: [0.0, 0.0, 1.0],
        range: range(48.0),
        parts: vec![
            finger_part(
                &name("tip"),
                "rubber",
                [0.0, 0.0, 0.0],
                [0.050, 0.0, 0.0],
                0.0095,
            ),
            part(
                &name("tip_joint"),
                "graphite",
                Pose::identity(),
                Loft::drum(0.0112, -0.0112, 0.0112, 0.002),
            ),
        ],
    });
    links
}

/// Returns the fixed part of the last row of the arm.
fn last_fixed() -> Pose {
    let frames = WamModel::<7>::new().chain.frames(&Joints::<7>::zeros());
    frames[5].inverse() * frames[6]
}

fn finger_part(
    mesh: &str,
    material: &'static str,
    from: [f64; 3],
    to: [f64; 3],
    radius: f64,
) -> Part {
    let (pose, length) = along(from, to);
    part(mesh, material, pose, Loft::capsule(radius, 0.0, length))
}

/// Returns the pose whose origin is `from` and whose z axis points to `to`, and their distance, m.
fn along(from: [f64; 3], to: [f64; 3]) -> (Pose, f64) {
    let (from, to) = (Point3::from(from), Point3::from(to));
    let way = to - from;
    let turn = Rotation3::rotation_between(&Vector3::z(), &way).unwrap_or_else(|| {
        Rotation3::from_axis_angle(&Unit::new_normalize(Vector3::x()), std::f64::consts::PI)
    });
    (Pose::from_parts(Translation3::from(from), turn), way.norm())
}

/// Returns a pose as the attributes of an `origin` element.
fn origin(pose: &Pose) -> String {
    let [x, y, z] = pose.translation.vector.into();
    let (roll, pitch, yaw) = pose.rotation.euler_angles();
    format!("<origin xyz=\"{x:.6} {y:.6} {z:.6}\" rpy=\"{roll:.6} {pitch:.6} {yaw:.6}\"/>")
}

fn write_link(urdf: &mut String, name: &str, parts: &[Part]) {
    let _ = writeln!(urdf, "  <link name=\"{name}\">");
    for part in parts {
        let _ = writeln!(
            urdf,
            "    <visual>{}<geometry><mesh filename=\"{}.obj\"/></geometry><material name=\"{}\"/></visual>",
            origin(&part.pose),
            part.mesh,
            part.material
        );
    }
    let _ = writeln!(urdf, "  </link>");
}

fn write_joint(urdf: &mut String, link: &Link) {
    let kind = if link.range.is_some() {
        "revolute"
    } else {
        "fixed"
    };
    let _ = writeln!(urdf, "  <joint name=\"{}\" type=\"{kind}\">", link.joint);
    let _ = writeln!(
        urdf,
        "    <parent link=\"{}\"/><child link=\"{}\"/>{}",
        link.parent,
        link.name,
        origin(&link.origin)
    );
    if let Some([min, max]) = link.range {
        let [x, y, z] = link.axis;
        let _ = writeln!(
            urdf,
            "    <axis xyz=\"{x} {y} {z}\"/><limit lower=\"{min:.4}\" upper=\"{max:.4}\" effort=\"0\" velocity=\"0\"/>"
        );
    }
    let _ = writeln!(urdf, "  </joint>");
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Composes the joints of a description, as a reader of URDF does.
    fn place(links: &[Link], name: &str, angle: &dyn Fn(&str) -> f64) -> Pose {
        let Some(link) = links.iter().find(|link| link.name == name) else {
            return Pose::identity();
        };
        let turn = match link.range {
            Some(_) => Rotation3::from_axis_angle(
                &Unit::new_normalize(link.axis.into()),
                angle(&link.joint),
            ),
            None => Rotation3::identity(),
        };
        place(links, &link.parent, angle) * link.origin * turn
    }

    #[test]
    fn joints_compose_to_the_kinematics_of_the_arm() {
        let links = arm();
        let model = WamModel::<7>::new();
        let joints = Joints::<7>::from([0.3, -0.8, 0.5, 1.2, -0.4, 0.7, 1.1]);
        let angle = |name: &str| joints[name[5..].parse::<usize>().unwrap() - 1];
        let found = place(&links, "link7", &angle) * last_fixed();
        let expected = model.chain.frames(&joints)[6];
        assert!((found.to_homogeneous() - expected.to_homogeneous()).norm() < 1e-9);
    }

    #[test]
    fn fingers_compose_to_the_kinematics_of_the_hand() {
        let mut links = hand();
        // Poses are compared in the frame of the palm.
        links[0].origin = Pose::identity();
        let joints = FingerJoints {
            spread: 0.7,
            links: Links {
                inner: 0.9,
                outer: 0.4,
            },
        };
        let angle = |name: &str| match name.rsplit('_').next() {
            Some("spread") => joints.spread,
            Some("inner") => joints.links.inner,
            Some("outer") => joints.links.outer,
            _ => unreachable!("{name}"),
        };
        for (index, finger) in Finger::ALL.into_iter().enumerate() {
            let found = place(&links, &format!("finger{}_distal", index + 1), &angle);
            let [_, _, expected] = finger_kinematics::link_frames(finger, &joints);
            let off = (found.to_homogeneous() - expected.to_homogeneous()).norm();
            assert!(off < 1e-9, "{finger:?}: {off}");
        }
    }

    #[test]
    fn every_mesh_of_the_description_exists() {
        let robot = RobotDescription::wam(true);
        let mut count = 0;
        for rest in robot.urdf.split("filename=\"").skip(1) {
            let name = rest.split(".obj").next().unwrap();
            assert!(
                robot.meshes.iter().any(|(known, _)| known == name),
                "{name}"
            );
            count += 1;
        }
        assert_eq!(count, robot.meshes.len());
        assert!(RobotDescription::wam(false).meshes.len() < count);
    }
}
