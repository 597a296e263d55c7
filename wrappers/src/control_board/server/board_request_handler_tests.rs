use proptest::prelude::*;
use yarp_devices::wam::SimulatedWam;
use yarp_devices::{Axes, Device, Encoders};
use yarp_wire::{Limits, Value, Vocab32, WireVersion};

use super::super::super::messages::Command;
use super::*;

fn board() -> RequestHandler {
    let arm: Arc<dyn Device> = Arc::new(SimulatedWam::new());
    RequestHandler::new(arm, "/test").expect("it has axes").0
}

/// Streams a command, and waits until the device has taken it.
fn handle_command(board: &RequestHandler, command: Command) {
    board.handle_command(command, "/tester");
    while board.run_next_queued() {}
}

/// The answer without the count and time of it.
fn asked(board: &RequestHandler, request: &str) -> String {
    let request = Bottle::parse(request).expect("the test's own text");
    let reply = board.answer(&request, "/tester").now().into_bottle();
    let mut items = reply.into_items();
    let stamp = Value::from(Vocab32::new("tsta"));
    if let Some(place) = items.iter().position(|item| *item == stamp) {
        assert!(matches!(items[place + 1], Value::Int32(_)));
        assert!(matches!(items[place + 2], Value::Float64(_)));
        items.drain(place + 1..place + 3);
    }
    Bottle::from(items).to_string()
}

#[test]
fn a_session_goes_as_with_stock() {
    let board = board();
    let check = |request: &str, reply: &str| assert_eq!(asked(&board, request), reply, "{request}");
    check("help", "[nak]");
    check("[nons]", "[nak]");
    check("", "[nak]");
    check("[get] [prot]", "[prot] 1 9 0 [ok]");
    check("foo [prot]", "[fail]");
    check("[get] [axes]", "[is] [axes] 7 [tsta] [ok]");
    check("get axes", "[is] axes 7 [tsta] [ok]");
    check("[get] [name] 3", "[is] [name] elbow [tsta] [ok]");
    check("[get] [type] 0", "[is] [type] 1987212385 [tsta] [ok]");
    check("[get] [name] 7", "[fail]");
    check("[get] [dons]", "[is] [dons] 1 [tsta] [ok]");
    check("[get] [dong] 2 (0 1)", "[is] [dong] 1 [tsta] [ok]");
    check("[get] [enc] 0", "[is] [enc] 0.0 [tsta] [ok]");
    check(
        "[get] [esps]",
        "[is] [esps] (0.0 0.0 0.0 0.0 0.0 0.0 0.0) [tsta] [ok]",
    );
    check("[get] [icmd] [cmod] 0", "[is] 0 [pos] [tsta] [ok]");
    check(
        "[get] [icmd] [cmog] 2 (0 1)",
        "[is] [cmog] ([pos] [pos]) [tsta] [ok]",
    );
    check("get icmd cmog 1 (1)", "[is] [cmog] ([pos]) [tsta] [ok]");
    check("[set] [icmd] [cmod] 2 [vel]", "[ok]");
    check("[get] [icmd] [cmod] 2", "[is] 2 [vel] [tsta] [ok]");
    check("[set] [icmd] [cmod] 2 [mix]", "[fail]");
    check("[set] [vels] (9 9 9 9 9 9 9)", "[ok]");
    check("[set] [velg] 2 (1 0) (11 12.0)", "[ok]");
    check(
        "[get] [velg] 2 (0 1)",
        "[is] [velg] (12.0 11.0) [tsta] [ok]",
    );
    check("[set] [acc] 1 30", "[ok]");
    check("[get] [acc] 1", "[is] [acc] 30.0 [tsta] [ok]");
    check("[set] [llim] 0 -10 50", "[ok]");
    check("[get] [llim] 0", "[is] [llim] -10.0 50.0 [tsta] [ok]");
    check("[set] [vlim] 0 0 30", "[ok]");
    check("[get] [vlim] 0", "[is] [vlim] 0.0 30.0 [tsta] [ok]");
    check("[set] [pos] 0 2.5", "[ok]");
    check("[get] [pos] 0", "[is] [pos] 2.5 [tsta] [ok]");
    check("[set] [poss] (1 2)", "[fail]");
    check("[set] [pos] 0 51", "[fail]");
    check("[set] [stos]", "[ok]");
    check("[set] [vmo] 2 5.0", "[fail]");
    check("[get] [vmo] 2", "[is] [vmo] 0.0 [tsta] [ok]");
    // Of a joint that was not moved: another is somewhere on its way.
    check("[get] [pid] [err] [pos] 1", "[is] [pid] 0.0 [ok]");
    check("[get] [mtnm]", "[is] [mtnm] 7 [tsta] [ok]");
    check("[get] [intm] [mode] 0", "[stif] [tsta] [ok]");
    check("[get] [iimp] [ipr] 0", "[is] [iimp] (0.0 0.0) [tsta] [ok]");
    check("[get] [ijfl] [jhfl] 0", "[is] 0 \"no fault\" [ok]");
    check(
        "[get] [ivar] [lvar]",
        "[is] [ivar] (description friction) [ok]",
    );
    check(
        "[get] [ivar] [mvar] description",
        "[is] [ivar] (\"simulated axes\") [ok]",
    );
    check("[get] [reca] [isca]", "[is] [reca] 1 [ok]");
    check("[get] [torq] [ref] 0", "[is] [torq] 0.0 [tsta] [ok]");
    check("[set] [torq] [mtps] 0 (1 2 3 4)", "[ok]");
    check(
        "[get] [torq] [mtps] 0",
        "[is] [torq] (1.0 2.0 3.0 4.0) [tsta] [ok]",
    );
    check("[set] [torq] [mtps] 0 (1 2 3 4 5 6 7 8 9)", "[ok]");
    check(
        "[get] [torq] [mtps] 0",
        "[is] [torq] (1.0 2.0 3.0 4.0 5.0 6.0 7.0 8.0 9.0) [tsta] [ok]",
    );
    check(
        "[set] [pid] [pid] [vel] 0 (1.0 2.0 3.0 4.0 5.0 6.0 7.0 8.0 9.0 10.0)",
        "[ok]",
    );
    check(
        "[get] [pid] [pid] [vel] 0",
        "[is] [pid] (1.0 2.0 3.0 4.0 5.0 6.0 7.0 8.0 9.0 10.0) [ok]",
    );
    check("[cald] 0", "[ok]");
    check("[cald] 7", "[fail]");
    check("[abca] 0", "[ok]");
    let help = asked(&board, "help more");
    assert!(
        help.starts_with("[many] (\"help more\") ") && help.ends_with(" [ok]"),
        "{help}"
    );
}

/// The answer to a call of 4.0.
fn called(board: &RequestHandler, call: &Bottle) -> Bottle {
    let Answer::Reply(reply) = board.answer_call(call, "/tester") else {
        panic!("{call} is not answered");
    };
    let mut bytes = bytes::BytesMut::new();
    reply.write_binary(&mut bytes, WireVersion::V4);
    Bottle::decode(&bytes.freeze(), WireVersion::V4, Limits::DEFAULT).expect("a bottle")
}

#[test]
fn a_session_of_4_goes_as_with_stock() {
    let board = board();
    let check = |call: &str, reply: &str| {
        let call = Bottle::parse(call).expect("the test's own text");
        assert_eq!(called(&board, &call).to_string(), reply, "{call}");
    };
    check("getAxesRPC", "([ok]) 7");
    check("getAxisNameRPC 3", "([ok]) elbow");
    check("getAxisNameRPC 7", "([err7]) \"\"");
    check("positionMoveOneRPC 0 2.5", "[ok]");
    check("getTargetPositionOneRPC 0", "([ok]) 2.5");
    check("getTargetPositionGroupRPC (0 0)", "([ok]) (2.5 2.5)");
    check("positionMoveOneRPC 0 1e6", "[err7]");
    check("positionMoveOneRPC 7 1.0", "[err7]");
    check("velocityMoveOneRPC 0 1.0", "[err5]");
    check("positionMoveAllRPC (1.0 2.0)", "[err5]");
    check(
        "getPidRPC 862994288 0",
        "([err2]) (0.0 0.0 0.0 0.0 0.0 0.0 0.0 0.0 0.0 0.0)",
    );
    check("stopAllRPC", "[ok]");
    check("calibrationDoneRPC 0", "[ok]");
    check("isJointBrakedRPC 0", "([ok]) [fail]");
    check(
        "getRemoteVariablesListRPC",
        "([ok]) ((description friction))",
    );
    check("getLastJointFaultRPC 0", "([ok]) 0 \"no fault\"");
    check("positionMoveOneRPC 0", "[fail]");
    check("get axes", "[fail]");
    check("", "[fail]");
}

#[test]
fn what_the_device_does_not_have_is_refused_with_its_results() {
    struct Shy(SimulatedWam);
    impl Device for Shy {
        fn encoders(&self) -> Option<&dyn Encoders> {
            self.0.encoders()
        }
    }
    let arm = Shy(SimulatedWam::new());
    let board = RequestHandler::new(Arc::new(arm), "/test")
        .expect("it has axes")
        .0;
    let check = |call: &str, reply: &str| {
        let call = Bottle::parse(call).expect("the test's own text");
        assert_eq!(called(&board, &call).to_string(), reply, "{call}");
    };
    check("positionMoveOneRPC 0 1.0", "[err6]");
    check("getTargetPositionOneRPC 0", "([err6]) 0.0");
    check("getTargetPositionAllRPC", "([err6]) ()");
    check("getTorqueRangeAllRPC", "([err6]) () ()");
    check("checkMotionDoneAllRPC", "([err6]) [fail]");
    check("getAmpStatusOneRPC 0", "([err6]) 0");
    assert_eq!(asked(&board, "[get] [poss]"), "[fail]");
    assert_eq!(asked(&board, "[set] [torq] [ref] 0 1.0"), "[fail]");
}

/// A program that named an axis twice, with the same target, did not move it.
#[test]
fn an_axis_may_be_named_twice_with_the_same_value() {
    let board = board();
    let check = |request: &str, reply: &str| assert_eq!(asked(&board, request), reply, "{request}");
    check("[set] [posg] 2 (1 1) (-3.0 -3.0)", "[ok]");
    check("[get] [pos] 1", "[is] [pos] -3.0 [tsta] [ok]");
    check("[set] [posg] 2 (1 1) (-4.0 -5.0)", "[fail]");
    check("[set] [relg] 2 (1 1) (-1.0 -1.0)", "[fail]");
    check("[get] [pos] 1", "[is] [pos] -3.0 [tsta] [ok]");
    check("[set] [icmd] [cmog] 2 (0 0) ([vel] [vel])", "[ok]");
    check("[get] [icmd] [cmod] 0", "[is] 0 [vel] [tsta] [ok]");
    check("[set] [icmd] [cmog] 2 (0 0) ([pos] [vel])", "[fail]");
}

#[test]
fn answers_are_counted_from_0() {
    let board = board();
    for count in 0..3 {
        let reply = board.answer(&Bottle::parse("[get] [axes]").unwrap(), "/tester");
        assert_eq!(reply.now().into_bottle().get(4), Some(&Value::Int32(count)));
    }
}

#[test]
fn streamed_velocities_move() {
    let board = board();
    asked(&board, "[set] [icmd] [cmod] 2 [vel]");
    let stream = |text: &str| {
        let bytes = Bottle::parse(text).unwrap().encode(WireVersion::V3);
        let command = yarp_wire::message::ReadObject::read_binary(&bytes, WireVersion::V3).unwrap();
        handle_command(&board, command);
        asked(&board, "[get] [vmo] 2")
    };
    let at = |velocity: &str| format!("[is] [vmo] {velocity} [tsta] [ok]");
    assert_eq!(stream("([vmo] 2) (5.0)"), at("5.0"));
    assert_eq!(stream("([vmog] 2 (2 2)) (7.0 7.0)"), at("7.0"));
    assert_eq!(stream("([vmog] 1 (2)) (6)"), at("6.0"));
    // For any malformed command, the joint continues as before.
    for wrong in [
        "([vmo] 2) (1e9)",
        "([vmo] 2) (1.0 2.0)",
        "([vmo] 2) ()",
        "([vmo] 7) (1.0)",
        "([vmos]) (1.0)",
        "([vmos]) (0.0 0.0 1.0 0.0 0.0 0.0 0.0)",
        "([vmog] 2 (2 2)) (1.0 2.0)",
        "([dpo] 2) (1.0)",
        "() ()",
    ] {
        assert_eq!(stream(wrong), at("6.0"), "{wrong}");
    }
    assert_eq!(stream("([vmo] 2) (0.0)"), at("0.0"));
}

fn value() -> impl Strategy<Value = Value> {
    let words = prop::sample::select(vec![
        "set", "get", "pos", "poss", "posg", "rel", "rels", "relg", "vmos", "vmo", "icmd", "cmod",
        "cmds", "sto", "enc", "llim", "axes", "help", "more", "is", "fail",
    ]);
    let leaf = prop_oneof![
        words
            .clone()
            .prop_map(|word| Value::from(Vocab32::new(word))),
        words.prop_map(Value::from),
        (-2..9i32).prop_map(Value::from),
        any::<i64>().prop_map(Value::from),
        any::<f64>().prop_map(Value::from),
        (-90.0..90.0f64).prop_map(Value::from),
        Just(Value::bool(true)),
    ];
    leaf.prop_recursive(2, 12, 8, |inner| {
        prop::collection::vec(inner, 0..8).prop_map(|items| Value::from(Bottle::from(items)))
    })
}

/// A move from the home pose that is as it should be.
fn good_move() -> impl Strategy<Value = Vec<Value>> {
    let all = |word: &'static str| {
        prop::collection::vec(1.0..9.0f64, 7).prop_map(move |mut values| {
            // The elbow begins at its upper limit.
            values[3] = -values[3];
            let list: Bottle = values.into_iter().map(Value::from).collect();
            vec![
                Vocab32::new("set").into(),
                Vocab32::new(word).into(),
                list.into(),
            ]
        })
    };
    let one = (0..3i32, 1.0..9.0f64).prop_map(|(joint, value)| {
        let words = ["set", "rel"].map(|word| Value::from(Vocab32::new(word)));
        words
            .into_iter()
            .chain([joint.into(), value.into()])
            .collect()
    });
    prop_oneof![all("poss"), all("rels"), one]
}

/// Spoils one thing of it.
fn spoiled() -> impl Strategy<Value = Bottle> {
    let bad = prop_oneof![
        Just(Value::from("up")),
        Just(Value::from(Vocab32::new("a"))),
        Just(Value::Float64(f64::NAN)),
        Just(Value::Float64(f64::INFINITY)),
        Just(Value::Float64(1e6)),
        Just(Value::Int32(-1)),
        Just(Value::from(Bottle::new())),
        Just(Value::bool(true)),
    ];
    (good_move(), 0..4u8, bad).prop_map(|(mut items, how, bad)| {
        match how {
            0 => drop(items.pop()),
            1 => items.push(bad),
            2 => items[2] = bad,
            _ => match items.last_mut() {
                Some(Value::List(list)) => {
                    let mut values = std::mem::take(list).into_items();
                    values[6] = bad;
                    // -1 is a fine position, and a fine distance.
                    if values[6] == Value::Int32(-1) {
                        values.pop();
                    }
                    *list = values.into();
                }
                Some(last) => {
                    *last = if bad == Value::Int32(-1) {
                        Value::from("-1")
                    } else {
                        bad
                    };
                }
                None => {}
            },
        }
        Bottle::from(items)
    })
}

/// A good move of 4.0, with one defect.
fn spoiled_call() -> impl Strategy<Value = Bottle> {
    let name = |word: Value| match word.to_plain_string().as_str() {
        "poss" => "positionMoveAllRPC",
        "rels" => "relativeMoveAllRPC",
        _ => "relativeMoveOneRPC",
    };
    spoiled().prop_map(move |spoiled| {
        let mut items = spoiled.into_items().into_iter();
        items.next();
        let name = items.next().map_or("relativeMoveOneRPC", name);
        std::iter::once(Value::from(name)).chain(items).collect()
    })
}

/// The names of functions that move, and some that do not.
fn function() -> impl Strategy<Value = Value> {
    let names = prop::sample::select(vec![
        "positionMoveOneRPC",
        "positionMoveGroupRPC",
        "positionMoveAllRPC",
        "relativeMoveOneRPC",
        "velocityMoveGroupRPC",
        "setRefTorqueAllRPC",
        "setControlModeGroupRPC",
        "setPidsRPC",
        "getPidRPC",
        "getTargetPositionGroupRPC",
        "setRemoteVariableRPC",
        "getRemoteProtocolVersion",
        "parkRPC",
        "fooRPC",
        "help",
    ]);
    names.prop_map(Value::from)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn arbitrary_calls_are_answered(calls in prop::collection::vec(
        (function(), prop::collection::vec(value(), 0..6)), 1..40,
    )) {
        let board = board();
        for (function, arguments) in calls {
            let call: Bottle = std::iter::once(function).chain(arguments).collect();
            let answer = board.answer_call(&call, "/tester");
            prop_assert!(matches!(answer, Answer::Reply(_)), "{} is not answered", call);
        }
    }

    #[test]
    fn malformed_calls_move_nothing(calls in prop::collection::vec(spoiled_call(), 1..40)) {
        let board = board();
        let before = targets(&board);
        for call in calls {
            let reply = called(&board, &call).to_string();
            prop_assert!(reply == "[fail]" || reply.starts_with("[err"), "{} was taken", call);
            prop_assert_eq!(&targets(&board), &before, "{} moved it", call);
        }
        prop_assert!(board.position_control().unwrap().motion_done(Axes::All).unwrap());
    }

    #[test]
    fn arbitrary_messages_are_answered(messages in prop::collection::vec(
        prop::collection::vec(value(), 0..6), 1..40,
    )) {
        let board = board();
        for items in messages {
            let message = Bottle::from(items.clone());
            let reply = board.answer(&message, "/tester").now().into_bottle();
            prop_assert!(!reply.is_empty());
            let mut items = items.into_iter();
            if let (Some(Value::List(head)), Some(Value::List(values))) = (items.next(), items.next()) {
                let values = values.iter().filter_map(Value::as_f64).collect();
                handle_command(&board, Command { head, values });
            }
        }
    }

    #[test]
    fn good_moves_are_carried_out(items in good_move()) {
        let board = board();
        let before = targets(&board);
        prop_assert_eq!(board.answer(&Bottle::from(items), "/tester").now(), Reply::ok());
        prop_assert_ne!(targets(&board), before);
    }

    #[test]
    fn malformed_moves_move_nothing(messages in prop::collection::vec(spoiled(), 1..40)) {
        let board = board();
        let before = targets(&board);
        for message in messages {
            let reply = board.answer(&message, "/tester").now();
            prop_assert!(reply.is_refusal(), "{} was taken", message);
            prop_assert_eq!(&targets(&board), &before, "{} moved it", message);
        }
        prop_assert!(board.position_control().unwrap().motion_done(Axes::All).unwrap());
    }
}

fn targets(board: &RequestHandler) -> Vec<f64> {
    board
        .position_control()
        .expect("the arm moves")
        .target_positions(Axes::All)
        .expect("it has targets")
}
