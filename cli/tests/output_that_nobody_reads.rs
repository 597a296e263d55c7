//! Nobody reads what `yarp up` prints: the arm goes on, and ends when it is told to.
//!
//! Each line was written by the thread that had something to say, so that 64 KiB of log that nobody read stopped the whole
//! process, Ctrl-C included.

#![cfg(target_os = "linux")]

use crate::common;

use std::fs::{File, OpenOptions};
use std::io::{BufRead, BufReader, ErrorKind, Read, Write};
use std::net::TcpStream;
use std::os::fd::AsFd;
use std::process::{Child, Command, ExitStatus, Stdio};
use std::time::{Duration, Instant};

use common::Home;
use rustix::pty::OpenptFlags;

/// Longer than any step takes on a busy machine.
const TIMEOUT: Duration = Duration::from_secs(60);
/// Connections of one flood: more lines of log than are kept for a reader.
const FLOOD: usize = 400;

/// A command that runs, killed when the test ends.
struct Killed(Child);

impl Killed {
    fn end(mut self) -> ExitStatus {
        let begin = Instant::now();
        loop {
            if let Some(status) = self.0.try_wait().unwrap() {
                return status;
            }
            assert!(begin.elapsed() < TIMEOUT, "it does not end");
            std::thread::sleep(Duration::from_millis(5));
        }
    }

    fn interrupt(self) -> Self {
        let id = self.0.id().to_string();
        let sent = Command::new("kill").args(["-s", "INT", &id]).status();
        assert!(sent.unwrap().success());
        self
    }
}

impl Drop for Killed {
    fn drop(&mut self) {
        // It may have ended.
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// Starts `yarp up` with these streams.
fn up(home: &Home, out: impl Into<Stdio>, err: impl Into<Stdio>) -> Killed {
    let mut command = Command::new(env!("CARGO_BIN_EXE_yarp"));
    command
        .arg("up")
        // Enough lines to fill the queue although each place in the code is limited to a rate.
        .env("YARP_TRACE_ENABLE", "1")
        .stdin(Stdio::null())
        .stdout(out)
        .stderr(err);
    Killed(home.prepare(&mut command).spawn().unwrap())
}

/// Opens connections to a port with long names, each of which is reported.
fn flood(home: &Home, port: &str, count: usize) {
    let place = home.run_until(&format!("name query {port}"), "registration name");
    let words: Vec<&str> = place.out[0].split(' ').collect();
    let number = words.iter().position(|word| *word == "port").unwrap() + 1;
    let address = format!("127.0.0.1:{}", words[number]);
    for count in 0..count {
        let mut stream = TcpStream::connect(&address).unwrap();
        stream.set_read_timeout(Some(TIMEOUT)).unwrap();
        let name = format!("/{count}{}", "x".repeat(3900));
        stream
            .write_all(format!("CONNECT {name}\r\n").as_bytes())
            .unwrap();
        let mut welcome = [0; 7];
        stream
            .read_exact(&mut welcome)
            .expect("an answer to the header");
    }
}

/// Sends commands that the arm refuses, each of which is reported.
fn send_refused_commands(home: &Home, count: usize) {
    let command = format!("[set] [poss] ({})\n", ["9999.0"; 7].join(" "));
    home.run_with("rpc /wam/rpc:i", &command.repeat(count))
        .with(0);
}

/// The arm answers, streams its state and moves.
#[track_caller]
fn is_alive(home: &Home) {
    home.run_until("name query /wam/state:o", "registration name");
    home.run_until("name query /wam/rpc:i", "registration name");
    let asked = home
        .run_with("rpc /wam/rpc:i", "[get] [axes]\n[set] [pos] 0 5.0\n")
        .with(0);
    assert!(
        asked.says("[is] [axes] 7") && asked.says("[ok]"),
        "{asked:?}"
    );
    let mut reader = home.start("read /r").see("Port /r active");
    home.run("connect /wam/state:o /r").with(0);
    assert!(reader.sees("5.0 -114.59"), "no state comes");
    reader.signal("INT").finish().with(0);
}

#[test]
fn in_pipes_that_are_full() {
    let home = Home::new();
    let (out, out_writer) = full_pipe();
    let (err, err_writer) = full_pipe();
    let up = up(&home, out_writer, err_writer);
    is_alive(&home);
    flood(&home, "/wam/state:o", FLOOD);
    send_refused_commands(&home, FLOOD);
    is_alive(&home);
    let drained = std::thread::spawn(move || {
        let told = |line: &String| line.ends_with("log lines dropped");
        BufReader::new(out)
            .lines()
            .map_while(Result::ok)
            .any(|line| told(&line))
    });
    assert!(up.interrupt().end().success());
    assert!(
        drained.join().unwrap(),
        "nothing told of the lines that were dropped"
    );
    drop(err);
    assert!(
        home.run("where").code == Some(1),
        "the name server is still there"
    );
}

#[test]
fn in_pipes_that_stay_full() {
    let home = Home::new();
    let (_out, out_writer) = full_pipe();
    let (_err, err_writer) = full_pipe();
    let up = up(&home, out_writer, err_writer);
    is_alive(&home);
    assert!(up.interrupt().end().success());
}

#[test]
fn in_a_terminal_that_was_stopped() {
    let home = Home::new();
    let flags = OpenptFlags::RDWR | OpenptFlags::NOCTTY | OpenptFlags::CLOEXEC;
    let master = rustix::pty::openpt(flags).unwrap();
    rustix::pty::unlockpt(&master).unwrap();
    let name = rustix::pty::ptsname(&master, Vec::new())
        .unwrap()
        .into_string()
        .unwrap();
    let terminal = || {
        OpenOptions::new()
            .read(true)
            .write(true)
            .open(&name)
            .unwrap()
    };
    let mut master = File::from(master);
    let mut probe = terminal();
    master.write_all(b"\x13").unwrap();
    rustix::io::ioctl_fionbio(&probe, true).unwrap();
    until_full(&mut probe);
    let mut command = Command::new("setsid");
    command.args(["--ctty", env!("CARGO_BIN_EXE_yarp"), "up"]);
    command
        .stdin(terminal())
        .stdout(terminal())
        .stderr(terminal());
    let up = Killed(home.prepare(&mut command).spawn().unwrap());
    is_alive(&home);
    flood(&home, "/wam/state:o", FLOOD);
    is_alive(&home);
    // Ctrl-C.
    master.write_all(b"\x03").unwrap();
    assert!(up.end().success());
}

#[test]
fn on_a_disk_that_is_full() {
    let home = Home::new();
    let full = || OpenOptions::new().write(true).open("/dev/full").unwrap();
    let up = up(&home, full(), full());
    is_alive(&home);
    flood(&home, "/wam/state:o", FLOOD);
    is_alive(&home);
    assert!(up.interrupt().end().success());
}

/// Names of senders came to the log as they were: with ends of lines and escape sequences of terminals.
#[test]
fn names_cannot_forge_lines() {
    let home = Home::new();
    let up = home.start("up").see("Ctrl-C ends it.");
    let place = home.run_until("name query /wam/rpc:i", "registration name");
    let words: Vec<&str> = place.out[0].split(' ').collect();
    let number = words.iter().position(|word| *word == "port").unwrap() + 1;
    let mut stream = TcpStream::connect(format!("127.0.0.1:{}", words[number])).unwrap();
    stream.write_all(b"CONNECT /a\x1b[2J\r\n").unwrap();
    let up = up.see("/a\\u{1b}[2J");
    let ended = up.signal("INT").finish().with(0);
    let raw = |lines: &[String]| lines.iter().any(|line| line.contains('\x1b'));
    assert!(!raw(&ended.out) && !raw(&ended.err));
}

/// 1300 bad connections per second wrote 120 kB of log per second for as long as they came.
#[test]
fn a_flood_of_reports_is_thinned() {
    let home = Home::new();
    let mut up = home.start("up").see("Ctrl-C ends it.");
    let begin = Instant::now();
    while !up.sees_within("lines like the next one left out", Duration::ZERO) {
        assert!(
            begin.elapsed() < TIMEOUT,
            "all of {} lines came",
            up.printed().len()
        );
        flood(&home, "/wam/state:o", FLOOD);
    }
    up.signal("INT").finish().with(0);
}

/// Returns the reading end of a pipe that takes nothing more, and the writing end.
fn full_pipe() -> (std::io::PipeReader, std::io::PipeWriter) {
    let (reader, mut writer) = std::io::pipe().unwrap();
    rustix::io::ioctl_fionbio(writer.as_fd(), true).unwrap();
    until_full(&mut writer);
    rustix::io::ioctl_fionbio(writer.as_fd(), false).unwrap();
    (reader, writer)
}

/// Writes to a stream in non-blocking mode until it takes nothing more.
fn until_full(stream: &mut impl Write) {
    let begin = Instant::now();
    loop {
        match stream.write(b"full\n") {
            Ok(_) => assert!(begin.elapsed() < TIMEOUT, "it takes all"),
            Err(error) if error.kind() == ErrorKind::WouldBlock => return,
            Err(error) => panic!("{error}"),
        }
    }
}
