//! `soak [CYCLES]`: connects and disconnects 100 000 times, and looks for leaks.
//!
//! Exits with 1 if a descriptor, a task, shared memory or more than some bytes leaked. The work is
//! done by another process, with its own folder for temporary files.

use std::process::ExitCode;
use std::time::Instant;

use yarp_conformance::counting_allocator::Counting;
use yarp_conformance::soak_cycles;

#[global_allocator]
static COUNTING: Counting = Counting;

/// One day, in cycles.
const CYCLES: usize = 100_000;

fn main() -> ExitCode {
    let alone = soak_cycles::alone(std::env::args_os().skip(1));
    let output = match alone {
        Ok(None) => return measure(),
        Ok(Some(output)) => output,
        Err(error) => {
            eprintln!("soak: {error}");
            return ExitCode::FAILURE;
        }
    };
    print!("{}", String::from_utf8_lossy(&output.stdout));
    eprint!("{}", String::from_utf8_lossy(&output.stderr));
    match output.status.success() {
        true => ExitCode::SUCCESS,
        false => ExitCode::FAILURE,
    }
}

#[tokio::main]
async fn measure() -> ExitCode {
    let cycles = match std::env::args().nth(1).map(|word| word.parse()) {
        None => CYCLES,
        Some(Ok(cycles)) => cycles,
        Some(Err(_)) => {
            eprintln!("usage: soak [CYCLES]");
            return ExitCode::FAILURE;
        }
    };
    let begin = Instant::now();
    let outcome = match soak_cycles::run(cycles).await {
        Ok(outcome) => outcome,
        Err(error) => {
            eprintln!("soak: {error}");
            return ExitCode::FAILURE;
        }
    };
    println!("before {cycles} cycles: {}", outcome.before);
    println!("after  {cycles} cycles: {}", outcome.after);
    println!("{:.0} s", begin.elapsed().as_secs_f64());
    match outcome.is_clean() {
        true => ExitCode::SUCCESS,
        false => {
            eprintln!("soak: something leaked");
            ExitCode::FAILURE
        }
    }
}
