//! Requests and replies in the words of both wire versions.

use proptest::prelude::*;
use yarp_devices::image::{Crop, Image, PixelFormat};
use yarp_devices::{CameraConfiguration, Intrinsics};
use yarp_wire::message::ReadObject;
use yarp_wire::{Bottle, Value, WireVersion};

use super::*;

/// Every request, in 3.x and in 4.0.
fn said() -> Vec<(Request, &'static str, &'static str)> {
    use Channel::{Colour, Raw};
    use Request as R;
    vec![
        (R::Width(Colour), "[fgi] [get] [w]", "getWidthRPC"),
        (R::Height(Raw), "[fgir] [get] [h]", ""),
        (R::Image(Colour), "[fgi] [get] [imgr]", "getImageRPC"),
        (R::Image(Raw), "[fgir] [get] [imgr]", ""),
        (
            R::Crop(Colour, Crop::Rectangle((1, 2), (3, 4))),
            "[fgi] [get] [crop] 0 (1 2 3 4)",
            "getImageCropRPC 0 ((1 2) (3 4))",
        ),
        (
            R::Crop(Colour, Crop::Pixels(vec![(1, 2)])),
            "[fgi] [get] [crop] 1 (1 2)",
            "getImageCropRPC 1 ((1 2))",
        ),
        (R::RgbWidth, "[visr] [get] [w]", "getRgbWidthRPC"),
        (R::RgbHeight, "[visr] [get] [h]", "getRgbHeightRPC"),
        (
            R::Configurations,
            "[visr] [get] [conf]",
            "getRgbSupportedConfigurationsRPC",
        ),
        (R::Resolution, "[visr] [get] [res]", "getRgbResolutionRPC"),
        (R::FieldOfView, "[visr] [get] [fov]", "getRgbFOVRPC"),
        (
            R::Intrinsics,
            "[visr] [get] [intp]",
            "getRgbIntrinsicParamRPC",
        ),
        (R::Mirroring, "[visr] [get] [mirr]", "getRgbMirroringRPC"),
        (
            R::SetResolution(640, 480),
            "[visr] [set] [res] 640 480",
            "setRgbResolutionRPC 640 480",
        ),
        (
            R::SetFieldOfView(1.5, 2.0),
            "[visr] [set] [fov] 1.5 2.0",
            "setRgbFOVRPC 1.5 2.0",
        ),
        (
            R::SetMirroring(true),
            "[visr] [set] [mirr] 1",
            "setRgbMirroringRPC [ok]",
        ),
        (
            R::Description,
            "[fgc] [get] [camd]",
            "getCameraDescriptionRPC",
        ),
        (
            R::Has(Ability::Feature, 0),
            "[fgc] [has] [feat] 0",
            "hasFeatureRPC 0",
        ),
        (
            R::Has(Ability::OnOff, 1),
            "[fgc] [has] [onof] 1",
            "hasOnOffRPC 1",
        ),
        (
            R::Has(Ability::Auto, 2),
            "[fgc] [has] [auto] 2",
            "hasAutoRPC 2",
        ),
        (
            R::Has(Ability::Manual, 3),
            "[fgc] [has] [man] 3",
            "hasManualRPC 3",
        ),
        (
            R::Has(Ability::OnePush, 4),
            "[fgc] [has] [onep] 4",
            "hasOnePushRPC 4",
        ),
        (R::Value(8), "[fgc] [get] [feat] 8", "getFeature1RPC 8"),
        (R::Pair(3), "[fgc] [get] [fea2] 3", "getFeature2RPC 3"),
        (R::Active(3), "[fgc] [get] [actv] 3", "getActiveRPC 3"),
        (R::Mode(3), "[fgc] [get] [mode] 3", "getModeRPC 3"),
        (
            R::SetValue(8, 0.5),
            "[fgc] [set] [feat] 8 0.5",
            "setFeature1RPC 8 0.5",
        ),
        (
            R::SetPair(3, 0.25, 0.75),
            "[fgc] [set] [fea2] 3 0.25 0.75",
            "setFeature2RPC 3 0.25 0.75",
        ),
        (
            R::SetActive(3, false),
            "[fgc] [set] [actv] 3 0",
            "setActiveRPC 3 [fail]",
        ),
        (R::SetMode(3, 2), "[fgc] [set] [mode] 3 2", "setModeRPC 3 2"),
        (R::OnePush(3), "[fgc] [set] [onep] 3", "setOnePushRPC 3"),
        (
            R::Firewire(Firewire::VideoModes, vec![]),
            "[fgfw] [DR2m]",
            "getVideoModeMaskDC1394RPC",
        ),
        (
            R::Firewire(Firewire::ColorCodings, vec![24]),
            "[fgfw] [DR2u] 24",
            "getColorCodingMaskDC1394RPC 24",
        ),
        (
            R::Firewire(Firewire::Window, vec![]),
            "[fgfw] [DR2A]",
            "getFormat7WindowDC1394RPC",
        ),
        (
            R::Firewire(Firewire::SetWindow, vec![160, 120, 8, -1]),
            "[fgfw] [DR2B] 160 120 8 -1",
            "setFormat7WindowDC1394RPC 160 120 8 -1",
        ),
        (
            R::Firewire(Firewire::SetTransmission, vec![1]),
            "[fgfw] [DR2E] 1",
            "setTransmissionDC1394RPC [ok]",
        ),
        (
            R::Firewire(Firewire::Reset, vec![]),
            "[fgfw] [DR2K]",
            "setResetDC1394RPC",
        ),
    ]
}

fn printed(message: &Message) -> Bottle {
    let mut bytes = BytesMut::new();
    message.write_binary(&mut bytes, WireVersion::V4);
    Bottle::read_binary(&bytes.freeze(), WireVersion::V4).expect("a bottle")
}

#[test]
fn each_request_has_its_words_and_its_call() {
    for (request, words, call) in said() {
        let bottle = request.to_bottle().expect("3.x says all of them");
        assert_eq!(bottle.to_string(), words);
        assert_eq!(Request::parse(&bottle).as_ref(), Ok(&request));
        match request.to_call() {
            None => assert_eq!(call, "", "{request:?}"),
            Some(message) => {
                let message = printed(&message);
                assert_eq!(message.to_string(), call);
                assert!(Request::is_call(&message));
                assert_eq!(Request::parse(&message), Ok(request));
            }
        }
    }
}

/// Typed requests: strings instead of words.
#[test]
fn typed_words_are_understood() {
    let parse = |text: &str| Request::parse(&Bottle::parse(text).unwrap());
    assert_eq!(parse("fgi get w"), Ok(Request::Width(Channel::Colour)));
    assert_eq!(parse("fgc set feat 0 0.9"), Ok(Request::SetValue(0, 0.9)));
    assert_eq!(parse("help"), Ok(Request::Help));
    assert_eq!(parse("[help]"), Err(Malformed::Interface));
    assert_eq!(
        parse("fgfw DR2o 4"),
        Ok(Request::Firewire(Firewire::SetVideoMode, vec![4]))
    );
}

#[test]
fn what_is_malformed_is_refused_in_its_own_way() {
    for (text, reply) in [
        ("", "[nak]"),
        ("[help]", "[nak]"),
        ("[nope] [get] [w]", "[nak]"),
        ("[fgi]", "[fail] \"unknown word []\""),
        ("[fgi] [set] [w]", "[fail] \"unknown word [set]\""),
        ("[fgi] [get] [feat]", "[fail] \"unknown word [feat]\""),
        (
            "[fgi] [get] [crop] 0 (1 2 3)",
            "[fail] \"wrong number or kind of values for [fgi] [get] [crop]\"",
        ),
        (
            "[fgi] [get] [crop] 0",
            "[fail] \"wrong number or kind of values for [fgi] [get] [crop]\"",
        ),
        (
            "[fgi] [get] [crop] 2 (1 2 3 4)",
            "[fail] \"wrong number or kind of values for [fgi] [get] [crop]\"",
        ),
        ("[visr] [get] [feat]", "[fail]"),
        ("[visr] [set] [res] 640", "[visr] [set] 0"),
        ("[visr] [set] [res] wide high", "[visr] [set] 0"),
        ("[visr] [is] [res]", "[fail]"),
        ("[fgc] [get] [feat]", "[fail]"),
        ("[fgc] [get] [feat] 0.5", "[fail]"),
        ("[fgc] [has] [w] 0", "[fail]"),
        ("[fgc] [set] [feat] 0", "[fgc] [set] 0"),
        ("[fgc] [set] [feat] 99999999999 0.5", "[fgc] [set] 0"),
        ("[fgfw]", "\"command not recognized\""),
        ("[fgfw] [nope]", "\"command not recognized\""),
        ("[fgfw] [DR2m] 1", "\"command not recognized\""),
        ("[fgfw] [DR2o]", "0"),
        ("[fgfw] [DR2o] high", "0"),
        ("[fgfw] [DR2B] 1 2 3", "0"),
        ("[fgfw] [DR2E] 0.5", "0"),
    ] {
        let message = Bottle::parse(text).unwrap();
        let why = Request::parse(&message).expect_err(text).to_string();
        assert_eq!(refusal(&message, &why).to_string(), reply, "{text}");
    }
    for text in [
        "nopeRPC",
        "getWidthRPC 1",
        "setFeature1RPC 0",
        "setFeature1RPC 0 high",
        "setFeature1RPC 0 0.5 0.5",
        "setActiveRPC 0 \"yes\"",
        "getVideoModeDC1394RPC 1",
        "setVideoModeDC1394RPC",
        "setTransmissionDC1394RPC \"yes\"",
        "setFormat7WindowDC1394RPC 1 2 3",
        "getImageCropRPC 0 ((1 2))",
        "getImageCropRPC 0 (1 2 3 4)",
        "getImageCropRPC 0 ((1 2) (3 4 5))",
    ] {
        let message = Bottle::parse(text).unwrap();
        assert!(Request::is_call(&message));
        assert!(Request::parse(&message).is_err(), "{text}");
    }
}

fn answers() -> Vec<(Request, Answer)> {
    use Request as R;
    let configuration = CameraConfiguration {
        width: 320,
        height: 240,
        rate: 29.97,
        format: PixelFormat::Rgb,
    };
    let lens = Intrinsics {
        focal_length: (400.5, 401.0),
        principal_point: (160.0, 120.0),
        distortion_model: "plumb_bob".to_owned(),
        radial: [0.1, 0.2, 0.3],
        tangential: [0.01, 0.02],
        ..Intrinsics::default()
    };
    let image = Image::new(PixelFormat::Rgb, 3, 1, (0..9).collect::<Vec<u8>>()).unwrap();
    vec![
        (R::Width(Channel::Colour), Answer::Integer(320)),
        (R::Image(Channel::Colour), Answer::Image(image)),
        (
            R::Configurations,
            Answer::Configurations(vec![configuration; 3]),
        ),
        (R::Configurations, Answer::Configurations(Vec::new())),
        (R::Resolution, Answer::Size(640, 480)),
        (R::FieldOfView, Answer::Numbers(60.5, 40.0)),
        (R::Intrinsics, Answer::Intrinsics(lens)),
        (R::Mirroring, Answer::Flag(true)),
        (R::Mirroring, Answer::Flag(false)),
        (
            R::Description,
            Answer::Description(2, "a camera".to_owned()),
        ),
        (R::Has(Ability::Auto, 3), Answer::Flag(true)),
        (R::Has(Ability::Auto, 3), Answer::Flag(false)),
        (R::Value(8), Answer::Number(0.5)),
        (R::Pair(3), Answer::Numbers(0.25, 0.75)),
        (R::Active(3), Answer::Flag(false)),
        (R::Mode(3), Answer::Mode(1)),
        (R::SetValue(8, 0.5), Answer::Done),
        (R::SetResolution(1, 2), Answer::Done),
        (
            R::Firewire(Firewire::VideoModes, vec![]),
            Answer::Integer(i32::MIN),
        ),
        (
            R::Firewire(Firewire::IsTransmitting, vec![]),
            Answer::Flag(false),
        ),
        (
            R::Firewire(Firewire::Window, vec![]),
            Answer::Integers(vec![160, 120, 8, 0]),
        ),
        (
            R::Firewire(Firewire::WindowLimits, vec![]),
            Answer::Integers(vec![640, 480, 2, 2, 1, 1]),
        ),
        (R::Firewire(Firewire::SetRate, vec![3]), Answer::Done),
    ]
}

#[test]
fn answers_come_back_as_they_went_in_both_generations() {
    for (request, answer) in answers() {
        let reply = request.reply(&answer).expect("it fits");
        // Over the wire, where numbers get their types.
        let bytes = reply.encode(WireVersion::V3);
        let reply = Bottle::read_binary(&bytes, WireVersion::V3).unwrap();
        let read = request.read_reply(&reply);
        assert_eq!(read, Some(Reply::Done(answer.clone())), "{reply}");

        let reply = printed(&request.reply_to_call(&answer).expect("it fits"));
        let (code, values) = ReturnCode::read(reply).expect("a code");
        assert_eq!(code, ReturnCode::Ok);
        assert_eq!(request.read_results(&values), Some(answer));
    }
}

#[test]
fn replies_of_3_look_like_those_of_stock() {
    let check = |request: Request, answer, expected: &str| {
        assert_eq!(request.reply(&answer).unwrap().to_string(), expected);
    };
    check(
        Request::Width(Channel::Raw),
        Answer::Integer(320),
        "[fgir] [w] [is] 320",
    );
    check(Request::SetResolution(1, 1), Answer::Done, "[visr] [set] 1");
    check(
        Request::Has(Ability::Feature, 0),
        Answer::Flag(true),
        "[fgc] [has] [feat] 1952540006 1",
    );
    check(
        Request::Value(8),
        Answer::Number(0.5),
        "[fgc] [feat] [is] 0.5",
    );
    check(
        Request::Mirroring,
        Answer::Flag(false),
        "[visr] [mirr] [is] 0",
    );
    check(
        Request::Description,
        Answer::Description(0, "a b".into()),
        "[fgc] [camd] [is] 0 \"a b\"",
    );
}

/// Replies of `FrameGrabberControlsDC1394_Responder.cpp` of 3.5: bare numbers.
#[test]
fn every_word_of_ieee_1394_has_its_call_and_bare_replies() {
    for what in Firewire::all() {
        let name = format!("{}RPC", what.function());
        let zeros = |count: usize| (0..count).map(|_| Value::Int32(0)).collect::<Vec<_>>();
        let counts = (0..5).filter(|count| what.request(&zeros(*count)).is_some());
        let counts: Vec<usize> = counts.collect();
        assert_eq!(counts.len(), 1, "{name}");
        let request = what.request(&zeros(counts[0])).expect("it has that many");
        let words = request.to_bottle().expect("3.x says it");
        assert_eq!(Request::parse(&words), Ok(request.clone()), "{name}");
        let call = printed(&request.to_call().expect("4.0 says it"));
        assert_eq!(call.get(0).and_then(Value::as_str), Some(&*name));
        assert_eq!(Request::parse(&call), Ok(request.clone()), "{name}");

        let refused = refusal(&words, "a reason");
        assert_eq!(request.read_reply(&refused), Some(Reply::Refused), "{name}");
        for nothing in ["[nak]", "[fail]"] {
            let nothing = Bottle::parse(nothing).unwrap();
            assert_eq!(request.read_reply(&nothing), Some(Reply::Refused));
        }
        assert_eq!(request.read_reply(&Bottle::new()), None, "{name}");
        if what.is_order() {
            let done = request.reply(&Answer::Done).expect("it fits");
            assert_eq!(done.to_string(), "1", "{name}");
            assert_eq!(request.read_reply(&Bottle::of(0)), Some(Reply::Refused));
            assert_eq!(refused.to_string(), "0");
        } else {
            let longer: Bottle = zeros(7).into_iter().collect();
            assert_eq!(request.read_reply(&longer), None, "{name}");
        }
    }
}

/// Returns whether it changes something.
fn is_order(request: &Request) -> bool {
    matches!(
        request,
        Request::SetResolution(..)
            | Request::SetFieldOfView(..)
            | Request::SetMirroring(_)
            | Request::SetValue(..)
            | Request::SetPair(..)
            | Request::SetActive(..)
            | Request::SetMode(..)
            | Request::OnePush(_)
    ) || matches!(request, Request::Firewire(what, _) if what.is_order())
}

#[test]
fn a_refused_call_has_the_results_that_stock_reads() {
    for (request, _, call) in said() {
        if call.is_empty() || is_order(&request) {
            continue;
        }
        let reply = printed(&request.refuse_call(ReturnCode::NotReady));
        assert_eq!(
            reply.get(0),
            Some(&Value::List(Bottle::of(yarp_wire::Vocab32::new("err6"))))
        );
        assert!(reply.len() > 1, "{call}");
    }
    let order = printed(&Request::OnePush(1).refuse_call(ReturnCode::NotImplemented));
    assert_eq!(order.to_string(), "[err2]");
    let parse = |text: &str| Request::parse(&Bottle::parse(text).unwrap()).unwrap();
    let reply = printed(&parse("getFormat7WindowDC1394RPC").refuse_call(ReturnCode::NotReady));
    assert_eq!(reply.to_string(), "([err6]) 0 0 0 0");
}

#[test]
fn a_server_of_3_5_answers_orders_it_carried_out_with_nak() {
    let nak = Bottle::parse("[nak]").unwrap();
    let done = Some(Reply::Done(Answer::Done));
    assert_eq!(Request::SetValue(0, 0.5).read_reply(&nak), done);
    assert_eq!(Request::Value(0).read_reply(&nak), Some(Reply::Refused));
    assert_eq!(
        Request::SetMirroring(true).read_reply(&nak),
        Some(Reply::Refused)
    );
}

proptest! {
    #[test]
    fn a_request_reads_back_or_is_refused_in_its_form(
        head in prop::sample::select(vec!["fgi", "fgir", "visr", "fgc", "fgfw", "getImageCropRPC", "setFeature1RPC", "setActiveRPC", "setVideoModeDC1394RPC"]),
        act in prop::sample::select(vec!["get", "set", "has", "0", ""]),
        what in prop::sample::select(vec!["crop", "feat", "fea2", "res", "fov", "mirr", "actv", "mode", "conf", "DR2m", "DR2B"]),
        tail in prop_oneof![
            prop::sample::select(vec!["", "0", "1", "0 0.5", "640 480", "0 (1 2 3 4)"]).prop_map(str::to_owned),
            "[-0-9. ()\\[\\]a-z]{0,20}",
        ],
    ) {
        let Ok(message) = Bottle::parse(&format!("{head} {act} {what} {tail}")) else {
            return Ok(());
        };
        match Request::parse(&message) {
            Ok(request) => {
                let words = request.to_bottle();
                let call = request.to_call().map(|call| printed(&call));
                prop_assert!(words.is_some() || call.is_some(), "{request:?}");
                for form in [words, call].into_iter().flatten() {
                    prop_assert_eq!(Request::parse(&form), Ok(request.clone()), "{}", form);
                }
            }
            Err(error) => {
                let refusal = refusal(&message, &error.to_string()).to_string();
                let forms = ["[fail]", "[nak]", "0", "\"command not recognized\"", &format!("[{head}] [set] 0")];
                prop_assert!(forms.iter().any(|form| refusal.starts_with(form)), "{}", refusal);
            }
        }
    }

    #[test]
    fn whatever_comes_back_is_judged(text in "[-0-9. ()\\[\\]a-z\"{}]{0,40}") {
        if let Ok(reply) = Bottle::parse(&text) {
            for (request, _) in answers() {
                let head = request.reply(&Answer::Done).unwrap_or_default();
                let _ = request.read_reply(&reply);
                let longer: Bottle = head.into_items().into_iter().chain(reply.clone()).collect();
                let _ = request.read_reply(&longer);
                let _ = request.read_results(reply.as_slice());
            }
        }
    }
}
