//! Peers over shared memory that are killed: the other end notices, and a new process may take their place.
//!
//! A program without the harness of the tests: started with [`ROLE`] in its environment it is the process that is killed.

mod common;

use std::io::{BufRead, BufReader};
use std::panic::catch_unwind;
use std::process::{Child, Command, ExitCode, Stdio};

use common::{at, open, until, within};
use yarp_ports::{PortOptions, Queue};
use yarp_wire::Bottle;

/// The environment variable of a child process: `read`, or the contact to write to.
const ROLE: &str = "YARP_TEST_SHMEM_ROLE";

const TESTS: [(&str, fn()); 2] = [
    (
        "a_writer_that_is_killed_is_noticed_and_may_come_again",
        || run(writer_is_killed()),
    ),
    (
        "a_reader_that_is_killed_is_noticed_and_may_come_again",
        || run(reader_is_killed()),
    ),
];

fn main() -> ExitCode {
    match std::env::var(ROLE).as_deref() {
        Ok("read") => run(read_until_killed()),
        Ok(contact) => run(write_until_killed(contact)),
        Err(_) => return test(),
    }
    ExitCode::SUCCESS
}

/// Runs the tests whose names contain the argument, and reports them as the harness does.
fn test() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let filter = arguments.iter().find(|argument| !argument.starts_with('-'));
    let chosen = TESTS
        .iter()
        .filter(|(name, _)| filter.is_none_or(|filter| name.contains(filter.as_str())));
    if arguments.iter().any(|argument| argument == "--list") {
        chosen.for_each(|(name, _)| println!("{name}: test"));
        return ExitCode::SUCCESS;
    }
    let (mut passed, mut failed) = (0, 0);
    for (name, test) in chosen {
        let result = catch_unwind(test);
        let (word, count) = match result {
            Ok(()) => ("ok", &mut passed),
            Err(_) => ("FAILED", &mut failed),
        };
        println!("test {name} ... {word}");
        *count += 1;
    }
    let result = if failed == 0 { "ok" } else { "FAILED" };
    let filtered = TESTS.len() - passed - failed;
    println!(
        "\ntest result: {result}. {passed} passed; {failed} failed; 0 ignored; 0 measured; {filtered} filtered out"
    );
    ExitCode::from(u8::from(failed > 0))
}

fn run(future: impl Future<Output = ()>) {
    let runtime = tokio::runtime::Runtime::new().unwrap();
    runtime.block_on(future);
}

/// Writes to the contact as fast as it can.
async fn write_until_killed(contact: &str) {
    let writer = open("/child", PortOptions::new()).await;
    within(writer.connect(contact)).await.unwrap();
    let message = Bottle::of("x".repeat(300_000));
    loop {
        writer.write(&message).await;
    }
}

/// Reads, and prints its TCP port.
async fn read_until_killed() {
    let reader = open("/child", PortOptions::new().queue(Queue::Wait(1))).await;
    println!("port={}", reader.tcp_port());
    while reader.read().await.is_ok() {}
}

fn child(role: &str) -> Child {
    Command::new(std::env::current_exe().unwrap())
        .env(ROLE, role)
        .stdout(Stdio::piped())
        .spawn()
        .unwrap()
}

async fn writer_is_killed() {
    let reader = open("/reader", PortOptions::new().queue(Queue::Wait(1))).await;
    for _ in 0..3 {
        let mut child = child(&at(&reader, "shmem"));
        for _ in 0..5 {
            let read = within(reader.read()).await.unwrap();
            assert_eq!(&*read.from, "/child");
        }
        child.kill().unwrap();
        child.wait().unwrap();
        let gone = until(|| {
            while reader.try_read().is_some() {}
            reader.inputs().is_empty()
        });
        gone.await;
    }
}

async fn reader_is_killed() {
    let writer = open("/writer", PortOptions::new()).await;
    for _ in 0..3 {
        let mut child = child("read");
        let output = BufReader::new(child.stdout.take().unwrap());
        let mut lines = output.lines().map_while(Result::ok);
        let number = lines.find_map(|line| line.strip_prefix("port=").map(str::to_owned));
        let contact = format!("shmem://127.0.0.1:{}/child", number.unwrap());
        within(writer.connect(&contact)).await.unwrap();
        let message = Bottle::of("x".repeat(300_000));
        for _ in 0..5 {
            assert_eq!(within(writer.write(&message)).await, 1);
        }
        child.kill().unwrap();
        child.wait().unwrap();
        let gone = async {
            while !writer.outputs().is_empty() {
                writer.write(&message).await;
            }
        };
        within(gone).await;
    }
}
