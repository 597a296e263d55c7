//! `yarp latency-test` measures round trips over every kind of connection.

use crate::common;

use std::time::Duration;

use common::{Home, Running};

/// Output of a server for each test once its port is open.
const READY: &str = "I am the server, now listening to the client for a `start` command";

#[test]
fn frames_make_round_trips() {
    let home = Home::new();
    let _name_server = home.serve();
    let mut server = home.start("latency-test --server");
    let prefix = home.path().join("log_");
    let mut tests = 0;
    for way in [
        "--protocol tcp",
        "--protocol tcp --no-reply",
        "--protocol text_ack",
        // The end may be lost: nothing is expected of the server after it.
        "--protocol udp",
    ] {
        // The previous server may still be ending.
        server = server.see_often(READY, tests + 1);
        let line = format!(
            "latency-test --client --nframes 5 --payload_size 100 {way} --logfile {}",
            prefix.display()
        );
        let ended = home.run(&line).with(0);
        assert!(
            ended.says("Processed 5 frames of 100 bytes, average latency "),
            "{ended:?}"
        );
        let kept = home.file("log_100.txt").unwrap();
        assert_eq!(kept.lines().count(), 5, "{kept}");
        for number in kept.split_whitespace() {
            assert!(number.parse::<f64>().unwrap().is_finite(), "{kept}");
        }
        tests += 1;
    }
    let mut server = server.see(&format!("Test {} complete", tests - 2));
    assert!(server.sees("Replying on the same connection"));
    assert!(server.sees("Using a separate connection"));
    server.signal("INT").finish().with(0);
}

/// Sends lines to a server until it prints `told`: its port may still be closing after the last
/// test.
fn tell(home: &Home, server: &mut Running, lines: &str, told: &str) {
    for _ in 0..100 {
        home.run_with("rpc /latencyTest/server", lines);
        if server.sees_within(told, Duration::from_millis(300)) {
            return;
        }
    }
    panic!("no {told:?} in {:?}", server.printed());
}

#[test]
fn invalid_requests_do_not_stop_the_server() {
    let home = Home::new();
    let _name_server = home.serve();
    let mut server = home.start("latency-test --server").see(READY);
    for (test, nonsense) in ["hello", "start 2147483647 1", "start -1 1"]
        .iter()
        .enumerate()
    {
        let told = format!("[ERROR] Test {test} error");
        tell(&home, &mut server, &format!("{nonsense}\n"), &told);
    }
    tell(
        &home,
        &mut server,
        "start 10 1\nquit\n",
        "complete, quitting",
    );
    server.finish().with(255);
}

#[test]
fn replies_without_the_time_are_not_counted() {
    let home = Home::new();
    let _name_server = home.serve();
    let mut server = home.start("rpcserver /latencyTest/server").see("Waiting");
    server.type_text(&"7\n".repeat(4));
    let line = "latency-test --client --nframes 2 --payload_size 3 --details";
    let ended = home.run(line).with(255);
    assert!(ended.says("Frame 1 is not counted"), "{ended:?}");
    assert!(ended.says("No frame was measured"), "{ended:?}");
}

#[test]
fn contradicting_arguments_are_refused() {
    let home = Home::new();
    let check = |line: &str, expected: &str| {
        assert!(home.run(line).with(255).says(expected), "{line}");
    };
    check("latency-test", "This is yarp latency-test");
    check(
        "latency-test --nothing",
        "[ERROR] Missing option. Use --help",
    );
    check(
        "latency-test --client",
        "[ERROR] Missing mandatory parameter nframes.",
    );
    check("latency-test --client --nframes 3", "[ERROR] Syntax error.");
    check(
        "latency-test --client --nframes 0 --payload_size 3",
        "[ERROR] nframes must be",
    );
}
