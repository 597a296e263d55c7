//! Ownership of names, as far as addresses show it.
//!
//! A name belongs to the program that registered it. Requests carry no proof of that but the address
//! that they come from, so a request counts as the owner's if it comes from the address that
//! registered the name, from one of the addresses of the port, or from the same machine.

use std::net::IpAddr;
use std::time::Instant;

use yarp_wire::name_service::{LeaseHolder, RegisterRequest, Registration};

use super::registry_limits::Refusal;
use super::{Body, Entry, Registry};

/// Properties that decide where a port is found and what goes with it: others must not change them
/// while the port lives.
const OWNERS_PROPERTIES: [&str; 3] = ["carrier", "ips", "owns"];

/// Returns whether a carrier is that of a group or topic, which are only words between ports.
pub(super) fn is_ownerless(carrier: &str) -> bool {
    matches!(carrier, "mcast" | "topic")
}

/// Returns whether the holder can be probed for its claim to the name.
pub(super) fn has_owner(registration: &Registration) -> bool {
    !is_ownerless(&registration.carrier)
}

/// Returns whether `asked` leaves it to a name whether it has an owner.
pub(super) fn keeps_ownership(asked: &RegisterRequest, holder: &Registration) -> bool {
    let carrier = asked.carrier.as_deref().unwrap_or("tcp");
    is_ownerless(carrier) == is_ownerless(&holder.carrier)
}

impl Registry {
    /// Returns whether `from` may set property `key` of `name` to `values`.
    pub(super) fn may_set(
        &self,
        now: Instant,
        from: Option<IpAddr>,
        name: &str,
        key: &str,
        values: &[String],
    ) -> Result<(), Refusal> {
        let Some(entry) = self.ports.get(name) else {
            return Ok(());
        };
        let Registration {
            host,
            port,
            carrier: registered,
            ..
        } = &entry.registration;
        // The first of the values, sorted, is the carrier of the registration.
        if key == "carrier"
            && let Some(carrier) = values.iter().min()
            && is_ownerless(carrier) != is_ownerless(registered)
        {
            return Err(Refusal::Ownership {
                name: name.to_owned(),
                registered: registered.clone(),
                carrier: carrier.clone(),
            });
        }
        let is_gone = has_owner(&entry.registration) && entry.liveness.is_gone(now);
        if !OWNERS_PROPERTIES.contains(&key) || is_gone || self.is_owner(entry, from) {
            return Ok(());
        }
        Err(Refusal::NotOwner {
            name: name.to_owned(),
            host: host.clone(),
            port: *port,
            key: key.to_owned(),
        })
    }

    /// Returns whether a request from `from` counts as that of the port itself. The server itself, which has
    /// no address, may do everything.
    pub(super) fn is_owner(&self, entry: &Entry, from: Option<IpAddr>) -> bool {
        let Some(from) = from.map(|from| from.to_canonical()) else {
            return true;
        };
        let host = entry.registration.host.parse::<IpAddr>();
        let host = host.ok().map(|host| host.to_canonical());
        let is_same =
            |address: IpAddr| address == from || (self.is_here(address) && self.is_here(from));
        let ips = entry.properties.get("ips").iter();
        let mut ips = ips.filter_map(|ip| ip.parse::<IpAddr>().ok());
        entry.liveness.registered_by.is_some_and(is_same)
            || host.is_some_and(is_same)
            || ips.any(|ip| ip.to_canonical() == from)
    }

    /// Returns whether a request from `from` counts as that of the port called `name`.
    pub(crate) fn is_asked_by(&self, name: &str, from: IpAddr) -> bool {
        let entry = self.ports.get(name);
        entry.is_some_and(|entry| self.is_owner(entry, Some(from)))
    }

    /// Returns whether an address is one of this machine.
    fn is_here(&self, address: IpAddr) -> bool {
        let mut subnets = self.settings.subnets.iter();
        address.is_loopback() || subnets.any(|subnet| subnet.own == address)
    }

    /// `passed NAME HOST NUMBER ...`: another server was told `lease` by these ports. Only other
    /// servers of the same names are believed.
    pub(super) fn passed(
        &mut self,
        now: Instant,
        from: Option<IpAddr>,
        holders: &[LeaseHolder],
    ) -> Body {
        let Some(from) = from.map(|from| from.to_canonical()) else {
            return self.lease(now, None, holders);
        };
        let mut others = self.settings.others.iter();
        let is_server = others.any(|(host, _)| match host.parse::<IpAddr>() {
            Ok(host) => host == from || (self.is_here(host) && self.is_here(from)),
            // A host name tells nothing.
            Err(_) => true,
        });
        match is_server {
            true => self.lease(now, None, holders),
            false => Body::end(),
        }
    }
}
