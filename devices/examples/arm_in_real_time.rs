//! The control loop of the arm with its real-time settings, on a CAN interface of the kernel and under load, which
//! `conformance/rt` runs in a virtual machine: `arm_in_real_time INTERFACE`, as root.
//!
//! Checks that the settings are in effect, as `/proc` shows them, and that the kernel is the expected one: the variable
//! `YARP_REALTIME_KERNEL` is 1 for one with PREEMPT_RT. Prints how late the periods began. No time is asserted: the clock
//! of a virtual machine is not real. With `YARP_REALTIME_PROCESSOR` the control thread is confined to that one of several
//! processors, and only the settings are checked.
//!
//! Prints a line for each scenario, and `VERDICT: ` with `all N scenarios hold` or what failed.

#[cfg(target_os = "linux")]
#[path = "../tests/support/can/mod.rs"]
mod can;

#[cfg(target_os = "linux")]
#[allow(dead_code, reason = "shared with arm_on_vcan, which uses all of it")]
#[path = "arm_on_vcan/kernel.rs"]
mod kernel;

#[cfg(target_os = "linux")]
#[path = "arm_in_real_time/real_time_scenarios.rs"]
mod real_time_scenarios;

#[cfg(target_os = "linux")]
fn main() -> std::process::ExitCode {
    use std::panic::{AssertUnwindSafe, catch_unwind};
    use std::process::ExitCode;

    let Some(interface) = std::env::args().nth(1) else {
        eprintln!("usage: arm_in_real_time INTERFACE (a vcan that is there)");
        return ExitCode::from(2);
    };
    let whole = catch_unwind(AssertUnwindSafe(|| real_time_scenarios::run(&interface)));
    match whole {
        Ok(count) => {
            println!("VERDICT: all {count} scenarios hold");
            ExitCode::SUCCESS
        }
        Err(_) => {
            println!("VERDICT: a scenario failed");
            ExitCode::FAILURE
        }
    }
}

#[cfg(not(target_os = "linux"))]
fn main() {
    eprintln!("CAN interfaces are the Linux kernel's");
}
