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
#[path = "verdict/mod.rs"]
mod verdict;

#[cfg(target_os = "linux")]
fn main() -> std::process::ExitCode {
    let Some(interface) = std::env::args().nth(1) else {
        eprintln!("usage: arm_on_vcan INTERFACE (a vcan that is there)");
        return std::process::ExitCode::from(2);
    };
    let mut verdict = verdict::Verdict::default();
    let mut run = |name: &str, scenario: &dyn Fn(&dyn can::Rig)| {
        verdict.run(name, || {
            let rig = kernel::Kernel::start(&interface);
            scenario(&rig);
        });
    };
    let scenarios = can::scenarios::ALL
        .into_iter()
        .chain([kernel::NOISE, kernel::RATE]);
    for (name, scenario) in scenarios {
        run(name, &scenario);
    }
    for seed in can::histories::seeds(2) {
        let record = std::env::temp_dir().join(format!("history{seed}"));
        let live = |rig: &dyn can::Rig| can::histories::live(rig, seed, record.clone());
        run(&format!("history {seed}"), &live);
    }
    verdict.end()
}

#[cfg(not(target_os = "linux"))]
fn main() {
    eprintln!("CAN interfaces are the Linux kernel's");
}
