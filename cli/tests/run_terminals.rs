//! `yarp run --stdio`: a command with a terminal on this or another machine. The terminal is a script in the place of `xterm`.

#![cfg(target_os = "linux")]

use crate::common;

use std::io::{Read, Write};
use std::net::TcpStream;
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::{Duration, Instant};

use common::{Ended, Home, Running};
use yarp_testing::until;

const YARP: &str = env!("CARGO_BIN_EXE_yarp");
/// Runs what xterm would run, with a pipe for its keyboard and a file for its screen.
const WINDOW: &str = r#"cd "$(dirname "$0")"
echo "$*" > arguments
[ -p keyboard ] || mkfifo keyboard
while [ "$1" != -e ]; do shift; done
shift
echo $$ > pid
exec "$@" <> keyboard > screen 2>&1
"#;

/// Stands for a terminal that connects itself `LATE` seconds after its ports are there.
///
/// The signal that closes it does not reach its reader: `yarp read` discards what it has not printed yet.
const LATE_WINDOW: &str = r#"cd "$(dirname "$0")"
while [ $# -gt 1 ]; do shift; done
setsid timeout 100 YARP read "$1/stdio:i" once > screen &
sleep LATE
YARP connect "$1/stdout" "$1/stdio:i"
wait
"#;

/// A script `xterm` in a folder of its own.
struct TerminalEmulator(PathBuf);

impl TerminalEmulator {
    fn new(home: &Home, name: &str, script: &str) -> Self {
        let folder = home.path().join(name);
        std::fs::create_dir(&folder).unwrap();
        write_script(&folder.join("xterm"), script);
        Self(folder)
    }

    /// Starts a server that finds this `xterm`.
    fn serve(&self, home: &Home, port: &str, options: &str) -> Running {
        let path = format!("{}:{}", self.0.display(), std::env::var("PATH").unwrap());
        serve(home, port, options, &path)
    }

    fn file(&self, name: &str) -> String {
        std::fs::read_to_string(self.0.join(name)).unwrap_or_default()
    }

    /// Waits until the window shows a text.
    #[track_caller]
    fn shows(&self, text: &str) {
        until(&format!("{text:?} on the screen"), || {
            self.file("screen").contains(text).then_some(())
        });
    }

    /// Types into the window.
    fn type_text(&self, text: &str) {
        let keyboard = self.0.join("keyboard");
        std::fs::write(keyboard, text).unwrap();
    }

    /// Returns the process of the window.
    fn process(&self) -> u32 {
        until("process of the window", || {
            self.file("pid").trim().parse().ok()
        })
    }
}

fn write_script(file: &Path, script: &str) {
    std::fs::write(file, format!("#!/bin/sh\n{script}")).unwrap();
    std::fs::set_permissions(file, std::fs::Permissions::from_mode(0o755)).unwrap();
}

fn serve(home: &Home, port: &str, options: &str, path: &str) -> Running {
    let mut command = Command::new(YARP);
    command.args(["run", "--server", port, "--insecure"]);
    command.args(options.split_whitespace()).env("PATH", path);
    let server = home.spawn(command, port);
    server.see("Yarprun successfully started")
}

/// Starts a name server, and a server `/host` that finds this `xterm`.
fn start_network(script: &str) -> (Home, Running, TerminalEmulator, Running) {
    let home = Home::new();
    let name_server = home.serve();
    let window = TerminalEmulator::new(&home, "window", script);
    let host = window.serve(&home, "/host", "");
    (home, name_server, window, host)
}

/// Runs `yarp run --on /host` with these arguments.
fn ask(home: &Home, words: &[&str]) -> Ended {
    let mut command = Command::new(YARP);
    command.args(["run", "--on", "/host"]).args(words);
    home.spawn(command, &words.join(" ")).finish()
}

/// Runs a command of the shell with a terminal.
fn start(home: &Home, stdio: &str, shell: &str, more: &[&str]) -> Ended {
    let command = format!("sh -c \"{shell}\"");
    let mut words = vec!["--as", "t", "--stdio", stdio, "--cmd", &command];
    words.extend(more);
    ask(home, &words)
}

/// Waits until a process is gone, or is a zombie.
fn gone(process: u32) {
    until("end of the process", || {
        let state = std::fs::read_to_string(format!("/proc/{process}/stat"));
        state
            .map_or(true, |stat| stat.contains(") Z"))
            .then_some(())
    });
}

/// Waits until no port of a session is registered.
#[track_caller]
fn no_session_left(home: &Home) {
    until("end of the session", || {
        let names = home.names();
        (!names.iter().any(|name| name.contains("/std"))).then_some(())
    });
}

/// Waits for the port of a session whose name ends like this.
fn session_port(home: &Home, end: &str) -> String {
    until("port of the session", || {
        home.names().into_iter().find(|name| name.ends_with(end))
    })
}

/// Sends a request as a browser does, which is not answered.
#[track_caller]
fn no_page(home: &Home, port: &str) {
    let endpoint = home.run(&format!("name query {port}"));
    let words: Vec<&str> = endpoint.out[0].split(' ').collect();
    let place = words.iter().position(|word| *word == "ip").unwrap();
    let mut browser =
        TcpStream::connect((words[place + 1], words[place + 3].parse().unwrap())).unwrap();
    browser
        .write_all(b"GET /?req=browser HTTP/1.1\r\nHost: localhost\r\n\r\n")
        .unwrap();
    let mut page = Vec::new();
    let _ = browser.read_to_end(&mut page);
    let page = String::from_utf8_lossy(&page);
    assert!(!page.contains("200 OK"), "{page}");
}

#[test]
fn a_terminal_shows_output_and_passes_input() {
    for stdio in ["/host", "/desk"] {
        let (home, _name_server, window, _host) = start_network(WINDOW);
        let _terminal_server = (stdio != "/host").then(|| window.serve(&home, stdio, ""));
        let shell = "printf 'name? '; read a; echo hello $a; read b; echo no line $b >&2; read c";
        let started = start(&home, stdio, shell, &["--geometry", "80x24+1+2"]).with(0);
        started.complains("STARTED: server=/host alias=t cmd=sh -c");
        started.complains(&format!("STARTED: server={stdio} alias=t cmd=xterm pid="));
        let arguments = window.file("arguments");
        let expected = "+hold -geometry 80x24+1+2 -title t -e ";
        assert!(arguments.starts_with(expected), "{arguments}");
        // A terminal is no command.
        let listed = ask(&home, &["--ps"]).with(0);
        let tags = listed.err.iter().filter(|line| line.contains("(tag t)"));
        assert_eq!(tags.count(), 1, "{listed:?}");
        // A question has no end of a line.
        window.shows("name? ");
        window.type_text("my self\n");
        window.shows("name? hello my self\n");
        window.type_text("é\n");
        window.shows("no line é\n");
        let process = window.process();
        window.type_text("end\n");
        gone(process);
        no_session_left(&home);
        assert_eq!(window.file("screen"), "name? hello my self\nno line é\n");
        ask(&home, &["--isrunning", "t"]).with(2);
    }
}

/// A terminal that connects itself late loses neither output nor the reason why a command does not start.
#[test]
fn output_waits_for_a_late_terminal() {
    // Longer than the rest of the output of a command may take.
    let script = LATE_WINDOW.replace("LATE", "3").replace("YARP", YARP);
    let (home, _name_server, window, _host) = start_network(&script);
    start(&home, "/host", "echo early", &[]).with(0);
    window.shows("early");
    no_session_left(&home);
    let script = LATE_WINDOW.replace("LATE", "1").replace("YARP", YARP);
    write_script(&window.0.join("xterm"), &script);
    // It is shown once the terminal is connected, not when the time for that is over.
    let file = home.path().join("slept");
    let shell = format!("echo now; sleep 6; touch {}", file.display());
    start(&home, "/host", &shell, &[]).with(0);
    window.shows("now");
    assert!(!file.exists());
    no_session_left(&home);
    let words = ["--as", "t", "--stdio", "/host", "--cmd", "/no/such/program"];
    ask(&home, &words).with(2);
    window.shows("Can't execute command because No such file or directory");
    no_session_left(&home);
}

/// The rest of the output has its time from the end of the command on.
#[test]
fn the_output_of_a_command_that_ends_late_is_shown() {
    let (home, _name_server, window, _host) = start_network(WINDOW);
    let shell = "echo begin; read a; exec seq 20000";
    start(&home, "/host", shell, &[]).with(0);
    let started = Instant::now();
    window.shows("begin\n");
    // After the time that output waits for a terminal.
    std::thread::sleep(Duration::from_secs(11).saturating_sub(started.elapsed()));
    window.type_text("x\n");
    window.shows("\n20000\n");
    no_session_left(&home);
}

/// The terminal connects itself later than the command prints.
#[test]
fn output_of_a_command_that_ends_at_once_is_shown() {
    let (home, _name_server, window, _host) = start_network(WINDOW);
    let shell = "seq 20000; echo last";
    start(&home, "/host", shell, &[]).with(0);
    window.shows("last\n");
    let expected: String = (1..=20000).map(|number| format!("{number}\n")).collect();
    until("the whole output", || {
        (window.file("screen") == format!("{expected}last\n")).then_some(())
    });
    no_session_left(&home);
}

#[test]
fn a_held_window_stays_until_the_server_ends() {
    let held = format!("trap 'exit 0' TERM\n{}", WINDOW.replace("exec", ""));
    let (home, _name_server, window, host) = start_network(&format!("{held}sleep 1000 & wait"));
    start(&home, "/host", "echo done", &["--hold"]).with(0);
    window.shows("done\n");
    no_session_left(&home);
    // A terminal is no command.
    ask(&home, &["--isrunning", "t"]).with(2);
    ask(&home, &["--ps"]).with(255);
    let arguments = window.file("arguments");
    assert!(arguments.starts_with("-hold -title"), "{arguments}");
    let process = window.process();
    assert!(Path::new(&format!("/proc/{process}")).exists());
    host.signal("INT").finish().with(0);
    gone(process);
}

#[test]
fn a_signal_for_a_command_leaves_its_terminal() {
    let (home, _name_server, window, _host) = start_network(WINDOW);
    let shell = "trap '' TERM; echo begin; while read a; do echo got $a; done";
    start(&home, "/host", shell, &[]).with(0);
    window.shows("begin\n");
    ask(&home, &["--sigterm", "t"]).with(0);
    ask(&home, &["--sigtermall"]).with(0);
    window.type_text("more\n");
    window.shows("got more\n");
}

/// In stock the command runs without its terminal.
#[test]
fn a_command_without_a_terminal_does_not_start() {
    let home = Home::new();
    let _name_server = home.serve();
    let _host = serve(&home, "/host", "", "/no/such/folder");
    // Its child keeps the pipe of its errors.
    let script = "sleep 1000 & seq 20000 >&2; echo >&2; exit 1";
    let failing = TerminalEmulator::new(&home, "failing", script);
    let _failing = failing.serve(&home, "/failing", "");
    let mute = TerminalEmulator::new(
        &home,
        "mute",
        "echo $$ > \"${0%xterm}pid\"; exec sleep 1000",
    );
    let _mute = mute.serve(&home, "/mute", "");
    let file = home.path().join("made");
    for (stdio, expected) in [
        ("/host", "No such file or directory: xterm"),
        ("/failing", "The terminal ended at once (exit status: 1): 1"),
        ("/mute", "The terminal opened no ports within 10 s"),
        ("/nobody", "cannot connect to the server /nobody"),
    ] {
        let shell = format!("touch {}", file.display());
        let failed = start(&home, stdio, &shell, &[]).with(2);
        failed.complains("ABORTED: server=/host alias=t cmd=sh");
        failed.complains(&format!("There is no terminal on {stdio}"));
        failed.complains(expected);
        if stdio != "/nobody" {
            failed.complains("--terminal COMMAND");
        }
        assert!(!home.names().iter().any(|name| name.contains("/std")));
        // Of many errors the first are told.
        let told = failed.err.iter().map(String::len).sum::<usize>();
        assert!(told < 2000, "{failed:?}");
        assert_eq!(
            failed.err.contains(&"100".to_owned()),
            stdio == "/failing",
            "{failed:?}"
        );
    }
    gone(mute.process());
    assert!(!file.exists());
}

#[test]
fn a_command_that_cannot_start_closes_its_terminal() {
    let (home, _name_server, window, _host) = start_network(WINDOW);
    let words = ["--as", "t", "--stdio", "/host", "--cmd", "/no/such/program"];
    let failed = ask(&home, &words).with(2);
    failed.complains("Can't execute command because No such file or directory");
    gone(window.process());
    no_session_left(&home);
    window.shows("Can't execute command because No such file or directory\n");
}

#[test]
fn a_server_may_have_another_terminal_program() {
    let home = Home::new();
    let _name_server = home.serve();
    let window = TerminalEmulator::new(&home, "window", WINDOW);
    let program = window.0.join("xterm");
    let options = format!("--terminal {}", program.display());
    let _host = serve(&home, "/host", &options, &std::env::var("PATH").unwrap());
    start(&home, "/host", "echo here; read a", &[]).with(0);
    window.shows("here\n");
}

/// Errors of a terminal that nobody reads any more ended it.
#[test]
fn a_terminal_has_no_streams_of_its_server() {
    let script = format!("cat > /dev/null\necho noise\nseq 20000 >&2 || exit 1\n{WINDOW}");
    let (home, _name_server, window, host) = start_network(&script);
    start(&home, "/host", "echo here; read a", &[]).with(0);
    window.shows("here\n");
    assert!(!host.printed().contains(&"noise".to_owned()));
}

/// Such programs leave their window to a process that runs already.
#[test]
fn a_terminal_program_may_leave_its_window_to_another_process() {
    let leaving = WINDOW
        .replace("exec \"$@\"", "setsid \"$@\"")
        .replace("2>&1", "2>&1 &");
    let (home, _name_server, window, _host) = start_network(&leaving);
    start(&home, "/host", "echo here; read a; echo $a", &[]).with(0);
    window.shows("here\n");
    window.type_text("there\n");
    window.shows("there\n");
    // It ends by itself.
    no_session_left(&home);
}

#[test]
fn commands_and_terminals_end_with_their_servers() {
    let (home, _name_server, window, host) = start_network(WINDOW);
    let terminal_server = window.serve(&home, "/desk", "");
    let file = home.path().join("command");
    let shell = format!("echo $$ > {}; read a", file.display());
    start(&home, "/desk", &shell, &[]).with(0);
    let command = until("process of the command", || {
        std::fs::read_to_string(&file).ok()?.trim().parse().ok()
    });
    host.signal("TERM").finish().with(0);
    gone(command);
    // The terminal notices that the ports of its command are gone.
    gone(window.process());
    no_session_left(&home);
    let _host = window.serve(&home, "/host", "");
    start(&home, "/desk", "echo again; read a", &[]).with(0);
    window.shows("again\n");
    let process = window.process();
    terminal_server.kill();
    gone(process);
    // As in stock, a command goes on without its terminal.
    ask(&home, &["--isrunning", "t"]).with(0);
}

#[test]
fn the_end_of_a_command_closes_its_own_terminal_alone() {
    let home = Home::new();
    let _name_server = home.serve();
    // Only `killstdio` ends these.
    let window = WINDOW.replace("exec \"$@\"", "\"$@\"") + "exec sleep 1000\n";
    let _host = serve(&home, "/host", "", &std::env::var("PATH").unwrap());
    let emulator = TerminalEmulator::new(&home, "emulator", "");
    // Each window has a folder of its own.
    let windows = home.path().join("w");
    let script = format!(
        "folder={}/$$; mkdir -p $folder\n{}",
        windows.display(),
        window.replace("cd \"$(dirname \"$0\")\"", "cd $folder")
    );
    write_script(&emulator.0.join("xterm"), &script);
    let _terminal_server = emulator.serve(&home, "/desk", "");
    for number in ["1", "2"] {
        start(
            &home,
            "/desk",
            &format!("echo number {number}; read a"),
            &[],
        )
        .with(0);
    }
    let window_of = |number: &str| {
        let shown = format!("number {number}\n");
        until("window", || {
            let folders = std::fs::read_dir(&windows).ok()?;
            let mut folders = folders.map(|folder| folder.unwrap().path());
            folders.find(|folder| {
                std::fs::read_to_string(folder.join("screen")).is_ok_and(|screen| screen == shown)
            })
        })
    };
    let (first, second) = (window_of("1"), window_of("2"));
    let process = |folder: &Path| {
        let pid = std::fs::read_to_string(folder.join("pid")).unwrap();
        pid.trim().parse::<u32>().unwrap()
    };
    std::fs::write(first.join("keyboard"), "x\n").unwrap();
    gone(process(&first));
    std::fs::write(second.join("keyboard"), "x\n").unwrap();
    gone(process(&second));
    no_session_left(&home);
}

/// A terminal whose server answers, but that never connects itself.
#[test]
fn output_waits_for_a_terminal_for_a_bounded_time() {
    let home = Home::new();
    let _name_server = home.serve();
    let _host = serve(&home, "/host", "", &std::env::var("PATH").unwrap());
    let mut terminal_server = home
        .start("rpcserver /desk")
        .see("Waiting for a message...");
    terminal_server.type_text("17 started\nok\n17 started\nok\n");
    let file = home.path().join("made");
    // More than a pipe holds.
    let shell = format!("seq 100000; touch {}", file.display());
    start(&home, "/desk", &shell, &[]).with(0);
    until("end of the command", || file.exists().then_some(()));
    no_session_left(&home);
    // So does the reason why a command does not start.
    let words = ["--as", "t", "--stdio", "/desk", "--cmd", "/no/such/program"];
    ask(&home, &words).with(2);
    no_session_left(&home);
}

#[test]
fn output_may_end_within_a_character() {
    let (home, _name_server, window, _host) = start_network(WINDOW);
    let file = home.path().join("output");
    std::fs::write(&file, b"\xc3\xa9 \xc3").unwrap();
    start(&home, "/host", &format!("cat {}", file.display()), &[]).with(0);
    window.shows("é \u{fffd}");
    no_session_left(&home);
}

/// A writer that waits for the command kept its session.
#[test]
fn input_that_nobody_reads_does_not_keep_the_session() {
    let (home, _name_server, window, _host) = start_network(WINDOW);
    start(&home, "/host", "echo begin; exec sleep 1000", &[]).with(0);
    window.shows("begin\n");
    // More than the pipe of the command holds, but not more than that and the keyboard.
    window.type_text(&"a line of input\n".repeat(6000));
    ask(&home, &["--sigterm", "t"]).with(0);
    gone(window.process());
    no_session_left(&home);
}

#[test]
fn a_session_whose_port_is_taken_leaves_nothing() {
    let (home, _name_server, window, host) = start_network(WINDOW);
    let taken = format!("/host/{}/t-0/stdin", host.id());
    let _reader = home.start(&format!("read {taken}")).see("active at");
    let failed = start(&home, "/host", "echo begin", &[]).with(2);
    failed.complains("Can't open the ports of the terminal");
    let names = home.names();
    let of_session = names.iter().filter(|name| name.starts_with("/host/"));
    assert_eq!(of_session.collect::<Vec<_>>(), [&taken]);
    assert_eq!(window.file("arguments"), "");
}

#[test]
fn nothing_leaves_the_input_of_a_command() {
    let (home, _name_server, window, _host) = start_network(WINDOW);
    start(&home, "/host", "echo begin; read a", &[]).with(0);
    window.shows("begin\n");
    let input = session_port(&home, "/stdin");
    let _reader = home.start("read /r").see("active at");
    home.run(&format!("connect {input} /r")).with(1);
}

#[test]
fn a_stopped_terminal_does_not_keep_the_session() {
    let (home, _name_server, window, _host) = start_network(WINDOW);
    start(&home, "/host", "echo one; read a; exec yes", &[]).with(0);
    window.shows("one\n");
    let output = session_port(&home, "/stdout");
    let stop = |signal: &str| {
        let process = window.process().to_string();
        let mut kill = Command::new("kill");
        assert!(
            kill.args(["-s", signal, &process])
                .status()
                .unwrap()
                .success()
        );
    };
    window.type_text("go\n");
    window.shows("y\ny\n");
    stop("STOP");
    // The command waits for the terminal.
    ask(&home, &["--isrunning", "t"]).with(0);
    ask(&home, &["--sigterm", "t"]).with(0);
    until("end of the session", || {
        (!home.names().contains(&output)).then_some(())
    });
    stop("CONT");
    gone(window.process());
}

#[test]
fn a_child_that_keeps_the_output_does_not_keep_the_session() {
    let (home, _name_server, window, _host) = start_network(WINDOW);
    // What it prints later is lost, as the terminal ends with the command.
    let shell = "(sleep 1; echo late; exec sleep 1000) & echo parent";
    start(&home, "/host", shell, &[]).with(0);
    window.shows("parent\n");
    gone(window.process());
    no_session_left(&home);
    assert_eq!(window.file("screen"), "parent\n");
}

/// Input that a command does not read any more once ended the session.
#[test]
fn a_command_that_closes_its_input_goes_on() {
    let (home, _name_server, window, _host) = start_network(WINDOW);
    let file = home.path().join("go");
    let shell = format!(
        "exec <&-; echo closed; while ! [ -e {0} ]; do sleep 0.1; done; echo goes on",
        file.display()
    );
    start(&home, "/host", &shell, &[]).with(0);
    window.shows("closed\n");
    for _ in 0..3 {
        window.type_text("nobody reads this\n");
    }
    std::fs::write(&file, "").unwrap();
    window.shows("goes on\n");
    no_session_left(&home);
}

#[test]
fn the_ports_of_a_command_are_for_administrators_of_the_server() {
    let home = Home::new();
    let roles = home.path().join("roles.conf");
    let _name_server = home.serve();
    let window = TerminalEmulator::new(&home, "window", WINDOW);
    let _host = window.serve(&home, "/host", "");
    let shell = "echo begin; while read a; do echo got $a; done";
    start(&home, "/host", shell, &[]).with(0);
    window.shows("begin\n");
    let (input, output) = (
        session_port(&home, "/stdin"),
        session_port(&home, "/stdout"),
    );
    let mut writer = home.start("write /w").see("active at");
    let _reader = home.start("read /r").see("active at");
    let connected = |from: &str, to: &str| home.run(&format!("connect {from} {to}")).code;
    assert_eq!(connected("/w", &input), Some(0));
    writer.type_text("by another program\n");
    window.shows("got by another program\n");
    assert_eq!(connected(&output, "/r"), Some(0));
    home.run(&format!("disconnect {output} /r")).with(0);
    // All other rights, and on all ports of the session, do not suffice.
    let text = "[a]\nports /host\nrights read write connect\n[b]\nports /host/*\nrights all\n";
    std::fs::write(&roles, text).unwrap();
    until("refusal", || {
        (ask(&home, &["--ps"]).code == Some(2)).then_some(())
    });
    assert_eq!(connected(&output, "/r"), Some(1));
    writer.type_text("an intruder\n");
    home.run(&format!("disconnect /w {input}"));
    assert_eq!(connected("/w", &input), Some(1));
    std::fs::write(&roles, "[a]\nports /host\nrights all\n").unwrap();
    until("right", || {
        (ask(&home, &["--ps"]).code == Some(0)).then_some(())
    });
    until("connection", || {
        (connected("/w", &input) == Some(0)).then_some(())
    });
    writer.type_text("allowed again\n");
    window.shows("got allowed again\n");
    assert!(!window.file("screen").contains("intruder"));
    no_page(&home, &input);
    writer.type_text("after the browser\n");
    window.shows("got after the browser\n");
    assert!(!window.file("screen").contains("got browser"));
}

#[test]
fn output_with_a_terminal_also_reaches_the_logger() {
    let (home, _name_server, window, _host) = start_network(WINDOW);
    let mut logger = home.start("read /yarplogger").see("active at");
    start(
        &home,
        "/host",
        "echo both; printf 'no end'; read a",
        &["--log"],
    )
    .with(0);
    window.shows("both\nno end");
    assert!(logger.sees("\"both\\n\""), "{:?}", logger.printed());
    window.type_text("x\n");
    assert!(logger.sees("\"no end\""), "{:?}", logger.printed());
    let printed = logger.printed();
    assert!(
        printed
            .iter()
            .any(|line| line.starts_with("\"[/log/host/sh/")),
        "{printed:?}"
    );
    no_session_left(&home);
    until("end of the log", || {
        (!home.names().iter().any(|name| name.starts_with("/log/"))).then_some(())
    });
}

/// The ports of a command of a stock server, which come later than the terminal.
#[test]
fn a_terminal_connects_itself_with_the_ports_of_another_server() {
    let home = Home::new();
    let _name_server = home.serve();
    let mut logger = home.start("read /yarplogger").see("active at");
    let mut terminal = home.start("run --readwrite /s --forward /log/a /yarplogger");
    // Before anything is connected.
    terminal.type_text("first\n");
    session_port(&home, "/s/stdio:i");
    let mut input = home.start("read /s/stdin").see("active at");
    let mut output = home.start("write /s/stdout").see("active at");
    assert!(input.sees("\"first\\n\""), "{:?}", input.printed());
    // A string is shown as it is; `write` of stock makes words of a line.
    output.reaches(&mut terminal, "two words");
    output.type_text("\"one\\n\"\n");
    assert!(terminal.sees("one"));
    assert!(logger.sees("\"two words\\n\""), "{:?}", logger.printed());
    terminal.type_text("second\n");
    assert!(input.sees("\"second\\n\""));
    // Several intervals of checks: what is connected is not connected anew.
    std::thread::sleep(Duration::from_secs(1));
    output.type_text("\"no end\"\n");
    // The command ends.
    let ended = output.finish().with(0);
    let connections = ended
        .out
        .iter()
        .filter(|line| line.contains("Sending output from /s/stdout"));
    assert_eq!(connections.count(), 1, "{ended:?}");
    let ended = terminal.finish().with(0);
    assert!(ended.says("two words"));
    assert!(ended.says("no end"), "{ended:?}");
    assert!(logger.sees("\"no end\""), "{:?}", logger.printed());
    let names = home.names();
    assert!(
        !names
            .iter()
            .any(|name| name.contains("stdio") || name.starts_with("/log")),
        "{names:?}"
    );
}

/// Killed ports leave their names; the terminal waited for them for ever.
#[test]
fn a_terminal_ends_with_a_killed_command() {
    let home = Home::new();
    let _name_server = home.serve();
    let mut terminal = home.start("run --readwrite /s");
    session_port(&home, "/s/stdio:i");
    let mut output = home.start("write /s/stdout").see("active at");
    output.reaches(&mut terminal, "text");
    output.kill();
    until("end of the terminal", || {
        let is_open = home.names().iter().any(|name| name.contains("stdio"));
        (!is_open).then_some(())
    });
    terminal.finish().with(0);
}

#[test]
fn a_terminal_needs_a_network_and_its_ports() {
    let home = Home::new();
    let ended = home.run("run --readwrite /s").with(255);
    ended.complains("no yarp network found");
    for taken in ["/s/stdio:o", "/s/stdio:i"] {
        let home = Home::new();
        let _name_server = home.serve();
        let _reader = home.start(&format!("read {taken}")).see("active at");
        home.run("run --readwrite /s").with(255);
        assert_eq!(home.names(), [taken]);
    }
}

#[test]
fn the_ports_of_a_terminal_are_not_for_browsers() {
    let home = Home::new();
    let _name_server = home.serve();
    let mut terminal = home.start("run --readwrite /s");
    let input = session_port(&home, "/s/stdio:i");
    no_page(&home, &input);
    let mut output = home.start("write /s/stdout").see("active at");
    output.reaches(&mut terminal, "text");
    assert!(!terminal.printed().contains(&"browser".to_owned()));
}

#[test]
fn a_terminal_without_input_shows_output() {
    let home = Home::new();
    let _name_server = home.serve();
    let mut command = Command::new("sh");
    command.args(["-c", &format!("exec {YARP} run --readwrite /s < /dev/null")]);
    let mut terminal = home.spawn(command, "terminal");
    session_port(&home, "/s/stdio:i");
    let mut output = home.start("write /s/stdout").see("active at");
    output.reaches(&mut terminal, "text");
}

#[test]
fn a_terminal_unregisters_its_ports_on_signals() {
    for signal in ["INT", "TERM", "HUP"] {
        let home = Home::new();
        let _name_server = home.serve();
        let terminal = home.start("run --readwrite /s");
        session_port(&home, "/s/stdio:i");
        terminal.signal(signal).finish().with(0);
        assert_eq!(home.names(), Vec::<String>::new());
    }
}
