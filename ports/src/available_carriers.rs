//! Carriers that this build has: some need a feature.

use yarp_wire::carrier::{ALL, Carrier, CarrierSpec, Transport};
use yarp_wire::protocol::PayloadKind;

/// Returns whether this build has the carrier.
pub(crate) fn is_available(carrier: &Carrier) -> bool {
    let shmem = carrier.transport == Transport::SharedMemory;
    let jpeg = carrier.protocol.payload_kind() == PayloadKind::Jpeg;
    (cfg!(feature = "shmem") || !shmem) && (cfg!(feature = "jpeg") || !jpeg)
}

/// Returns the carrier that a carrier string names, if this build has it.
pub(crate) fn of(spec: &CarrierSpec) -> Option<&'static Carrier> {
    Carrier::of(spec).filter(|carrier| is_available(carrier))
}

/// Returns the names of the carriers that this build has and `accept` selects.
pub(crate) fn names(accept: impl Fn(&Carrier) -> bool) -> Vec<&'static str> {
    let all = ALL.into_iter();
    let chosen = all.filter(|carrier| is_available(carrier) && accept(carrier));
    let mut names: Vec<_> = chosen.map(|carrier| carrier.name).collect();
    names.dedup();
    names
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_build_has_the_carriers_of_its_features() {
        let names = names(|_| true);
        assert_eq!(names.contains(&"shmem"), cfg!(feature = "shmem"));
        assert_eq!(names.contains(&"mjpeg"), cfg!(feature = "jpeg"));
        assert!(names.contains(&"fast_tcp") && names.contains(&"http"));
        let spec = "shmem+send.portmonitor".parse().unwrap();
        assert_eq!(of(&spec).is_some(), cfg!(feature = "shmem"));
    }
}
