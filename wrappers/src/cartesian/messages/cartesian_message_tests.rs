//! Every row of the protocol, and invalid requests.

use bytes::Bytes;
use proptest::prelude::*;
use yarp_devices::{CartesianEvent, Limits, Target, TaskPose};
use yarp_wire::{Bottle, Limits as WireLimits, WireVersion};

use super::*;
use crate::cartesian::CartesianVersion;

/// Requests as stock's client writes them, and as they print.
const REQUESTS: [&str; 44] = [
    "[stop]",
    "[go] [full] 1.5 (-0.3 -0.1 0.1 0.0 0.0 1.0 3.14)",
    "[go] [xyz] 1.5 (-0.3 0.1 0.1)",
    "[tvel] (0.1 0.0 0.0 0.0 0.0 1.0 0.5)",
    "[ask] ([xd] (-0.3 0.1 0.1 0.0 0.0 1.0 3.0)) ([pose] [full])",
    "[ask] ([xd] (-0.3 0.1 0.1)) ([q] (0.0 12.0 3.0)) ([pose] [xyz])",
    "[stor]",
    "[rest] 1",
    "[rest]",
    "[del] (1 2)",
    "[del] ()",
    "[del]",
    "[get] [mode]",
    "[get] [refe]",
    "[get] [prio]",
    "[get] [time]",
    "[get] [tol]",
    "[get] [done]",
    "[get] [ison]",
    "[get] [lim] 3",
    "[get] [dof]",
    "[get] [resp]",
    "[get] [resw]",
    "[get] [des]",
    "[get] [qdot]",
    "[get] [xdot]",
    "[get] [pose] 3",
    "[get] [tip]",
    "[get] [info]",
    "[get] [twea]",
    "[set] [mode] [cont]",
    "[set] [refe] [fals]",
    "[set] [prio] orientation",
    "[set] [time] 1.5",
    "[set] [tol] 0.001",
    "[set] [lim] 2 -10.0 10.0",
    "[set] [dof] (1 0 2 1)",
    "[set] [resp] (0.0 12.0)",
    "[set] [resw] (0.0 1.0)",
    "[set] [tip] (0.0 0.0 0.0 0.0 0.0 0.0 0.0)",
    "[set] [twea] ((straightness 1.0) (tol 0.001) (max_iter 50))",
    "[even] [regi] [ogoi] 0.5",
    "[even] [unre] [ogoi] 0.5",
    "[even] [list] [ogoi]",
];

/// Requests that must not be accepted.
const WRONG: [&str; 29] = [
    "",
    "[go]",
    "[go] [full] 1.5",
    "[go] [full] 1.5 7",
    "[go] [full] 1.5 (1.0 2.0 3.0)",
    "[go] [xyz] 1.5 (1.0 2.0)",
    "[go] [xyz] 1.5 (1.0 2.0 3.0 4.0)",
    "[go] [xyz] 1.5 (1.0 2.0 high)",
    "[go] [xyz] soon (1.0 2.0 3.0)",
    "[go] [abc] 1.5 (1.0 2.0 3.0)",
    "[tvel] (1.0 2.0 3.0)",
    "[ask]",
    "[ask] ([xd])",
    "[ask] ([xd] (1.0 2.0 3.0))",
    "[ask] ([xd] (1.0 2.0 3.0)) ([q]) ([pose] [xyz])",
    "[rest] x",
    "[del] 1",
    "[get]",
    "[get] [what]",
    "[get] [lim]",
    "[get] [pose] -1",
    "[set] [time]",
    "[set] [time] soon",
    "[set] [mode] [what]",
    "[set] [lim] 2 1.0",
    "[set] [dof] 1",
    "[set] [tip] (1.0)",
    "[even] [regi] [what] 0.5",
    "[what] 1 2 3",
];

fn parsed(text: &str) -> Bottle {
    Bottle::parse(text).expect("a message")
}

#[test]
fn every_request_is_understood_and_said_again_the_same_way() {
    for text in REQUESTS {
        let request = Request::parse(&parsed(text)).unwrap_or_else(|_| panic!("{text}"));
        assert_eq!(request.to_bottle(), parsed(text), "{text}");
    }
}

#[test]
fn what_is_malformed_is_not_understood() {
    for text in WRONG {
        assert_eq!(Request::parse(&parsed(text)), Err(Malformed), "{text}");
    }
}

#[test]
fn a_question_has_the_bytes_of_stock() {
    let bytes = Request::Get(Query::IsOn)
        .to_bottle()
        .encode(WireVersion::V3);
    let stock = [
        0x09, 1, 0, 0, 2, 0, 0, 0, 0x67, 0x65, 0x74, 0, 0x69, 0x73, 0x6F, 0x6E,
    ];
    assert_eq!(bytes[..], stock);
}

#[test]
fn a_target_is_metres_and_an_axis_and_an_angle() {
    let request = Request::parse(&parsed("[go] [full] 1.5 (1 2 3 0 0 1 0.5)"));
    let pose = TaskPose {
        position: [1.0, 2.0, 3.0],
        axis: [0.0, 0.0, 1.0],
        angle: 0.5,
    };
    assert_eq!(request, Ok(Request::Go(Target::Pose(pose), 1.5)));
}

#[test]
fn answers_are_those_of_stock() {
    let check = |bottle: Bottle, text: &str| assert_eq!(bottle.to_string(), text);
    check(acknowledged(), "[ack]");
    check(refused(), "[nack]");
    check(cartesian_reply::tracking(true), "[ack] [cont]");
    check(cartesian_reply::tracking(false), "[ack] [shot]");
    check(cartesian_reply::yes_or_no(true), "[ack] [true]");
    check(cartesian_reply::yes_or_no(false), "[ack] [fals]");
    check(cartesian_reply::number(2.0), "[ack] 2.0");
    check(cartesian_reply::id(1), "[ack] 1");
    check(
        cartesian_reply::limits(Limits::new(-1.0, 2.5)),
        "[ack] -1.0 2.5",
    );
    check(cartesian_reply::dof(&[true, false]), "[ack] (1 0)");
    check(cartesian_reply::list(&[0.5, 1.0]), "[ack] (0.5 1.0)");
    let info = yarp_devices::CartesianInfo {
        server_version: "2.0".to_owned(),
        part: "arm".to_owned(),
        part_version: "1.0".to_owned(),
        part_type: "wam7".to_owned(),
    };
    check(
        cartesian_reply::info(&info, CartesianVersion::V2_0),
        "[ack] ((server_version \"2.0\") (arm_version \"1.0\") (arm_type wam7) (events (motion-onset motion-done motion-ongoing closing \"*\")))",
    );
    check(
        cartesian_reply::info(&info, CartesianVersion::V1_1),
        "[ack] ((server_version 1.10000000000000008882) (arm_version \"1.0\") (arm_type wam7) (events (motion-onset motion-done motion-ongoing closing \"*\")))",
    );
    let stock = parsed(
        "[ack] ((server_version \"2.0\") (arm_version \"2.0\") (arm_type right_v2.0) (events (motion-onset)))",
    );
    let read = cartesian_reply::read(stock)
        .flatten()
        .and_then(|values| values.info());
    assert_eq!(
        read.map(|info| info.part_type),
        Some("right_v2.0".to_owned())
    );
}

#[test]
fn events_are_a_kind_and_a_time() {
    for (event, text) in [
        (
            CartesianEvent::Onset { time: 1203.5 },
            "motion-onset 1203.5",
        ),
        (
            CartesianEvent::Ongoing {
                time: 1204.5,
                checkpoint: 0.5,
            },
            "motion-ongoing 1204.5 0.5",
        ),
        (
            CartesianEvent::Done { time: 1204.75 },
            "motion-done 1204.75",
        ),
        (CartesianEvent::Closing { time: 1205.0 }, "closing 1205.0"),
    ] {
        assert_eq!(to_event(&event).to_string(), text);
        assert_eq!(from_event(&parsed(text)), Some(event));
    }
    for wrong in [
        "",
        "motion-onset",
        "motion-ongoing 1.0",
        "what 1.0",
        "closing x",
    ] {
        assert_eq!(from_event(&parsed(wrong)), None, "{wrong}");
    }
}

proptest! {
    #[test]
    fn no_bytes_make_a_reader_panic(bytes in proptest::collection::vec(any::<u8>(), 0..200), row in 0..REQUESTS.len(), at in 0..200_usize, byte: u8) {
        let mut changed = parsed(REQUESTS[row]).encode(WireVersion::V3).to_vec();
        if let Some(place) = changed.get_mut(at) {
            *place = byte;
        }
        for bytes in [bytes, changed] {
            let Ok(message) = Bottle::decode(&Bytes::from(bytes), WireVersion::V3, WireLimits::DEFAULT) else {
                continue;
            };
            if let Ok(request) = Request::parse(&message) {
                let again = Request::parse(&request.to_bottle());
                // As they print: a nan is not equal to itself.
                prop_assert_eq!(format!("{again:?}"), format!("{:?}", Ok::<_, Malformed>(request)));
            }
            let _ = from_event(&message);
            let _ = cartesian_reply::read(message);
        }
    }
}
