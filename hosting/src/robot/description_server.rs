//! Tells other programs which devices a robot has, as `robotDescription_nws_yarp` of YARP 4.0.
//!
//! ```text
//! getAllDevicesRPC                    (CODE) ((NAME TYPE CONFIGURATION "") ...)
//! getAllDevicesByTypeRPC TYPE         the same, with devices of this type
//! ```
//!
//! The configuration is the text of the resolved parameters. Requests to change the list are refused: it is that of the
//! devices that are open. Source: `IRobotDescriptionMsgs.thrift` and its generated code of YARP 4.0.0.

use std::sync::{Arc, Mutex, PoisonError};

use yarp_ports::{Answer, Network, Port, PortError, PortOptions, Received};
use yarp_wire::{Bottle, Value, Vocab32};
use yarp_wrappers::thrift::{GET_VERSION, Item, Message, ReturnCode, ServiceVersion};

/// Maximum number of bytes of a request.
const MAX_REQUEST: usize = 64 * 1024;

/// An open device of a robot.
#[derive(Clone, Debug, PartialEq)]
pub struct DeviceDescription {
    /// Name.
    pub name: String,
    /// Device type.
    pub kind: String,
    /// Text of its parameters.
    pub configuration: String,
}

/// Devices that a port tells of; none before it is attached.
pub(crate) type SharedDescriptions = Arc<Mutex<Option<Arc<[DeviceDescription]>>>>;

/// Opens a port that answers with the devices.
pub(crate) async fn open_port(
    network: &Network,
    name: &str,
    devices: SharedDescriptions,
) -> Result<Port, PortError> {
    let handler = move |received: &mut Received| {
        let devices = devices.lock().unwrap_or_else(PoisonError::into_inner);
        answer(&received.bottle().unwrap_or_default(), devices.as_deref())
    };
    let options = PortOptions::new().max_message(MAX_REQUEST);
    Port::open(network, name, options.handler(handler).input_only()).await
}

fn answer(request: &Bottle, devices: Option<&[DeviceDescription]>) -> Answer {
    let words: Vec<&str> = request.iter().map_while(Value::as_str).collect();
    match (&words[..], devices) {
        ([GET_VERSION], _) => Answer::reply(ServiceVersion::SERVED),
        (["getAllDevicesRPC"], Some(devices)) => Answer::reply(reply(devices.iter())),
        (["getAllDevicesByTypeRPC", kind], Some(devices)) => {
            Answer::reply(reply(devices.iter().filter(|device| device.kind == *kind)))
        }
        (
            [
                "registerDeviceRPC" | "unregisterDeviceRPC" | "unregisterAllRPC",
                ..,
            ],
            _,
        ) => Answer::reply(Message(ReturnCode::NotImplemented.alone())),
        _ => Answer::reply(Bottle::of(Vocab32::FAIL)),
    }
}

fn reply<'d>(devices: impl Iterator<Item = &'d DeviceDescription>) -> Message {
    let devices = devices.map(|device| {
        let texts = [&device.name, &device.kind, &device.configuration];
        let mut texts: Vec<Item> = texts.map(|text| Item::Text(text.clone())).into();
        // Stock's field for further information, which is always empty.
        texts.push(Item::Text(String::new()));
        Item::List(texts)
    });
    Message(ReturnCode::Ok.with([Item::List(devices.collect())]))
}
