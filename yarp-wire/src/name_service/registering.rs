//! Ports, as they register and as they say that they are there.

use crate::{Bottle, Value};

use super::SERVER_CHOOSES;

/// A port that says that it is there.
#[derive(Clone, Debug, Eq, PartialEq)]
pub struct LeaseHolder {
    /// Its name.
    pub name: String,
    /// Its host, as it is registered.
    pub host: String,
    /// Its TCP port.
    pub number: u16,
}

/// Registration request of a port. `None` leaves the choice to the server.
#[derive(Clone, Debug, Default, Eq, PartialEq)]
pub struct RegisterRequest {
    /// The port's name; `...` lets the server invent one.
    pub name: String,
    /// The carrier to be reached by.
    pub carrier: Option<String>,
    /// The host to be reached at.
    pub host: Option<String>,
    /// The TCP port; may be out of range, as it came.
    pub number: Option<i64>,
    /// Type of the port's messages, for example `yarp/image`.
    pub type_name: Option<String>,
}

impl RegisterRequest {
    /// A port that leaves everything but its name to the server.
    pub fn named(name: &str) -> Self {
        Self {
            name: name.to_owned(),
            ..Self::default()
        }
    }

    /// `register NAME` alone if nothing else is asked for, else all four fields, with `...` for
    /// an open one and `-1` for an open number, as stock clients write it.
    pub(super) fn to_bottle(&self) -> Bottle {
        let mut bottle = Bottle::of("register").with(self.name.as_str());
        let Self {
            carrier,
            host,
            number,
            type_name,
            ..
        } = self;
        if (carrier, host, number, type_name) == (&None, &None, &None, &None) {
            return bottle;
        }
        bottle.push(carrier.as_deref().unwrap_or(SERVER_CHOOSES));
        bottle.push(host.as_deref().unwrap_or(SERVER_CHOOSES));
        bottle.push(
            number.map_or(Value::from(-1), |number| match i32::try_from(number) {
                Ok(number) => number.into(),
                Err(_) => number.into(),
            }),
        );
        if let Some(type_name) = type_name {
            bottle.push(type_name.as_str());
        }
        bottle
    }
}
