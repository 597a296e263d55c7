//! `yarp run` starts, queries and ends commands, and leaves nothing.

#![cfg(target_os = "linux")]

use crate::common;

use std::path::Path;
use std::process::Command;

use common::{Ended, Home, Running};
use yarp_testing::until;

/// Runs `yarp run --on /host` with these arguments.
fn ask(home: &Home, words: &[&str]) -> Ended {
    let mut command = Command::new(env!("CARGO_BIN_EXE_yarp"));
    command.args(["run", "--on", "/host"]).args(words);
    home.spawn(command, &words.join(" ")).finish()
}

fn serve(home: &Home) -> Running {
    let server = home.start("run --server /host --insecure");
    server.see("Yarprun successfully started on port:  /host")
}

/// Returns the number that a command writes to a file.
fn number_in(file: &Path) -> u32 {
    until("a number in the file", || {
        std::fs::read_to_string(file).ok()?.trim().parse().ok()
    })
}

/// Waits until a process is gone, or is a zombie.
fn gone(process: u32) {
    until("end of the process", || {
        let state = std::fs::read_to_string(format!("/proc/{process}/stat"));
        let dead = |stat: &str| {
            stat.rsplit(')')
                .next()
                .is_some_and(|rest| rest.starts_with(" Z"))
        };
        state.map_or(true, |stat| dead(&stat)).then_some(())
    });
}

/// Starts a shell with a child; returns the id of the child. Neither ends by itself.
fn start_family(home: &Home, before: &str) -> u32 {
    let file = home.path().join("child");
    let command = format!(
        "sh -c \"{before} sleep 1000 & echo $! > {}; wait; wait\"",
        file.display()
    );
    let started = ask(home, &["--as", "family", "--cmd", &command]).with(0);
    started.complains("STARTED: server=/host alias=family cmd=sh -c");
    number_in(&file)
}

#[test]
fn a_command_starts_and_ends() {
    let home = Home::new();
    let _name_server = home.serve();
    let server = serve(&home);
    assert!(home.run("name get /host yarprun").says("true"));
    let file = home.path().join("told");
    let command = format!(
        "sh -c \"echo $COLOUR $YARP_IS_YARPRUN > {}; sleep 1000\"",
        file.display()
    );
    let started = ask(
        &home,
        &[
            "--as",
            "t",
            "--cmd",
            &command,
            "--env",
            "SIZE=3;COLOUR=blue",
        ],
    )
    .with(0);
    assert_eq!(started.err[..2], ["RESPONSE:", "========="]);
    let told = until("line in the file", || {
        std::fs::read_to_string(&file)
            .ok()
            .filter(|text| !text.is_empty())
    });
    assert_eq!(told, "blue 1\n");
    ask(&home, &["--ps"])
        .with(0)
        .complains("(tag t) (status running)");
    ask(&home, &["--isrunning", "t"])
        .with(0)
        .complains("running");
    ask(&home, &["--isrunning", "other"])
        .with(2)
        .complains("not running");
    ask(&home, &["--sigterm", "other"])
        .with(2)
        .complains("sigterm FAILED");
    ask(&home, &["--kill", "other", "9"])
        .with(2)
        .complains("kill FAILED");
    ask(&home, &["--sigterm", "t"])
        .with(0)
        .complains("sigterm OK");
    until("end of the command", || {
        (ask(&home, &["--isrunning", "t"]).code == Some(2)).then_some(())
    });
    // An empty list is no success, as in stock.
    ask(&home, &["--ps"]).with(255);
    ask(&home, &["--exit"]).with(0).complains("exit OK");
    server.finish().with(0);
    assert!(!home.names().contains(&"/host".to_owned()));
}

#[test]
fn a_signal_reaches_all_of_a_command() {
    let home = Home::new();
    let _name_server = home.serve();
    let _server = serve(&home);
    let child = start_family(&home, "");
    ask(&home, &["--kill", "family", "9"])
        .with(0)
        .complains("kill OK");
    gone(child);
}

#[test]
fn commands_that_cannot_start_are_reported() {
    let home = Home::new();
    let _name_server = home.serve();
    let _server = serve(&home);
    let check = |words: &[&str], expected: &str| {
        let ended = ask(&home, words).with(2);
        ended.complains("ABORTED: server=/host alias=t cmd=");
        ended.complains(expected);
    };
    check(
        &["--as", "t", "--cmd", "/no/such/program"],
        "Can't execute command because No such file or directory",
    );
    check(
        &["--as", "t", "--cmd", "ls", "--workdir", "/no/such/place"],
        "Can't execute command, cannot set working directory No such file or directory",
    );
}

#[test]
fn the_number_of_commands_and_terminals_is_limited() {
    let home = Home::new();
    let _name_server = home.serve();
    let _server = serve(&home);
    let mut requests = "(cmd \"sleep 1000\") (as t)\n".repeat(256);
    requests.push_str("(cmd \"sleep 1000\") (as t)\n");
    requests.push_str("(stdio \"/x\") (as t) (on \"/other\") (stdiouuid \"/other/s\")\n");
    let told = home.run_with("rpc /host", &requests);
    let count = |text: &str| told.out.iter().filter(|line| line.contains(text)).count();
    assert_eq!(count("STARTED"), 256, "{told:?}");
    assert_eq!(count("Can't execute command because 256 are running"), 2);
}

#[test]
fn commands_end_with_their_server() {
    for signal in ["INT", "TERM", "HUP"] {
        let home = Home::new();
        let _name_server = home.serve();
        let server = serve(&home);
        let child = start_family(&home, "");
        server.signal(signal).finish().with(0);
        gone(child);
    }
}

#[test]
fn commands_end_with_a_killed_server() {
    let home = Home::new();
    let _name_server = home.serve();
    let server = serve(&home);
    let child = start_family(&home, "");
    server.kill();
    gone(child);
}

#[test]
fn commands_that_ignore_sigterm_are_killed() {
    let home = Home::new();
    let _name_server = home.serve();
    let server = serve(&home);
    let child = start_family(&home, "trap '' TERM;");
    ask(&home, &["--exit"]).with(0);
    server.finish().with(0);
    gone(child);
}

#[test]
fn orphaned_children_end_with_the_server() {
    let home = Home::new();
    let _name_server = home.serve();
    let server = serve(&home);
    let file = home.path().join("child");
    let command = format!("sh -c \"sleep 1000 & echo $! > {}\"", file.display());
    ask(&home, &["--as", "t", "--cmd", &command]).with(0);
    let child = number_in(&file);
    until("end of the command", || {
        (ask(&home, &["--isrunning", "t"]).code == Some(2)).then_some(())
    });
    // As in stock, it continues while the server runs.
    assert!(Path::new(&format!("/proc/{child}")).exists());
    server.signal("INT").finish().with(0);
    gone(child);
}

#[test]
fn running_commands_needs_the_right_to_administer() {
    let home = Home::new();
    let roles = home.path().join("roles.conf");
    let _name_server = home.serve();
    let file = home.path().join("made");
    let command = format!("touch {}", file.display());
    // A client that may not administer the name cannot register it either.
    std::fs::write(&roles, "[everybody]\nports /host\nrights all\n").unwrap();
    let _server = serve(&home);
    std::fs::write(
        &roles,
        "[everybody]\nports /host\nrights read write connect\n",
    )
    .unwrap();
    let refused = until("refusal", || {
        let ended = ask(&home, &["--ps"]);
        (ended.code == Some(2)).then_some(ended)
    });
    refused.complains("no right to administer on /host");
    ask(&home, &["--as", "t", "--cmd", &command]).with(2);
    ask(&home, &["--exit"]).with(2);
    assert!(!file.exists());
    std::fs::write(&roles, "[everybody]\nports /host\nrights all\n").unwrap();
    until("right", || {
        (ask(&home, &["--as", "t", "--cmd", &command]).code == Some(0)).then_some(())
    });
    until("file", || file.exists().then_some(()));
}

#[test]
fn an_open_server_logs_a_warning() {
    let home = Home::new();
    let _name_server = home.serve();
    let ended = serve(&home).signal("INT").finish().with(0);
    ended.complains("no role (roles.conf) that is about /host");
}

/// The reply is no bottle, and has no length.
#[test]
fn a_server_describes_its_machine() {
    let home = Home::new();
    let _name_server = home.serve();
    let _server = serve(&home);
    for _ in 0..2 {
        let told = ask(&home, &["--sysinfo"]).with(0);
        assert_eq!(told.out[..2], ["RESPONSE:", "========="], "{told:?}");
        assert!(told.says("Platform name    : Linux"), "{told:?}");
        let kernel = std::fs::read_to_string("/proc/sys/kernel/osrelease").unwrap();
        assert!(told.says(kernel.trim()), "{told:?}");
        // The environment of the server is nobody's business.
        assert!(!told.says("PATH"), "{told:?}");
    }
    // Other requests still work.
    ask(&home, &["--which", "sh"]).with(0).complains("/sh");
    let missing = home.run("run --on /nobody --sysinfo");
    missing
        .with(255)
        .complains("Cannot connect to remote server");
    home.run("run --sysinfo")
        .with(255)
        .complains("missing remote server");
}
