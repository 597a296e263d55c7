//! `yarp read`, `write`, `rpc`, `rpcserver`, `repeat` and `wait` exchange messages.

use crate::common;

use std::process::Command;

use common::Home;

#[test]
fn write_reaches_read_over_every_carrier() {
    let home = Home::new();
    let _server = home.serve();
    for carrier in ["tcp", "fast_tcp", "text", "text_ack"] {
        let reader = home.start("read /r").see("Port /r active at");
        let mut writer = home.start("write /w").see("Port /w active at");
        let made = home.run(&format!("connect /w /r {carrier}")).with(0);
        assert!(made.says(&format!(
            "Success: Added connection from /w to {carrier}://r"
        )));
        home.run("exists /w /r").with(0);
        home.run(&format!("exists /w {carrier}://r")).with(0);
        writer.type_text("hello 5 (a b)\n\"unfinished\n0 raw\nend\n");
        let reader = reader.see("end");
        home.run("disconnect /w /r").with(0);
        home.run("disconnect /w /r").with(1);
        writer.finish().with(0);
        drop(reader);
        home.run("clean --timeout 5").with(0);
    }
}

#[test]
fn read_prints_every_kind_of_message() {
    let home = Home::new();
    let _server = home.serve();
    let reader = home.start("read /r").see("active at");
    home.run_with(
        "write /w text://r",
        "hello 5\n\n0 \"a b\"\n[ok] (1 2.5)\nunterminated",
    )
    .with(0);
    home.run_with("write /w /r verbatim", "as (typed\n").with(0);
    let ended = reader.finish().with(0);
    let printed: Vec<_> = ended
        .out
        .iter()
        .filter(|line| !line.starts_with("[INFO]"))
        .collect();
    assert_eq!(
        printed,
        [
            "hello 5",
            "",
            "a b",
            "[ok] (1 2.5)",
            "unterminated",
            "as (typed"
        ]
    );
}

/// Log lines without a reader, as with `| head`, once caused an error message each.
#[cfg(unix)]
#[test]
fn closed_output_is_no_error() {
    let home = Home::new();
    let _server = home.serve();
    let mut command = Command::new("sh");
    let yarp = env!("CARGO_BIN_EXE_yarp");
    command.args(["-c", "\"$0\" read /r | true", yarp]);
    let reader = home.spawn(command, "read /r | true");
    home.run("wait /r").with(0);
    home.run_with("write /w /r", "hello\n").with(0);
    let ended = reader.finish().with(0);
    assert!(ended.err.is_empty(), "{ended:?}");
}

#[test]
fn read_once_trims() {
    let home = Home::new();
    let _server = home.serve();
    let reader = home.start("read /r trim 3 once").see("active at");
    home.run_with("write /w /r", "hello\n").with(0);
    let ended = reader.finish().with(0);
    // The writer may end before its line is printed: log lines are in any order.
    let mut printed = ended.out.iter().filter(|line| !line.starts_with("[INFO]"));
    assert_eq!(printed.next().map(String::as_str), Some("hel"));
}

#[test]
fn read_connects_itself() {
    let home = Home::new();
    let _server = home.serve();
    let mut writer = home.start("write /w").see("active at");
    let reader = home.start("read ... /w").see("Receiving input from /w");
    writer = writer.see("Sending output");
    writer.type_text("hello\n");
    drop(reader.see("hello"));
    writer.finish().with(0);
}

#[test]
fn rpc_asks_and_rpcserver_replies() {
    let home = Home::new();
    let _server = home.serve();
    let mut server = home.start("rpcserver /s").see("Waiting for a message...");
    let mut client = home.start("rpc /s");
    client.type_text("question 1\n");
    server = server.see("Message: question 1");
    server.type_text("[ok] 2\n");
    client = client.see("Response: [ok] 2");
    client.type_text("question 2\n");
    server = server.see("Message: question 2");
    server.type_text("[many] a (b c)\n");
    let ended = client.see("  b c").finish().with(0);
    assert_eq!(
        ended.out,
        ["Response: [ok] 2", "Responses:", "  a", "  b c"]
    );
}

#[test]
fn rpcserver_echoes_and_stops() {
    let home = Home::new();
    let _server = home.serve();
    let server = home.start("rpcserver --echo --stop /s").see("Waiting");
    // A last line without an end, as `printf` writes it, is sent, too.
    let ended = home.run_with("rpc /s", "hi 5").with(0);
    assert_eq!(ended.out, ["Response: hi 5"]);
    server.finish().with(0);
    assert!(home.names().is_empty());
}

#[test]
fn rpc_sends_administration_requests() {
    let home = Home::new();
    let _server = home.serve();
    let _reader = home.start("read /r").see("active at");
    let ended = home
        .run_with("admin rpc /r", "[ver]\n[list] [in]\n")
        .with(0);
    assert_eq!(ended.out[0], "Response: [ver] 1 2 3");
    // The connection of a request that just ended may still be listed, as with stock.
    let inputs = ended.out[1].strip_prefix("Response: ").unwrap();
    let inputs: Vec<_> = inputs.split(' ').filter(|name| *name != "admin").collect();
    assert_eq!(inputs, ["anon_rpc"]);
}

#[test]
fn repeat_forwards_messages() {
    let home = Home::new();
    let _server = home.serve();
    let reader = home.start("read /r").see("active at");
    let _repeater = home.start("repeat /again").see("active at");
    home.run("connect /again /r").with(0);
    home.run_with("write /w /again", "hello (a b)\n").with(0);
    drop(reader.see("hello (a b)"));
}

#[test]
fn names_in_use_are_not_taken() {
    // Opening a port under a live name once took the name from its owner.
    let home = Home::new();
    let _server = home.serve();
    let reader = home.start("read /r").see("active at");
    for line in ["write /r", "read /r", "repeat /r", "rpcserver /r"] {
        let refused = home.run(line).with(1);
        assert!(refused.err[0].contains("(address conflict)"), "{refused:?}");
    }
    home.run_with("write /w /r", "hello\n").with(0);
    drop(reader.see("hello"));
}

#[test]
fn wait_ends_when_the_port_comes() {
    let home = Home::new();
    let _server = home.serve();
    let waiting = home.start("wait /late").see("Waiting for /late...");
    let _reader = home.start("read /late").see("active at");
    waiting.finish().with(0);
}

/// Stock drops what `printf 'get axes' | yarp rpc` sends, since the line has no end.
#[test]
fn a_request_without_a_line_end_is_sent() {
    let home = Home::new();
    let _server = home.serve();
    let _arm = home.start("up --name /arm").see("/arm/rpc:i");
    let told = home.run_with("rpc /arm/rpc:i", "[get] [axes]").with(0);
    assert!(told.says("Response: [is] [axes] 7"), "{told:?}");
}
