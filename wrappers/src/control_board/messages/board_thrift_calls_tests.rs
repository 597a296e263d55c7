use super::super::board_vocab_requests::tests::every_request;
use super::super::request_table::Query;
use super::*;
use bytes::{Bytes, BytesMut};
use yarp_wire::message::{ReadObject, WireObject};

const V4: yarp_wire::WireVersion = yarp_wire::WireVersion::V4;

fn written(message: &Message) -> Bytes {
    let mut out = BytesMut::new();
    message.write_binary(&mut out, V4);
    out.freeze()
}

/// The names of all functions that are understood.
fn functions() -> Vec<String> {
    let spelt = Row::all().map(|row| row.spelling().functions);
    let mut names: Vec<String> = spelt
        .flat_map(|forms| [forms.one, forms.group, forms.all])
        .flatten()
        .chain([INTERFACES, GET_VARIABLE])
        .map(|name| format!("{name}{SUFFIX}"))
        .collect();
    names.sort();
    names
}

fn parse(text: &str) -> Result<Request, Malformed> {
    Request::parse_call(&Bottle::parse(text).expect("the test's own text"))
}

#[test]
fn every_request_that_has_a_function_is_read_back() {
    let mut said = 0;
    for request in every_request() {
        let Some(call) = request.to_call() else {
            continue;
        };
        let bytes = written(&call);
        let bottle = Bottle::read_binary(&bytes, V4).expect("our own bytes");
        let read = Request::parse_call(&bottle);
        assert_eq!(read.as_ref(), Ok(&request), "{bottle}");
        said += 1;
    }
    assert_eq!(said, functions().len() + 2);
}

#[test]
fn the_functions_are_those_of_stock() {
    let mut recorded: Vec<&str> = FUNCTIONS.lines().collect();
    recorded.sort_unstable();
    assert_eq!(functions(), recorded);
}

#[test]
fn people_may_type_it() {
    let check = |text: &str, request: Request| assert_eq!(parse(text), Ok(request), "{text}");
    let axes = Get::About(Query::Axes, Selection::All);
    check("getAxesRPC", Request::Get(axes.clone()));
    check("__direct__ getAxesRPC", Request::Get(axes));
    check("help", Request::Help);
    check("getRemoteProtocolVersion", Request::ProtocolVersion);
    let to = Set::Values(Setting::Position, Selection::One(0.into()), vec![45.0]);
    check("positionMoveOneRPC 0 45", Request::Set(to));
}

#[test]
fn what_is_not_wholly_understood_is_refused() {
    let arguments = |text: &str| {
        let name = text.split(' ').next().expect("a name").to_owned();
        assert_eq!(parse(text), Err(Malformed::Arguments(name)), "{text}");
    };
    arguments("getAxesRPC 1");
    arguments("getRemoteProtocolVersion 1");
    arguments("positionMoveOneRPC 0");
    arguments("positionMoveOneRPC 0 1.0 2.0");
    arguments("positionMoveOneRPC 0 up");
    arguments("positionMoveOneRPC -1 1.0");
    arguments("positionMoveOneRPC 0.5 1.0");
    arguments("positionMoveAllRPC 1.0 2.0");
    arguments("positionMoveAllRPC (1.0 up)");
    arguments("setControlModeOneRPC 0");
    arguments("setPidRPC 829648752 0 (1.0 2.0)");
    arguments("getPidRPC 829648752");
    arguments("setRemoteVariableRPC friction 1.0");
    arguments("setManualBrakeActiveRPC 0");
    for unknown in ["positionMoveOne 0 45.0", "fooRPC", "[get] [axes]", "", "5"] {
        let read = parse(unknown);
        assert!(
            matches!(read, Err(Malformed::UnknownFunction(_))),
            "{unknown}: {read:?}"
        );
    }
}
