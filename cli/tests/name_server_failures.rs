//! The name server with unusable databases, full disks, invalid requests, and thousands of dead
//! names.

use crate::common;

use std::io::{Read, Write};
use std::net::{TcpListener, TcpStream};
use std::os::unix::fs::PermissionsExt;
use std::os::unix::process::CommandExt;
use std::path::PathBuf;
use std::process::Command;
use std::time::{Duration, Instant};

use common::Home;

/// Returns the answer to one request as received.
fn ask(port: u16, request: &[u8]) -> Vec<u8> {
    let mut stream = TcpStream::connect(("127.0.0.1", port)).unwrap();
    stream
        .set_read_timeout(Some(Duration::from_secs(30)))
        .unwrap();
    // A request that is too long is not read to its end.
    let _ = stream.write_all(&[b"NAME_SERVER ", request, b"\n"].concat());
    let mut answer = Vec::new();
    let mut chunk = [0; 65536];
    while !answer.ends_with(b"*** end of message\r\n") {
        match stream.read(&mut chunk) {
            Ok(count) if count > 0 => answer.extend_from_slice(&chunk[..count]),
            _ => break,
        }
    }
    answer
}

#[test]
fn an_unusable_database_is_reported_and_unchanged() {
    let home = Home::new();
    let text = home.path().join("text.db");
    std::fs::write(&text, "no database\n".repeat(100)).unwrap();
    for (file, reason) in [
        (text.as_path(), "is no SQLite file"),
        (home.path(), "cannot open the database"),
        (&text.join("below"), "cannot create the directory"),
    ] {
        let line = format!("server --socket 1 --local --portdb {}", file.display());
        let ended = home.run(&line).with(1);
        let said = |line: &String| line.contains(reason) && line.contains("--portdb");
        assert!(ended.err.iter().any(said), "{reason}: {ended:?}");
        assert!(
            !ended.err.iter().any(|line| line.contains("panicked")),
            "{ended:?}"
        );
    }
    assert!(
        std::fs::read_to_string(&text)
            .unwrap()
            .starts_with("no database\nno")
    );
}

/// Copies the program to a place where every user may run it.
///
/// Another program makes the copy: a file that this process has open for writing is also open in
/// every child that another test starts at that moment, and cannot be executed until that child
/// closes it.
fn a_copy(home: &Home) -> PathBuf {
    let copy = home.path().join("yarp");
    let mut command = Command::new("cp");
    let made = command.arg(env!("CARGO_BIN_EXE_yarp")).arg(&copy).status();
    assert!(made.unwrap().success());
    copy
}

/// Root may read everything, so the server runs as another user.
#[test]
fn the_database_of_another_user_is_refused() {
    let home = Home::new();
    std::fs::set_permissions(home.path(), PermissionsExt::from_mode(0o777)).unwrap();
    let file = home.path().join("theirs.db");
    std::fs::write(&file, "").unwrap();
    std::fs::set_permissions(&file, PermissionsExt::from_mode(0o000)).unwrap();
    let mut command = Command::new(a_copy(&home));
    command
        .args(["server", "--socket", "1", "--local", "--portdb"])
        .arg(&file);
    command.current_dir(home.path());
    if std::fs::read(&file).is_ok() {
        command.uid(65_534);
    }
    let ended = home.spawn(command, "server").finish().with(1);
    let said = |line: &String| line.contains("cannot open the database") && line.contains("whose");
    assert!(ended.err.iter().any(said), "{ended:?}");
}

/// A file size limit stands for a full disk.
#[test]
fn on_a_full_disk_requests_are_refused_and_nothing_is_lost() {
    let home = Home::new();
    let mut server = home.serve();
    let port = home.server_port();
    for index in 0..20 {
        let request = format!("register /before/{index} tcp 127.0.0.1 {}", 20_000 + index);
        assert!(ask(port, request.as_bytes()).starts_with(b"registration "));
    }
    server = server.signal("INT");
    server.finish();

    // At most 300 KiB, in units of 1024 bytes or of 512.
    let mut command = Command::new("bash");
    let words = format!("server --ip 127.0.0.1 --socket {port} --write");
    let script = format!("ulimit -f 300; exec {} {words}", env!("CARGO_BIN_EXE_yarp"));
    command.args(["-c", &script]);
    let server = home.spawn(command, &words).see("Ok. Ready!");
    let mut kept = 20;
    let refusal = (0..20_000).find_map(|index| {
        let request = format!("register /full/{index} tcp 127.0.0.1 20000");
        let answer = ask(port, request.as_bytes());
        let answer = String::from_utf8(answer).unwrap();
        kept += usize::from(answer.starts_with("registration "));
        (!answer.starts_with("registration ")).then_some(answer)
    });
    let refusal = refusal.expect("the file has a largest size");
    assert!(
        refusal.starts_with("refused: the name server cannot store the change: "),
        "{refusal}"
    );
    assert!(refusal.contains("cannot be written"), "{refusal}");
    // The server still answers, with the stored state.
    assert!(ask(port, b"query /before/7").starts_with(b"registration "));
    assert_eq!(home.names().len(), kept);
    drop(server);

    let words = format!("server --ip 127.0.0.1 --socket {port} --write");
    let server = home.start(&words).see("Ok. Ready!");
    assert_eq!(home.names().len(), kept);
    assert!(ask(port, b"register /more").starts_with(b"registration "));
    drop(server);
}

#[test]
fn invalid_requests_are_answered() {
    let home = Home::new();
    let server = home.serve();
    let port = home.server_port();
    let long = [b"register /".as_slice(), &vec![b'x'; 1 << 20]].concat();
    for (request, refused) in [
        (b"register /a\x01b".as_slice(), true),
        (b"register \"/a\\nb\"", true),
        (b"register /a\xff\xfe tcp", false),
        (b"register /a tcp ... 65536", true),
        (b"register /a tcp ... -5", true),
        (b"register /a tcp ... 99999999999999999999", false),
        (b"register", true),
        (&long, false),
        (b"set /root k \"a\\n*** end of message\"", false),
        (b"((((((((((", false),
        (b"\0\0\0\0", false),
    ] {
        let answer = ask(port, request);
        let said = String::from_utf8_lossy(&answer);
        let beginning = String::from_utf8_lossy(&request[..request.len().min(40)]);
        assert!(
            !refused || said.starts_with("refused: "),
            "{beginning}: {said}"
        );
        let next = ask(port, b"query /root");
        assert!(
            next.starts_with(b"registration name /root "),
            "after {beginning}"
        );
    }
    assert!(!home.names().iter().any(|name| name.len() > 1000));
    drop(server);
}

#[test]
fn clean_removes_a_thousand_dead_names_only() {
    let home = Home::new();
    let server = home.serve();
    let port = home.server_port();
    let dead = TcpListener::bind("127.0.0.1:0").unwrap();
    let number = dead.local_addr().unwrap().port();
    drop(dead);
    for index in 0..1000 {
        let request = format!("register /dead/{index} tcp 127.0.0.1 {number}");
        assert!(ask(port, request.as_bytes()).starts_with(b"registration "));
    }
    let reader = home.start("read /alive").see("Port /alive active");
    let ended = home.run("clean --timeout 5").with(0);
    let removed = ended
        .out
        .iter()
        .filter(|line| line.starts_with("* No response, removing"));
    assert_eq!(removed.count(), 1000);
    assert_eq!(home.names(), ["/alive"]);
    drop((reader, server));
}

#[test]
fn states_are_listed() {
    let home = Home::new();
    let server = home.serve();
    let port = home.server_port();
    let dead = TcpListener::bind("127.0.0.1:0").unwrap();
    let number = dead.local_addr().unwrap().port();
    drop(dead);
    // Ports registered before the server started must be probed first.
    ask(
        port,
        format!("register /dead tcp 127.0.0.1 {number}").as_bytes(),
    );
    drop(server);
    let words = format!("server --ip 127.0.0.1 --socket {port} --write --probe-interval 0.2");
    let server = home.start(&words).see("Ok. Ready!");
    let began = Instant::now();
    loop {
        let states = home.run("name list --state").with(0);
        if states.says("registration name /dead ") && states.says(" type tcp state gone") {
            assert!(states.says(" state alive"), "{states:?}");
            break;
        }
        assert!(began.elapsed() < Duration::from_secs(60), "{states:?}");
    }
    let below = home.run("name list --state /dead").with(0);
    assert_eq!(below.out.len(), 2, "{below:?}");
    drop(server);
}

/// Root may read everything, so the server runs as another user.
#[test]
fn another_users_configuration_is_reported_and_unchanged() {
    let home = Home::new();
    std::fs::set_permissions(home.path(), PermissionsExt::from_mode(0o777)).unwrap();
    let file = home.path().join("yarp.conf");
    std::fs::write(&file, "192.0.2.5 10310 yarp\n").unwrap();
    std::fs::set_permissions(&file, PermissionsExt::from_mode(0o000)).unwrap();
    let mut command = Command::new(a_copy(&home));
    command.args(["server", "--memory", "--socket", "1", "--write"]);
    command.current_dir(home.path());
    let is_root = std::fs::read(&file).is_ok();
    if is_root {
        command.uid(65_534);
    }
    let ended = home.spawn(command, "server").finish();
    assert_ne!(ended.code, Some(0), "{ended:?}");
    let named = |line: &String| line.contains("cannot read") && line.contains("yarp.conf");
    assert!(ended.err.iter().any(named), "{ended:?}");
    std::fs::set_permissions(&file, PermissionsExt::from_mode(0o600)).unwrap();
    let left = home.file("yarp.conf");
    assert_eq!(left.as_deref(), Some("192.0.2.5 10310 yarp\n"));
}

#[test]
fn without_a_database_a_restart_loses_names() {
    let home = Home::new();
    let server = home.serve_with("--memory");
    let port = home.server_port();
    assert!(ask(port, b"register /a").starts_with(b"registration "));
    assert_eq!(home.names(), ["/a"]);
    server.kill();
    let words = format!("server --ip 127.0.0.1 --socket {port} --write --memory");
    let server = home.start(&words).see("Ok. Ready!");
    assert!(home.names().is_empty());
    assert!(!home.path().join("data/nameserver").exists());
    drop(server);
}
