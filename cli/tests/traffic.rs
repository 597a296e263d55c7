//! `yarp trafficgen` sends, `yarp stats` counts.

mod common;

use common::Home;

#[test]
fn what_is_sent_is_counted() {
    let home = Home::new();
    let _server = home.serve();
    let line = "trafficgen /t --period 0.05 --size 0.001";
    let traffic = home.start(line).see("Port /t active at");
    for kind in ["BufferedPort", "Port"] {
        let counted = home
            .run(&format!("stats /t --duration 2 --port_type {kind}"))
            .with(0);
        let lines: Vec<&String> = counted
            .out
            .iter()
            .filter(|line| line.contains(" Mb/s, "))
            .collect();
        assert_eq!(lines.len(), 2, "{counted:?}");
        let total = counted
            .out
            .iter()
            .find(|line| line.contains("total MB"))
            .unwrap();
        let numbers: Vec<f64> = total
            .split(' ')
            .filter_map(|word| word.parse().ok())
            .collect();
        let [megabytes, messages, _period] = numbers[..] else {
            panic!("{total}");
        };
        // A thousand zeros, and what makes them a bottle.
        assert!(messages >= 1.0, "{total}");
        assert!(
            (megabytes * 1e6 - messages * 1012.0).abs() < messages,
            "{total}"
        );
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
fn what_cannot_be_is_refused() {
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
