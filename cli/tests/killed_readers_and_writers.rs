//! When the system kills or stops programs, the others continue.

#![cfg(unix)]

use crate::common;

use common::Home;

/// Waits until the port `/w` writes to `readers` and to no other port.
#[track_caller]
fn outputs_become(home: &Home, readers: &str) {
    let mut last = None;
    for _ in 0..200 {
        let ended = home.run_with("admin rpc /w", "[list] [out]\n").with(0);
        if ended.out == [format!("Response: \"{readers}\"")] {
            return;
        }
        last = Some(ended);
        std::thread::sleep(std::time::Duration::from_millis(50));
    }
    panic!("{readers} are not all that /w writes to: {last:?}");
}

#[test]
fn killed_readers_are_dropped() {
    let home = Home::new();
    let _server = home.serve();
    let mut keeps = home.start("read /keeps").see("active at");
    let mut writer = home.start("write /w /keeps").see("active at");
    for carrier in ["tcp", "fast_tcp", "text", "text_ack", "unix_stream"] {
        let mut dies = home.start("read /dies").see("active at");
        home.run(&format!("connect /w /dies {carrier}")).with(0);
        writer.reaches(&mut dies, &format!("before {carrier}"));
        dies.kill();
        outputs_become(&home, "/keeps");
        writer.reaches(&mut keeps, &format!("after {carrier}"));
    }
}

#[test]
fn stopped_readers_do_not_delay_others() {
    let home = Home::new();
    let _server = home.serve();
    let mut keeps = home.start("read /keeps").see("active at");
    let mut stops = home.start("read /stops").see("active at");
    let mut writer = home.start("write /w /keeps").see("active at");
    home.run("connect /w /stops").with(0);
    writer.reaches(&mut stops, "first");
    let stops = stops.signal("STOP");
    for line in ["while stopped", "still stopped", "stopped for long"] {
        writer.type_text(&format!("{line}\n"));
        assert!(keeps.sees(line), "{line}: {:?}", keeps.printed());
    }
    // The reader continues and has missed nothing.
    let stops = stops.signal("CONT").see("while stopped");
    let stops = stops.see("still stopped").see("stopped for long");
    let stops = stops.signal("STOP");
    writer.type_text("stopped again\n");
    assert!(keeps.sees("stopped again"), "{:?}", keeps.printed());
    stops.kill();
    outputs_become(&home, "/keeps");
    writer.reaches(&mut keeps, "at last");
}

#[test]
fn killed_writers_are_dropped() {
    let home = Home::new();
    let _server = home.serve();
    let mut reader = home.start("read /r").see("active at");
    let mut keeps = home.start("write /keeps /r").see("active at");
    for carrier in ["tcp", "fast_tcp", "text", "text_ack", "unix_stream"] {
        let mut dies = home.start("write /dies").see("active at");
        home.run(&format!("connect /dies /r {carrier}")).with(0);
        dies.reaches(&mut reader, &format!("before {carrier}"));
        dies.kill();
        let gone = (0..200).any(|_| {
            let ended = home.run_with("admin rpc /r", "[list] [in]\n").with(0);
            !ended.says("/dies")
        });
        assert!(gone, "{carrier}");
        keeps.reaches(&mut reader, &format!("after {carrier}"));
    }
}

#[test]
fn a_killed_server_is_reported() {
    let home = Home::new();
    let _server = home.serve();
    let server = home.start("rpcserver /s").see("Waiting for a message...");
    let mut client = home.start("rpc /s");
    client.type_text("question\n");
    let server = server.see("Message: question");
    server.kill();
    let ended = client.finish();
    assert!(!ended.says("Response"), "{ended:?}");
}
