//! Feeds the bytes of each fuzz target to a parser of messages or images, and checks what must hold for any bytes.
//!
//! The same functions are replayed over the committed corpora by `tests/fuzz_corpus.rs`.

use bytes::{Bytes, BytesMut};
use yarp_wire::message::{ReadObject, WireObject};
use yarp_wire::{Bottle, Limits, WireVersion};
use yarp_wrappers::cartesian::messages as cartesian;
use yarp_wrappers::control_board::messages::{
    Command, JointData, MotionUpdate, Numbered, Reply, Request,
};
use yarp_wrappers::frame_grabber::messages as grabber;
use yarp_wrappers::gaze::messages::{self as gaze_messages, GazeReply};
use yarp_wrappers::hand::messages as hands;
use yarp_wrappers::thrift::{ReturnCode, ServiceVersion};

/// One fuzz target: its name, which is also that of its corpus, and what it does.
pub type Target = (&'static str, fn(&[u8]));

/// All targets.
pub const TARGETS: [Target; 10] = [
    ("request", request),
    ("numbered", numbered),
    ("call", call),
    ("streamed", streamed),
    ("state", state),
    ("camera", camera),
    ("picture", picture),
    ("hand", hand),
    ("tool", tool),
    ("gaze", gaze),
];

const DIALECTS: [WireVersion; 2] = [WireVersion::V3, WireVersion::V4];

/// Queries, commands and replies, in binary: a parsed message can be printed, and parsed again.
pub fn request(data: &[u8]) {
    let bytes = Bytes::copy_from_slice(data);
    for wire_version in DIALECTS {
        let Ok(bottle) = Bottle::decode(&bytes, wire_version, Limits::DEFAULT) else {
            continue;
        };
        if let Ok(understood) = Request::parse(&bottle)
            && let Some(printed) = understood.to_bottle()
        {
            let again = Request::parse(&printed).expect("our own words");
            // Compared as they print: a nan is not equal to itself.
            assert_eq!(format!("{again:?}"), format!("{understood:?}"), "{printed}");
        }
        let reply = Reply::from_bottle(bottle);
        let _ = (reply.is_ok(), reply.is_refusal(), reply.read_version());
    }
}

/// Our own messages about numbered motions, and their replies.
pub fn numbered(data: &[u8]) {
    for wire_version in DIALECTS {
        let Ok(bottle) =
            Bottle::decode(&Bytes::copy_from_slice(data), wire_version, Limits::DEFAULT)
        else {
            continue;
        };
        if let Some(Ok(wanted)) = Numbered::parse(&bottle)
            && let Some(printed) = wanted.to_bottle()
        {
            let again = Numbered::parse(&printed).expect("our own words");
            // Compared as they print: a nan is not equal to itself.
            let again = again.expect("our own words");
            assert_eq!(format!("{again:?}"), format!("{wanted:?}"), "{printed}");
        }
        if let Some(news) = MotionUpdate::from_bottle(&bottle) {
            assert_eq!(MotionUpdate::from_bottle(&news.to_bottle()), Some(news));
        }
        let _ = Numbered::read_drops(&bottle);
    }
}

/// Calls and replies of 4.0: what is understood is written, and is understood again.
pub fn call(data: &[u8]) {
    let bytes = Bytes::copy_from_slice(data);
    for wire_version in DIALECTS {
        let Ok(bottle) = Bottle::decode(&bytes, wire_version, Limits::DEFAULT) else {
            continue;
        };
        if let Ok(understood) = Request::parse_call(&bottle)
            && let Some(call) = understood.to_call()
        {
            written(&call, wire_version, |bytes| {
                let again = Bottle::decode(bytes, wire_version, Limits::DEFAULT)?;
                let again = Request::parse_call(&again).expect("our own call");
                assert_eq!(format!("{again:?}"), format!("{understood:?}"));
                Ok(())
            });
        }
        let _ = ReturnCode::read(bottle);
        let _ = ServiceVersion::read_binary(&bytes, wire_version);
    }
}

/// StreamingCommand commands: what reads also writes, and reads the same again.
pub fn streamed(data: &[u8]) {
    let bytes = Bytes::copy_from_slice(data);
    for wire_version in DIALECTS {
        if let Ok(command) = Command::read_binary(&bytes, wire_version) {
            let _ = command.parse();
            written(&command, wire_version, |bytes| {
                Command::read_binary(bytes, wire_version)
                    .map(|again| written(&again, wire_version, |_| Ok(())))
            });
        }
    }
}

/// Whole states: what reads also writes, and reads the same again.
pub fn state(data: &[u8]) {
    let bytes = Bytes::copy_from_slice(data);
    for wire_version in DIALECTS {
        if let Ok(state) = JointData::read_binary(&bytes, wire_version) {
            written(&state, wire_version, |bytes| {
                JointData::read_binary(bytes, wire_version)
                    .map(|again| written(&again, wire_version, |_| Ok(())))
            });
        }
    }
}

/// Requests to cameras and replies, of both wire versions: a parsed message is encoded the same way.
pub fn camera(data: &[u8]) {
    let bytes = Bytes::copy_from_slice(data);
    for wire_version in DIALECTS {
        let Ok(bottle) = Bottle::decode(&bytes, wire_version, Limits::DEFAULT) else {
            continue;
        };
        match grabber::Request::parse(&bottle) {
            Ok(understood) => {
                // Compared as they print: a nan is not equal to itself.
                let same = |again| assert_eq!(format!("{again:?}"), format!("{understood:?}"));
                if let Some(words) = understood.to_bottle() {
                    same(grabber::Request::parse(&words).expect("our own words"));
                }
                if let Some(call) = understood.to_call() {
                    written(&call, wire_version, |bytes| {
                        let again = Bottle::decode(bytes, wire_version, Limits::DEFAULT)?;
                        same(grabber::Request::parse(&again).expect("our own call"));
                        Ok(())
                    });
                }
            }
            Err(error) => assert!(!grabber::refusal(&bottle, &error.to_string()).is_empty()),
        }
        for request in [
            grabber::Request::Configurations,
            grabber::Request::Intrinsics,
            grabber::Request::Image(grabber::Channel::Colour),
            grabber::Request::Description,
            grabber::Request::SetMirroring(true),
        ] {
            let _ = request.read_reply(&bottle);
            let _ = request.read_results(bottle.as_slice());
        }
    }
}

/// Requests to hands and replies: a parsed message is encoded the same way.
pub fn hand(data: &[u8]) {
    let bytes = Bytes::copy_from_slice(data);
    for wire_version in DIALECTS {
        let Ok(bottle) = Bottle::decode(&bytes, wire_version, Limits::DEFAULT) else {
            continue;
        };
        match hands::Request::parse(&bottle) {
            Ok(understood) => {
                let again = hands::Request::parse(&understood.to_bottle()).expect("our own words");
                // Compared as they print: a nan is not equal to itself.
                assert_eq!(format!("{again:?}"), format!("{understood:?}"));
            }
            Err(error) => {
                let refused = hands::Reply::Refused(error.into());
                let back = hands::Reply::read(&hands::Request::Open, &refused.to_bottle());
                assert_eq!(back, Some(refused));
            }
        }
        for request in [
            hands::Request::Open,
            hands::Request::Positions,
            hands::Request::IsConnected,
            hands::Request::Command(String::new()),
        ] {
            if let Some(reply) = hands::Reply::read(&request, &bottle) {
                let again = hands::Reply::read(&request, &reply.to_bottle());
                assert_eq!(format!("{again:?}"), format!("{:?}", Some(reply)));
            }
        }
    }
}

/// Requests to controllers of a tool, and events: a parsed message is encoded the same way.
pub fn tool(data: &[u8]) {
    let bytes = Bytes::copy_from_slice(data);
    for wire_version in DIALECTS {
        let Ok(bottle) = Bottle::decode(&bytes, wire_version, Limits::DEFAULT) else {
            continue;
        };
        if let Ok(understood) = cartesian::Request::parse(&bottle) {
            let printed = understood.to_bottle();
            let again = cartesian::Request::parse(&printed).expect("our own words");
            // Compared as they print: a nan is not equal to itself.
            assert_eq!(format!("{again:?}"), format!("{understood:?}"), "{printed}");
        }
        if let Some(event) = cartesian::from_event(&bottle) {
            let again = cartesian::from_event(&cartesian::to_event(&event));
            assert_eq!(format!("{again:?}"), format!("{:?}", Some(event)));
        }
    }
}

/// Replies of gaze controllers, and events: any values are read, or are none.
pub fn gaze(data: &[u8]) {
    let bytes = Bytes::copy_from_slice(data);
    for wire_version in DIALECTS {
        let Ok(bottle) = Bottle::decode(&bytes, wire_version, Limits::DEFAULT) else {
            continue;
        };
        let _ = gaze_messages::from_event(&bottle);
        let Some(GazeReply::Done(values)) = GazeReply::read(&bottle) else {
            continue;
        };
        let _ = (values.number(), values.flag(), values.id(), values.range());
        let _ = (values.blocked_vergence(), values.list());
        let _ = (values.array::<3>(), values.angles(), values.pose());
        if let Some(info) = values.info() {
            let options = values.options().expect("information is options");
            assert!(info.others.options.len() <= options.options.len());
        }
    }
}

/// Image files and films.
pub fn picture(data: &[u8]) {
    let _ = yarp_devices::image::image_file::decode(data);
    for place in yarp_devices::camera::mjpeg_splitter::images(data) {
        let _ = yarp_devices::image::image_file::decode(&data[place]);
    }
}

/// Writes a message and hands the bytes to `check`, which must not fail.
fn written<T>(
    object: &dyn WireObject,
    wire_version: WireVersion,
    check: impl Fn(&Bytes) -> Result<T, yarp_wire::bottle::DecodeError>,
) {
    let mut bytes = BytesMut::new();
    object.write_binary(&mut bytes, wire_version);
    check(&bytes.freeze()).map(drop).expect("our own bytes");
}
