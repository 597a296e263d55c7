//! `yarp trafficgen` sends messages, `yarp stats` counts them.

use crate::common;

use common::{Ended, Home};

/// Returns megabytes and messages of two seconds; `None` if no message came, as on a busy machine.
fn counted(home: &Home, kind: &str) -> Option<(f64, f64)> {
    let ended = home.run(&format!("stats /t --duration 2 --port_type {kind}"));
    let Ended { out, .. } = ended.with(0);
    let lines = out.iter().filter(|line| line.contains(" Mb/s, "));
    assert_eq!(lines.count(), 2, "{out:?}");
    let total = out.iter().find(|line| line.contains("total MB")).unwrap();
    let numbers = total.split(' ').filter_map(|word| word.parse().ok());
    let [megabytes, messages, _period] = numbers.collect::<Vec<f64>>()[..] else {
        panic!("{total}");
    };
    (messages > 0.0).then_some((megabytes, messages))
}

#[test]
fn what_is_sent_is_counted() {
    let home = Home::new();
    let _server = home.serve();
    let line = "trafficgen /t --period 0.05 --size 0.001";
    let traffic = home.start(line).see("Port /t active at");
    for kind in ["BufferedPort", "Port"] {
        let counted = (0..20).find_map(|_| counted(&home, kind));
        let (megabytes, messages) = counted.expect("it sends twenty messages a second");
        // A thousand zeros, and the overhead of a bottle.
        let expected = messages * 1012.0;
        let found = megabytes * 1e6;
        assert!((found - expected).abs() < messages, "{found} {expected}");
    }
    traffic.signal("INT").finish().with(0);
    assert_eq!(home.names(), Vec::<String>::new());
}

#[test]
fn traffic_ends_after_its_duration() {
    let home = Home::new();
    let _server = home.serve();
    let ended = home
        .run("trafficgen /t --bandwidth 1 --duration 0.2")
        .with(0);
    assert!(
        ended.says("period:1.000(s), size:0.125(MB), duration:0.200(s), bandwidth:1.000(Mb/s)")
    );
}

#[test]
fn invalid_traffic_is_refused() {
    let home = Home::new();
    let _server = home.serve();
    for size in ["-1", "1e6"] {
        let refused = home
            .run(&format!("trafficgen /t --period 1 --size {size}"))
            .with(1);
        assert!(
            refused.says("[ERROR] A message may have 0 to 500 MB"),
            "{refused:?}"
        );
    }
    let refused = home.run("stats /nothing").with(255);
    assert!(refused.says("Connection failed"));
}
