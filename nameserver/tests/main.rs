//! One program of all tests of this crate, one file per behaviour: it is compiled and linked once, and its tests run side by side.
//! A test that needs a process of its own has an entry in `Cargo.toml` instead.

#[allow(unreachable_pub)]
#[path = "../fuzz/src/lib.rs"]
mod fuzz;

mod cancelled_openings;
mod contested_names;
mod handed_out_port_range;
mod liveness_states;
mod liveness_views_agree;
mod loopback_networks;
mod multicast_groups;
mod multiple_name_servers;
mod name_ownership;
mod name_server_roles;
mod names_survive_restart;
mod recorded_requests;
mod registry_fuzz_corpus;
mod reregistration;
mod restart_with_less;
mod rpc_replies_by_wire_version;
mod scripts_in_properties;
mod shared_store;
mod web_pages;
mod what_others_may_change;
