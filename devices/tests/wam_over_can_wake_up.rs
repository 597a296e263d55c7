//! Pucks that wake late, one after the other, by themselves, or never: the first start of the driver waits for them in
//! silence, and names the one that is missing.

use std::time::Duration;

use yarp_devices::can::puck::{Address, Node, PuckMessage, PuckProperty, status};
use yarp_devices::simulation::WakeUp;
use yarp_devices::wam::WamModel;
use yarp_devices::wam::can::CanWam;

use crate::can;

use can::Rig;
use can::memory::Memory;
use can::scenarios::{activate, options, start};

fn nodes() -> impl Iterator<Item = Node> {
    (0..7).map(Node::of_motor).chain([Node::SAFETY])
}

fn waking_after(time: Option<Duration>) -> WakeUp {
    WakeUp {
        wake_time: time,
        self_start: None,
    }
}

/// Errors of the start, and how often it talked while pucks were waking.
fn start_with(wake_up: impl Fn(usize) -> WakeUp) -> (Option<String>, u64) {
    let rig = Memory::new();
    for (index, node) in nodes().enumerate() {
        rig.pucks().lock().set_wake_up(node, wake_up(index));
    }
    let started = CanWam::start(WamModel::<7>::new(), options(), rig.open());
    let disturbances = rig.pucks().lock().disturbances();
    (started.err().map(|error| error.to_string()), disturbances)
}

#[test]
fn late_pucks_start_at_the_first_attempt_and_are_not_disturbed() {
    for milliseconds in [0, 200, 500, 1000] {
        let time = Some(Duration::from_millis(milliseconds));
        let (error, disturbances) = start_with(|_| waking_after(time));
        assert_eq!(error, None, "{milliseconds} ms");
        assert_eq!(disturbances, 0, "{milliseconds} ms");
    }
}

#[test]
fn pucks_may_wake_one_after_the_other() {
    let time = |index: usize| Some(Duration::from_millis(300 * index as u64 + 300));
    let (error, _) = start_with(|index| waking_after(time(index)));
    assert_eq!(error, None);
}

#[test]
fn a_puck_that_never_wakes_is_named() {
    for index in [0, 6] {
        let late = |other| match other == index {
            true => waking_after(None),
            false => waking_after(Some(Duration::from_millis(100))),
        };
        let error = start_with(late).0.expect("a puck is missing");
        let named = format!("puck {} does not answer", index + 1);
        assert!(error.contains("waking pucks"), "{error}");
        assert!(error.contains(&named), "{error}");
    }
}

#[test]
fn a_lost_command_to_wake_is_repeated() {
    let rig = Memory::new();
    for node in nodes() {
        let soon = waking_after(Some(Duration::from_millis(100)));
        rig.pucks().lock().set_wake_up(node, soon);
    }
    let wake = PuckMessage::Value {
        property: PuckProperty::STAT,
        value: status::READY,
    };
    let wake = wake.frame(Address::from_host(Node::of_motor(2)));
    let mut lost = 0;
    rig.wire().lock().loss = Some(Box::new(move |frame| {
        let loses = lost == 0 && *frame == wake;
        lost += u32::from(loses);
        loses
    }));
    let started = CanWam::start(WamModel::<7>::new(), options(), rig.open());
    assert!(started.is_ok(), "{:?}", started.err());
}

/// A question that is lost twice is asked again; after three losses the puck counts as silent.
#[test]
fn lost_questions_are_repeated() {
    for (losses, starts) in [(2, true), (3, false)] {
        for property in [PuckProperty::VERS, PuckProperty::P] {
            let rig = Memory::new();
            let address = Address::from_host(Node::of_motor(2));
            let question = PuckMessage::Get(property).frame(address);
            let mut left = losses;
            rig.wire().lock().loss = Some(Box::new(move |frame| {
                let loses = left > 0 && *frame == question;
                left -= u32::from(loses);
                loses
            }));
            let started = CanWam::start(WamModel::<7>::new(), options(), rig.open());
            assert_eq!(started.is_ok(), starts, "{property}, {losses} losses");
        }
    }
}

/// Later than the documented limit, 1 s of silence and [`wake_timeout`](yarp_devices::wam::can::CanOptions).
#[test]
fn pucks_later_than_the_limit_are_an_error() {
    let (error, _) = start_with(|_| waking_after(Some(Duration::from_millis(3500))));
    assert!(error.expect("too late").contains("waking pucks"));
}

#[test]
fn pucks_that_started_by_themselves_are_told_where_they_are() {
    let rig = Memory::new();
    rig.pucks().lock().advance_start(Duration::from_secs(2));
    let arm = start(&rig);
    activate(&rig, &arm);
}
