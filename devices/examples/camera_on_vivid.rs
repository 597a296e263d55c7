//! The driver of cameras on the kernel's virtual camera `vivid`, which `conformance/camera` runs in a virtual machine:
//! `camera_on_vivid /dev/video0`.
//!
//! Prints a line for each scenario, and `VERDICT: ` with `all N scenarios hold` or what failed. What is expected of the
//! camera is what the kernel's documentation of vivid says (`Documentation/admin-guide/media/vivid.rst`), and for the
//! colour bars ITU-R BT.471: their order, and full or no light of each colour.

#[cfg(target_os = "linux")]
#[path = "camera_on_vivid/scenarios.rs"]
mod scenarios;

#[cfg(target_os = "linux")]
#[path = "camera_on_vivid/vivid_controls.rs"]
mod vivid_controls;

#[cfg(target_os = "linux")]
#[path = "verdict/mod.rs"]
mod verdict;

#[cfg(target_os = "linux")]
fn main() -> std::process::ExitCode {
    let Some(device) = std::env::args().nth(1) else {
        eprintln!("usage: camera_on_vivid DEVICE (of the kernel's module vivid)");
        return std::process::ExitCode::from(2);
    };
    let mut verdict = verdict::Verdict::default();
    for (name, scenario) in scenarios::ALL {
        verdict.run(name, || scenario(&device));
    }
    verdict.end()
}

#[cfg(not(target_os = "linux"))]
fn main() {
    eprintln!("video devices are the Linux kernel's");
}
