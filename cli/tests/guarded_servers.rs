//! Serving commands start safely: their addresses, warnings and refusals.

#![cfg(target_os = "linux")]

use crate::common;

use std::io::{Read, Write};
use std::net::TcpStream;
use std::os::unix::net::UnixDatagram;
use std::process::Command;
use std::time::{Duration, Instant};

use common::{Home, Running};

/// Longer than any step takes on a busy machine.
const TIMEOUT: Duration = Duration::from_secs(60);
const YARP: &str = env!("CARGO_BIN_EXE_yarp");

/// The host and the TCP port that a port is registered with.
fn place(home: &Home, port: &str) -> (String, u16) {
    let found = home.run_until(&format!("name query {port}"), "registration name");
    let words: Vec<&str> = found.out[0].split(' ').collect();
    let after = |word: &str| {
        let index = words.iter().position(|found| *found == word).unwrap();
        words[index + 1].to_owned()
    };
    (after("ip"), after("port").parse().unwrap())
}

/// The addresses that programs listen at on this TCP port.
///
/// The system writes the table while sockets come and go, and may leave out a row.
fn listeners(port: u16) -> Vec<String> {
    let begin = Instant::now();
    loop {
        let found = listeners_now(port);
        if !found.is_empty() || begin.elapsed() > TIMEOUT {
            return found;
        }
        std::thread::sleep(Duration::from_millis(20));
    }
}

fn listeners_now(port: u16) -> Vec<String> {
    let table = std::fs::read_to_string("/proc/net/tcp").unwrap();
    let rows = table.lines().skip(1).filter_map(|row| {
        let mut words = row.split_whitespace().skip(1);
        let (local, _peer, state) = (words.next()?, words.next()?, words.next()?);
        let (address, number) = local.split_once(':')?;
        let listens = state == "0A" && u16::from_str_radix(number, 16) == Ok(port);
        listens.then(|| address.to_owned())
    });
    rows.collect()
}

const LOOPBACK: &str = "0100007F";
const EVERYWHERE: &str = "00000000";

/// A robot of one arm that moves, and its server, in TOML.
const ROBOT: &str = r#"
[robot]
name = "one"
portprefix = "/one"
[[device]]
name = "arm"
type = "simulatedWam"
[[device]]
name = "arm_nws"
type = "controlBoard_nws_yarp"
params = { name = "/one/arm", period = 0.05 }
action = [
  { phase = "startup", level = 5, type = "attach", params = { networks = ["all_of_it"], all_of_it = "arm" } },
  { phase = "shutdown", level = 5, type = "detach" },
]
"#;

/// Writes the robot into a folder; returns the command that runs it.
fn robotinterface(folder: &std::path::Path) -> String {
    let file = folder.join("robot.toml");
    std::fs::write(&file, ROBOT).unwrap();
    format!("robotinterface --config {}", file.display())
}

#[track_caller]
fn listens_where_it_is_told(line: &str, port: &str) {
    let home = Home::new();
    let _server = home.serve();
    for (option, expected) in [("127.0.0.1", LOOPBACK), ("0.0.0.0", EVERYWHERE)] {
        let serving = home.start(&format!("{line} --bind {option}"));
        let (host, number) = place(&home, port);
        assert_eq!(listeners(number), [expected], "{line}");
        assert_eq!(host == "127.0.0.1", option == "127.0.0.1", "{line}");
        serving.signal("TERM").finish().with(0);
    }
    let refused = home.run(&format!("{line} --bind nowhere"));
    assert_ne!(refused.code, Some(0), "{refused:?}");
}

#[test]
fn up_listens_where_it_is_told() {
    listens_where_it_is_told("up", "/wam/rpc:i");
}

#[test]
fn dev_listens_where_it_is_told() {
    listens_where_it_is_told("dev --device simulatedWam --name /wam", "/wam/rpc:i");
}

#[test]
fn robotinterface_listens_where_it_is_told() {
    let folder = Home::new();
    listens_where_it_is_told(&robotinterface(folder.path()), "/one/arm/rpc:i");
}

#[test]
fn a_camera_listens_where_it_is_told() {
    listens_where_it_is_told("camera", "/grabber");
}

#[test]
fn run_listens_where_it_is_told() {
    listens_where_it_is_told("run --server /host --insecure", "/host");
}

/// The name server of `up` and its ports listened at all addresses, whatever they were for.
#[test]
fn a_network_of_its_own_is_on_loopback_if_told() {
    let home = Home::new();
    let up = home.start("up --bind 127.0.0.1").see("Ctrl-C ends it.");
    assert_eq!(listeners(home.server_port()), [LOOPBACK]);
    assert_eq!(listeners(place(&home, "/wam/rpc:i").1), [LOOPBACK]);
    let ended = up.signal("TERM").finish().with(0);
    assert_eq!(warnings(&ended.err), 0, "{:?}", ended.err);
}

/// The number of warnings of a device that others can move.
fn warnings(lines: &[String]) -> usize {
    let warning = |line: &&String| line.contains("can move it: add a key");
    lines.iter().filter(warning).count()
}

#[test]
fn who_may_move_an_arm_is_told() {
    let home = Home::new();
    let _server = home.serve();
    let roles = home.path().join("roles.conf");
    let check_count = |line: &str, ready: &str, expected: usize| {
        let serving = home.start(line).see(ready);
        // The warning is on the other stream, and before the end.
        let ended = serving.signal("TERM").finish().with(0);
        assert_eq!(warnings(&ended.err), expected, "{line}: {ended:?}");
    };
    let check = |line: &str, ready: &str, expected: bool| {
        check_count(line, ready, usize::from(expected));
    };
    check("up --bind 0.0.0.0", "Ctrl-C ends it.", true);
    check("up --bind 127.0.0.1", "Ctrl-C ends it.", false);
    let dev = "dev --device simulatedWam --name /wam --bind";
    check(&format!("{dev} 0.0.0.0"), "device active", true);
    check(&format!("{dev} 127.0.0.1"), "device active", false);
    let robot = robotinterface(home.path());
    check(&format!("{robot} --bind 0.0.0.0"), "running happily", true);
    check(
        &format!("{robot} --bind 127.0.0.1"),
        "running happily",
        false,
    );
    // An arm and a hand.
    let table = "table --objects 0 --no-view --bind";
    check_count(&format!("{table} 0.0.0.0"), "Ctrl-C ends it.", 2);
    check_count(&format!("{table} 127.0.0.1"), "Ctrl-C ends it.", 0);
    // A role that is about other ports protects nothing.
    let role = |text: &str| std::fs::write(&roles, text).unwrap();
    role("[us]\nports /other\nat local\nrights all\n");
    check("up --bind 0.0.0.0", "Ctrl-C ends it.", true);
    role("[us]\nports /wam/*\nat local\nrights all\n");
    check("up --bind 0.0.0.0", "Ctrl-C ends it.", false);
    role("[everybody]\nports /*\nrights all\n");
    check("up --bind 0.0.0.0", "Ctrl-C ends it.", true);
}

/// Runs a command in a shell that this text prepares.
fn shell(home: &Home, text: &str) -> Running {
    let mut command = Command::new("sh");
    command.args(["-c", text, YARP]);
    home.spawn(command, text)
}

#[test]
fn run_refuses_to_serve_anybody() {
    let home = Home::new();
    let _server = home.serve();
    home.run("run --server /host")
        .with(255)
        .complains("Not started: there is no key");
    assert!(home.names().is_empty());
    let server = home
        .start("run --server /host --insecure")
        .see("started on port:  /host");
    server.signal("TERM").finish().with(0).complains("INSECURE");
    std::os::unix::fs::symlink(YARP, home.path().join("yarprun")).unwrap();
    let link = home.path().join("yarprun");
    let server = shell(&home, &format!("exec {} --server /host", link.display()));
    let server = server.see("started on port:  /host");
    server.signal("TERM").finish().with(0).complains("INSECURE");
    std::fs::write(
        home.path().join("roles.conf"),
        "[us]\nports /host\nat local\nrights all\n",
    )
    .unwrap();
    let server = home
        .start("run --server /host")
        .see("started on port:  /host");
    let ended = server.signal("TERM").finish().with(0);
    assert!(
        !ended.err.iter().any(|line| line.contains("INSECURE")),
        "{ended:?}"
    );
}

/// A page that somebody on the machine visits could start any command.
#[test]
fn run_takes_no_requests_of_browsers() {
    let home = Home::new();
    let _server = home.serve();
    let _run = home
        .start("run --server /host --insecure")
        .see("started on port:  /host");
    let (host, port) = place(&home, "/host");
    let file = home.path().join("made");
    let order = format!("(cmd+\"touch+{}\")+(as+x)", file.display());
    let get = |path: &str, head: &str| {
        format!("GET {path} HTTP/1.1\r\nHost: {host}:{port}\r\n{head}\r\n")
    };
    let upgrade = "Connection: Upgrade\r\nUpgrade: websocket\r\nSec-WebSocket-Version: 13\r\n\
                   Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n";
    let body = format!("data={order}");
    let length = body.len();
    for request in [
        get(&format!("/?data={order}"), ""),
        get(&format!("/?req={order}"), ""),
        get("/", ""),
        get("/?ws", upgrade),
        get("/?action=stream", ""),
        format!(
            "POST /form HTTP/1.1\r\nHost: {host}:{port}\r\nContent-Length: {length}\r\n\r\n{body}"
        ),
    ] {
        let mut stream = TcpStream::connect((host.as_str(), port)).unwrap();
        stream.set_read_timeout(Some(TIMEOUT)).unwrap();
        stream.write_all(request.as_bytes()).unwrap();
        let mut answer = Vec::new();
        // The end may be a reset: the port has not read all of it.
        let _ = stream.read_to_end(&mut answer);
        let answer = String::from_utf8_lossy(&answer);
        assert!(answer.starts_with("HTTP/1.1 403 "), "{request}: {answer}");
    }
    let other = home.path().join("other");
    let command = format!("touch {}", other.display());
    let mut asking = Command::new(YARP);
    asking.args(["run", "--on", "/host", "--as", "t", "--cmd", &command]);
    home.spawn(asking, "run --on /host").finish().with(0);
    home.run("run --on /host --exit").with(0);
    assert!(!file.exists(), "a browser started a command");
}

#[test]
fn serving_commands_tell_the_service_manager() {
    for line in [
        "server --memory --ip 127.0.0.1 --socket 0 --write",
        "up",
        "camera",
        "run --server /host --insecure",
        "clock --name /clock",
        "dev --device simulatedWam --name /wam",
        "table",
        "rpcserver /a",
        "repeat /a",
        "readwrite /a /b",
        "merge /a",
        "split /a",
        "read /a",
        "sample --output /a --rate 20",
        "trafficgen /a",
    ] {
        let home = Home::new();
        let _server = (!line.starts_with("server") && line != "up").then(|| home.serve());
        // These two read from a port that is there.
        let reads = line.starts_with("merge") || line.starts_with("split");
        let _source = reads.then(|| home.start("write /a").see("active at"));
        let path = home.path().join("notify");
        let socket = UnixDatagram::bind(&path).unwrap();
        socket.set_read_timeout(Some(TIMEOUT)).unwrap();
        let mut command = Command::new(YARP);
        command.args(line.split(' ')).env("NOTIFY_SOCKET", &path);
        let serving = home.spawn(command, line);
        let mut text = [0; 64];
        let length = socket.recv(&mut text).expect(line);
        assert_eq!(&text[..length], b"READY=1\n", "{line}");
        // The exit codes differ, see `termination_signals.rs`.
        serving.signal("TERM").finish();
    }
}

/// 1008 connections that said nothing kept everybody out.
#[test]
fn serving_commands_take_all_descriptors_they_may() {
    let folder = Home::new();
    let robot = robotinterface(folder.path());
    for (line, port) in [
        ("up", "/wam/rpc:i"),
        ("camera", "/grabber"),
        ("dev --device simulatedWam --name /wam", "/wam/rpc:i"),
        (robot.as_str(), "/one/arm/rpc:i"),
    ] {
        let home = Home::new();
        let _server = home.serve();
        let serving = shell(
            &home,
            &format!("ulimit -Sn 128; ulimit -Hn 512; exec \"$0\" {line}"),
        );
        place(&home, port);
        let limits = std::fs::read_to_string(format!("/proc/{}/limits", serving.id())).unwrap();
        let row = limits
            .lines()
            .find(|row| row.starts_with("Max open files"))
            .unwrap();
        let numbers: Vec<&str> = row.split_whitespace().skip(3).take(2).collect();
        assert_eq!(numbers, ["512", "512"], "{line}");
        serving.signal("TERM").finish().with(0);
    }
}
