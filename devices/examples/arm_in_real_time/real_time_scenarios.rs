//! Settings in effect, and periods under load.

use std::fs;
use std::time::Duration;

use yarp_devices::real_time::RealTime;
use yarp_devices::wam::WamModel;
use yarp_devices::wam::can::{CanOptions, CanWam};

use super::can::scenarios::{activate, options};
use super::can::{Rig, until};
use super::kernel::Kernel;

/// Priority that the control thread asks for: not the default, so that it is known to come from here.
const PRIORITY: u8 = 41;
/// Processor that the control thread asks for.
const PROCESSOR: usize = 1;
/// Periods that are watched: five seconds.
const PERIODS: u64 = 2500;
/// Number of `SCHED_FIFO` in `/proc`.
const FIFO: u64 = 1;

/// Runs the scenarios and returns their number.
pub(crate) fn run(interface: &str) -> usize {
    the_kernel_is_the_expected_one();
    let rig = Kernel::start(interface);
    let settings = CanOptions {
        real_time: RealTime {
            priority: Some(PRIORITY),
            processor: Some(PROCESSOR),
            lock_memory: true,
        },
        ..options()
    };
    let arm = CanWam::start(WamModel::<7>::new(), settings, rig.open()).expect("the arm is found");
    activate(&rig, &arm);
    the_settings_are_in_effect();
    periods_under_load(&arm);
    3
}

/// Returns a file of the kernel, or nothing.
fn read(path: &str) -> String {
    fs::read_to_string(path)
        .unwrap_or_default()
        .trim()
        .to_owned()
}

fn the_kernel_is_the_expected_one() {
    let expected = std::env::var("YARP_REALTIME_KERNEL").is_ok_and(|value| value == "1");
    println!("kernel {}", read("/proc/version"));
    let real_time = read("/sys/kernel/realtime");
    assert_eq!(
        real_time == "1",
        expected,
        "/sys/kernel/realtime says {real_time:?}"
    );
    println!("the_kernel_is_the_expected_one ok");
}

/// Returns the value of a line `NAME:   value` of a status file.
fn line(status: &str, name: &str) -> String {
    let mut lines = status.lines();
    let found = lines.find_map(|line| line.strip_prefix(name)?.strip_prefix(':'));
    found.unwrap_or_default().trim().to_owned()
}

fn the_settings_are_in_effect() {
    let tasks = fs::read_dir("/proc/self/task").expect("there are tasks");
    let control = tasks
        .map(|task| task.expect("it is readable").path())
        .find(|task| read(&format!("{}/comm", task.display())) == "can-wam");
    let control = control
        .expect("there is a control thread")
        .display()
        .to_string();
    let stat = read(&format!("{control}/stat"));
    // The name is in brackets and may contain anything; the state behind it is field 3.
    let fields = stat.rsplit_once(") ").expect("a name").1;
    let field = |number: usize| {
        fields
            .split(' ')
            .nth(number - 3)
            .and_then(|text| text.parse().ok())
    };
    let (priority, policy): (Option<u64>, Option<u64>) = (field(40), field(41));
    let status = read(&format!("{control}/status"));
    let allowed = line(&status, "Cpus_allowed_list");
    let locked = line(&read("/proc/self/status"), "VmLck");
    println!(
        "  /proc: policy {policy:?}, priority {priority:?}, processors {allowed}, locked {locked}"
    );
    assert_eq!((policy, priority), (Some(FIFO), Some(PRIORITY.into())));
    assert_eq!(allowed, PROCESSOR.to_string());
    let kilobytes: u64 = locked.trim_end_matches(" kB").parse().expect("a number");
    assert!(kilobytes > 0, "{locked}");
    // The settings are those of one thread.
    let main = line(&read("/proc/self/status"), "Cpus_allowed_list");
    assert_ne!(main, allowed, "the main thread may use any processor");
    println!("the_settings_are_in_effect ok");
}

fn periods_under_load(arm: &CanWam) {
    let before = arm.status();
    let begin = std::time::Instant::now();
    until("periods under load", || {
        std::thread::sleep(Duration::from_millis(100));
        arm.status().periods > before.periods + PERIODS
    });
    let after = arm.status();
    println!(
        "  {} periods in {:.2} s of the machine, load {}; {} late, {} positions missed",
        after.periods - before.periods,
        begin.elapsed().as_secs_f64(),
        read("/proc/loadavg"),
        after.late_periods - before.late_periods,
        after.missed_replies - before.missed_replies,
    );
    println!(
        "  delays of control periods: {}; {}",
        after.delays, after.scheduling
    );
    println!("periods_under_load ok");
}
