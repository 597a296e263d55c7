use proptest::prelude::*;
use yarp_devices::{
    AxisIndex, CalibrationParameters, Impedance, Interaction, Limits, Mode, MotorTorqueParameters,
    VariableValue,
};
use yarp_wire::WireVersion;

use super::super::board_arguments::SentMotorParameters;
use super::super::request_table::{Quantity, Query};
use super::*;

fn parse(text: &str) -> Result<Request, Malformed> {
    Request::parse(&Bottle::parse(text).expect("the test's own text"))
}

#[test]
fn prints_what_stock_prints() {
    // Both ways; the words are those of recorded traffic of 3.12.3.
    let check = |text: &str, request: Request| {
        assert_eq!(parse(text).as_ref(), Ok(&request), "{text}");
        assert_eq!(request.to_bottle().expect("it has words").to_string(), text);
    };
    let get = Request::Get;
    let set = Request::Set;
    let one = Selection::One(1.into());
    let group = Selection::Group(vec![2.into(), 0.into()]);
    check("[get] [prot]", Request::ProtocolVersion);
    check("[get] [axes]", get(Get::About(Query::Axes, Selection::All)));
    check("[get] [name] 1", get(Get::About(Query::Name, one.clone())));
    check("[get] [type] 1", get(Get::About(Query::Type, one.clone())));
    check(
        "[get] [llim] 1",
        get(Get::About(Query::PositionLimits, one.clone())),
    );
    check(
        "[get] [vlim] 1",
        get(Get::About(Query::VelocityLimits, one.clone())),
    );
    check(
        "[get] [dons]",
        get(Get::About(Query::MotionDone, Selection::All)),
    );
    check(
        "[get] [dong] 2 (2 0)",
        get(Get::About(Query::MotionDone, group.clone())),
    );
    check(
        "[get] [pos] 1",
        get(Get::Values(Quantity::TargetPosition, one.clone())),
    );
    check(
        "[get] [vmos]",
        get(Get::Values(Quantity::ReferenceVelocity, Selection::All)),
    );
    check(
        "[get] [icmd] [cmog] 2 (2 0)",
        get(Get::About(Query::ControlModes, group.clone())),
    );
    check(
        "[set] [icmd] [cmds] ([pos] [vel])",
        set(Set::ControlModes(
            Selection::All,
            vec![Mode::Position, Mode::Velocity],
        )),
    );
    check(
        "[set] [icmd] [cmod] 1 [posd]",
        set(Set::ControlModes(one.clone(), vec![Mode::PositionDirect])),
    );
    check(
        "[set] [pos] 1 4.0",
        set(Set::Values(Setting::Position, one.clone(), vec![4.0])),
    );
    check(
        "[set] [relg] 2 (2 0) (3.0 -5.0)",
        set(Set::Values(
            Setting::Distance,
            group.clone(),
            vec![3.0, -5.0],
        )),
    );
    check(
        "[set] [vels] (30.0 30.0)",
        set(Set::Values(
            Setting::ReferenceSpeed,
            Selection::All,
            vec![30.0, 30.0],
        )),
    );
    check("[set] [sto] 1", set(Set::Act(Action::Stop, one.clone())));
    check("[set] [stos]", set(Set::Act(Action::Stop, Selection::All)));
    check(
        "[set] [ere] 1",
        set(Set::Act(Action::ResetEncoders, one.clone())),
    );
    let torque = Setting::Torque;
    check(
        "[set] [torq] [refs] (1.0 2.0)",
        set(Set::Values(torque, Selection::All, vec![1.0, 2.0])),
    );
    check(
        "[get] [pid] [err] [cur] 1",
        get(Get::Values(
            Quantity::PidError(PidKind::Current),
            one.clone(),
        )),
    );
    check(
        "[get] [acus]",
        get(Get::Values(Quantity::Current, Selection::All)),
    );
    check(
        "[set] [iimp] [iof] 1 (2.0)",
        set(Set::Values(
            Setting::ImpedanceOffset,
            one.clone(),
            vec![2.0],
        )),
    );
    check(
        "[set] [reca] [homs]",
        set(Set::Act(Action::Home, Selection::All)),
    );
    check(
        "[set] [ivar] [mvar] gain 1.0 (2 three)",
        set(Set::Variable(
            "gain".to_owned(),
            vec![
                VariableValue::Number(1.0),
                VariableValue::List(vec![
                    VariableValue::Integer(2),
                    VariableValue::Text("three".to_owned()),
                ]),
            ],
        )),
    );
    check(
        "[calj] 1 3 1.0 2.0 3.0",
        set(Set::CalibrateAxis(1.into(), 3, [1.0, 2.0, 3.0])),
    );
    check(
        "[cald] 1",
        get(Get::About(Query::CalibrationDone, one.clone())),
    );
    check(
        "[set] [llim] 1 -10.0 10.0",
        set(Set::PositionLimits(1.into(), Limits::new(-10.0, 10.0))),
    );
}

#[test]
fn bytes_are_those_recorded() {
    // [set] [pos] 1 4.0 from a stock 3.12.3 client.
    let recorded: &[u8] = &[
        0x00, 0x01, 0, 0, 4, 0, 0, 0, 9, 0, 0, 0, b's', b'e', b't', 0, 9, 0, 0, 0, b'p', b'o',
        b's', 0, 1, 0, 0, 0, 1, 0, 0, 0, 10, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0x10, 0x40,
    ];
    let request = Request::Set(Set::Values(
        Setting::Position,
        Selection::One(1.into()),
        vec![4.0],
    ));
    let bytes = request.to_bottle().expect("words").encode(WireVersion::V3);
    assert_eq!(&bytes[..], recorded);
}

#[test]
fn people_may_type_it() {
    let check = |typed: &str, meant: &str| assert_eq!(parse(typed), parse(meant), "{typed}");
    check("get axes", "[get] [axes]");
    check("set pos 0 10", "[set] [pos] 0 10.0");
    check(
        "set posg 2 (0 1.0) (10 -5)",
        "[set] [posg] 2 (0 1) (10.0 -5.0)",
    );
    check("set icmd cmod 0.0 pos", "[set] [icmd] [cmod] 0 [pos]");
    assert_eq!(parse("help more"), Ok(Request::Help));
}

#[test]
fn what_is_not_wholly_understood_is_refused() {
    let check = |text: &str, why: Malformed| assert_eq!(parse(text), Err(why), "{text}");
    let values = |word: &str| Malformed::Values(Vocab32::new(word));
    check("", Malformed::TooShort);
    check("help", Malformed::TooShort);
    check("[abca]", Malformed::TooShort);
    check("foo bar", Malformed::UnknownWord(Vocab32::new("foo")));
    check("[get] foo", Malformed::UnknownWord(Vocab32::new("foo")));
    check("foo [pid]", Malformed::UnknownWord(Vocab32::new("foo")));
    check("[get] [torq] [vmo]", Malformed::UnknownWord(word::VELOCITY));
    check(
        "[set] [icur] [ref] 0 1.0",
        Malformed::UnknownWord(word::REFERENCE),
    );
    check("[get] [pid] [err]", values("pid"));
    check("[get] [pid] [err] [pos]", values("err"));
    check("[set] [pid] [pid] [pos] 0 (1.0 2.0)", values("pid"));
    check("[set] [torq] [mtps] 0 (1 2 3 4 5)", values("mtps"));
    check("[calj] 0 1 2 3", values("calj"));
    check(
        "[set] [prot]",
        Malformed::UnknownWord(word::PROTOCOL_VERSION),
    );
    check("[set] [pos]", values("pos"));
    check("[set] [pos] 0", values("pos"));
    check("[set] [pos] 0 [up]", values("pos"));
    check("[set] [pos] 0 true", values("pos"));
    check("[set] [pos] 0 \"10\"", values("pos"));
    check("[set] [pos] 0.5 10.0", values("pos"));
    check("[set] [pos] -1 10.0", values("pos"));
    check("[set] [pos] 0 10.0 11.0", values("pos"));
    check("[set] [poss] 1.0 2.0", values("poss"));
    check("[set] [poss] (1.0 up)", values("poss"));
    check("[set] [posg] 1 (0 1) (1.0 2.0)", values("posg"));
    check("[set] [vmo] 0 10.0", Malformed::UnknownWord(word::VELOCITY));
    check("[set] [llim] 0 1.0", values("llim"));
    check("[set] [icmd]", values("icmd"));
    check(
        "[set] [icmd] [what] 0 [pos]",
        Malformed::UnknownWord(Vocab32::new("what")),
    );
    check("[set] [icmd] [cmds] ([pos]) 1", values("cmds"));
}

#[test]
fn a_stop_is_a_stop() {
    let check = |text: &str, selection: Selection| {
        assert_eq!(
            parse(text),
            Ok(Request::Set(Set::Act(Action::Stop, selection))),
            "{text}"
        );
    };
    check("[set] [stos] 1 2 3", Selection::All);
    check("[set] [sto] 2 now", Selection::One(2.into()));
    check(
        "[set] [stog] 3 (0 1)",
        Selection::Group(vec![0.into(), 1.into()]),
    );
    // Which joint is not a detail.
    assert!(parse("[set] [sto]").is_err());
}

/// Every request that the tables have, in its three forms.
pub(in super::super) fn every_request() -> Vec<Request> {
    let selections = [
        Selection::One(1.into()),
        Selection::Group(vec![2.into(), 0.into()]),
        Selection::All,
    ];
    let mut all = Vec::new();
    for selection in selections {
        let values = match selection {
            Selection::One(_) => vec![4.0],
            _ => vec![4.0, -0.5],
        };
        let select = || selection.clone();
        all.extend(Quantity::all().map(|one| Request::Get(Get::Values(one, select()))));
        all.extend(Query::all().map(|one| Request::Get(Get::About(one, select()))));
        all.extend(Action::all().map(|one| Request::Set(Set::Act(one, select()))));
        all.extend(
            Setting::all().map(|one| Request::Set(Set::Values(one, select(), values.clone()))),
        );
        let pids = vec![yarp_devices::Pid::default(); values.len()];
        let modes = vec![Mode::Velocity; values.len()];
        let interactions = vec![Interaction::Compliant; values.len()];
        let kind = PidKind::Torque;
        all.push(Request::Set(Set::Pids(kind, select(), pids)));
        all.push(Request::Set(Set::ControlModes(select(), modes)));
        all.push(Request::Set(Set::Interactions(select(), interactions)));
    }
    let axis = AxisIndex::from(1);
    let impedance = Impedance {
        stiffness: 1.0,
        damping: 2.0,
    };
    let parameters = MotorTorqueParameters::from_array([1.0; 9]);
    let calibration = CalibrationParameters {
        method: 3,
        parameters: [1.0, 2.0, 3.0, 4.0, 0.0],
        zero: 0.0,
    };
    let name = || "gain".to_owned();
    let value = vec![VariableValue::Number(1.5), VariableValue::Integer(2)];
    all.extend([
        Request::Get(Get::Variable(name())),
        Request::Set(Set::Variable(name(), value)),
        Request::Set(Set::PositionLimits(axis, Limits::new(-1.0, 1.0))),
        Request::Set(Set::VelocityLimits(axis, Limits::new(0.0, 1.0))),
        Request::Set(Set::Impedance(axis, impedance)),
        Request::Set(Set::MotorParameters(
            axis,
            SentMotorParameters::all(parameters),
        )),
        Request::Set(Set::CalibrateAxis(axis, 3, [1.0, 2.0, 3.0])),
        Request::Set(Set::CalibrationParameters(axis, calibration)),
        Request::Set(Set::ManualBrake(axis, true)),
        Request::Set(Set::AutoBrake(axis, false)),
        Request::ProtocolVersion,
        Request::Help,
        Request::Interfaces,
    ]);
    all
}

#[test]
fn every_request_that_has_words_is_read_back() {
    let mut said = 0;
    for request in every_request() {
        if let Some(message) = request.to_bottle() {
            assert_eq!(Request::parse(&message).as_ref(), Ok(&request), "{message}");
            said += 1;
        }
    }
    assert!(said > 100, "{said}");
}

proptest! {
    #[test]
    fn what_is_printed_is_read_back(
        group in prop::collection::vec(0usize..9, 0..6),
        values in prop::collection::vec(-1e9..1e9f64, 0..6),
        setting in prop::sample::select(Setting::all().collect::<Vec<_>>()),
        quantity in prop::sample::select(Quantity::all().collect::<Vec<_>>()),
    ) {
        let one = Selection::One(group.first().copied().unwrap_or(3).into());
        let group = Selection::Group(group.into_iter().map(AxisIndex::from).collect());
        for selection in [one, group, Selection::All] {
            let values = match selection {
                Selection::One(_) => vec![values.first().copied().unwrap_or(0.0)],
                _ => values.clone(),
            };
            let requests = [
                Request::Set(Set::Values(setting, selection.clone(), values)),
                Request::Get(Get::Values(quantity, selection)),
            ];
            for request in requests {
                if let Some(message) = request.to_bottle() {
                    prop_assert_eq!(Request::parse(&message), Ok(request));
                }
            }
        }
    }
}
