//! The driver of IIDC cameras on a simulated camera of USB, which `conformance/iidc` runs in a virtual machine: the driver's calls pass through
//! libdc1394, libusb and the kernel's USB to the kernel's module `vhci-hcd`, at whose other end is the camera.
//!
//! Prints a line for each scenario, and `VERDICT: ` with `all N scenarios hold` or what failed. The camera shares no code and no
//! numbers with the driver. Sources: IIDC 1.31 for its registers; the kernel's `Documentation/usb/usbip_protocol.rst` for its messages;
//! USB 2.0, chapter 9, for its descriptors; ITU-T T.871 for its colours.

#[cfg(target_os = "linux")]
#[path = "iidc_on_usb/camera_registers.rs"]
mod camera_registers;

#[cfg(target_os = "linux")]
#[path = "iidc_on_usb/camera_scene.rs"]
mod camera_scene;

#[cfg(target_os = "linux")]
#[path = "iidc_on_usb/iidc_scenarios.rs"]
mod iidc_scenarios;

#[cfg(target_os = "linux")]
#[path = "iidc_on_usb/usb_camera.rs"]
mod usb_camera;

#[cfg(target_os = "linux")]
#[path = "iidc_on_usb/usb_descriptors.rs"]
mod usb_descriptors;

#[cfg(target_os = "linux")]
#[path = "verdict/mod.rs"]
mod verdict;

#[cfg(target_os = "linux")]
fn main() -> std::process::ExitCode {
    tracing_subscriber::fmt().without_time().init();
    let mut verdict = verdict::Verdict::default();
    for (name, scenario) in iidc_scenarios::ALL {
        verdict.run(name, scenario);
    }
    verdict.end()
}

#[cfg(not(target_os = "linux"))]
fn main() {
    eprintln!("the virtual bus is the Linux kernel's");
}
