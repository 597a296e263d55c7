//! Set points do not run ahead of an arm whose states are late.

#![cfg(all(unix, feature = "table"))]

use std::collections::BTreeSet;

use yarp_client::ports::blocking::wait;
use yarp_client::{Axes, Hand, RemoteClock, Robot};
use yarp_demos::table::{ServedTable, ServedTableOptions};
use yarp_devices::Encoders;
use yarp_manipulation::{RemoteWorkcell, Workcell};
use yarp_nameserver::{Server, ServerOptions};
use yarp_table::{LiveOptions, LiveTable, Scene};

/// Number of set points, 20 ms apart on the arm's clock.
const SET_POINTS: usize = 20;

/// The arm was so far behind its set points when it was seen again that its safety module stopped it.
#[test]
fn a_motion_waits_for_states_of_the_arm() {
    let mut options = LiveOptions::default();
    options.speed = 4.0;
    let table = LiveTable::start(Scene::empty(), options).unwrap();
    let names = wait(Server::start(ServerOptions::default().at("127.0.0.1", 0))).unwrap();
    let network = names.network();
    let mut serving = ServedTableOptions::default();
    // Every 100 ms, which are 400 ms of the arm.
    serving.speed = 0.1;
    let on = network.clone();
    let served = wait(async move { ServedTable::open(&on, table, &serving).await }).unwrap();
    {
        let arm = Robot::connect_on(&network, "/wam").unwrap();
        let hand = Hand::connect_on(&network, "/hand").unwrap();
        let clock = RemoteClock::connect_on(&network, "/table/clock:o").unwrap();
        let mut cell = RemoteWorkcell::new(arm.clone(), hand, ["/wam", "/hand"], 4.0);
        cell = cell.with_clock(clock);
        let mut states = BTreeSet::new();
        for _ in 0..SET_POINTS {
            cell.wait(0.02).unwrap();
            let reading = &arm.encoder_readings(Axes::All).unwrap()[0];
            states.insert(reading.time.to_bits());
        }
        // At most three or four set points with each; in the time of all of them come one or two.
        assert!(states.len() >= 4, "{}", states.len());
    }
    wait(async move {
        served.close().await;
        names.close().await;
    });
}
