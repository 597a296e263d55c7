//! Lines of the log, and the output of commands, reach the logger in stock's form.

#![cfg(target_os = "linux")]

use crate::common;

use std::process::Command;

use common::{Home, Running};

/// Numbered lines of output, about twice as many as a pipe holds.
const MANY: u32 = 20_000;

fn logger(home: &Home) -> Running {
    home.start("read /yarplogger").see("active at")
}

fn camera(home: &Home, variables: &[(&str, &str)]) -> Running {
    let mut command = Command::new(env!("CARGO_BIN_EXE_yarp"));
    command.args(["dev", "--device", "fakeFrameGrabber", "--name", "/cam"]);
    command.envs(variables.iter().copied());
    home.spawn(command, "dev")
}

/// Starts a `yarp run --server` on port `/host`.
fn run_server(home: &Home, options: &str) -> Running {
    home.start(&format!("run --server /host --insecure {options}"))
        .see("Yarprun successfully started on port:  /host")
}

/// Runs a command of the shell on `/host`, with its output for a logger: `--log` and its value.
fn run_logged(home: &Home, log: &[&str], shell: &str) {
    let mut command = Command::new(env!("CARGO_BIN_EXE_yarp"));
    command.args(["run", "--on", "/host", "--as", "t"]);
    command.args(log).args(["--cmd", shell]);
    home.spawn(command, "run").finish().with(0);
}

#[test]
fn a_program_sends_its_log_and_says_when_it_ends() {
    let home = Home::new();
    let _server = home.serve();
    let mut logger = logger(&home);
    let camera = camera(
        &home,
        &[
            ("YARP_FORWARD_LOG_ENABLE", "1"),
            ("YARP_LOG_PROCESS_LABEL", "left"),
        ],
    );
    let port = format!("/yarp[left]/{}", camera.id());
    assert!(
        logger.sees("(level INFO) (systemtime 1"),
        "{:?}",
        logger.printed()
    );
    assert!(
        home.names()
            .iter()
            .any(|name| name.starts_with("/log/") && name.ends_with(&port))
    );
    camera.signal("INT").finish().with(0);
    assert!(logger.sees("(networktime 1"), "{:?}", logger.printed());
    let printed = logger.printed();
    let lines: Vec<&String> = printed
        .iter()
        .filter(|line| line.starts_with("\"[/log/"))
        .collect();
    assert!(
        lines
            .iter()
            .all(|line| line.contains(&format!("{port}]\" \"(level "))),
        "{lines:?}"
    );
    assert!(
        lines
            .iter()
            .any(|line| line.contains("(component ") && line.contains("(message "))
    );
    // What sending reports is not sent.
    assert!(
        !lines
            .iter()
            .any(|line| line.contains("component yarp.os.impl")),
        "{lines:?}"
    );
    assert!(!home.names().iter().any(|name| name.starts_with("/log/")));
}

#[test]
fn a_program_without_the_variable_opens_no_port() {
    let home = Home::new();
    let _server = home.serve();
    let _camera = camera(&home, &[("YARP_FORWARD_LOG_ENABLE", "0")]).see("/cam");
    assert!(!home.names().iter().any(|name| name.starts_with("/log/")));
}

#[test]
fn a_logger_that_reads_nothing_holds_no_program_up() {
    let home = Home::new();
    let _server = home.serve();
    let logger = logger(&home).signal("STOP");
    let camera = camera(&home, &[("YARP_FORWARD_LOG_ENABLE", "1")]).see("/cam");
    camera.signal("INT").finish().with(0);
    assert!(!home.names().iter().any(|name| name.starts_with("/log/")));
    logger.kill();
}

#[test]
fn a_program_below_a_logging_yarp_run_prints_in_the_form_of_loggers() {
    let home = Home::new();
    let _server = home.serve();
    let _camera = camera(
        &home,
        &[
            ("YARPRUN_IS_FORWARDING_LOG", "1"),
            ("YARP_FORWARD_LOG_ENABLE", "1"),
        ],
    )
    .see("(level INFO) (systemtime 1");
    assert!(!home.names().iter().any(|name| name.starts_with("/log/")));
}

#[test]
fn the_output_of_a_command_goes_to_the_logger() {
    let home = Home::new();
    let _name_server = home.serve();
    let mut logger = logger(&home);
    let server = run_server(&home, "");
    let shell = "sh -c \"echo one; echo two >&2; echo $YARPRUN_IS_FORWARDING_LOG; printf three; sleep 1000\"";
    run_logged(&home, &["--log"], shell);
    assert!(logger.sees("\"1\\n\""), "{:?}", logger.printed());
    let printed = logger.printed();
    let lines: Vec<&String> = printed
        .iter()
        .filter(|line| line.starts_with("\"[/log/host/sh/"))
        .collect();
    let ends = [" \"one\\n\"", " \"two\\n\"", " \"1\\n\""];
    assert_eq!(lines.len(), 3, "{printed:?}");
    assert!(
        lines
            .iter()
            .zip(ends)
            .all(|(line, end)| line.ends_with(end)),
        "{lines:?}"
    );
    home.run("run --on /host --sigterm t").with(0);
    // A line without an end, when the command is over.
    assert!(logger.sees(" three"), "{:?}", logger.printed());
    home.run("run --on /host --exit").with(0);
    server.finish().with(0);
}

#[test]
fn a_long_line_is_sent_in_parts() {
    let home = Home::new();
    let _name_server = home.serve();
    let mut logger = logger(&home);
    let _server = run_server(&home, "");
    let shell = "sh -c \"printf %05000d 0; echo; echo end\"";
    run_logged(&home, &["--log"], shell);
    assert!(logger.sees("\"end\\n\""), "{:?}", logger.printed());
    let printed = logger.printed();
    let zeros = |line: &String| {
        line.rsplit(' ')
            .next()
            .map_or(0, |text| text.matches('0').count())
    };
    let parts: Vec<usize> = printed
        .iter()
        .filter(|line| line.contains("/log/host/sh/") && line.contains("0000"))
        .map(zeros)
        .collect();
    assert_eq!(parts, [2047, 2047, 906], "{printed:?}");
}

#[test]
fn a_command_whose_logger_is_missing_or_reads_nothing_runs_on() {
    let home = Home::new();
    let _name_server = home.serve();
    let stopped = logger(&home).signal("STOP");
    let _server = run_server(&home, "--log");
    let file = home.path().join("done");
    for logger in ["/yarplogger", "/nobody"] {
        let shell = format!(
            "sh -c \"seq {MANY}; head -c 100000 /dev/zero; echo {logger} > {}\"",
            file.display()
        );
        run_logged(&home, &["--log", logger], &shell);
        yarp_testing::eventually("the end of the command", || {
            std::fs::read_to_string(&file).is_ok_and(|text| text.trim() == logger)
        });
    }
    stopped.kill();
}
