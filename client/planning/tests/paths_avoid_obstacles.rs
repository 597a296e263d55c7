//! Paths in cluttered scenes keep away from everything, by a check that shares nothing with the planner's.

use nalgebra::{Point3, Rotation3, Translation3, Vector3};
use yarp_devices::kinematics::{Joints, Pose};
use yarp_devices::pseudo_random::Random;
use yarp_devices::wam::WamModel;
use yarp_planning::{
    ArmGeometry, CollisionModel, Obstacle, Path, PlanError, Planner, PlannerOptions, Scene, Shape,
};

/// A table with boxes and cylinders on it, and some boxes in the air.
fn cluttered(seed: u64) -> Scene {
    let mut random = Random::new(seed);
    let mut scene = Scene::default();
    let table = Pose::translation(0.0, 0.0, -0.35);
    scene.add(Obstacle::new("floor", Shape::HalfSpace, table));
    for index in 0..8 {
        let angle = random.between(-2.4, 2.4);
        let radius = random.between(0.35, 0.85);
        let size = [
            random.between(0.05, 0.2),
            random.between(0.05, 0.2),
            random.between(0.1, 0.5),
        ];
        let height = match index {
            0..6 => -0.35 + size[2] / 2.0,
            _ => random.between(0.1, 0.7),
        };
        let place = Translation3::new(radius * angle.cos(), radius * angle.sin(), height);
        let turn = Rotation3::from_axis_angle(&Vector3::z_axis(), random.between(-1.5, 1.5));
        let shape = match index % 2 {
            0 => Shape::cuboid(size),
            _ => Shape::cylinder(size[0] / 2.0, size[2]),
        };
        scene.add(Obstacle::new(
            format!("obstacle {index}"),
            shape,
            Pose::from_parts(place, turn),
        ));
    }
    scene
}

fn free_posture(model: &CollisionModel, random: &mut Random) -> Joints<7> {
    let limits = *model.chain().limits();
    loop {
        let posture =
            Joints::<7>::from_fn(|joint, _| random.between(limits[joint].min, limits[joint].max));
        if model.is_free(&posture) {
            return posture;
        }
    }
}

/// Smallest distance of the bare axes of the arm, sampled densely, from the obstacles; no sphere, no bound.
fn sampled_clearance(scene: &Scene, joints: &Joints<7>) -> f64 {
    let frames = WamModel::<7>::new().chain.frames(joints);
    // (frame, from, to, radius of the real link)
    let links = [
        (3, [-0.045, 0.50, 0.0], [-0.045, 0.08, 0.0], 0.060),
        (4, [0.0, 0.0, 0.04], [0.0, 0.0, 0.25], 0.048),
        (6, [0.0, 0.0, 0.0], [0.0, 0.0, 0.035], 0.043),
    ];
    let mut smallest = f64::INFINITY;
    for (frame, from, to, radius) in links {
        for step in 0..=40 {
            let part = f64::from(step) / 40.0;
            let local = Point3::from(Vector3::from(from).lerp(&Vector3::from(to), part));
            let point = frames[frame - 1] * local;
            for obstacle in scene.obstacles() {
                smallest = smallest.min(obstacle.distance(&point) - radius);
            }
        }
    }
    smallest
}

#[track_caller]
fn check_path(scene: &Scene, path: &Path) {
    for pair in path.postures().windows(2) {
        let steps = ((pair[1] - pair[0]).norm() / 0.005).ceil().max(1.0);
        for step in 0..=steps as usize {
            let posture = pair[0].lerp(&pair[1], step as f64 / steps);
            let clearance = sampled_clearance(scene, &posture);
            assert!(clearance > 0.005, "{clearance} at {posture:?}");
        }
    }
}

#[test]
fn a_path_is_found_in_nearly_every_cluttered_scene() {
    let model = WamModel::<7>::new();
    let mut missing = Vec::new();
    let scenes = 40;
    for seed in 0..scenes {
        let scene = cluttered(seed);
        let checks = CollisionModel::new(&model.chain, ArmGeometry::wam(), scene.clone());
        let mut random = Random::new(seed + 1000);
        let start = free_posture(&checks, &mut random);
        let goal = free_posture(&checks, &mut random);
        match Planner::with_model(checks).plan(&start, &[goal]) {
            Ok(path) => {
                assert_eq!(path.postures()[0], start);
                assert_eq!(path.goal(), goal);
                check_path(&scene, &path);
            }
            Err(error) => missing.push((seed, error)),
        }
    }
    // An error is allowed where a random posture is walled in.
    assert!(missing.len() <= 1, "{missing:?}");
}

#[test]
fn a_detour_is_found_and_shortened() {
    let mut scene = Scene::default();
    let wall = Shape::cuboid([0.8, 0.04, 1.0]);
    scene.add(Obstacle::new(
        "wall",
        wall,
        Pose::translation(0.75, 0.0, 0.0),
    ));
    let start: Joints<7> = [-0.6, 1.2, 0.0, 0.6, 0.0, 0.0, 0.0].into();
    let goal: Joints<7> = [0.6, 1.2, 0.0, 0.6, 0.0, 0.0, 0.0].into();
    let model = WamModel::<7>::new();
    let plan = |shortcuts| {
        let mut options = PlannerOptions::default();
        options.shortcuts = shortcuts;
        options.searches = 1;
        let mut planner = Planner::new(&model, scene.clone()).with_options(options);
        assert!(!planner.model().is_motion_free(&start, &goal));
        planner
            .plan(&start, &[goal])
            .expect("there is a way over it")
    };
    let (raw, short) = (plan(0), plan(200));
    check_path(&scene, &raw);
    check_path(&scene, &short);
    assert!(
        short.length() < raw.length(),
        "{} {}",
        short.length(),
        raw.length()
    );
    // The same seed gives the same plan.
    assert_eq!(plan(200), short);
}

#[test]
fn a_motion_through_a_thin_wall_is_noticed() {
    let mut scene = Scene::default();
    // Thinner than any step of a sampled check would be.
    let wall = Shape::cuboid([1.0, 0.0005, 1.0]);
    scene.add(Obstacle::new(
        "foil",
        wall,
        Pose::translation(0.8, 0.0, 0.0),
    ));
    let model = CollisionModel::new(&WamModel::<7>::new().chain, ArmGeometry::wam(), scene);
    let one: Joints<7> = [-1.0, 1.5, 0.0, 0.0, 0.0, 0.0, 0.0].into();
    let other: Joints<7> = [1.0, 1.5, 0.0, 0.0, 0.0, 0.0, 0.0].into();
    for end in [&one, &other] {
        assert!(model.is_free(end), "{:?}", model.contact(end));
    }
    assert!(!model.is_motion_free(&one, &other));
    // Away from it, the same sweep is free.
    let up = |base: f64| Joints::<7>::from([base, -1.5, 0.0, 0.0, 0.0, 0.0, 0.0]);
    assert!(model.is_motion_free(&up(-1.0), &up(1.0)));
}

#[test]
fn errors_name_what_is_in_the_way() {
    let model = WamModel::<7>::new();
    let mut scene = Scene::default();
    let shape = Shape::Sphere { radius: 0.1 };
    scene.add(Obstacle::new(
        "ball",
        shape,
        Pose::translation(0.0, 0.0, 0.7),
    ));
    let mut planner = Planner::new(&model, scene);
    let upright = Joints::<7>::zeros();
    let aside: Joints<7> = [0.0, 1.5, 0.0, 0.0, 0.0, 0.0, 0.0].into();
    let blocked = planner
        .plan(&upright, &[aside])
        .expect_err("the ball is in the arm");
    let text = blocked.to_string();
    assert!(
        text.contains("ball") && text.contains("start is in collision"),
        "{text}"
    );
    let no_goal = planner
        .plan(&aside, &[upright])
        .expect_err("the goal is in the ball");
    assert!(no_goal.to_string().contains("and ball"), "{no_goal}");
    let mut outside = aside;
    outside[1] = 2.5;
    let refused = planner.plan(&outside, &[aside]);
    assert_eq!(
        refused,
        Err(PlanError::StartOutOfRange {
            joint: 1,
            angle: 2.5
        })
    );
    let refused = planner.plan(&aside, &[outside]);
    assert_eq!(
        refused,
        Err(PlanError::NoFreeGoal {
            count: 1,
            first: None
        })
    );
    let folded: Joints<7> = [0.0, 0.0, 0.0, 3.1, 0.0, 1.5, 0.0].into();
    let mut planner = Planner::new(&model, Scene::default());
    let error = planner
        .plan(&folded, &[aside])
        .err()
        .map(|error| error.to_string());
    // Either the hand meets the upper arm, or the posture is free and a path exists.
    assert!(error.is_none_or(|text| text.contains("links")));
}
