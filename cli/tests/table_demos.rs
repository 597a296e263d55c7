//! The demos on the simulated table: here with a live view, and in several processes on one network.

#![cfg(unix)]

mod common;

use std::io::{Read, Write};
use std::net::TcpStream;
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use common::{Ended, Home, Running};

/// Longer than a demo with few objects takes on a busy machine.
const DEMO_TIMEOUT: Duration = Duration::from_secs(240);

/// Interval between two looks at whether a demo has ended.
const LOOK_INTERVAL: Duration = Duration::from_millis(200);

/// Each test simulates a robot in real time or faster: they take turns.
fn turn() -> MutexGuard<'static, ()> {
    static TURN: Mutex<()> = Mutex::new(());
    TURN.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Returns the value of a key in a result that is printed over several lines, or in one.
fn value(ended: &Ended, key: &str) -> String {
    let text = ended.out.join(" ");
    let (_, rest) = text
        .split_once(&format!("\"{key}\":"))
        .unwrap_or_else(|| panic!("no {key} in {ended:?}"));
    let end = rest.find([',', '}']).unwrap_or(rest.len());
    rest[..end].trim().to_owned()
}

/// Returns the answer to a request for a page.
fn page(url: &str) -> String {
    let host = url.trim_start_matches("http://").trim_end_matches('/');
    let mut stream = TcpStream::connect(host).unwrap();
    write!(
        stream,
        "GET / HTTP/1.1\r\nHost: {host}\r\nConnection: close\r\n\r\n"
    )
    .unwrap();
    let mut answer = String::new();
    stream.read_to_string(&mut answer).unwrap();
    answer
}

/// A name server, a table, a program that tidies it, and a reader of its plan, each in a process of its own.
struct Lab {
    server: Running,
    table: Running,
    demo: Running,
    viewer: Running,
}

impl Lab {
    /// Starts a table with this number of objects, seed and speed, and returns in this phase of the first plan.
    fn until(home: &Home, [objects, seed, speed]: [u32; 3], phase: &str) -> Self {
        let server = home.serve();
        let table = home
            .start(&format!(
                "table --objects {objects} --seed {seed} --speed {speed} --prefix /lab --no-view"
            ))
            .see(&format!("A table with {objects} objects"));
        let mut demo = home.start(&format!(
            "demo tidy --remote /lab --speed {speed} --detector truth"
        ));
        // The port is there once the task begins.
        home.run("wait /tidy/plan:o").with(0);
        let mut viewer = home.start("read ... /tidy/plan:o");
        let end = Instant::now() + DEMO_TIMEOUT;
        while !viewer.sees_within(phase, LOOK_INTERVAL) {
            // A demo that has ended begins no phase.
            let ended = demo.sees_within("\"wall_seconds\"", Duration::ZERO);
            assert!(
                !ended && Instant::now() < end,
                "no {phase} in the plan {:?}: {:?} {:?} at {:?} {:?}",
                viewer.printed(),
                demo.printed(),
                demo.logged(),
                table.printed(),
                table.logged()
            );
        }
        Self {
            server,
            table,
            demo,
            viewer,
        }
    }
}

/// Waits for the result of a demo and its end.
fn end_of(mut demo: Running) -> Ended {
    assert!(demo.sees_within("\"wall_seconds\"", DEMO_TIMEOUT));
    demo.finish()
}

#[test]
fn a_table_is_tidied_in_front_of_viewers() {
    let _turn = turn();
    let home = Home::new();
    let mut demo = home.start("demo tidy --objects 1 --seed 7001 --speed 3 --detector truth");
    assert!(demo.sees_within("Live view: ", DEMO_TIMEOUT));
    let first = demo.printed()[0].clone();
    let url = first
        .strip_prefix("Live view: ")
        .expect("the first line is the address");
    let shown = page(url);
    assert!(
        shown.starts_with("HTTP/1.1 200") && shown.contains("<html"),
        "{shown}"
    );
    // Its exit code depends on how fast this machine is.
    let ended = end_of(demo);
    assert_eq!(value(&ended, "placed"), "1");
    assert_eq!(value(&ended, "detector"), "\"truth\"");
}

#[test]
fn the_result_is_one_line_of_json_without_a_view() {
    let _turn = turn();
    let home = Home::new();
    let demo = home.start("demo tidy --objects 1 --seed 7002 --speed 3 --json --detector truth");
    let ended = end_of(demo);
    assert_eq!(ended.out.len(), 1, "{ended:?}");
    assert_eq!(value(&ended, "placed"), "1");
}

#[test]
fn a_table_of_another_process_is_tidied_until_the_first_signal() {
    let _turn = turn();
    let home = Home::new();
    let mut lab = Lab::until(&home, [3, 7003, 2], "(phase lift)");
    let told = lab.viewer.printed().join(" ");
    assert!(told.contains("into the basket of"), "{told}");
    lab.viewer.kill();
    lab.demo = lab.demo.signal("INT");
    let ended = end_of(lab.demo);
    assert_eq!(value(&ended, "stopped"), "true", "{ended:?}");
    assert_eq!(value(&ended, "attempts"), "1", "{ended:?}");
    assert_eq!(value(&ended, "error"), "null", "{ended:?}");
}

#[test]
fn objects_go_into_the_slots_that_another_program_commands() {
    let _turn = turn();
    let home = Home::new();
    // A name server as `yarp up` starts it: other programs find the table.
    let mut demo =
        home.start("demo reorder --wait --objects 1 --seed 7004 --speed 3 --detector truth");
    assert!(demo.sees_within("Live view: ", DEMO_TIMEOUT));
    let listed = (0..100).find_map(|_| {
        std::thread::sleep(Duration::from_millis(300));
        let told = home.run_with("rpc /reorder/rpc:i", "list\n");
        told.out.iter().find(|line| line.contains("is (")).cloned()
    });
    let listed = listed.expect("an object on the table");
    let id = listed
        .split("is (")
        .nth(1)
        .and_then(|rest| rest.split(' ').next());
    let id: u32 = id.and_then(|id| id.parse().ok()).expect("its number");
    let told = home.run_with("rpc /reorder/rpc:i", &format!("put {id} 4\nquit\n"));
    assert_eq!(
        told.out.iter().filter(|line| line.contains("ok")).count(),
        2,
        "{told:?}"
    );
    let ended = end_of(demo).with(0);
    assert_eq!(value(&ended, "placed"), "1");
}

/// The cameras are the default where the build has OpenCV.
#[cfg(feature = "vision")]
#[test]
fn a_table_is_tidied_by_what_the_cameras_see() {
    let _turn = turn();
    let home = Home::new();
    let demo = home.start("demo tidy --objects 2 --seed 7005 --speed 2 --json");
    let ended = end_of(demo);
    assert_eq!(value(&ended, "detector"), "\"vision\"");
    assert_eq!(value(&ended, "placed"), "2", "{ended:?}");
}

/// Returns number and height above the table, m, of the objects of a table.
fn objects(home: &Home, truth: &str) -> Vec<(u32, f64)> {
    let told = home.run_with(&format!("rpc {truth}"), "list\n");
    let lists = told.out.iter().flat_map(|line| line.split('(').skip(1));
    lists
        .filter_map(|list| {
            let words: Vec<&str> = list.split_whitespace().collect();
            let id = words.first()?.parse().ok()?;
            let z: f64 = words.get(4)?.parse().ok()?;
            Some((id, z + 0.05))
        })
        .collect()
}

#[test]
fn an_object_stays_in_the_hand_when_the_program_is_killed() {
    let _turn = turn();
    let home = Home::new();
    let lab = Lab::until(&home, [1, 7006, 2], "(phase place)");
    lab.demo.kill();
    lab.viewer.kill();
    let held = |height: f64| height > 0.15;
    let before = objects(&home, "/lab/truth/rpc:i");
    let (id, _) = *before
        .iter()
        .find(|(_, height)| held(*height))
        .unwrap_or_else(|| panic!("nothing is in the hand: {before:?}"));
    std::thread::sleep(Duration::from_secs(4));
    let after = objects(&home, "/lab/truth/rpc:i");
    let still = after.iter().find(|(other, _)| *other == id);
    assert!(
        still.is_some_and(|(_, height)| held(*height)),
        "{before:?} {after:?}"
    );
}

#[test]
fn a_name_server_that_restarts_disturbs_nothing() {
    let _turn = turn();
    let home = Home::new();
    let lab = Lab::until(&home, [1, 7007, 2], "(phase grasp)");
    lab.server.kill();
    // The arm grasps, lifts and carries meanwhile.
    std::thread::sleep(Duration::from_secs(2));
    let _server = home.serve();
    let ended = end_of(lab.demo).with(0);
    assert_eq!(value(&ended, "released"), "1", "{ended:?}");
    assert_eq!(value(&ended, "error"), "null", "{ended:?}");
}

/// A name server, a table, a program that sees what is on it, and one that tidies it.
#[cfg(feature = "vision")]
struct SeeingLab {
    _server: Running,
    _table: Running,
    vision: Running,
    demo: Running,
}

#[cfg(feature = "vision")]
impl SeeingLab {
    const VISION: &str = "vision serve --prefix /lab --name /lab/vision";

    /// Starts all of them, and returns when the first object is grasped.
    fn start(home: &Home) -> Self {
        let server = home.serve();
        let table = home
            .start("table --objects 2 --seed 7005 --speed 2 --prefix /lab --no-view")
            .see("A table with 2 objects");
        let vision = home.start(Self::VISION).see("Objects that /lab/camera and");
        let demo = home.start("demo tidy --remote /lab --speed 2 --detector /lab/vision");
        home.run("wait /tidy/plan:o").with(0);
        let mut viewer = home.start("read ... /tidy/plan:o");
        assert!(viewer.sees_within("(phase grasp)", DEMO_TIMEOUT));
        viewer.kill();
        Self {
            _server: server,
            _table: table,
            vision,
            demo,
        }
    }
}

#[cfg(feature = "vision")]
#[test]
fn a_vision_process_that_is_killed_and_started_again_is_asked_again() {
    let _turn = turn();
    let home = Home::new();
    let lab = SeeingLab::start(&home);
    lab.vision.kill();
    let _vision = home
        .start(SeeingLab::VISION)
        .see("Objects that /lab/camera and");
    let ended = end_of(lab.demo);
    assert_eq!(value(&ended, "error"), "null", "{ended:?}");
    assert_eq!(value(&ended, "released"), "2", "{ended:?}");
}

/// The object in the hand is placed first: that needs no vision.
#[cfg(feature = "vision")]
#[test]
fn a_vision_process_that_is_killed_ends_the_demo_with_its_name() {
    let _turn = turn();
    let home = Home::new();
    let lab = SeeingLab::start(&home);
    lab.vision.kill();
    let ended = end_of(lab.demo).with(1);
    let error = value(&ended, "error");
    assert!(error.contains("/lab/vision"), "{ended:?}");
    assert_eq!(value(&ended, "released"), "1", "{ended:?}");
}

/// The second signal halts at once: without vision the demo waits for 20 s, and ends with an error then.
#[cfg(feature = "vision")]
#[test]
fn a_demo_that_waits_for_vision_ends_at_the_second_signal() {
    let _turn = turn();
    let home = Home::new();
    let lab = SeeingLab::start(&home);
    lab.vision.kill();
    let waits = |demo: &Running| {
        let logged = demo.logged();
        logged.iter().any(|line| line.contains("does not answer"))
    };
    let end = Instant::now() + DEMO_TIMEOUT;
    while !waits(&lab.demo) {
        assert!(Instant::now() < end, "{:?}", lab.demo.logged());
        std::thread::sleep(LOOK_INTERVAL);
    }
    let demo = lab.demo.signal("INT");
    // Two signals within two seconds are one, as `timeout` sends them.
    std::thread::sleep(Duration::from_millis(2500));
    let ended = end_of(demo.signal("INT"));
    assert_eq!(value(&ended, "stopped"), "true", "{ended:?}");
    assert_eq!(value(&ended, "error"), "null", "{ended:?}");
}

/// Returns the error with which a demo ends.
fn error_of(demo: Running) -> String {
    value(&end_of(demo).with(1), "error")
}

/// The program made the arm move again.
#[test]
fn a_joint_that_somebody_made_idle_ends_the_demo_and_stays_idle() {
    let _turn = turn();
    let home = Home::new();
    let lab = Lab::until(&home, [1, 7006, 2], "(phase place)");
    let idle: String = (0..7)
        .map(|joint| format!("set icmd cmod {joint} idl\n"))
        .collect();
    home.run_with("rpc /lab/wam/rpc:i", &idle);
    let error = error_of(lab.demo);
    assert!(
        error.contains("emergency stop") && error.contains("/lab/wam"),
        "{error}"
    );
    let modes = home.run_with("rpc /lab/wam/rpc:i", "get icmd cmod 0\nget icmd cmod 3\n");
    let idle = modes.out.iter().filter(|line| line.contains("[idl]"));
    assert_eq!(idle.count(), 2, "{modes:?}");
}

#[test]
fn a_table_that_does_not_answer_ends_the_demo() {
    let _turn = turn();
    let home = Home::new();
    let mut lab = Lab::until(&home, [1, 7006, 2], "(phase place)");
    lab.table = lab.table.signal("STOP");
    let error = error_of(lab.demo);
    assert!(
        error.contains("transport") && error.contains("/lab/wam"),
        "{error}"
    );
}

/// Files that describe another table are read before anything moves.
#[test]
#[cfg(feature = "vision")]
fn files_of_the_table_that_are_missing_are_named() {
    let _turn = turn();
    for option in ["--calibration", "--depth-calibration", "--database"] {
        let home = Home::new();
        let line = format!("demo tidy --objects 1 --json {option} no-such-file.xml");
        let ended = home.run(&line).with(1);
        ended.complains("no-such-file.xml");
        assert!(ended.out.is_empty(), "{ended:?}");
    }
}

/// The times are those of this machine; the exit code says whether they are below the targets.
#[test]
fn rendering_and_physics_are_measured() {
    let _turn = turn();
    let home = Home::new();
    let ended = home.run("table evaluate --seed 3 --count 2 --json");
    let (render, rest) = ended.out[0].split_once("\"seed\"").expect("one object");
    assert!(render.contains("\"render_ms\":{\"p50\":"), "{ended:?}");
    assert!(
        rest.contains("\"simulated_second_s\":{\"p50\":"),
        "{ended:?}"
    );
    assert_eq!(value(&ended, "objects"), "30");
    let is_below = |part: &str| part.contains("\"passed\":true");
    let passed = value(&ended, "passed") == "true";
    assert_eq!(
        passed,
        is_below(rest) && render.matches("\"passed\":true").count() == 2
    );
    ended.with(i32::from(!passed));
}

/// A lost frame of the arm's bus at any moment, on average every two seconds: nothing falls, and the table gets tidy.
#[test]
fn frames_that_the_bus_of_the_arm_loses_disturb_nothing() {
    let _turn = turn();
    let home = Home::new();
    let demo = home.start(
        "demo tidy --objects 2 --seed 9 --detector truth --simulation bus --lost-frames 1e-4 --json",
    );
    let ended = end_of(demo);
    for (key, expected) in [
        ("placed", "2"),
        ("dropped", "0"),
        ("lost", "0"),
        ("error", "null"),
    ] {
        assert_eq!(value(&ended, key), expected, "{key}: {ended:?}");
    }
    assert_ne!(value(&ended, "lost_frames"), "0", "{ended:?}");
}
