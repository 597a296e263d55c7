//! The driver of the arm's CAN bus against simulated pucks on a CAN interface of the kernel, which `conformance/can`
//! runs in a virtual machine: `arm_on_vcan INTERFACE`, as root, since the interface goes up and down. After the scenarios
//! come as many random histories as the variable `YARP_CAN_HISTORIES` says, 2 without it, from the seed
//! `YARP_CAN_FIRST_HISTORY` on, 0 without it.
//!
//! Prints a line for each scenario and history, and `VERDICT: ` with `all N scenarios hold` or what failed.

#[cfg(target_os = "linux")]
#[path = "../tests/support/can/mod.rs"]
mod can;

#[cfg(target_os = "linux")]
#[path = "arm_on_vcan/kernel.rs"]
mod kernel;

#[cfg(target_os = "linux")]
fn main() -> std::process::ExitCode {
    use std::panic::{AssertUnwindSafe, catch_unwind};
    use std::process::ExitCode;

    let Some(interface) = std::env::args().nth(1) else {
        eprintln!("usage: arm_on_vcan INTERFACE (a vcan that is there)");
        return ExitCode::from(2);
    };
    let mut failed = Vec::new();
    let scenarios = can::scenarios::ALL
        .into_iter()
        .chain([kernel::NOISE, kernel::RATE]);
    let mut count = 0;
    let mut run = |name: String, scenario: &dyn Fn(&dyn can::Rig)| {
        count += 1;
        println!("{name} ...");
        let whole = catch_unwind(AssertUnwindSafe(|| {
            let rig = kernel::Kernel::start(&interface);
            scenario(&rig);
        }));
        println!("{name} {}", if whole.is_ok() { "ok" } else { "FAILED" });
        if whole.is_err() {
            failed.push(name);
        }
    };
    for (name, scenario) in scenarios {
        run(name.to_owned(), &scenario);
    }
    for seed in can::histories::seeds(2) {
        let record = std::env::temp_dir().join(format!("history{seed}"));
        let live = |rig: &dyn can::Rig| can::histories::live(rig, seed, record.clone());
        run(format!("history {seed}"), &live);
    }
    if failed.is_empty() {
        println!("VERDICT: all {count} scenarios hold");
        ExitCode::SUCCESS
    } else {
        println!(
            "VERDICT: {} of {count} failed: {}",
            failed.len(),
            failed.join(", ")
        );
        ExitCode::FAILURE
    }
}

#[cfg(not(target_os = "linux"))]
fn main() {
    eprintln!("CAN interfaces are the Linux kernel's");
}
